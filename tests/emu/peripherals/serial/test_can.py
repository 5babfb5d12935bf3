"""CAN1/2 (dspic30f6014a.md §15)."""

from __future__ import annotations

import pytest

from emu.peripherals.can.frame import CanFrame, _crc

NORMAL, LOOPBACK = 0, 2


def configure(rig, mode=LOOPBACK, *, can=1):
    """Configure CAN1 for Fcan = Fcy, BRP 0 and eight quanta (16 Tcy) per bit, then set the mode."""
    rig.write(f"C{can}CFG1", 0)
    rig.write(f"C{can}CFG2", 2 | 1 << 3 | 1 << 8)
    rig.write(f"C{can}CTRL", mode << 8 | 0x800)
    rig.at(rig.events.now + 10)


def load(rig, buffer, identifier, data, *, can=1, priority=0, extended=False):
    prefix = f"C{can}TX{buffer}"
    if extended:
        sid, eid = identifier >> 18, identifier & 0x3FFFF
        rig.write(prefix + "SID", (sid >> 6) << 11 | (sid & 0x3F) << 2 | 3)
        rig.write(prefix + "EID", (eid >> 14) << 12 | eid >> 6 & 0xFF)
        rig.write(prefix + "DLC", (eid & 0x3F) << 10 | len(data) << 3)
    else:
        rig.write(prefix + "SID", (identifier >> 6) << 11 | (identifier & 0x3F) << 2)
        rig.write(prefix + "DLC", len(data) << 3)
    padded = data.ljust(8, b"\0")
    for word in range(4):
        rig.write(f"{prefix}B{word + 1}", int.from_bytes(padded[2 * word : 2 * word + 2], "little"))
    rig.write(prefix + "CON", 8 | priority)


def test_reset_state_is_configuration_mode(rig):
    """§15: after reset the module is in configuration mode (0x0480)."""
    assert rig.read("C1CTRL") == 0x0480


def test_mode_follows_the_request_after_a_few_cycles(rig):
    """§15: the mode changes a few cycles after the request."""
    rig.at(10).write("C1CTRL", 0x0200)
    assert rig.field("C1CTRL", "OPMODE") == 4
    assert rig.at(15).field("C1CTRL", "OPMODE") == 2


def test_stuffing_of_a_frame_of_zeros():
    """CAN 2.0: the CRC of zeros is 0, so a frame of zeros has 34 zero bits and a stuff bit after every five: 6 stuff
    bits."""
    assert CanFrame(0, False, False, 0, b"").wire_bits() == 19 + 15 + 13 + 6


def test_crc_has_the_published_check_value():
    """The CRC-15/CAN of the digits 1 to 9 is 0x059E, the published check value."""
    assert _crc("".join(f"{byte:08b}" for byte in b"123456789")) == 0x059E


@pytest.mark.parametrize("extended", [False, True])
@pytest.mark.parametrize("length", range(9))
def test_frame_length_lies_between_no_and_most_stuffing(length, extended):
    """CAN 2.0: a frame has 34 or 54 stuffable bits plus data, and between none and (n - 1) / 4 stuff bits."""
    stuffable = (54 if extended else 34) + 8 * length
    for seed in range(50):
        frame = CanFrame(
            seed * 0x1234567 % (1 << 29 if extended else 1 << 11), extended, False, length, b"\x0f" * length
        )
        assert stuffable + 13 <= frame.wire_bits() <= stuffable + 13 + (stuffable - 1) // 4


def test_loopback_delivers_through_the_filters(rig):
    """§15: in loopback a frame passes the filters at 16 Tcy per bit; TXREQ falls, TXB0IF and RXB0IF rise, and C1IF if
    enabled."""
    configure(rig)
    rig.write("C1INTE", 1)
    start = rig.events.now
    load(rig, 0, 0x123, b"\x11\x22\x33")
    end = start + 1 + 16 * CanFrame(0x123, False, False, 3, b"\x11\x22\x33").wire_bits()
    assert rig.at(end - 1).field("C1TX0CON", "TXREQ") == 1
    assert not rig.flag("C1IF")
    assert rig.at(end).field("C1TX0CON", "TXREQ") == 0
    assert rig.flag("C1IF")
    assert rig.read("C1INTF") == 0b101
    assert rig.field("C1RX0CON", "RXFUL") == 1
    assert rig.field("C1RX0SID", "SID") == 0x123
    assert rig.field("C1RX0DLC", "DLC") == 3
    assert (rig.read("C1RX0B1"), rig.read("C1RX0B2")) == (0x2211, 0x0033)
    assert rig.field("C1CTRL", "ICODE") == 6


