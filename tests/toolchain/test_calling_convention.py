"""Argument rules of the calling convention (abi-elf.md §2): C calls assembly, and assembly calls C.

Each row of SIGNATURES generates a C caller, an assembly callee that records registers and stack, an assembly caller,
and a C callee that checks its parameters. All rows run in one image per level.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import pytest

from tests.toolchain.c_programs import build, run, run_both

LEVELS = ("-O0", "-Os", "-O2")
STACK = "stack"
TYPES = """
typedef struct { int a, b; } s_int2;
typedef struct { char a; int b; } s_char_int;
typedef struct { char a[4]; } s_char4;
typedef struct { int a, b, c; } s_int3;
typedef struct { int a[4]; } s_int4;
typedef struct { int a[8]; } s_int8;
typedef struct { int a[9]; } s_int9;
typedef struct { long a, b; } s_long2;
"""
WORDS = {
    "int": 1, "unsigned": 1, "char": 1, "unsigned char": 1, "void *": 1, "long": 2, "float": 2, "long long": 4,
    "double": 4, "long double": 4, "s_int2": 2, "s_char_int": 2, "s_char4": 2, "s_int3": 3, "s_int4": 4, "s_int8": 8,
    "s_int9": 9, "s_long2": 4,
}  # fmt: skip
NARROW = ("char", "unsigned char")


@dataclass(frozen=True)
class Signature:
    """Parameter types, with the first register or "stack" for each; `rule` cites abi-elf.md §2.2."""

    rule: str
    types: tuple[str, ...]
    places: tuple[int | str, ...]


def _row(rule: str, *pairs: tuple[str, int | str]) -> Signature:
    return Signature(rule, tuple(t for t, _ in pairs), tuple(p for _, p in pairs))


SIGNATURES = [
    _row("1: words from W0", ("int", 0), ("unsigned", 1), ("void *", 2)),
    _row("1: a char fills a register", ("char", 0), ("unsigned char", 1), ("int", 2)),
    _row("2: long is aligned to an even register", ("int", 0), ("long", 2), ("int", 1)),
    _row("2: 64 bits go to W0 or W4", ("long long", 0), ("long long", 4)),
    _row("2: row int, long long, int, int", ("int", 0), ("long long", 4), ("int", 1), ("int", 2)),
    _row("4: ten ints", *[("int", i) for i in range(8)], ("int", STACK), ("int", STACK)),
    _row("4: int long int long int int int", ("int", 0), ("long", 2), ("int", 1), ("long", 4), ("int", 6), ("int", 7),
         ("int", STACK)),
    _row("4: back-filling after a long on the stack", ("int", 0), ("int", 1), ("int", 2), ("long long", 4),
         ("long", STACK), ("int", 3)),
    _row("2: floats and long double", ("float", 0), ("int", 2), ("float", 4), ("long double", STACK), ("int", 3)),
    _row("2: doubles", ("double", 0), ("double", 4), ("double", STACK), ("float", STACK)),
    _row("3: struct of two ints is aligned", ("int", 0), ("s_int2", 2), ("int", 1)),
    _row("3: struct char int is like a long", ("int", 0), ("s_char_int", 2), ("int", 1)),
    _row("3: struct of chars is not aligned", ("int", 0), ("s_char4", 1), ("int", 3)),
    _row("3: struct of three ints is not aligned", ("int", 0), ("s_int3", 1), ("int", 4)),
    _row("3: struct with an array of four ints", ("int", 0), ("s_int4", 4), ("int", 1)),
    _row("3: struct of two longs", ("long", 0), ("s_long2", 4), ("int", 2)),
    _row("3: struct of eight ints fills all registers", ("s_int8", 0), ("int", STACK)),
    _row("3: struct of nine ints goes to the stack", ("s_int9", STACK), ("int", 0)),
    _row("4: stack order of an int, a long and an int", *[("int", i) for i in range(8)], ("int", STACK),
         ("long", STACK), ("char", STACK), ("long long", STACK)),
]  # fmt: skip


def words_of(index: int, type_name: str) -> list[int]:
    """Return distinct test words of argument `index`; narrow arguments use the low byte only."""
    if type_name in NARROW:
        return [0x11 + index]
    return [(0x1000 * (index % 7 + 1) + 0x0101 * index + 0x13 * k) & 0x7FFF for k in range(WORDS[type_name])]


def initialiser(index: int, type_name: str) -> str:
    """Return C statements that build argument `index` in variable `v{index}` from its words."""
    words = ", ".join(map(hex, words_of(index, type_name)))
    if type_name in NARROW:
        return f"{type_name} v{index} = {words};"
    return (
        f"{type_name} v{index}; {{ static const unsigned w[] = {{{words}}}; "
        f"__builtin_memcpy(&v{index}, w, sizeof v{index}); }}"
    )


def stack_offsets(signature: Signature) -> dict[int, list[int]]:
    """Return for each stack argument how far its words lie below W15 at the callee's entry (abi-elf.md §2.4)."""
    offsets = {}
    below = 4  # the return address
    for index, (type_name, place) in enumerate(zip(signature.types, signature.places, strict=True)):
        if place == STACK:
            below += 2 * WORDS[type_name]
            offsets[index] = [below - 2 * k for k in range(WORDS[type_name])]
    return offsets


