"""The calling convention of abi-elf.md §2, rule by rule, in both directions: C calls assembly and assembly calls C.

From each row of SIGNATURES a C caller, an assembly callee that records registers and stack, an assembly caller and a C
callee that checks its parameters are generated; all rows run in one image per level.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import pytest

from tests.toolchain.c_programs import build, run

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
    """Parameter types, and for each its first register or "stack"; `rule` cites abi-elf.md §2.2."""

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
    """Distinct test words of argument `index`; narrow arguments use the low byte only."""
    if type_name in NARROW:
        return [0x11 + index]
    return [(0x1000 * (index % 7 + 1) + 0x0101 * index + 0x13 * k) & 0x7FFF for k in range(WORDS[type_name])]


def initialiser(index: int, type_name: str) -> str:
    """C statements that build argument `index` in variable `v{index}` from its words."""
    words = ", ".join(map(hex, words_of(index, type_name)))
    if type_name in NARROW:
        return f"{type_name} v{index} = {words};"
    return (
        f"{type_name} v{index}; {{ static const unsigned w[] = {{{words}}}; "
        f"__builtin_memcpy(&v{index}, w, sizeof v{index}); }}"
    )


def stack_offsets(signature: Signature) -> dict[int, list[int]]:
    """For each stack argument the distance of its words below W15 at the callee's entry (abi-elf.md §2.4)."""
    offsets = {}
    below = 4  # the return address
    for index, (type_name, place) in enumerate(zip(signature.types, signature.places, strict=True)):
        if place == STACK:
            below += 2 * WORDS[type_name]
            offsets[index] = [below - 2 * k for k in range(WORDS[type_name])]
    return offsets


def c_source(number: int, signature: Signature) -> str:
    """The C half of one row: caller of the assembly probe, and callee for the assembly caller."""
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
    """The assembly half: a probe that records what it got, and a caller that loads everything by the rules."""
    lines = [f"        .global _probe_{number}", f"_probe_{number}:", "        bra _record"]
    lines += [f"        .global _call_{number}", f"_call_{number}:"]
    stack = [(i, t) for i, (t, p) in enumerate(zip(signature.types, signature.places, strict=True)) if p == STACK]
    pushed = 0
    for index, type_name in reversed(stack):
        for word in words_of(index, type_name):
            # a char on the stack leaves its upper byte undefined: fill it with noise
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
    """Result of every generated function by name: 0 is right."""
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
    ran = run(image, engine="interp")
    assert ran.status == 0, ran
    return {name: int(value) for name, value in (line.split() for line in ran.uart.decode().splitlines())}


@pytest.fixture(scope="session")
def abi_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("abi")


@pytest.mark.parametrize("level", LEVELS)
@pytest.mark.parametrize("number", range(len(SIGNATURES)), ids=[s.rule for s in SIGNATURES])
def test_c_puts_arguments_where_assembly_expects_them(number: int, level: str, abi_folder: Path) -> None:
    """abi-elf.md §2.2, §2.4; status = 10 * argument + word of the first difference."""
    assert outcomes(level, abi_folder)[f"c_calls_{number}"] == 0


@pytest.mark.parametrize("level", LEVELS)
@pytest.mark.parametrize("number", range(len(SIGNATURES)), ids=[s.rule for s in SIGNATURES])
def test_c_finds_arguments_where_assembly_puts_them(number: int, level: str, abi_folder: Path) -> None:
    """abi-elf.md §2.2, §2.4; the upper bytes of narrow arguments are noise. Status = first wrong argument."""
    assert outcomes(level, abi_folder)[f"call_{number}"] == 0


def both(folder: Path, level: str, c_text: str, s_text: str) -> int:
    """Status of a program of one C and one assembly file."""
    (folder / "a.c").write_text(c_text)
    (folder / "b.s").write_text("        .section .text,code\n" + s_text)
    built = build([folder / "a.c", folder / "b.s"], folder / "a.elf", level, "-std=gnu11", "-Wall")
    assert built.status == 0, built.messages
    ran = run(folder / "a.elf", engine="interp")
    assert ran.status is not None, ran
    return ran.status


