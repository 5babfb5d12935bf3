"""Single instructions that the recorded vectors do not cover, and the examples of the reference."""

from __future__ import annotations

import csv
import re
from pathlib import Path
from typing import Any

import pytest

from emu.dspic30f.isa import codec, text
from emu.dspic30f.isa.flow import ClearWatchdog, Disi, Reset, Sleep
from emu.dspic30f.isa.table import BY_ID
from tests.emu.rowmachine import CORCON, REGISTERS, SR, RowMachine

GOLDEN = Path(__file__).resolve().parents[2] / "vectors" / "golden.csv"


class Traps(RowMachine):
    """Row machine that records trap requests."""

    def __init__(self, *statements: str) -> None:
        words = [word for i, statement in enumerate(statements) for word in text.parse(statement).encode(2 * i)]
        super().__init__({2 * i: word for i, word in enumerate(words)})
        self.traps = 0
        self.put(CORCON, 0x0020)

    def trap_math(self, c: Any) -> None:
        self.traps += bool(c)


def after(statement: str, w: dict[int, int], mem: dict[int, int] | None = None, **registers: int) -> Traps:
    """Return a machine after it has executed one instruction."""
    m = Traps(statement)
    for n, value in w.items():
        m.set_w(n, value)
    for address, value in (mem or {}).items():
        m.put(address, value)
    for name, value in registers.items():
        m.put(REGISTERS[name], value)
    m.step()
    return m


@pytest.mark.parametrize(
    ("statement", "w", "mem", "w_after", "mem_after"),
    [
        ("mov [w1++], [w1++]", {1: 0x1100}, {0x1100: 7}, {1: 0x1104}, {0x1102: 7}),
        ("add w0, [w1++], [w1++]", {0: 5, 1: 0x1100}, {0x1100: 7}, {1: 0x1104}, {0x1102: 12}),
        ("mov [w1++], w1", {1: 0x1100}, {0x1100: 7}, {1: 7}, {}),
        ("mov w1, [w1++]", {1: 0x1100}, {}, {1: 0x1102}, {0x1100: 0x1100}),
        ("mov w1, [++w1]", {1: 0x1100}, {}, {1: 0x1102}, {0x1102: 0x1100}),
        ("add w1, [w1++], w2", {1: 0x1100}, {0x1100: 7}, {1: 0x1102, 2: 0x1107}, {}),
        ("add w1, w0, [w1++]", {0: 1, 1: 0x1100}, {}, {1: 0x1102}, {0x1100: 0x1101}),
        ("push w15", {15: 0x1000}, {}, {15: 0x1002}, {0x1000: 0x1000}),
        ("mov w1, [w2++]", {1: 0x1234, 2: 0x0004}, {}, {2: 0x1234}, {}),  # the data write overrides, isa.md §2.2
        ("push 0x1e", {15: 0x1000}, {}, {15: 0x1002}, {0x1000: 0x1000}),
        ("pop 0x1e", {15: 0x1002}, {0x1000: 0x1801}, {15: 0x1800}, {}),
        ("bset [w1++], #3", {1: 0x1100}, {}, {1: 0x1102}, {0x1100: 8}),
        ("mov.d [w4--], w4", {4: 0x1100}, {0x1100: 1, 0x1102: 2}, {4: 1, 5: 2}, {}),
        ("mov.d w4, [--w4]", {4: 0x1104, 5: 9}, {}, {4: 0x1100}, {0x1100: 0x1104, 0x1102: 9}),
        ("mul.uu w4, w5, w4", {4: 0x8000, 5: 6}, {}, {4: 0, 5: 3}, {}),
        ("exch w3, w3", {3: 5}, {}, {3: 5}, {}),
        ("mov [w1+w2], w3", {1: 0x1100, 2: 0xFFFE}, {0x10FE: 4}, {3: 4, 1: 0x1100}, {}),
        ("mov [w1-2], w3", {1: 0}, {0xFFFE: 4}, {3: 4}, {}),
        ("lnk #8", {14: 0x1111, 15: 0x1000}, {}, {14: 0x1002, 15: 0x100A}, {0x1000: 0x1111}),
        ("ulnk", {14: 0x1002, 15: 0x1234}, {0x1000: 0x1111}, {14: 0x1111, 15: 0x1000}, {}),
        ("sl w1, w2, w3", {1: 1, 2: 0xFFEF}, {}, {3: 0x8000}, {}),  # the count is Wns<4:0>
        ("asr w1, w2, w3", {1: 0x8000, 2: 31}, {}, {3: 0xFFFF}, {}),
    ],
)
def test_a_register_in_two_roles_follows_the_order_of_the_reference(
    statement: str, w: dict[int, int], mem: dict[int, int], w_after: dict[int, int], mem_after: dict[int, int]
) -> None:
    """isa.md §2.2, §3.4, §3.5, §7.4: if a register is both pointer and data, its value follows the order of the
    reference."""
    m = after(statement, w, mem)
    assert {n: m.w(n) for n in w_after} == w_after
    assert {address: m.get(address) for address in mem_after} == mem_after


