"""Flags in native code: a sample of tests/fuzz/emulator/fuzz_flags.py, and writes to SR by other instructions."""

from __future__ import annotations

import itertools

import pytest

from emu.dspic30f.isa import codec
from emu.dspic30f.isa.fields import Operands
from emu.dspic30f.isa.row import Insn
from tests.emu.jit.comparison.engine_pair import engine_pair
from tests.emu.jit.comparison.flag_drills import FLAGS, Tally, all_pairs, asked, check, kind, pairs_of, rows, written
from tests.emu.jit.comparison.random_firmware import BY_SYNTAX, Firmware, difference, words_of
from tests.emu.rowmachine import SR


@pytest.mark.parametrize("seed", range(3))
def test_drills_end_equally_in_every_cycle(seed: int) -> None:
    """engines.md §4.3: drills give equal states when cut at every cycle; native code executes most instructions."""
    tally = Tally()
    assert check(seed, tally) is None
    turns = {all_pairs()[(2 * 24 * seed + turn) % len(all_pairs())] for turn in range(48)}
    assert len(turns & tally.pairs.keys()) > 35
    assert len(tally.pairs) > 80
    assert tally.runs > 300
    assert tally.executed > 5 * tally.python > 0


def test_readers_and_writers_of_flags_are_told_from_the_table() -> None:
    """isa.md §5, §6: the rows that read and write flags are found from the table, which well-known examples show."""
    writers, readers, others = ({row.mnemonic for row in some} for some in rows())
    assert {"ADD", "RLC", "CP0", "DAW.B", "FBCL", "DIV.S", "BTST.C", "BTSTS", "POP.S", "ZE"} <= writers
    assert {"ADDC", "SUBBR", "CPB", "RRC", "BSW.Z", "BRA", "DAW.B", "PUSH.S"} <= readers
    assert {"MUL.UU", "BTG", "SWAP", "EXCH"} <= others


def of(syntax: str, **fields: int) -> Insn:
    """Return an instruction with the given syntax and fields."""
    insn = codec.decode(*codec.encode(BY_SYNTAX[syntax], Operands(**fields)))
    assert insn is not None
    return insn


def test_a_pair_is_a_flag_that_is_written_and_read_with_no_other_writer_between() -> None:
    """A pair of writer and reader is counted only if no other instruction writes the flag between them."""
    add, shift = of("ADD{.B} #lit10, Wn", B=0, k=1, d=1), of("SL{.B} Ws, Wd", B=1, s=1, p=0, d=1, q=0)
    borrow, status = of("SUBB{.B} #lit10, Wn", B=0, k=1, d=1), of("MOV{.W} f, Wnd", f=SR, d=2)
    assert written(shift) == {"C", "Z", "N"}
    assert asked(borrow) == {"C", "Z"}
    assert asked(status) == set(FLAGS)
    assert set(pairs_of([add, shift, borrow])) == {(kind(shift), "C", kind(borrow)), (kind(shift), "Z", kind(borrow))}
    assert (kind(add), "DC", kind(status)) in set(pairs_of([add, shift, status]))
    assert (kind(add), "C", kind(status)) not in set(pairs_of([add, shift, status]))


STORING = [row for row in rows()[0] if row.syntax.endswith("{.B} f") and not row.syntax.startswith("CP")]


@pytest.mark.slow
@pytest.mark.parametrize("row", STORING, ids=lambda row: row.mnemonic)
def test_an_instruction_that_sets_flags_may_write_sr_or_a_byte_of_it(row: object) -> None:
    """isa.md §2.3: if an instruction's destination is SR or a byte of it, the flags outside of the written byte come
    from the result: N and Z of COM.B SRH."""
    for size, address in ((0, SR), (1, SR), (1, SR + 1)):
        firmware = Firmware(2)
        firmware.put(0, words_of("GOTO Expr", n=0x100))
        at = firmware.put(0x100, list(codec.encode(row, Operands(B=size, f=address))[:1]))  # type: ignore[arg-type]
        firmware.put(at, words_of("BRA Expr", n=-1))
        plain, native = engine_pair(firmware, 0, 0)
        for value, status in itertools.product((0, 0x7F, 0x80, 0xFFFF), (0, 0x10F, 0x00A, 0x105)):
            for machine in (plain, native):
                machine.w[0] = value
                machine.poke("SR", status)
                machine.pc = 0x100
                machine.run(5)
            assert not difference(plain, native), (size, address, value, status)
