"""Core registers at their data addresses, stack and shadow instructions (isa.md §2, §7.4)."""

from __future__ import annotations

import pytest

from tests.emu.cpu.cpu_rig import RAM, STACK, Rig


def after(engine: str, text: str, **w: int) -> Rig:
    rig = Rig(f"{text}\nend: nop", engine, **w)
    rig.cycles_to()
    return rig


def test_w_registers_are_memory(engine: str) -> None:
    """isa.md §2.2: W registers are memory at 2n (word or low byte) and 2n + 1 (high byte)."""
    rig = after(engine, "mov w3, 0x0004\nmov.b [w1], w5\nmov #0x77, w0\nmov.b wreg, 0x000B", w3=0xABCD, w1=5, w5=0)
    assert rig.machine.w[2] == 0xABCD
    assert rig.machine.w[5] == 0x77AB


def test_bit_zero_of_the_stack_pointer_stays_zero(engine: str) -> None:
    """isa.md §2.2: bit 0 of the stack pointer W15 is always 0."""
    assert after(engine, "mov #0x0955, w15").machine.w[15] == 0x0954
    assert after(engine, "mov w1, 0x001E", w1=0x0955).machine.w[15] == 0x0954
    assert after(engine, "mov.b #0x55, w15").machine.w[15] == 0x0954


def test_a_store_to_the_pointer_register_wins_over_its_update(engine: str) -> None:
    """isa.md §2.2: a store to the pointer register overrides its update: with W1 = 1234 and W2 = 0004, MOV W1,[W2++]
    leaves W2 = 1234."""
    assert after(engine, "mov w1, [w2++]", w1=0x1234, w2=4).machine.w[2] == 0x1234


def test_a_pointer_that_moves_onto_itself_reads_its_new_value(engine: str) -> None:
    """docs/accuracy.md, UNVERIFIED: a pointer to its own register reads its updated value: INC [++W3],W0 with 4 in W3
    reads W3 at 6; INC.B [W2--],W0 reads the low byte."""
    assert after(engine, "inc [++w3], w0", w3=4).machine.w[0] == 7
    assert after(engine, "inc.b [w2--], w0", w0=0, w2=4).machine.w[0] == 4


def test_an_explicit_write_of_sr_wins_over_flags(engine: str) -> None:
    """isa.md §2.3, UNVERIFIED: IOR with SR as destination stores its result and does not set N and Z."""
    rig = after(engine, "ior.b 0x42", w0=0x01)
    assert rig.machine.peek("SR") == 0x0001


def test_read_only_and_clear_only_bits_of_sr(engine: str) -> None:
    """isa.md §2.3: OA, OB, OAB, DA and RA cannot be written; SA, SB and SAB can only be cleared."""
    assert after(engine, "mov w0, 0x42", w0=0xFFFF).machine.peek("SR") == 0x01EF
    rig = Rig("bclr.b 0x43, #2\nend: nop", engine)  # clearing SAB clears both SA and SB
    rig.machine.poke("SR", 0x3400)
    rig.cycles_to()
    assert rig.machine.peek("SR") == 0
    rig = Rig("bclr.b 0x43, #5\nend: nop", engine)  # clears only SA
    rig.machine.poke("SR", 0x3400)
    rig.cycles_to()
    assert rig.machine.peek("SR") == 0x1400


def test_corcon_bits(engine: str) -> None:
    """isa.md §2.4: in CORCON, DL is read-only, IPL3 can only be cleared, and EDT reads 0."""
    assert after(engine, "mov w0, 0x44", w0=0xFFFF).machine.peek("CORCON") == 0x10F7


def test_the_guard_byte_reads_sign_extended(engine: str) -> None:
    """isa.md §2.1: the accumulator's guard byte reads sign-extended."""
    rig = after(engine, "mov w0, 0x26\nmov 0x26, w1", w0=0x1280)
    assert rig.machine.w[1] == 0xFF80


def test_the_program_counter_can_be_read(engine: str) -> None:
    """isa.md §2.1, UNVERIFIED: the PC registers read the address of the next instruction and ignore writes."""
    rig = after(engine, "nop\nmov 0x2E, w1\nmov w0, 0x2E", w0=0x1234)
    assert rig.machine.w[1] == 0x204


@pytest.mark.parametrize(
    ("place", "written", "read"),
    [
        (0x20, 0xFFFF, 0xFFFE), (0x36, 0xFFFF, 0x3FFF), (0x46, 0xFFFF, 0xCFFF), (0x48, 0xFFFF, 0xFFFE),
        (0x4A, 0x0000, 0x0001), (0x32, 0xFFFF, 0x00FF),
    ],
)  # fmt: skip
def test_unimplemented_bits(engine: str, place: int, written: int, read: int) -> None:
    """isa.md §2.1: unimplemented bits of SPLIM, RCOUNT, MODCON, XMODSRT, XMODEND and TBLPAG are not stored."""
    rig = Rig(f"mov w0, {place}\nend: nop", engine, w0=written)
    rig.cycles_to()
    assert rig.machine.peek(place) == read