@pytest.mark.parametrize("level", LEVELS)
def test_variadic_functions_get_everything_on_the_stack(level: str, tmp_path: Path) -> None:
    """abi-elf.md §2.2 rule 5 and the last row of its table: g(int n, ...) called g(1, 2, 3L, 'c', 1.0f)."""
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
    assert both(tmp_path, level, c_text, s_text) == 0


@pytest.mark.parametrize("level", LEVELS)
def test_results_come_in_w0_to_w3(level: str, tmp_path: Path) -> None:
    """abi-elf.md §2.3: 8, 16, 32, 64 bits, float, double; the upper byte of an 8-bit result is noise."""
    c_text = """
signed char r8(void); unsigned char u8(void); int r16(void); long r32(void); long long r64(void);
float rf(void); double rd(void); int check(void);
signed char c8(void) { return -3; }
int c16(void) { return 0x1234; }
long c32(void) { return 0x12345678L; }
long long c64(void) { return 0x123456789ABCDEF0LL; }
float cf(void) { return -2.0f; }
double cd(void) { return 1.5; }
int main(void)
{
    if (r8() != -2 || u8() != 200) return 1;
    if (r16() != 0x4321) return 2;
    if (r32() != 0x11112222L) return 3;
    if (r64() != 0x1111222233334444LL) return 4;
    if (rf() != 1.0f) return 5;
    if (rd() != 1.0) return 6;
    return check();
}
"""
    s_text = """
        .global _r8
_r8:    mov #0x55FE,w0
        return
        .global _u8
_u8:    mov #0x55C8,w0
        return
        .global _r16
_r16:   mov #0x4321,w0
        return
        .global _r32
_r32:   mov #0x2222,w0
        mov #0x1111,w1
        return
        .global _r64
_r64:   mov #0x4444,w0
        mov #0x3333,w1
        mov #0x2222,w2
        mov #0x1111,w3
        return
        .global _rf
_rf:    clr w0
        mov #0x3F80,w1
        return
        .global _rd
_rd:    clr w0
        clr w1
        clr w2
        mov #0x3FF0,w3
        return
        .macro expect reg, value, status
        mov #\\value,w7
        mov #\\status,w6
        cp \\reg,w7
        bra nz,fail
        .endm
        .global _check
_check: rcall _c8
        and #0xFF,w0
        expect w0,0xFD,7
        rcall _c16
        expect w0,0x1234,8
        rcall _c32
        expect w0,0x5678,9
        expect w1,0x1234,9
        rcall _c64
        expect w0,0xDEF0,10
        expect w1,0x9ABC,10
        expect w2,0x5678,10
        expect w3,0x1234,10
        rcall _cf
        expect w0,0,11
        expect w1,0xC000,11
        rcall _cd
        expect w2,0,12
        expect w3,0x3FF8,12
        retlw #0,w0
fail:   mov w6,w0
        return
"""
    assert both(tmp_path, level, c_text, s_text) == 0


@pytest.mark.parametrize("level", LEVELS)
def test_struct_results_go_through_a_hidden_pointer_in_w0(level: str, tmp_path: Path) -> None:
    """abi-elf.md §2.2 rule 7 and §2.3: any size, even one byte; the other arguments follow from W1."""
    c_text = """
struct one { char a; };
struct three { int a, b, c; };
extern struct one make_one(int x);
extern struct three make_three(int x, long y);
extern int check(void);
struct one c_one(int x) { struct one r = {(char)(x + 1)}; return r; }
struct three c_three(int x, long y) { struct three r = {x, (int)y, (int)(y >> 16)}; return r; }
int main(void)
{
    struct one o = make_one(5);
    struct three t = make_three(7, 0x20003L);
    if (o.a != 15 || t.a != 7 || t.b != 3 || t.c != 2) return 1;
    return check();
}
"""
    s_text = """
        .global _make_one
_make_one:
        add w1,#10,w1
        mov.b w1,[w0]
        return
        .global _make_three
_make_three:
        mov w1,[w0]                     ; x in W1, y in W2:W3
        mov w2,[w0+2]
        mov w3,[w0+4]
        return
        .section .nbss,bss,near
room:   .space 6
        .section .text,code
        .global _check
_check: mov #room,w0
        mov #40,w1
        rcall _c_one
        mov #room,w1
        mov.b [w1],w0
        ze w0,w0
        mov #41,w2
        cp w0,w2
        bra nz,1f
        mov #room,w0
        mov #11,w1
        mov #0x2222,w2
        mov #0x3333,w3
        rcall _c_three
        mov #room,w1
        mov [w1],w0
        cp w0,#11
        bra nz,1f
        mov [w1+2],w0
        mov #0x2222,w2
        cp w0,w2
        bra nz,1f
        mov [w1+4],w0
        mov #0x3333,w2
        cp w0,w2
        bra nz,1f
        retlw #0,w0
1:      retlw #2,w0
"""
    assert both(tmp_path, level, c_text, s_text) == 0