def c_source(number: int, signature: Signature) -> str:
    """Return the C half of one row: the caller of the assembly probe, and the callee of the assembly caller."""
    count = len(signature.types)
    parameters = ", ".join(f"{t} p{i}" for i, t in enumerate(signature.types))
    setup = "\n    ".join(initialiser(i, t) for i, t in enumerate(signature.types))
    checks = []
    offsets = stack_offsets(signature)
    for index, (type_name, place) in enumerate(zip(signature.types, signature.places, strict=True)):
        mask = "0xFF" if type_name in NARROW else "0xFFFF"
        for k, word in enumerate(words_of(index, type_name)):
            seen = f"stack_words[{(offsets[index][k] - 6) // 2}]" if place == STACK else f"registers[{int(place) + k}]"
            checks.append(f"if (({seen} & {mask}) != {word:#x}) return {10 * (index + 1) + k};")
    compare = "\n    ".join(
        f"if (p{i} != v{i}) return {i + 1};"
        if t in NARROW
        else f"if (__builtin_memcmp(&p{i}, &v{i}, sizeof v{i})) return {i + 1};"
        for i, t in enumerate(signature.types)
    )
    return f"""
extern void probe_{number}({parameters});
int c_calls_{number}(void)
{{
    {setup}
    probe_{number}({", ".join(f"v{i}" for i in range(count))});
    {" ".join(checks)}
    return 0;
}}
extern int call_{number}(void);
int callee_{number}({parameters})
{{
    {setup}
    {compare}
    return 0;
}}
"""


def assembly_source(number: int, signature: Signature) -> str:
    """Return the assembly half of one row: a probe that records its arguments, and a caller that follows the rules."""
    lines = [f"        .global _probe_{number}", f"_probe_{number}:", "        bra _record"]
    lines += [f"        .global _call_{number}", f"_call_{number}:"]
    stack = [(i, t) for i, (t, p) in enumerate(zip(signature.types, signature.places, strict=True)) if p == STACK]
    pushed = 0
    for index, type_name in reversed(stack):
        for word in words_of(index, type_name):
            # the upper byte of a char on the stack is undefined: fill it with noise
            noise = word | 0xA500 if type_name in NARROW else word
            lines += [f"        mov #{noise:#x},w0", "        mov w0,[w15++]"]
            pushed += 2
    lines += [f"        mov #0xDEA{r:X},w{r}" for r in range(8)]
    for index, (type_name, place) in enumerate(zip(signature.types, signature.places, strict=True)):
        if place != STACK:
            for k, word in enumerate(words_of(index, type_name)):
                noise = word | 0x5A00 if type_name in NARROW else word
                lines.append(f"        mov #{noise:#x},w{int(place) + k}")
    lines += [f"        rcall _callee_{number}", f"        sub #{pushed},w15", "        return"]
    return "\n".join(lines) + "\n"


RECORD = """
        .section .text,code
        .global _record
_record:
        mov w0,_registers
        mov w1,_registers+2
        mov w2,_registers+4
        mov w3,_registers+6
        mov w4,_registers+8
        mov w5,_registers+10
        mov w6,_registers+12
        mov w7,_registers+14
        sub w15,#6,w1
        mov #_stack_words,w2
        mov #12,w3
1:      mov [w1--],[w2++]
        dec w3,w3
        bra nz,1b
        setm w4                         ; everything a callee may change (abi-elf.md 2.1)
        setm w5
        setm w6
        setm w7
        mov w4,_RCOUNT
        return
"""

