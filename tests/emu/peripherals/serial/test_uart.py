"""UART1/2. Sections are those of dspic30f6014a.md."""

from __future__ import annotations

import pytest

from emu.peripherals.uart.rx_queue import BREAK, FRAMING_ERROR, PARITY_ERROR

UARTEN, LPBACK, WAKE, ABAUD = 0x8000, 0x40, 0x80, 0x20
UTXISEL, UTXBRK, UTXEN, ADDEN, OERR = 0x8000, 0x800, 0x400, 0x20, 2


def enable(rig, cycle=0, brg=7, mode=0, sta=0, number=1):
    """Write UARTEN in `cycle` and UTXEN in the next one; the baud generator starts from 0 in cycle + 1."""
    rig.at(cycle).write(f"U{number}BRG", brg)
    rig.write(f"U{number}MODE", UARTEN | mode)
    rig.at(cycle + 1).write(f"U{number}STA", UTXEN | sta)
    rig.at(cycle + 2).clear_flags()


def collect(rig, number=1):
    sent = []
    rig.dev.uart[number].on_byte = lambda byte, start: sent.append((byte, start))
    return sent


# -- transmit ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("written", "start"), [(50, 129), (128, 129), (129, 257), (300, 385)])
def test_start_bit_begins_at_the_next_edge_of_the_free_running_bit_clock(rig, written, start):
    """§10.1: a start bit begins at the next edge of the free-running bit clock. With BRG 7 a bit is 128 Tcy; the
    clock started in cycle 1, so its edges are in 129, 257, 385, ..."""
    enable(rig)
    sent = collect(rig)
    rig.at(written).write("U1TXREG", 0x55)
    assert rig.at(start - 1).dev.pins.get("RF3") == 1
    assert rig.at(start).dev.pins.get("RF3") == 0
    rig.at(start + 1280)
    assert sent == [(0x55, start)]


def test_frames_follow_each_other_without_a_gap(rig):
    """§10.1: frames follow each other without a gap: five characters in flight have 10 bits of 128 Tcy each."""
    enable(rig)
    sent = collect(rig)
    rig.at(10).write("U1TXREG", 1)
    for offset in range(4):
        rig.at(20 + offset).write("U1TXREG", 2 + offset)
    assert rig.field("U1STA", "UTXBF") == 1
    rig.at(129 + 5 * 1280)
    assert sent == [(1, 129), (2, 1409), (3, 2689), (4, 3969), (5, 5249)]


def test_write_to_a_full_fifo_is_dropped(rig):
    """§10.1: a write to a full transmit FIFO is ignored."""
    enable(rig)
    sent = collect(rig)
    rig.at(10)
    for value in range(7):
        rig.at(10 + value).write("U1TXREG", value)
    rig.at(20000)
    assert [byte for byte, _ in sent] == [0, 1, 2, 3, 4]


def test_levels_on_the_pin_are_start_data_lsb_first_and_stop(rig):
    """§10.1: the pin sends a start bit, data with the LSB first, and a stop bit; 0x53 is 1 1 0 0 1 0 1 0."""
    enable(rig)
    rig.at(10).write("U1TXREG", 0x53)
    levels = [rig.at(129 + 128 * bit + 64).dev.pins.get("RF3") for bit in range(10)]
    assert levels == [0, 1, 1, 0, 0, 1, 0, 1, 0, 1]


@pytest.mark.parametrize(("mode", "bits"), [(0, 10), (1, 11), (2, 11), (4, 11), (3, 12), (6, 11)])
def test_frame_length_follows_parity_and_stop_bits(rig, mode, bits):
    """§10: PDSEL and STSEL determine the frame length; TRMT rises at the end of the last stop bit."""
    enable(rig, mode=mode)
    rig.at(10).write("U1TXREG", 0x41)
    assert rig.at(129 + bits * 128 - 1).field("U1STA", "TRMT") == 0
    assert rig.at(129 + bits * 128).field("U1STA", "TRMT") == 1


@pytest.mark.parametrize(("mode", "parity"), [(2, 0), (4, 1)])
def test_parity_bit(rig, mode, parity):
    """§10: PDSEL = 01 sends even parity, 10 odd parity; 0x41 has two ones."""
    enable(rig, mode=mode)
    rig.at(10).write("U1TXREG", 0x41)
    assert rig.at(129 + 9 * 128 + 64).dev.pins.get("RF3") == parity


def test_transmit_interrupt_with_every_transfer_or_with_the_last(rig):
    """§10.1: with UTXISEL = 0 the interrupt comes at each transfer from FIFO to TSR, with 1 when a transfer empties
    the FIFO."""
    enable(rig, sta=UTXISEL)
    rig.at(10).write("U1TXREG", 1)
    assert rig.at(11).flag("U1TXIF") == 1  # the first write to an idle transmitter empties the FIFO at once
    rig.clear_flags()
    rig.at(20).write("U1TXREG", 2)
    rig.at(21).write("U1TXREG", 3)
    assert rig.at(1409).flag("U1TXIF") == 0
    assert rig.at(2689).flag("U1TXIF") == 1