def test_mode_7_of_a_move_adds_the_index_register_as_mode_6_does() -> None:
    """isa.md §3.1, §22 item 6: mode 7 of a move adds the index register like mode 6."""
    insn = codec.decode_for_execution(0x790170)  # mov [w0+w2] in mode 7, w2
    assert insn is not None
    m = RowMachine({})
    m.set_w(0, 0x1000)
    m.set_w(2, 0x10)
    m.put(0x1010, 77)
    insn.row.does(m, insn.x)
    assert m.w(2) == 77


@pytest.mark.parametrize(
    ("statement", "latch"),
    [
        ("tblwtl w1, [w2]", {"latch 011234/3": 0xABCD}),
        ("tblwth w1, [w2]", {"latch 011234/4": 0xCD0000}),
        ("tblwtl.b w1, [w2]", {"latch 011234/1": 0xCD}),
        ("tblwtl.b w1, [w3]", {"latch 011234/2": 0xCD00}),
        ("tblwth.b w1, [w2]", {"latch 011234/4": 0xCD0000}),
        ("tblwth.b w1, [w3]", {"latch 011234/0": 0xCD0000}),  # selects no byte, so it has no effect
    ],
)
def test_table_writes_fill_the_latch_bytes_of_the_reference(statement: str, latch: dict[str, int]) -> None:
    """isa.md §7.7: table writes fill the latch bytes that the reference names."""
    assert after(statement, {1: 0xABCD, 2: 0x1234, 3: 0x1235}, TBLPAG=1).shadow == latch


@pytest.mark.parametrize("count", [17, -17, 31, -32])
def test_an_accumulator_shift_beyond_16_traps_and_changes_nothing(count: int) -> None:
    """isa.md §8.5: an accumulator shift by more than 16 traps and changes nothing."""
    m = Traps("sftac A, w2")
    m.set_w(2, count)
    m.set_acc(0, 0x7F_FFFF_FFFF)
    m.put(SR, 0x2400)
    m.put(CORCON, 0x00A0)
    m.step()
    assert (m.traps, m.acc(0), m.get(SR)) == (1, 0x7F_FFFF_FFFF, 0x2400)


@pytest.mark.parametrize("statement", ["div.sw w4, w5", "div.ud w4, w6", "divf w4, w5"])
def test_a_zero_divisor_traps_in_the_first_iteration_only(statement: str) -> None:
    """isa.md §6.7: a zero divisor traps only in the first iteration."""
    m = Traps("repeat #17", statement)
    m.set_w(4, 100)
    m.step()
    m.step()
    assert m.traps == 1
    while m.pc != 4:
        m.step()
    assert m.traps == 1


@pytest.mark.parametrize(
    ("statement", "high", "low", "divisor", "quotient", "remainder", "sr"),
    [
        ("div.sw w4, w6", 0, 0x3000, 0x27, 0x013B, 3, 0),
        ("div.sd w4, w6", 0xFF42, 0x2500, 0x2200, 0xFA6B, 0xEF00, 0x8),
        ("divf w4, w6", 0, 0x1000, 0x4000, 0x2000, 0, 0x2),
        ("divf w4, w6", 0, 0x1000, 0x8000, 0xF000, 0, 0x2),
        ("divf w4, w6", 0, 0x8002, 0x8001, 0x7FFE, 0x8002, 0x8),
        ("div.sw w4, w6", 0, 0x8000, 0xFFFF, 0x8000, 0, 0x6),
        ("div.ud w4, w6", 2, 0, 2, 0, 0, 0x6),
        ("divf w4, w6", 0, 0x4000, 0xC000, 0x8000, 0, 0x2),  # the quotient is exactly -1.0, for which OV is taken as 0
    ],
)
def test_divides_give_the_examples_of_the_reference(
    statement: str, high: int, low: int, divisor: int, quotient: int, remainder: int, sr: int
) -> None:
    """isa.md §6.7: divides give the results of its examples and the overflow flags of its table. Flags: N 8, OV 4, Z
    2, C 1."""
    m = Traps("repeat #17", statement)
    for n, value in ((4, low), (5, high), (6, divisor)):
        m.set_w(n, value)
    while m.pc != 4:
        m.step()
    assert (m.w(0), m.w(1), m.get(SR)) == (quotient, remainder, sr)


@pytest.mark.parametrize(
    ("statement", "pointer", "ea", "moved"),
    [
        ("mov w0, [w1++]", 0x1000, 0x1000, 0x1010),
        ("mov w0, [w1++]", 0x1010, 0x1010, 0x1008),
        ("mov w0, [++w1]", 0x1000, 0x1010, 0x1010),
        ("mov w0, [++w1]", 0x101E, 0x1000, 0x1000),  # the carry leaves at bit 1
        ("mov w0, [w1--]", 0x1002, 0x1002, 0x1000),
        ("mov.b w0, [w1++]", 0x1000, 0x1000, 0x1001),
    ],
)
def test_bit_reversed_addressing_applies_to_incrementing_word_writes(
    statement: str, pointer: int, ea: int, moved: int
) -> None:
    """isa.md §3.7: bit-reversed addressing applies to incrementing word writes; a buffer of 16 words has XB = 8."""
    m = after(statement, {0: 0x55, 1: pointer}, XBREV=0x8008, MODCON=0x01FF)
    assert m.w(1) == moved
    assert m.get(ea) == 0x55


