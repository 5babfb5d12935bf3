"""Adversarial programs: the bound covers the longest run, or the report names the line that has no bound."""

from __future__ import annotations

from pathlib import Path

import pytest

import emu
from tests.toolchain.c_programs import build
from toolchain.bounds.annotations.flow_facts import (
    DO_LOOP_ENDS_WITH_JUMP,
    DO_LOOPS_TOO_DEEP,
    DO_REGISTER_WRITTEN,
    IRREGULAR_DO_LOOP,
    JUMP_PAST_TABLE,
    JUMP_WITHOUT_TABLE,
    SPECIAL_ADDRESSING,
    STACK_POINTER_OVERWRITTEN,
    WAITS_FOR_INTERRUPT,
)
from toolchain.bounds.program import Program
from toolchain.bounds.report import Bound, BoundAnalysis
from toolchain.elf.read import read_executable

DATA = "volatile unsigned in, out; __attribute__((used)) unsigned get(void) { return in; }\n"
HEAD = "    .text\n    .global _main\n_main:\n    mov _in,w0\n"
WAIT = "1:  repeat #99\n    nop\n    dec w1,w1\n    bra gtu,1b\n    return\n"
CYCLES = 20_000
PROGRAMS = {
    "a branch past DO": (
        "clr w1\n btss w0,#0\n do #9,1f\n nop\n repeat #50\n nop\n nop\n1: inc w1,w1\n return\n",
        8, (IRREGULAR_DO_LOOP, 8)),
    "a branch out of the inner of two DO loops": (
        "clr w1\n mov #30,w4\n do #4,3f\n do #4,1f\n dec w4,w4\n cp w0,w4\n bra z,2f\n nop\n1: inc w1,w1\n2: nop\n"
        " nop\n3: nop\n mov w4,w1\n" + WAIT, 32, (IRREGULAR_DO_LOOP, 14)),
    "a call at the end of DO": (
        "do #3,1f\n nop\n nop\n1: rcall s1\n return\ns1: repeat #90\n nop\n return\n", 1, (DO_LOOP_ENDS_WITH_JUMP, 8)),
    "EDT": (
        "mov #10,w1\n do #9,1f\n dec w1,w1\n cpsne w0,w1\n bset.b 0x45,#3\n nop\n1: nop\n" + WAIT, 12, None),
    "the upper byte of a register": ("mov #1,w1\n bset.b 0x03,#0\n1: dec w1,w1\n bra gtu,1b\n return\n", 1, None),
    "registers by their addresses": (
        "and w0,#6,w0\n mov #100,w5\n mov #1,w3\n mov w5,[w0]\n1: dec w3,w3\n bra gtu,1b\n return\n", 8, None),
    "half a word of the stack": (
        "lnk #8\n mov.b #1,w0\n add w14,#3,w1\n mov.b w0,[w1]\n mov _in,w2\n and w2,#2,w2\n add w14,w2,w3\n"
        " mov #0x1400,w0\n mov w0,[w3]\n ze [w1],w4\n1: dec w4,w4\n bra gtu,1b\n ulnk\n return\n", 4, None),
    "a jump into what is no table": (
        "cp w0,#3\n bra gtu,2f\n bra w0\n repeat #200\n nop\n nop\n nop\n2: return\n", 5, (JUMP_WITHOUT_TABLE, 7)),
    "a jump past the end of its table": (
        "cp w0,#3\n bra gtu,2f\n bra w0\n bra 2f\n bra 2f\n repeat #200\n nop\n nop\n2: return\n",
        4, (JUMP_PAST_TABLE, 7)),
    "a jump into its table": (
        "and w0,#1,w0\n bra w0\n bra 1f\n bra 2f\n bra 3f\n1: repeat #20\n nop\n2: return\n3: repeat #200\n nop\n"
        " return\n", 4, None),
    "a jump into a table of seven": (
        "cp w0,#7\n bra c,1f\n bra w0\n bra 1f\n bra 1f\n bra 1f\n bra 1f\n bra 1f\n bra 1f\n bra 2f\n1: return\n"
        "2: repeat #20\n nop\n return\n", 8, None),
    "DCOUNT made more": (
        "clr w1\n do #3,1f\n cp0 w1\n bra nz,2f\n mov #300,w2\n mov w2,0x38\n inc w1,w1\n2: nop\n nop\n1: nop\n"
        " return\n", 1, None),
    "DCOUNT put back": (
        "mov #2,w2\n do #4,1f\n nop\n push 0x38\n push 0x3e\n clr 0x38\n nop\n pop 0x3e\n pop 0x38\n"
        " nop\n nop\n1: nop\n return\n", 1, None),
    "DOEND moved": (
        "do #3,1f\n mov 0x3e,w1\n add w1,#8,w1\n mov w1,0x3e\n nop\n nop\n1: nop\n nop\n nop\n nop\n repeat #90\n"
        " nop\n return\n", 1, (DO_REGISTER_WRITTEN, 8)),
    "a third DO within two": (
        "clr w1\n do #1,3f\n do #1,2f\n do #1,1f\n nop\n inc w1,w1\n1: nop\n nop\n2: nop\n nop\n3: nop\n"
        " mov #8,w2\n sub w2,w1,w1\n bra z,5f\n4: repeat #90\n nop\n dec w1,w1\n bra nz,4b\n5: return\n", 1,
        (DO_LOOPS_TOO_DEEP, 8)),
    "Idle": (
        "mov #500,w1\n mov w1,0x102\n bset 0x8c,#3\n bset 0x104,#15\n bset 0x42,#7\n pwrsav #1\n nop\n return\n", 1,
        (WAITS_FOR_INTERRUPT, 10)),
    "registers, or what lies behind them all": (
        "mov #0xffe,w1\n and w0,w1,w0\n mov #100,w5\n mov #1,w3\n mov w5,[w0]\n1: dec w3,w3\n bra gtu,1b\n return\n",
        8, (STACK_POINTER_OVERWRITTEN, 9)),
    "SR, or what lies behind the registers": (
        "and w0,#1,w0\n sl w0,#11,w0\n mov #0x42,w1\n add w0,w1,w0\n mov #2,w5\n mov w5,[w0]\n bra z,1f\n return\n"
        "1: repeat #90\n nop\n return\n", 2, None),
    "SR between a comparison and its branch": (
        "and w0,#1,w1\n cp w1,#3\n mov #2,w2\n mov w2,0x42\n bra z,1f\n return\n1: repeat #90\n nop\n return\n", 2,
        None),
    "a compared register by its address": (
        "mov #99,w3\n cp w0,#4\n mov w3,0x0\n bra gtu,1f\n cp w0,#5\n bra ltu,1f\n repeat #90\n nop\n1: return\n", 2,
        None),
    "RETFIE of a function": (
        "and w0,#1,w2\n rcall s2\n mov 0x42,w1\n lsr w1,#5,w1\n and w1,#7,w1\n bra z,1f\n return\n1: repeat #90\n"
        " nop\n return\ns2: bset 0x42,#7\n retfie\n", 2, None),
    "modulo addressing": (
        "mov #0x900,w0\n mov w0,0x48\n mov #0x91f,w0\n mov w0,0x4a\n mov #0x8ff1,w0\n mov w0,0x46\n nop\n"
        " mov #0x910,w1\n mov #100,w3\n1: mov [w1++],w2\n mov #0x920,w4\n dec w3,w3\n bra z,2f\n cp w1,w4\n bra nz,1b\n"
        "2: clr 0x46\n nop\n return\n", 1, (SPECIAL_ADDRESSING, 10)),
}  # fmt: skip
"""Adversarial code by name: code after `mov _in,w0`, number of inputs, and reason and line of the refusal.

None: the program is bounded.
"""
LOOSE = {"half a word of the stack": 11}
"""Maximum ratio of bound and longest run if it exceeds 1.1: the analysis does not know a byte of the program."""
NINTH = """
__attribute__((noinline)) void set(int a, int b, int c, int d, int e, int f, int g, int h, unsigned *p)
{
    *p = 60 + (a & 1);
    out += a + b + c + d + e + f + g + h;
}
int main(void)
{
    unsigned n;
    CALLS
    for (unsigned i = 0; i < n; i++) out++;
    return 0;
}
"""
"""C program in which only one pointer among the stack arguments points to the variable.

It has more contexts than the analysis separates.
"""


