"""Run-time programming (dspic30f6014a.md §16)."""

from __future__ import annotations

import pytest

TWO_MS = 29_491


def start(rig, cycle, nvmcon, *, gap=1, keys=(0x55, 0xAA)):
    """Execute the sequence that starts an operation: NVMCON, the two keys with a literal load between them, then BSET
    NVMCON, #WR."""
    rig.at(cycle).write("NVMCON", nvmcon)
    rig.at(cycle + 2).write("NVMKEY", keys[0])
    rig.at(cycle + 4).write("NVMKEY", keys[1])
    rig.at(cycle + 4 + gap).write("NVMCON", nvmcon | 0x8000)
    return cycle + 4 + gap


def latch(rig, address, value):
    rig.program.table_write(address, 0b111, value)


def test_table_write_captures_its_address(rig):
    """§16: a table write stores its address in NVMADR and NVMADRU."""
    latch(rig, 0x012346, 0)
    assert rig.read("NVMADR") == 0x2346
    assert rig.read("NVMADRU") == 0x01


def test_flash_row_is_erased_and_programmed_while_the_cpu_stalls(rig):
    """§16: erasing or programming a flash row of 32 words stalls the CPU for 2 ms = 29491 Tcy and sets NVMIF at the
    end."""
    stalls, changes = [], []
    rig.cpu_signals.stall_until = stalls.append
    rig.program.changed.append(lambda low, high: changes.append((low, high)))
    rig.program.put_flash(0x1000, list(range(64)))
    latch(rig, 0x1044, 0xABCDEF)
    for index in range(32):
        latch(rig, 0x1040 + 2 * index, 0x100 + index)
    begun = start(rig, 100, 0x4041)
    assert stalls == [begun + 1 + TWO_MS]
    assert rig.field("NVMCON", "WR") == 1
    rig.at(begun + TWO_MS)
    assert not rig.flag("NVMIF")
    rig.at(begun + 1 + TWO_MS)
    assert rig.flag("NVMIF")
    assert rig.field("NVMCON", "WR") == 0
    assert [rig.program.word(0x1040 + 2 * n) for n in range(32)] == [0xFFFFFF] * 32
    assert rig.program.word(0x103E) == 31
    start(rig, 50000, 0x4001)
    rig.at(100000)
    assert [rig.program.word(0x1040 + 2 * n) for n in range(32)] == [0x100 + n for n in range(32)]
    assert changes[-2:] == [(0x1040, 0x1080), (0x1040, 0x1080)]


def test_programming_only_clears_bits_and_resets_the_latches(rig):
    """§16: programming only clears bits, and resets the latches afterwards."""
    rig.program.put_flash(0x2000, [0xF0F0F0] * 32)
    latch(rig, 0x2000, 0xFF00FF)
    start(rig, 100, 0x4001)
    rig.at(100000)
    assert rig.program.word(0x2000) == 0xF000F0
    assert rig.program.word(0x2002) == 0xF0F0F0
    assert set(rig.program.flash_latch) == {0xFFFFFF}


@pytest.mark.parametrize(("erase", "program", "words"), [(0x4044, 0x4004, 1), (0x4045, 0x4005, 16)])
def test_eeprom_words_and_rows_are_written_while_the_cpu_runs(rig, erase, program, words):
    """§16: EEPROM words and rows are written while the CPU runs; WR reads 1 until the end, then NVMIF rises."""
    stalls = []
    rig.cpu_signals.stall_until = stalls.append
    for index in range(32):
        rig.program.put(0x7FF000 + 2 * index, 0x1111)
    latch(rig, 0x7FF022, 0)
    start(rig, 100, erase)
    rig.at(100000)
    expected = {0x7FF020 + 2 * n for n in range(16)} if words == 16 else {0x7FF022}
    assert {0x7FF000 + 2 * n for n in range(32) if rig.program.word(0x7FF000 + 2 * n) == 0xFFFF} == expected
    latch(rig, 0x7FF022, 0xBEEF)
    start(rig, 200000, program)
    assert rig.field("NVMCON", "WR") == 1
    rig.at(300000)
    assert rig.field("NVMCON", "WR") == 0
    assert rig.program.word(0x7FF022) == 0xBEEF
    assert stalls == []


def test_whole_eeprom_erase(rig):
    """§16: the whole EEPROM can be erased in one operation."""
    rig.program.put(0x7FF000, 1)
    rig.program.put(0x7FFFFE, 2)
    rig.write_all(NVMADRU=0x7F, NVMADR=0xF000)
    start(rig, 100, 0x4046)
    rig.at(100000)
    assert (rig.program.word(0x7FF000), rig.program.word(0x7FFFFE)) == (0xFFFF, 0xFFFF)


@pytest.mark.parametrize(
    "spoil", [{"gap": 5}, {"keys": (0xAA, 0x55)}, {"keys": (0x55, 0x55)}], ids=["late", "swapped", "wrong"]
)
def test_interrupted_or_wrong_key_sequence_leaves_wr_0(rig, spoil):
    """§16: a wrong key sequence, or one that an interrupt separates, leaves WR = 0."""
    start(rig, 100, 0x4041, **spoil)
    assert rig.field("NVMCON", "WR") == 0
    assert rig.at(100000).flag("NVMIF") == 0


def test_without_wren_nothing_starts(rig):
    """§16: without WREN no operation starts."""
    start(rig, 100, 0x0041)
    assert rig.field("NVMCON", "WR") == 0


def test_one_key_sequence_opens_one_write(rig):
    """§16: one key sequence permits one write."""
    end = start(rig, 100, 0x4044) + TWO_MS + 10
    rig.at(end).write("NVMCON", 0xC044)
    assert rig.field("NVMCON", "WR") == 0


def test_key_register_reads_0(rig):
    """§16: NVMKEY is write-only and reads 0."""
    rig.write("NVMKEY", 0x55)
    assert rig.read("NVMKEY") == 0


def test_reset_during_an_operation_sets_wrerr(rig):
    """§16: a reset during an operation sets WRERR; the row is then either erased or unchanged, and the next operation
    works."""
    rig.program.put(0x7FF000, 0x1234)
    latch(rig, 0x7FF000, 0x5678)
    rig.program.put(0x7FF000, 0xFFFF)
    start(rig, 100, 0x4004)
    rig.at(5000).dev.reset("EXTR")
    assert rig.field("NVMCON", "WRERR") == 1
    assert rig.field("NVMCON", "WR") == 0
    rig.at(100000)
    assert rig.program.word(0x7FF000) == 0xFFFF


def test_rows_outside_the_array_are_ignored(rig):
    """§16: operations on rows outside of flash and EEPROM are ignored."""
    before = bytes(rig.program.flash)
    rig.write("NVMADRU", 0x30)
    start(rig, 100, 0x4041)
    rig.at(100000)
    assert bytes(rig.program.flash) == before
    assert rig.flag("NVMIF")


@pytest.mark.parametrize(("address", "value"), [(0xF80002, 0x7FFF), (0xF80006, 0x310F), (0xF8000C, 0x4003)])
def test_a_configuration_word_is_programmed_from_the_latch(rig, address, value):
    """§16: NVMCON 0x4008 programs a configuration word from the latch of its address; here 0xFFFF turns the watchdog
    on (§2)."""
    latch(rig, address, value)
    begun = start(rig, 100, 0x4008)
    rig.at(begun + 1 + TWO_MS)
    assert rig.flag("NVMIF")
    assert rig.program.word(address) == value