MAIN = """
unsigned registers[8], stack_words[12];
{prototypes}
#include <stdio.h>
int main(void)
{{
    {calls}
    return 0;
}}
"""


@cache
def outcomes(level: str, folder: Path) -> dict[str, int]:
    """Return the result of every generated function by name; 0 means correct."""
    c_file, s_file, main_file = folder / "rows.c", folder / "rows.s", folder / "main.c"
    rows = range(len(SIGNATURES))
    c_file.write_text(
        TYPES + "extern unsigned registers[8], stack_words[12];\n" + "".join(c_source(n, SIGNATURES[n]) for n in rows)
    )
    s_file.write_text(RECORD + "".join(assembly_source(n, SIGNATURES[n]) for n in rows))
    names = [name for n in rows for name in (f"c_calls_{n}", f"call_{n}")]
    main_file.write_text(
        MAIN.format(
            prototypes="\n".join(f"int {name}(void);" for name in names),
            calls="\n    ".join(f'printf("{name} %d\\n", {name}());' for name in names),
        )
    )
    image = folder / f"rows{level}.elf"
    built = build([main_file, c_file, s_file], image, level, "-std=gnu11", "-Wall", "-Wno-padded")
    assert built.status == 0, built.messages
    ran = run(image, engine="auto")
    assert ran.status == 0, ran
    return {name: int(value) for name, value in (line.split() for line in ran.uart.decode().splitlines())}


@pytest.fixture(scope="session")
def abi_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("abi")


@pytest.mark.slow
@pytest.mark.parametrize("level", LEVELS)
@pytest.mark.parametrize("number", range(len(SIGNATURES)), ids=[s.rule for s in SIGNATURES])
def test_c_puts_arguments_where_assembly_expects_them(number: int, level: str, abi_folder: Path) -> None:
    """C callers put arguments where the rules say (abi-elf.md §2.2, §2.4).

    Status = 10 * argument + word of the first difference.
    """
    assert outcomes(level, abi_folder)[f"c_calls_{number}"] == 0


@pytest.mark.parametrize("level", LEVELS)
@pytest.mark.parametrize("number", range(len(SIGNATURES)), ids=[s.rule for s in SIGNATURES])
def test_c_finds_arguments_where_assembly_puts_them(number: int, level: str, abi_folder: Path) -> None:
    """C callees find arguments where the rules say, although the upper bytes of narrow arguments are noise.

    Source: abi-elf.md §2.2, §2.4. Status = first wrong argument.
    """
    assert outcomes(level, abi_folder)[f"call_{number}"] == 0


@pytest.mark.parametrize("level", LEVELS)
def test_variadic_functions_get_everything_on_the_stack(level: str, tmp_path: Path) -> None:
    """All arguments of g(int n, ...) are on the stack: call g(1, 2, 3L, 'c', 1.0f) (abi-elf.md §2.2 rule 5, last
    row)."""
    c_text = """
extern int g(int n, ...);
extern int caller(void);
int callee(int n, ...)
{
    __builtin_va_list list;
    __builtin_va_start(list, n);
    int a = __builtin_va_arg(list, int);
    long b = __builtin_va_arg(list, long);
    int c = __builtin_va_arg(list, int);
    __builtin_va_end(list);
    return n == 1 && a == 2 && b == 0x30004L && c == 'c';
}
int main(void) { return g(1, 2, 0x30004L, 'c') == 0x1234 && caller() == 1 ? 0 : 1; }
"""
    s_text = """
        .global _g
_g:     mov [w15-6],w0                  ; n = 1 lies highest, the others below it
        cp w0,#1
        bra nz,1f
        mov [w15-8],w0
        cp w0,#2
        bra nz,1f
        mov [w15-12],w0
        cp w0,#4
        bra nz,1f
        mov [w15-10],w0
        cp w0,#3
        bra nz,1f
        mov [w15-14],w0
        mov #99,w1
        cp w0,w1
        bra nz,1f
        mov #0x1234,w0
        return
1:      clr w0
        return
        .global _caller
_caller:
        mov #99,w0
        mov w0,[w15++]
        mov #4,w0
        mov w0,[w15++]
        mov #3,w0
        mov w0,[w15++]
        mov #2,w0
        mov w0,[w15++]
        mov #1,w0
        mov w0,[w15++]
        rcall _callee
        sub #10,w15
        return
"""
    assert run_both(tmp_path, level, c_text, s_text) == 0