@pytest.mark.parametrize("level", LEVELS)
def test_c_functions_preserve_w8_to_w14_and_balance_w15(level: str, tmp_path: Path) -> None:
    """abi-elf.md §2.1: a C function with much to keep, called from assembly."""
    c_text = """
volatile int sink;
extern int check(void);
int leaf(int x) { return x + sink; }
int busy(int a, int b, int c, int d)
{
    int e = a * b, f = c * d, g = a + d, h = b - c, i = a ^ c;
    for (int k = 0; k < 3; k++) {
        e += leaf(f); f -= leaf(g); g ^= leaf(h); h += leaf(i); i -= leaf(a); a += b; b ^= c; c -= d; d += a;
    }
    int array[5] = {e, f, g, h, i};
    for (int k = 0; k < 5; k++) sink += array[(k + a) & 3];
    return a + b + c + d + e + f + g + h + i;
}
int main(void) { return check(); }
"""
    registers = range(8, 15)
    s_text = (
        "        .global _check\n_check:\n"
        + "".join(f"        mov w{r},[w15++]\n" for r in registers)
        + "".join(f"        mov #0x7A{r:02X},w{r}\n" for r in registers)
        + "        mov w15,_before\n        mov #1,w0\n        mov #2,w1\n        mov #3,w2\n        mov #4,w3\n"
        + "        rcall _busy\n        mov _before,w1\n        sub w15,w1,w0\n        bra nz,1f\n"
        + "".join(f"        mov #0x7A{r:02X},w1\n        sub w{r},w1,w0\n        bra nz,1f\n" for r in registers)
        + "1:\n"
        + "".join(f"        mov [--w15],w{r}\n" for r in reversed(registers))
        + "        return\n        .section .nbss,bss,near\n        .align 2\n_before: .space 2\n"
    )
    assert both(tmp_path, level, c_text, s_text) == 0


@pytest.mark.parametrize("level", LEVELS)
def test_c_expects_calls_to_change_w0_to_w7_and_rcount(level: str, tmp_path: Path) -> None:
    """abi-elf.md §2.1: a callee that ruins everything it may."""
    c_text = """
extern void ruin(void);
int main(void)
{
    volatile int seed = 3;
    int a = seed, b = seed * 2;
    long c = seed * 100000L;
    long long d = seed * 10000000000LL;
    int buffer[20];
    for (int i = 0; i < 20; i++) buffer[i] = i + seed;
    int copy[20];
    ruin();
    __builtin_memcpy(copy, buffer, sizeof copy);
    ruin();
    if (a != 3 || b != 6 || c != 300000L || d != 30000000000LL) return 1;
    for (int i = 0; i < 20; i++) { ruin(); if (copy[i] != i + a) return 2; }
    return 0;
}
"""
    s_text = (
        "        .global _ruin\n_ruin:\n"
        + "".join(f"        mov #0xBAD{r},w{r}\n" for r in range(8))
        + "        mov w0,_RCOUNT\n        mov #0x0F,w0\n        mov.b WREG,_SR\n        return\n"
    )
    assert both(tmp_path, level, c_text, s_text) == 0