def test_link_and_unlink(engine: str) -> None:
    """isa.md §7.4: LNK allocates a stack frame, and ULNK frees it."""
    rig = Rig("lnk #6\nmid: nop\nulnk\nend: nop", engine, w14=0x1234)
    rig.note("mid", stop=True)
    rig.run()
    assert (rig.machine.w[14], rig.machine.w[15], rig.machine.peek(STACK)) == (STACK + 2, STACK + 8, 0x1234)
    rig.cycles_to()
    assert (rig.machine.w[14], rig.machine.w[15]) == (0x1234, STACK)


def test_shadow_registers(engine: str) -> None:
    """isa.md §2.6: PUSH.S and POP.S save and restore W0-W3 and DC, N, OV, Z, C, one level deep."""
    text = "push.s\nmov #1, w0\nmov #2, w3\nmov w5, 0x42\npop.s"
    rig = Rig(f"{text}\nend: nop", engine, w0=0x1111, w3=0x4444, w5=0x0000)
    rig.machine.poke("SR", 0x010F)
    rig.cycles_to()
    assert (rig.machine.w[0], rig.machine.w[3], rig.machine.peek("SR")) == (0x1111, 0x4444, 0x010F)


def test_table_writes_fill_the_latches_only(engine: str) -> None:
    """isa.md §7.7: TBLWTL, TBLWTH and their byte forms fill the write latches and do not change flash."""
    text = "tblwtl w2, [w1]\ntblwth w3, [w1]\ntblwtl.b w4, [++w1]"
    rig = after(engine, text, w1=0x0444, w2=0x1234, w3=0x56, w4=0xAB)
    assert rig.machine.program.flash_latch[0x0444 >> 1 & 31] == 0x56AB34
    assert rig.machine.program.word(0x0444) == 0xFFFFFF
    assert rig.machine.peek("NVMADR") == 0x0444


def test_table_reads(engine: str) -> None:
    """isa.md §7.7: table reads return low and high words, bytes, the phantom byte, and EEPROM."""
    text = "tblrdl [w1], w2\ntblrdh [w1], w3\ntblrdl.b [w4], w5\ntblrdh.b [w4], w6\nmov w7, 0x32\ntblrdl [w8], w9"
    rig = Rig(f"{text}\nend: nop", engine, w1=0x444, w4=0x445, w5=0, w6=0xFFFF, w7=0x7F, w8=0xF002)
    rig.machine.program.put(0x444, 0xABCDEF)
    rig.machine.program.put(0x7FF002, 0x4321)
    rig.cycles_to()
    w = rig.machine.w
    assert (w[2], w[3], w[5], w[6], w[9]) == (0xCDEF, 0x00AB, 0x00CD, 0xFF00, 0x4321)


def test_snapshots_restore_everything(engine: str) -> None:
    """Engine contract: a restored snapshot continues to the same state, and every engine can restore it."""
    text = "do #20, last\ninc w0, w0\nadd w0, [w1], [w1]\nlast: rlc w2, w2\nrepeat #30\nadd w0, w2, w2\nend: bra end"
    rig = Rig(text, engine)
    rig.interrupt_at(37)
    rig.machine.run(25)
    middle = rig.machine.snapshot()
    rig.machine.run(60)
    first = rig.machine.snapshot()
    rig.machine.restore(middle)
    rig.machine.run(60)
    assert rig.machine.snapshot() == first


def test_time_passes_in_any_slices(engine: str) -> None:
    """Engine contract: `run_until` in one piece or in several ends in the same state."""
    text = "loop: inc w0, w0\nadd w0, [w1], [w1]\nmov.d w2, w4\nbtss w0, #2\ncall sub\nbra loop\nsub: nop\nreturn"
    whole, pieces = Rig(text, engine), Rig(text, engine)
    whole.machine.run_until(1000)
    for cycle in range(0, 1001, 7):
        pieces.machine.run_until(cycle)
    pieces.machine.run_until(1000)
    pieces.machine.events.now = whole.machine.events.now
    assert pieces.machine.cycle == whole.machine.cycle
    assert pieces.machine.snapshot() == whole.machine.snapshot()


def test_near_ram_by_file_register(engine: str) -> None:
    """isa.md §3.3, UNVERIFIED: an odd file address in word mode is an address error."""
    rig = Rig(".word 0xB42001\nnop\nnop\ntrap: nop", engine)  # ADD 0x0001
    rig.vector(0x08, "trap")
    assert rig.cycles_to("trap") == 4
    assert rig.machine.peek(RAM) == 0