def bound_of(image: Path) -> Bound:
    """Return the bound of main."""
    executable = read_executable(image.read_bytes(), str(image))
    program = Program(executable)
    address = program.address("_main")
    assert address is not None
    return BoundAnalysis(program).bound("_main", address, "call")


def worst(image: Path, inputs: int) -> int:
    """Return the cycles of main's longest run over all inputs 0..inputs-1 in the variable `in`."""
    longest = 0
    for value in range(inputs):
        machine = emu.load(image, engine="plain")
        assert machine.run(until="main", seconds=1).reason == "until"
        machine.poke("in", value)
        start, top = machine.cycle, machine.w[15]
        while machine.w[15] >= top and machine.cycle - start < CYCLES:
            machine.run(until=None, cycles=1)
        longest = max(longest, machine.cycle - start)
    assert 0 < longest < CYCLES
    return longest


@pytest.mark.slow
@pytest.mark.parametrize("name", PROGRAMS)
def test_assembly_stays_within_its_bound_or_is_refused_by_its_line(tmp_path: Path, name: str) -> None:
    """Unusual assembly stays within its bound or is refused with its line.

    The programs use DO loops, registers accessed through memory, jump tables and rare addressing modes.
    """
    text, inputs, refused = PROGRAMS[name]
    most = LOOSE.get(name, 1.1)
    (tmp_path / "p.s").write_text(HEAD + text)
    (tmp_path / "c.c").write_text(DATA)
    built = build([tmp_path / "p.s", tmp_path / "c.c"], tmp_path / "p.elf", "-Os", "-g", "-fno-lto")
    assert built.status == 0, built.messages
    bound = bound_of(tmp_path / "p.elf")
    if refused is not None:
        reason, line = refused
        assert bound.cycles is None
        assert [where for where, why in bound.unbounded.items() if why == reason and f"p.s:{line} " in where], (
            bound.unbounded
        )
    else:
        seen = worst(tmp_path / "p.elf", inputs)
        assert bound.cycles is not None
        assert seen <= bound.cycles <= most * seen