@pytest.mark.parametrize("level", LEVELS)
def test_names_get_an_underscore_in_both_directions(level: str, tmp_path: Path) -> None:
    """abi-elf.md §2.6: functions, variables, and constants that assembly reads through the PSV window."""
    c_text = """
int shared = 5;
const int table[3] = {10, 20, 30};
extern int from_assembly;
extern int twice(void);
int main(void) { from_assembly += 1; return twice() == 2 * 5 + 30 + 8 ? 0 : twice(); }
"""
    s_text = """
        .global _twice
_twice: mov #_shared,w1
        mov [w1],w0
        add w0,w0,w0
        mov #psvoffset(_table),w1
        add w0,[++w1],w2                ; skip: pointer to table[1]
        inc2 w1,w1
        add w0,[w1],w0
        mov #_from_assembly,w1
        add w0,[w1],w0
        return
        .section .ndata,data,near
        .global _from_assembly
        .align 2
_from_assembly: .word 7
"""
    assert both(tmp_path, level, c_text, s_text) == 0


@pytest.mark.parametrize("level", LEVELS)
def test_function_pointers_cross_the_border(level: str, tmp_path: Path) -> None:
    """abi-elf.md §1.5: a handle made by assembly is called by C, and the other way round."""
    c_text = """
typedef int (*function)(int);
extern function give(void);
extern int use(function f);
int triple(int x) { return 3 * x; }
int main(void) { return give()(5) == 6 && use(triple) == 21 ? 0 : 1; }
"""
    s_text = """
        .global _give
_give:  mov #handle(_plus_one),w0
        return
_plus_one:
        inc w0,w0
        return
        .global _use
_use:   mov w0,w4
        mov #7,w0
        call w4
        return
"""
    assert both(tmp_path, level, c_text, s_text) == 0


def assembly_of(folder: Path, c_text: str, level: str = "-Os") -> str:
    """Our compiler's output for one file."""
    (folder / "x.c").write_text("#include <dspic30f6014a.h>\n" + c_text)
    built = build([folder / "x.c"], folder / "x.s", level, "-S")
    assert built.status == 0, built.messages
    return (folder / "x.s").read_text()


def body_of(text: str, name: str) -> list[str]:
    """Instructions of one function, labels and directives left out."""
    part = text.split(f"\n{name}:", 1)[1].split(".size", 1)[0]
    lines = [line.strip() for line in part.splitlines() if line.startswith("\t")]
    return [line for line in lines if line and not line.startswith(".")]


def test_minimal_handler_is_two_words(tmp_path: Path) -> None:
    """abi-elf.md §2.5: one INC f and RETFIE, nothing saved."""
    text = assembly_of(tmp_path, "volatile int n; OS_ISR(_T1Interrupt) { n++; }")
    assert body_of(text, "__T1Interrupt") == ["inc _n", "retfie"]


def test_handler_that_calls_saves_rcount_and_w0_to_w7(tmp_path: Path) -> None:
    """abi-elf.md §2.5 items 2 and 3, mirrored at the end."""
    body = body_of(assembly_of(tmp_path, "void f(void); OS_ISR(_T1Interrupt) { f(); }"), "__T1Interrupt")
    assert body[:5] == ["push _RCOUNT", "mov.d w0,[w15++]", "mov.d w2,[w15++]", "mov.d w4,[w15++]", "mov.d w6,[w15++]"]
    assert body[-6:] == [
        "mov.d [--w15],w6", "mov.d [--w15],w4", "mov.d [--w15],w2", "mov.d [--w15],w0", "pop _RCOUNT", "retfie",
    ]  # fmt: skip


def test_shadow_handler_uses_the_shadow_registers(tmp_path: Path) -> None:
    """abi-elf.md §2.5, attribute `shadow`."""
    text = assembly_of(tmp_path, "volatile int a, b; OS_ISR_SHADOW(_T1Interrupt) { a = b + 3; }")
    body = body_of(text, "__T1Interrupt")
    assert body[0] == "push.s"
    assert body[-2:] == ["pop.s", "retfie"]


def test_auto_psv_handler_loads_and_restores_psvpag(tmp_path: Path) -> None:
    """abi-elf.md §2.5 item 6."""
    source = "volatile int a; OS_ISR_AUTO_PSV(_T1Interrupt) { static const int t[3] = {5, 6, 7}; a = t[a]; }"
    body = "\n".join(body_of(assembly_of(tmp_path, source), "__T1Interrupt"))
    assert "push _PSVPAG" in body
    assert "#__const_psvpage" in body
    assert body.endswith("retfie")
    assert body.index("pop _PSVPAG") > body.index("#__const_psvpage")
