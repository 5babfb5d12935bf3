"""Breaks on a UART's TX pin, and edges of serial pins in the log. Sections are those of dspic30f6014a.md."""

from __future__ import annotations

import pytest

from emu.peripherals.uart.rx_queue import BREAK
from tests.emu.peripherals.serial.test_uart import UTXBRK, UTXEN, collect, enable

BIT = 128
"""Bit time in Tcy with BRG = 7, as `enable` sets it."""


@pytest.mark.parametrize("length", [10 * BIT, 13 * BIT, 50 * BIT])
def test_a_break_is_one_zero_byte_for_the_receivers(rig, length):
    """§10.1: UTXBRK holds TX low. A receiver takes a break of a frame or more for one zero byte."""
    enable(rig)
    sent = collect(rig)
    rig.at(50).write("U1STA", UTXEN | UTXBRK)
    rig.at(50 + length).write("U1STA", UTXEN)
    rig.at(20_000)
    assert sent == [(0, 51)]


@pytest.mark.parametrize(("bits", "byte"), [(1, 0xFF), (4, 0xF8), (9, 0x00)])
def test_a_short_break_is_a_byte_with_low_bits(rig, bits, byte):
    """§10.2: each bit is sampled in its middle; the bits after the break are high."""
    enable(rig)
    sent = collect(rig)
    rig.at(50).write("U1STA", UTXEN | UTXBRK)
    rig.at(50 + bits * BIT).write("U1STA", UTXEN)
    rig.at(20_000)
    assert sent == [(byte, 51)]


def test_a_low_pulse_of_less_than_half_a_bit_is_no_start_bit(rig):
    enable(rig)
    sent = collect(rig)
    rig.at(50).write("U1STA", UTXEN | UTXBRK)
    rig.at(100).write("U1STA", UTXEN)
    rig.at(20_000)
    assert sent == []


def test_a_character_sent_during_a_break_is_part_of_it(rig):
    """§10.1: the line stays low while a character is shifted out, so it has no start bit."""
    enable(rig)
    sent = collect(rig)
    rig.at(50).write("U1STA", UTXEN | UTXBRK)
    rig.at(60).write("U1TXREG", 0x55)
    rig.at(5_000).write("U1STA", UTXEN)
    rig.at(5_001).write("U1TXREG", 0x41)
    rig.at(20_000)
    assert [byte for byte, _ in sent] == [0, 0x41]


def test_a_break_in_loopback_needs_no_character(rig):
    """§10: in loopback the module's own receiver hears the break as a zero with a framing error."""
    enable(rig, mode=0x40)
    rig.at(50).write("U1STA", UTXEN | UTXBRK)
    rig.at(3_000)
    assert rig.field("U1STA", "FERR") == 1
    assert rig.read("U1RXREG") == 0


def test_disabling_the_transmitter_ends_a_break(rig):
    enable(rig)
    sent = collect(rig)
    rig.at(50).write("U1STA", UTXEN | UTXBRK)
    rig.at(50 + 4 * BIT).write("U1MODE", 0)
    rig.at(20_000)
    assert rig.field("U1STA", "UTXBRK") == 0
    assert sent == [(0xF8, 51)]


def test_a_break_from_outside_still_has_its_mark(rig):
    """A break that comes to the receiver from outside the chip sets FERR."""
    enable(rig)
    rig.dev.uart[1].feed(b"\x00", errors=BREAK)
    rig.at(3_000)
    assert rig.field("U1STA", "FERR") == 1


def test_the_log_of_edges_has_the_break(rig):
    enable(rig)
    rig.dev.pins.edges = log = []
    rig.at(50).write("U1STA", UTXEN | UTXBRK)
    rig.at(2_000).write("U1STA", UTXEN)
    tx = 1 << 3
    assert [(cycle, bool(levels & tx)) for cycle, port, levels in log if port == 5] == [(51, False), (2_001, True)]


def test_the_log_of_edges_has_the_words_of_a_master(rig):
    """§12: 8 pulses of SCK per byte, MSB first; the slave of mode CKP = 0, CKE = 1 samples SDO on the rising edge."""
    rig.at(0).write("SPI1CON", 0x0120 | 0x1B)  # CKE, MSTEN, secondary 2:1, primary 1:1
    rig.write("SPI1STAT", 0x8000)
    rig.dev.pins.edges = log = []
    rig.at(10).write("SPI1BUF", 0xA5)
    rig.at(100)
    sck, sdo = 1 << 6, 1 << 8
    levels = [entry[2] for entry in log if entry[1] == 5]
    rising = [after for before, after in zip([0, *levels], levels, strict=False) if after & sck and not before & sck]
    assert [bool(level & sdo) for level in rising] == [True, False, True, False, False, True, False, True]