def test_a_pointer_to_the_stack_among_arguments_on_the_stack(tmp_path: Path) -> None:
    """The bound covers a callee that stores through a pointer which is passed among the stack arguments."""
    calls = " ".join(f"n = {k}; set({k}, 2, 3, 4, 5, 6, 7, 8, &n);" for k in range(14))
    (tmp_path / "p.c").write_text(DATA + NINTH.replace("CALLS", calls))
    built = build([tmp_path / "p.c"], tmp_path / "p.elf", "-O0", "-g")
    assert built.status == 0, built.messages
    bound = bound_of(tmp_path / "p.elf")
    assert bound.cycles is None or bound.cycles >= worst(tmp_path / "p.elf", 1)


@pytest.mark.parametrize("level", ["-O0", "-Os", "-O2"])
def test_the_table_of_a_switch_has_an_end_the_compiler_asks_for(tmp_path: Path, level: str) -> None:
    """The analysis derives the end of a switch's jump table from the compiler's range check.

    No jump into the table is refused, although the number of cases, seven, is no power of two.
    """
    cases = " ".join(f"case {k}: out += {k * k + 1}; break;" for k in range(3, 10))
    (tmp_path / "p.c").write_text(DATA + f"int main(void) {{ switch (in) {{ {cases} }} return 0; }}\n")
    built = build([tmp_path / "p.c"], tmp_path / "p.elf", level, "-g", "-fno-lto")
    assert built.status == 0, built.messages
    bound = bound_of(tmp_path / "p.elf")
    assert bound.cycles is not None
    assert bound.cycles >= worst(tmp_path / "p.elf", 12)
