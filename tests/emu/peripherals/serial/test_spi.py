"""SPI1/2 (dspic30f6014a.md §12)."""

from __future__ import annotations

import pytest

SPIEN, MSTEN, MODE16, CKE, CKP, SSEN = 0x8000, 0x20, 0x400, 0x100, 0x40, 0x80


@pytest.mark.parametrize(
    ("ppre", "spre", "mode16", "cycles"),
    [(3, 6, 0, 16), (2, 7, 0, 32), (1, 7, 0, 128), (0, 0, 0, 4096), (2, 4, MODE16, 256)],
)
def test_transfer_takes_bits_times_both_prescalers(rig, ppre, spre, mode16, cycles):
    """§12: a transfer takes bits x primary x secondary prescale Tcy; written in cycle 10, it shifts from 11 on."""
    rig.write_all(SPI1CON=MSTEN | mode16 | spre << 2 | ppre, SPI1STAT=SPIEN)
    rig.at(10).write("SPI1BUF", 0x5A)
    assert rig.at(11 + cycles - 1).flag("SPI1IF") == 0
    assert rig.at(11 + cycles).flag("SPI1IF") == 1
    assert rig.field("SPI1STAT", "SPIRBF") == 1


def test_words_are_exchanged_with_the_device(rig):
    """§12: master and device exchange words; reading SPI1BUF clears SPIRBF."""
    asked = []
    rig.dev.spi[2].exchange = lambda word, bits: asked.append((word, bits)) or 0xC3
    rig.write_all(SPI2CON=MSTEN | 0x1A, SPI2STAT=SPIEN)
    rig.at(10).write("SPI2BUF", 0x5A)
    rig.at(100)
    assert asked == [(0x5A, 8)]
    assert rig.read("SPI2BUF") == 0xC3
    assert rig.field("SPI2STAT", "SPIRBF") == 0


def test_second_word_waits_and_a_third_is_lost(rig):
    """§12: a second word waits in the buffer (SPITBF) and follows without a gap; a third word is lost."""
    asked = []
    rig.dev.spi[1].exchange = lambda word, bits: asked.append((rig.events.now, word)) or 0
    rig.write("SPI1CON", MSTEN | 6 << 2 | 2)  # 4 x 2 = 8 Tcy per bit
    rig.write("SPI1STAT", SPIEN)
    for offset, word in enumerate((1, 2, 3)):
        rig.at(10 + 2 * offset).write("SPI1BUF", word)
    assert rig.field("SPI1STAT", "SPITBF") == 1
    rig.at(500)
    assert asked == [(75, 1), (139, 2)]


def test_unread_word_overflows_and_blocks_reception(rig):
    """§12: a word that arrives before the last one was read sets SPIROV; SPI1BUF keeps the old word until SPIROV is
    cleared."""
    words = iter((0x11, 0x22, 0x33, 0x44))
    rig.dev.spi[1].exchange = lambda word, bits: next(words)
    rig.write_all(SPI1CON=MSTEN | 6 << 2 | 2, SPI1STAT=SPIEN)
    for cycle in (10, 100, 200):
        rig.at(cycle).write("SPI1BUF", 0)
    rig.at(300)
    assert rig.field("SPI1STAT", "SPIROV") == 1
    assert rig.read("SPI1BUF") == 0x11
    rig.write("SPI1STAT", SPIEN)
    rig.at(301).write("SPI1BUF", 0)
    assert rig.at(400).read("SPI1BUF") == 0x44


def test_slave_exchanges_when_the_master_clocks_and_selects_it(rig):
    """§12: a slave with SSEN exchanges words only while the master selects it by SS1 = RB2, which is active low."""
    out = []
    rig.write("ADPCFG", 0xFFFF)
    rig.dev.spi[1].on_slave_word = lambda word, cycle: out.append((word, cycle))
    rig.dev.pins.set("RB2", 1)
    rig.at(2).write("SPI1CON", SSEN)
    rig.write_all(SPI1STAT=SPIEN, SPI1BUF=0x77)
    assert not rig.dev.spi[1].clock_word(0x88, 4)
    rig.dev.pins.set("RB2", 0)
    assert rig.at(10).dev.spi[1].clock_word(0x88, 4)
    assert rig.at(43).flag("SPI1IF") == 1
    assert rig.read("SPI1BUF") == 0x88
    assert out == [(0x77, 43)]


@pytest.mark.parametrize(("mode", "clock"), [(0, [1, 0]), (CKP, [0, 1]), (CKE, [0, 1]), (CKP | CKE, [1, 0])])
def test_clock_and_data_levels(rig, mode, clock):
    """§12: with CKP = 1 the clock idles high, with CKE = 0 its active edge is in the first half of a bit; the MSB is
    first."""
    rig.write_all(SPI1CON=MSTEN | 6 << 2 | 2 | mode, SPI1STAT=SPIEN)
    rig.at(10).write("SPI1BUF", 0xA0)
    assert [rig.at(11 + offset).dev.pins.get("RF6") for offset in (0, 4)] == clock
    assert [rig.at(20 + 8 * bit).dev.pins.get("RF8") for bit in range(3)] == [0, 1, 0]


def test_switching_off_clears_buffers_and_flags(rig):
    """§12: switching the module off clears buffers and flags."""
    rig.write_all(SPI1CON=MSTEN | 6 << 2 | 2, SPI1STAT=SPIEN)
    rig.at(10).write("SPI1BUF", 1)
    rig.at(20).write("SPI1STAT", 0)
    rig.at(500)
    assert rig.read("SPI1STAT") == 0
    assert rig.flag("SPI1IF") == 0
