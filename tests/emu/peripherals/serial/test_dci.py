"""Codec interface (dspic30f6014a.md §14)."""

from __future__ import annotations

import pytest

DCIEN, DLOOP, UNFM = 0x8000, 0x800, 0x80


def epuck(rig, con1=0x40, blen=3):
    """Set up the DCI as on the e-puck: 16 slots of 16 bits, 8 Tcy per bit, one slot used."""
    rig.write_all(DCICON1=con1, DCICON2=blen << 10 | 0x01EF, DCICON3=3, TSCON=1, RSCON=1)


def test_interrupt_of_the_epuck_comes_every_8192_cycles(rig):
    """§14: the e-puck's interrupt comes every four frames of 2048 Tcy; the first slot ends 128 Tcy after the start of
    the frame."""
    epuck(rig)
    rig.at(10).write("DCICON1", DCIEN | 0x40)
    first = 11 + 3 * 2048 + 128
    assert not rig.at(first - 1).flag("DCIIF")
    assert rig.at(first).flag("DCIIF")
    rig.clear_flags()
    assert not rig.at(first + 8191).flag("DCIIF")
    assert rig.at(first + 8192).flag("DCIIF")


def test_words_go_out_in_order_and_come_in(rig):
    """§14: each exchange copies TXBUF to the shadow registers and received words to RXBUF; TMPTY and RFUL show it."""
    sent = []
    rig.dev.dci.on_word = lambda word, slot, cycle: sent.append((word, slot))
    rig.dev.dci.source = lambda slot, cycle: 0x1000 + len(sent)
    epuck(rig)
    for index in range(4):
        rig.write(f"TXBUF{index}", 0xA000 + index)
    rig.at(10).write("DCICON1", DCIEN | 0x40)
    assert rig.field("DCISTAT", "TMPTY") == 1
    rig.write("TXBUF0", 0xB000)
    assert rig.field("DCISTAT", "TMPTY") == 0
    rig.at(10000)
    assert sent == [(0xA000, 0), (0xA001, 0), (0xA002, 0), (0xA003, 0), (0xB000, 0)]
    assert rig.field("DCISTAT", "RFUL") == 1
    assert [rig.read(f"RXBUF{index}") for index in range(4)] == [0x1001, 0x1002, 0x1003, 0x1004]
    assert rig.field("DCISTAT", "RFUL") == 0


@pytest.mark.parametrize(("unfm", "second"), [(0, 0), (UNFM, 0xA000)])
def test_underflow_sends_zeros_or_the_last_words(rig, unfm, second):
    """§14: if TXBUF was not written, TUNF is set, and UNFM selects whether zeros or the last words are sent."""
    sent = []
    rig.dev.dci.on_word = lambda word, slot, cycle: sent.append(word)
    epuck(rig, con1=unfm, blen=0)
    rig.write("TXBUF0", 0xA000)
    rig.at(10).write("DCICON1", DCIEN | unfm)
    rig.at(2500)
    assert sent == [0xA000, second]
    assert rig.field("DCISTAT", "TUNF") == 1


def test_unread_words_overflow(rig):
    """§14: words that are not read before the next exchange set ROV."""
    epuck(rig, blen=0)
    rig.at(10).write("DCICON1", DCIEN)
    assert rig.at(200).field("DCISTAT", "ROV") == 0
    assert rig.at(2300).field("DCISTAT", "ROV") == 1


def test_loopback_returns_the_words_sent(rig):
    """§14: DLOOP returns the sent words."""
    epuck(rig, blen=0)
    rig.write("TXBUF0", 0x5A5A)
    rig.at(10).write("DCICON1", DCIEN | DLOOP)
    assert rig.at(200).read("RXBUF0") == 0x5A5A


def test_several_slots_and_short_words(rig):
    """§14: slots 0 and 2 of 3 carry left-aligned 8-bit words, here with Fcsck = Fcy / 4."""
    sent = []
    rig.dev.dci.on_word = lambda word, slot, cycle: sent.append((word, slot, cycle))
    rig.write_all(DCICON2=1 << 10 | 2 << 5 | 7, DCICON3=1, TSCON=5, TXBUF0=0x12FF, TXBUF1=0x34FF)
    rig.at(10).write("DCICON1", DCIEN)
    rig.at(120)
    assert sent == [(0x1200, 0, 43), (0x3400, 2, 107)]
    assert rig.flag("DCIIF")


def test_slot_counter_shows_the_slot_on_the_wire(rig):
    """§14: DCISTAT<11:8> is the number of the current slot; a slot lasts 128 Tcy."""
    epuck(rig)
    rig.at(10).write("DCICON1", DCIEN)
    assert rig.at(11 + 5 * 128 + 3).field("DCISTAT", "SLOT") == 5


def test_switching_off_ends_with_the_frame(rig):
    """§14: after DCIEN = 0 the module stops at the end of the frame."""
    sent = []
    rig.dev.dci.on_word = lambda word, slot, cycle: sent.append(cycle)
    epuck(rig)
    rig.at(10).write("DCICON1", DCIEN)
    rig.at(2100).write("DCICON1", 0)
    rig.at(20000)
    assert sent == [139, 2187]


def test_generator_stands_with_bcg_0(rig):
    """§14: with BCG = 0 the bit clock generator is stopped."""
    epuck(rig)
    rig.write_all(DCICON3=0, DCICON1=DCIEN)
    assert not rig.at(100000).flag("DCIIF")


def test_switching_off_without_a_clock_ends_at_once(rig):
    """§14: if BCG was set to 0 during a frame, DCIEN = 0 stops the module at once."""
    epuck(rig)
    rig.at(10).write("DCICON1", DCIEN)
    rig.at(100).write("DCICON3", 0)
    rig.at(200).write("DCICON1", 0)
    assert not rig.at(100000).flag("DCIIF")
    assert rig.field("DCISTAT", "SLOT") == 0