def test_transmit_interrupt_when_the_sender_is_first_enabled(rig):
    """§10.1: the transmit flag rises when UTXEN and UARTEN are first both set, in either order."""
    rig.write("U1MODE", UARTEN)
    assert rig.flag("U1TXIF") == 0
    rig.at(5).write("U1STA", UTXEN)
    assert rig.at(6).flag("U1TXIF") == 1


def test_data_loaded_before_utxen_starts_from_a_cleared_baud_clock(rig):
    """§10.1: data loaded before UTXEN start from a cleared baud clock: UTXEN is written in 1000, the clock runs from
    1001, and the start bit begins one bit later in 1129."""
    rig.write_all(U1BRG=7, U1MODE=UARTEN)
    rig.at(10).write("U1TXREG", 0x41)
    sent = collect(rig)
    rig.at(1000).write("U1STA", UTXEN)
    rig.at(4000)
    assert sent == [(0x41, 1129)]


def test_disabling_the_sender_aborts_and_flushes(rig):
    """§10.1: clearing UTXEN aborts the current character and empties the FIFO."""
    enable(rig)
    sent = collect(rig)
    rig.at(10).write("U1TXREG", 1)
    rig.at(11).write("U1TXREG", 2)
    rig.at(500).write("U1STA", 0)
    rig.at(20000)
    assert sent == []
    assert rig.field("U1STA", "TRMT") == 1


def test_disabling_the_uart_clears_flags_and_keeps_mode_and_brg(rig):
    """§10.1: clearing UARTEN clears the status flags and keeps U1MODE and U1BRG."""
    enable(rig, mode=6)
    rig.at(10).write("U1TXREG", 1)
    rig.at(500).write("U1MODE", 6)
    assert rig.read("U1STA") == 0x0110
    assert rig.read("U1BRG") == 7
    assert rig.read("U1MODE") == 6


def test_break_holds_the_line_low(rig):
    """§10.1: UTXBRK holds the line low."""
    enable(rig)
    rig.at(10).write("U1STA", UTXEN | UTXBRK)
    assert rig.at(12).dev.pins.get("RF3") == 0


def test_drain_delivers_what_the_stopped_program_left_in_the_transmitter(rig):
    """`drain` returns the characters that remain in the transmitter when the program stops."""
    enable(rig)
    sent = collect(rig)
    for value in (1, 2, 3):
        rig.at(10 + value).write("U1TXREG", value)
    rig.dev.uart[1].drain()
    assert sent == [(1, 129), (2, 1409), (3, 2689)]


def test_edge_log_shows_every_bit_of_a_frame(rig):
    """The edge log has every bit of a frame: 0x55 alternates, so its ten bits are edges 128 Tcy apart after the idle
    line."""
    enable(rig)
    rig.dev.pins.edges = []
    rig.at(10).write("U1TXREG", 0x55)
    rig.at(2000)
    assert [cycle for cycle, port, _ in rig.dev.pins.edges if port == 5] == [129 + 128 * bit for bit in range(10)]


# -- receive ----------------------------------------------------------------------------------------------------------


def test_received_character_is_complete_in_the_middle_of_the_stop_bit(rig):
    """§10.2: a received character is complete in the middle of the stop bit, 9.5 bits = 1216 Tcy after the start edge
    plus up to 1/16 bit: edge in 1000, sampled in 1001."""
    enable(rig)
    rig.dev.uart[1].feed(b"A", cycle=1000)
    assert rig.at(999).field("U1STA", "RIDLE") == 1
    assert rig.at(1000).field("U1STA", "RIDLE") == 0
    assert rig.at(2216).flag("U1RXIF") == 0
    assert rig.at(2217).flag("U1RXIF") == 1
    assert rig.field("U1STA", "URXDA") == 1
    assert rig.field("U1STA", "RIDLE") == 1
    assert rig.read("U1RXREG") == 0x41
    assert rig.field("U1STA", "URXDA") == 0


def test_bytes_arrive_back_to_back_at_line_rate(rig):
    """§10: bytes are received back to back at line rate, 1280 Tcy per frame."""
    enable(rig)
    rig.dev.uart[1].feed(b"ab", cycle=1001)
    assert rig.at(2217).read("U1RXREG") == 0x61
    assert rig.at(3496).field("U1STA", "URXDA") == 0
    assert rig.at(3497).read("U1RXREG") == 0x62


