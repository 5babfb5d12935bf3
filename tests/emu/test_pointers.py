"""In every engine, `++` and `--` of every row change the pointer by the size of the access (isa.md §3.1, §8.1).

The expected change is read from the assembly text of the instruction, independently of the row's code.
"""

from __future__ import annotations

import re
from itertools import product
from typing import Any

import pytest

from emu.dspic30f.isa import codec, text
from emu.dspic30f.isa.row import Insn, Row
from emu.dspic30f.isa.table import ROWS
from tests.emu.engines import ENGINES, OnMachine

PC = 0x1000
MODES = {"p": range(6), "q": range(6), "g": range(7), "h": range(7), "i": range(16), "j": range(16), "a": range(3)}
"""Fields that select a pointer mode, with their values."""
FIXED = {"s": 2, "d": 6, "w": 9, "x": 2, "y": 3}
"""Registers of the other fields, chosen so that they do not overlap: W2 to W6, W7, offset W9; prefetched W6 and W7."""
POINTERS = [0x900 + 0x40 * n for n in range(10)] + [0x1A00, 0x1A40, 4, 0xC40, 0, 0x800]
"""Initial values of W0 to W15. W10 and W11 point into Y memory, W12 is the offset of prefetches."""
STEPS = 3
NATIVE_STRIDE = 7
"""The JIT runs only every NATIVE_STRIDE-th instruction of the list, because it compiles each one."""
BRA_SELF = 0x37FFFF
BYTES = ("se", "ze")
MOVES = (
    (re.compile(r"\[w(\d+)\+\+\]|\[\+\+w(\d+)\]"), 1),
    (re.compile(r"\[w(\d+)--\]|\[--w(\d+)\]"), -1),
)
PREFETCH = re.compile(r"\[w(\d+)\]([+-])=(\d)")


def instructions() -> list[Insn]:
    """Return instructions with every pointer mode of every row, as word and byte; the modes of several operands
    change together."""
    found: dict[tuple[int, ...], Insn] = {}
    for row in ROWS:
        modes = [letter for letter in MODES if letter in row.fields]
        for byte, letter in product((0, 1) if "B" in row.fields else (0,), modes):
            for mode in MODES[letter]:
                if any(insn.row is row and getattr(insn.x, "B", 0) == byte and getattr(insn.x, letter) == mode
                       for insn in found.values()):  # fmt: skip
                    continue
                others = ({name: MODES[name][(mode + turn) % len(MODES[name])] for name in modes} for turn in range(6))
                insns = (_encoded(row, other | {letter: mode, "B": byte}) for other in others)
                insn = next((insn for insn in insns if insn is not None), None)
                if insn is not None:
                    found[insn.word1, byte] = insn
    return list(found.values())


def _encoded(row: Row, chosen: dict[str, int]) -> Insn | None:
    fields = {letter: (chosen | FIXED).get(letter, 0) for letter in row.fields}
    try:
        insn = codec.decode(*codec.encode(row, fields))
    except codec.EncodeError:
        return None
    return insn if insn is not None and insn.row is row else None


def moves(insn: Insn) -> dict[int, int]:
    """Return the expected change of each pointer register by one execution of the instruction, as its text states."""
    said = text.format(insn, PC)
    mnemonic = said.split()[0]
    size = 4 if mnemonic == "mov.d" else 1 if mnemonic.endswith(".b") or mnemonic in BYTES else 2
    found = {}
    for pattern, sign in MOVES:
        for match in pattern.finditer(said):
            found[int(match[1] or match[2])] = sign * size
    for match in PREFETCH.finditer(said):
        found[int(match[1])] = int(match[2] + match[3])
    return found


def run(engine: Any, words: list[int], instructions_run: int) -> None:
    """Run words from PC, followed by a branch to itself."""
    data = {"W": POINTERS, "SR": 0, "CORCON": 0x20, "mem": {}}
    engine.prepare({"pc": PC, "op": [f"{word:06x}" for word in (*words, BRA_SELF)], "in": data})
    if isinstance(engine, OnMachine):
        assert engine.machine.run_until(engine.machine.cycle + 4 * instructions_run) is None
    else:
        for _ in range(instructions_run):
            engine.step()


@pytest.fixture(params=sorted(ENGINES), scope="module")
def engine(request: pytest.FixtureRequest) -> Any:
    """Return each engine, and the instruction table without a machine."""
    return ENGINES[request.param]()


@pytest.mark.slow
def test_pointers_move_by_the_size_of_the_access(engine: Any) -> None:
    """Pointers change by the size of the access, once, and three times under REPEAT."""
    (again,) = codec.encode(next(row for row in ROWS if row.syntax == "REPEAT #lit14"), {"k": STEPS - 1})
    wrong = []
    for insn in instructions()[:: NATIVE_STRIDE if engine.name == "jit" else 1]:
        wanted = moves(insn)
        program, times = [insn.word1, 0], 1  # a NOP for the instructions that skip
        if insn.row.repeat_ok:
            program += [again, insn.word1]
            times += STEPS
        run(engine, program, len(program) + times)
        for n, step in wanted.items():
            moved = engine.w(n) - POINTERS[n]
            if moved != times * step:
                wrong.append(f"{text.format(insn, PC)}: w{n} moved {moved} instead of {times} times {step}")
    assert not wrong, "\n".join(wrong)


def test_the_instructions_of_the_test_are_all_there_are() -> None:
    """The instructions include every row with a pointer and every pointer mode."""
    met = {(insn.row.id, letter, getattr(insn.x, letter)) for insn in instructions() for letter in MODES
           if letter in insn.row.fields}  # fmt: skip
    for row in ROWS:
        for letter in MODES.keys() & row.fields.keys():
            for mode in MODES[letter]:
                possible = any(_encoded(row, dict.fromkeys(MODES, 1) | {letter: mode, "B": byte}) for byte in (0, 1))
                assert ((row.id, letter, mode) in met) == possible, f"{row.syntax}: {letter} = {mode}"
    assert sum(bool(moves(insn)) for insn in instructions()) > 500