def test_modulo_follows_the_write_back_pointer_and_each_prefetch_generator() -> None:
    """isa.md §3.6, §8.1: prefetches with W8, W9 and W13 use X modulo addressing, those with W10 and W11 use Y modulo;
    write-back uses X."""
    modulo = {"XMODSRT": 0x1000, "XMODEND": 0x1007, "YMODSRT": 0x1800, "YMODEND": 0x1807}
    m = after("mac w4*w5, A, [w8]+=4, w4, [w10]-=2, w5", {8: 0x1006, 10: 0x1800}, MODCON=0xCFA8, **modulo)
    assert (m.w(8), m.w(10)) == (0x1002, 0x1806)
    m = after("mac w4*w5, A, [w8]+=4, w4, [w10]-=2, w5, [w13]+=2", {8: 6, 10: 8, 13: 0x1006}, MODCON=0x8FFD, **modulo)
    assert (m.w(8), m.w(10), m.w(13)) == (10, 6, 0x1000)


def test_a_multiply_does_not_see_data_prefetched_by_the_same_instruction() -> None:
    """isa.md §8.2: a multiply uses the old operands, not the data that the same instruction prefetches."""
    m = after("mpy w4*w5, A, [w8], w4", {4: 3, 5: 5, 8: 0x1000}, {0x1000: 100}, CORCON=0x21)
    assert (m.acc(0), m.w(4)) == (15, 100)


@pytest.mark.parametrize(
    ("enables", "start", "traps"),
    [(0x400, 0x7FFFFFFF, 1), (0x200, 0x7FFFFFFF, 0), (0x100, 0x7FFFFFFF, 0), (0x100, (1 << 39) - 1, 1)],
)
def test_accumulator_overflow_traps_only_where_enabled(enables: int, start: int, traps: int) -> None:
    """isa.md §8.5: accumulator overflow traps only if OVATE, OVBTE or COVTE (INTCON1<10:8>) enables it."""
    from dataclasses import replace

    class Enabled(Traps):
        @property
        def context(self):  # type: ignore[no-untyped-def]
            bits = {"ovate": enables >> 10 & 1, "ovbte": enables >> 9 & 1, "covte": enables >> 8 & 1}
            return replace(super().context, **bits)

    m = Enabled("add A")
    m.set_acc(0, start)
    m.set_acc(1, 1)
    m.step()
    assert m.traps == traps


@pytest.mark.parametrize(
    ("statement", "wanted"),
    [
        ("disi #5", Disi(5)),
        ("pwrsav #0", Sleep("sleep")),
        ("pwrsav #1", Sleep("idle")),
        ("clrwdt", ClearWatchdog()),
        ("reset", Reset()),
    ],
)
def test_system_instructions_only_ask_the_sequencer(statement: str, wanted: object) -> None:
    """isa.md §11, §12: system instructions only request an action of the sequencer."""
    m = Traps(statement)
    insn = m.decode(0)
    before = bytes(m.data)
    assert insn.row.does(m, insn.x) == wanted
    assert bytes(m.data) == before


def golden() -> list[dict[str, str]]:
    """Return the rows of golden.csv."""
    with GOLDEN.open(newline="") as file:
        return list(csv.DictReader(file))


def assignments(cell: str) -> dict[str, int]:
    """Return the register values by name."""
    return {name: int(value, 16) for name, value in re.findall(r"(W\d+|ACC[AB])=([0-9A-F]+)", cell)}


def test_there_are_72_golden_vectors() -> None:
    """isa.md §21: there are 72 golden vectors."""
    assert len(golden()) == 72


@pytest.mark.parametrize("row", golden(), ids=lambda row: f"{row['instruction']} {row['inputs']} {row['corcon']}")
def test_golden_vectors_of_the_reference(row: dict[str, str]) -> None:
    """isa.md §21: for each golden vector text and code agree, and the result is the recorded one."""
    assert text.parse(row["instruction"]).encode(0) == (int(row["code"], 16),)
    m = Traps(row["instruction"])
    registers = [f"W{n}" for n in range(16)] + ["ACCA", "ACCB"]
    start = dict.fromkeys(registers, 0) | assignments(row["inputs"])
    for name, value in start.items():
        if name.startswith("W"):
            m.set_w(int(name[1:]), value)
        else:
            m.set_acc("AB".index(name[-1]), value - (value >> 39 << 40))
    m.put(SR, int(row["sr_in"], 16))
    m.put(CORCON, int(row["corcon"], 16))
    m.step()
    wanted = start | assignments(row["changes"])
    got = {f"W{n}": m.w(n) for n in range(16)} | {f"ACC{'AB'[i]}": m.acc(i) & (1 << 40) - 1 for i in (0, 1)}
    assert got == wanted
    assert m.get(SR) == int(row["sr_out"], 16)


def test_every_row_says_where_it_comes_from() -> None:
    """Every row names its source in the manual."""
    assert BY_ID[5].source == "PRM ADD; isa.csv 5"