@pytest.mark.parametrize(("sel", "counts"), [(0, [1, 2, 3, 4]), (1, [1, 2, 3, 4]), (2, [3]), (3, [4])])
def test_receive_interrupt_modes(rig, sel, counts):
    """§10.2: URXISEL = 0x interrupts at every character, 10 at three characters, 11 at four."""
    enable(rig, sta=sel << 6)
    rig.dev.uart[1].feed(b"wxyz", cycle=1001)
    seen = []
    for number in range(1, 5):
        rig.at(1001 + 1280 * number)
        if rig.flag("U1RXIF"):
            seen.append(number)
            rig.clear_flags()
    assert seen == counts


def test_fifth_character_overruns_and_clearing_oerr_flushes(rig):
    """§10.2: a fifth character sets OERR, and clearing OERR empties the FIFO."""
    enable(rig)
    rig.dev.uart[1].feed(b"123456", cycle=1001)
    assert rig.at(1001 + 1280 * 4).field("U1STA", "OERR") == 0
    assert rig.at(1001 + 1280 * 5).field("U1STA", "OERR") == 1
    assert rig.read("U1RXREG") == 0x31
    rig.at(20000)
    assert [rig.read("U1RXREG") for _ in range(3)] == [0x32, 0x33, 0x34]
    rig.dev.uart[1].feed(b"7", cycle=20001)
    rig.at(22000)
    assert rig.field("U1STA", "URXDA") == 0  # the receiver is blocked until OERR is cleared
    rig.write("U1STA", UTXEN)
    rig.dev.uart[1].feed(b"8", cycle=22001)
    rig.at(24000)
    assert rig.read("U1RXREG") == 0x38


def test_clearing_oerr_throws_unread_characters_away(rig):
    """§10.2: clearing OERR, from 1 to 0, discards unread characters."""
    enable(rig)
    rig.dev.uart[1].feed(b"12345", cycle=1001)
    rig.at(9000).write("U1STA", UTXEN)
    assert rig.field("U1STA", "URXDA") == 0


def test_writing_oerr_0_when_it_is_0_changes_nothing(rig):
    """§10.2: writing 0 to OERR while it is 0 changes nothing; the e-puck's receive handler does this in every call."""
    enable(rig)
    rig.dev.uart[1].feed(b"12", cycle=1001)
    rig.at(9000).write("U1STA", rig.read("U1STA") & ~OERR)
    assert [rig.read("U1RXREG") for _ in range(2)] == [0x31, 0x32]


def test_software_cannot_set_oerr_or_receive_flags(rig):
    """§10: software can clear OERR but not set it; URXDA, FERR, PERR, RIDLE, TRMT and UTXBF are read-only."""
    enable(rig)
    rig.at(10).write("U1STA", 0xFFFF & ~UTXBRK)
    assert rig.read("U1STA") == 0x8000 | UTXEN | 0xC0 | ADDEN | 0x110


def test_framing_error_belongs_to_the_character_at_the_top(rig):
    """§10.2: FERR belongs to the character at the top of the FIFO; a character with a framing error is stored too."""
    enable(rig)
    uart = rig.dev.uart[1]
    uart.feed(b"\x81", cycle=1001, errors=FRAMING_ERROR)
    uart.feed(b"\x82", cycle=4000)
    rig.at(9000)
    assert rig.field("U1STA", "FERR") == 1
    assert rig.read("U1RXREG") == 0x81
    assert rig.field("U1STA", "FERR") == 0
    assert rig.read("U1RXREG") == 0x82


def test_parity_error(rig):
    """§10.2: a character with wrong parity sets PERR."""
    enable(rig, mode=2)
    rig.dev.uart[1].feed(b"\x01", cycle=1001, errors=PARITY_ERROR)
    rig.at(9000)
    assert rig.field("U1STA", "PERR") == 1
    assert rig.read("U1RXREG") == 1


def test_break_is_received_as_0_with_a_framing_error(rig):
    """§10.2: a break is received as 0 with a framing error."""
    enable(rig)
    rig.dev.uart[1].feed(b"\xff", cycle=1001, errors=BREAK)
    rig.at(9000)
    assert rig.field("U1STA", "FERR") == 1
    assert rig.read("U1RXREG") == 0


@pytest.mark.parametrize(("baud", "clean"), [(115200, True), (118600, True), (111800, True), (130000, False)])
def test_senders_at_another_rate_are_sampled_as_the_16_fold_clock_sees_them(rig, baud, clean):
    """§10.2: characters at another bit rate are sampled as by the 16-fold clock, samples 7, 8, 9 of each bit; for ten
    bits the limit is about 5 % of error."""
    enable(rig)
    rig.dev.uart[1].feed(b"\x55", cycle=1001, baud=baud)
    rig.at(9000)
    assert (rig.field("U1STA", "FERR"), rig.read("U1RXREG")) == (0, 0x55) or not clean
    if not clean:
        rig.dev.uart[1].feed(b"\x55", cycle=9001, baud=baud)
        rig.at(20000)
        assert rig.read("U1RXREG") != 0x55 or rig.field("U1STA", "FERR")