def test_extended_identifier_survives_the_trip(rig):
    """§15: an extended identifier is received as sent, in SID, EID17_6 and EID5_0."""
    configure(rig)
    load(rig, 1, 0x1ABCDEF5, b"", extended=True)
    rig.at(5000)
    sid = rig.field("C1RX0SID", "SID")
    assert sid << 18 | rig.read("C1RX0EID") << 6 | rig.field("C1RX0DLC", "EID5_0") == 0x1ABCDEF5
    assert rig.field("C1RX0SID", "RXIDE") == 1


def test_masks_and_filters_choose_the_buffer(rig):
    """§15: filters 0-1 with mask 0 accept frames for RXB0, filters 2-5 with mask 1 for RXB1; FILHIT is the number of
    the filter."""
    rig.write_all(C1RXM0SID=0x7FF << 2, C1RXM1SID=0x7FF << 2, C1RXF0SID=0x100 << 2, C1RXF3SID=0x200 << 2)
    configure(rig)
    load(rig, 0, 0x200, b"a")
    rig.at(3000)
    assert rig.field("C1RX0CON", "RXFUL") == 0
    assert (rig.field("C1RX1CON", "RXFUL"), rig.field("C1RX1CON", "FILHIT")) == (1, 3)
    load(rig, 0, 0x300, b"b")
    rig.at(6000)
    assert rig.field("C1RX0CON", "RXFUL") == 0


def test_full_buffer_overflows_or_spills_into_the_second(rig):
    """§15: a frame for the full RXB0 goes to RXB1 if DBEN is set, otherwise it sets RXB0OVFL."""
    configure(rig)
    load(rig, 0, 1, b"a")
    rig.at(3000)
    load(rig, 0, 2, b"b")
    rig.at(6000)
    assert rig.field("C1INTF", "RXB0OVFL") == 1
    rig.write("C1RX0CON", 0x84)
    load(rig, 0, 3, b"c")
    rig.at(9000)
    assert rig.field("C1RX1SID", "SID") == 3


def test_higher_priority_goes_first(rig):
    """§15: pending buffers are sent in the order of TXPRI, and with equal TXPRI in the order of their numbers."""
    order = []
    rig.dev.can[1].on_frame = lambda frame, cycle: order.append(frame.identifier) or True
    configure(rig, NORMAL)
    load(rig, 2, 0x10, b"")
    load(rig, 0, 0x20, b"", priority=1)
    load(rig, 1, 0x30, b"", priority=3)
    rig.at(20000)
    assert order == [0x10, 0x30, 0x20]


def test_unacknowledged_frame_stays_pending_and_counts_errors(rig):
    """§15: a frame of a node alone on the bus is not acknowledged, stays pending and increments the error count."""
    configure(rig, NORMAL)
    load(rig, 0, 0x10, b"")
    rig.at(20000)
    assert (rig.field("C1TX0CON", "TXREQ"), rig.field("C1TX0CON", "TXERR")) == (1, 1)
    assert rig.read("C1EC") == 0x8000
    assert rig.field("C1INTF", "ERRIF") == 1


def test_frames_from_other_nodes_are_received_in_normal_mode_only(rig):
    """§15: frames from other nodes are received only in normal mode."""
    frame = CanFrame(0x77, False, False, 2, b"hi")
    assert not rig.dev.can[2].receive(frame)
    configure(rig, NORMAL, can=2)
    rig.write("C2INTE", 1)
    assert rig.dev.can[2].receive(frame)
    assert rig.at(100).flag("C2IF")
    assert rig.read("C2RX0B1") == int.from_bytes(b"hi", "little")