def test_nine_bit_address_detection_drops_data(rig):
    """§10.2: with ADDEN, only characters with bit 8 set are stored."""
    enable(rig, mode=6, sta=ADDEN)
    rig.dev.uart[1].feed([0x055, 0x1AA], cycle=1001)
    rig.at(9000)
    assert rig.read("U1RXREG") == 0x1AA
    assert rig.field("U1STA", "URXDA") == 0


def test_loopback_receives_its_own_frames_and_not_the_pin(rig):
    """§10.2: with LPBACK the receiver receives the transmitter's frames and not the pin."""
    enable(rig, mode=LPBACK)
    sent = collect(rig)
    rig.dev.uart[1].feed(b"z", cycle=100)
    rig.at(200).write("U1TXREG", 0x42)
    assert rig.at(257 + 1216).flag("U1RXIF") == 1
    assert rig.read("U1RXREG") == 0x42
    rig.at(5000)
    assert rig.field("U1STA", "URXDA") == 0
    assert sent == [(0x42, 257)]


def test_disabled_receiver_loses_timed_bytes_and_untimed_ones_wait(rig):
    """A disabled receiver loses bytes that are fed for a cycle; bytes fed without a cycle wait until UARTEN is set."""
    rig.dev.uart[1].feed(b"a", cycle=100)
    rig.at(5000)
    rig.dev.uart[1].feed(b"b")
    enable(rig, cycle=9000)
    rig.at(15000)
    assert rig.read("U1RXREG") == 0x62
    assert rig.field("U1STA", "URXDA") == 0


def test_wake_raises_the_interrupt_at_the_start_edge_in_sleep(rig):
    """§10.2: with WAKE, a start edge in Sleep raises the interrupt."""
    enable(rig, mode=WAKE)
    rig.at(100).dev.sleep(2, 100)
    rig.dev.uart[1].feed(b"x", cycle=500)
    assert rig.at(499).flag("U1RXIF") == 0
    assert rig.at(500).flag("U1RXIF") == 1
    assert rig.field("U1MODE", "WAKE") == 0


@pytest.mark.parametrize(("baud", "bit"), [(0, 128), (57600, 256), (230400, 64), (100000, 147.456)])
def test_autobaud_lets_the_capture_module_time_the_senders_bits(rig, baud, bit):
    """§10: with ABAUD, IC1 captures every edge of 0x55 against timer 3, for any bit rate of the sender."""
    enable(rig, mode=ABAUD)
    rig.write_all(T3CON=0x8000, IC1CON=1)
    rig.dev.uart[1].feed(b"\x55", cycle=1001, baud=baud)
    rig.at(1001 + round(3 * bit) + 2)
    times = [rig.read("IC1BUF") for _ in range(4)]
    assert [later - times[0] for later in times] == [round(index * bit) for index in range(4)]


def test_long_feeds_do_not_lose_bytes(rig):
    """`feed` accepts any number of bytes, and all are received."""
    enable(rig)
    rig.dev.uart[1].feed(bytes(range(256)) * 5)
    received = []
    cycle = 10
    while len(received) < 1280:
        cycle += 1280
        rig.at(cycle)
        while rig.field("U1STA", "URXDA"):
            received.append(rig.read("U1RXREG"))
    assert bytes(received) == bytes(range(256)) * 5


def test_snapshot_in_the_middle_of_a_frame_continues_identically(rig):
    """A snapshot in the middle of a frame continues with the same bytes at the same cycles, because hidden state is
    in the record."""
    enable(rig)
    sent = collect(rig)
    rig.at(10).write("U1TXREG", 0x41)
    rig.at(11).write("U1TXREG", 0x42)
    rig.dev.uart[1].feed(b"q", cycle=600)
    rig.at(700)
    state = rig.record.snapshot()
    rig.at(9000)
    first = list(sent), rig.record.snapshot()
    sent.clear()
    rig.record.restore(state)
    rig.dev.restored()
    rig.at(9000)
    assert (sent, rig.record.snapshot()) == first


def test_reading_a_character_with_errors_returns_its_data(rig):
    """Reading U1RXREG returns the data of a character with errors, because FERR is in U1STA; a debugger's read
    removes nothing from the FIFO."""
    enable(rig)
    rig.dev.uart[1].feed(b"A", 100, errors=FRAMING_ERROR)
    rig.at(3000)
    assert rig.peek("U1RXREG") == 0x41
    assert rig.field("U1STA", "FERR") == 1
    assert rig.read("U1RXREG") == 0x41
