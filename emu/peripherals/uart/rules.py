"""Rules of a UART (§10).

The rules at the end handle the common cases. `uart.py` uses the same functions and adds the cases that need Python:
eager listeners, loopback, autobaud, senders at another baud rate, and the log of edges.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

from emu.peripherals.uart.frame import FRAMING_MARK, PARITY_MARK, data_of, first_stop, is_nine, length, pack, unpack
from emu.peripherals.uart.rx_queue import CAPACITY, ERRORS, RxQueueOperands
from emu.system.events import NEVER
from emu.system.rules import Cell, EventSlot, InterruptLine, Number, RuleBuilder, request

FIFO: Final = 4
"""Depth of the transmit and receive FIFOs in characters (§10.1, §10.2)."""
SENT: Final = 64
"""Capacity of the buffer for sent characters of which listeners are notified later."""
QUIET, COMING, SAMPLING = range(3)
"""Receiver states: no frame; start bit posted (loopback); inside a frame."""
_FILL: Final = (0, 0, 3, 4)
"""FIFO level that requests an interrupt, by URXISEL; 0 means that every character does."""
CHARACTER: Final = 0x1FF
"""Mask of the data bits in an element of the receive FIFO."""


@dataclass(frozen=True, slots=True)
class UartOperands:
    """Operands of the rules: registers and cells of one UART."""

    mode: Cell
    sta: Cell
    brg: Cell
    txreg: Cell
    bit: Mapping[str, int]
    """Masks of the fields of UxMODE and UxSTA, which have different names."""
    urxisel: int
    """Bit position of URXISEL in UxSTA."""
    writable: int
    """Mask of the writable bits of UxTXREG."""
    clock: Cell
    tx: Cell
    tx_count: Cell
    shifting: Cell
    frame: Cell
    wave: Cell
    start: Cell
    end: Cell
    bit_began: Cell
    rx: Cell
    rx_count: Cell
    held: Cell
    receiving: Cell
    incoming: Cell
    done: Cell
    rx_wave: Cell
    rx_start: Cell
    rx_bit: Cell
    line_free: Cell
    frozen: Cell
    at_once: Cell
    """Whether an eager listener must be called in the cycle in which a character has been sent."""
    sent: Cell
    sent_count: Cell
    watched: Cell
    """Pins with eager watchers on the port of TX. They include TX while edges are logged."""
    tx_pin: int
    line: RxQueueOperands
    send_slot: EventSlot
    receive_slot: EventSlot
    line_slot: EventSlot
    send_line: InterruptLine
    receive_line: InterruptLine


# -- transmit --------------------------------------------------------------------------------------------------------
def push(m: RuleBuilder, u: UartOperands, value: Number, lanes: int) -> bool:
    """Write TXREG. A write to the low byte pushes the character; a full FIFO drops it (§10.1)."""
    mode, status, count, due = m.get(u.mode), m.get(u.sta), m.get(u.tx_count), m.get(u.send_slot.due)
    free = u.writable & lanes
    word = (m.get(u.txreg) & (0xFFFF & ~free)) | (value & free)
    taken = ((mode & u.bit["UARTEN"]) != 0) & (count < FIFO) & int(bool(lanes & 0xFF))
    starts = taken & ((status & u.bit["UTXEN"]) != 0) & (m.get(u.shifting) == 0)
    place = m.select(taken, count, 0)
    filled = (status & (0xFFFF & ~u.bit["TRMT"])) | m.select(count + 1 == FIFO, u.bit["UTXBF"], 0)
    m.put(u.tx, m.select(taken, data_of(mode, word), m.get(u.tx, place)), place)
    m.put(u.txreg, word)
    m.put(u.tx_count, m.select(taken, count + 1, count))
    m.put(u.sta, m.select(taken, filled, status))
    m.post(u.send_slot, m.select(starts, m.now + 1, due))
    return True


def bit_time(m: RuleBuilder, u: UartOperands) -> Number:
    """Return the bit time in Tcy: 16 (BRG + 1)."""
    return (m.get(u.brg) + 1) << 4


def edge(m: RuleBuilder, u: UartOperands, cycle: Number, step: Number) -> Number:
    """Return the first edge, at or after `cycle`, of the baud clock with a period of `step` Tcy."""
    clock = m.get(u.clock)
    return clock + m.div(cycle - clock + step - 1, step) * step


def send_next(m: RuleBuilder, u: UartOperands, cycle: Number) -> None:
    """Move the next FIFO entry to TSR; its start bit begins at the next bit clock edge (§10.1). Set TRMT if empty."""
    mode, status, count, ended = m.get(u.mode), m.get(u.sta), m.get(u.tx_count), m.get(u.end)
    waits, data, bit = count != 0, m.get(u.tx), bit_time(m, u)
    free = m.select(ended == cycle, cycle, edge(m, u, cycle, bit))
    start = m.select(free == m.get(u.clock), free + bit, free)
    end = start + length(mode) * bit
    for place in range(FIFO - 1):
        m.put(u.tx, m.select(waits, m.get(u.tx, place + 1), m.get(u.tx, place)), place)
    m.put(u.tx_count, m.select(waits, count - 1, 0))
    m.put(u.sta, m.select(waits, status & (0xFFFF & ~u.bit["UTXBF"]), status | u.bit["TRMT"]))
    m.put(u.frame, m.select(waits, data, m.get(u.frame)))
    m.put(u.wave, m.select(waits, pack(mode, data), m.get(u.wave)))
    m.put(u.bit_began, m.select(waits, start, m.get(u.bit_began)))
    m.put(u.start, m.select(waits, start, NEVER))
    m.put(u.end, m.select(waits, end, NEVER))
    m.put(u.shifting, waits)
    m.post(u.send_slot, m.select(waits, end, NEVER))
    request(m, u.send_line, cycle, waits & (((status & u.bit["UTXISEL"]) == 0) | (count == 1)))


# -- receive ---------------------------------------------------------------------------------------------------------
def schedule_frame(
    m: RuleBuilder, u: UartOperands, start: Number, wave: Number, sampled: Number, bit_q8: Number
) -> None:
    """Schedule the reception of a frame whose start bit begins in cycle `start`.

    `wave`: levels on the line. `sampled`: bits that the receiver will sample. `bit_q8`: the sender's bit time in
    Tcy/256.
    """
    mode, tick = m.get(u.mode), m.get(u.brg) + 1
    middle = edge(m, u, start, tick) + ((first_stop(mode) << 4) + 8) * tick  # middle of the first stop bit (§10.2)
    m.put(u.incoming, unpack(mode, sampled))
    m.put(u.rx_bit, bit_q8)
    m.put(u.done, middle)
    m.put(u.rx_wave, (wave | 0xFFFF << length(mode)) & 0xFFFF)  # after the frame the line is high
    m.put(u.rx_start, start)


def begin(m: RuleBuilder, u: UartOperands) -> None:
    """Handle the start of a frame's start bit."""
    m.put(u.receiving, SAMPLING)
    m.put(u.sta, m.get(u.sta) & (0xFFFF & ~u.bit["RIDLE"]))
    m.post(u.receive_slot, m.get(u.done))


def shown(u: UartOperands, status: Number, count: Number, top: Number) -> Number:
    """Return `status` with URXDA, PERR and FERR of the character at the head of the FIFO (§10.2)."""
    bit, some = u.bit, count != 0
    others = status & (0xFFFF & ~(bit["URXDA"] | bit["PERR"] | bit["FERR"]))
    wrong = some & ((top & PARITY_MARK) != 0)
    broken = some & ((top & FRAMING_MARK) != 0)
    return others | some * bit["URXDA"] | wrong * bit["PERR"] | broken * bit["FERR"]


def receive(m: RuleBuilder, u: UartOperands) -> None:
    """Store a complete character in the FIFO; if the FIFO is full, in the shift register (§10.2)."""
    bit, mode, count, character = u.bit, m.get(u.mode), m.get(u.rx_count), m.get(u.incoming)
    status = m.get(u.sta) | bit["RIDLE"]
    unaddressed = ((status & bit["ADDEN"]) != 0) & is_nine(mode) & ((character & 0x100) == 0)
    kept = (((m.get(u.held) != 0) | ((status & bit["OERR"]) != 0) | unaddressed) == 0) & (count <= FIFO)
    full, after = count == FIFO, count + 1
    wanted = m.table(_FILL, status >> u.urxisel & 3)
    top = m.select(count == 0, character, m.get(u.rx))
    last = m.get(u.rx, count)
    m.put(u.receiving, QUIET)
    m.put(u.rx, m.select(kept, character, last), count)
    m.put(u.held, m.select(kept & full, 1, m.get(u.held)))
    taken = kept & (full == 0)
    m.put(u.rx_count, m.select(taken, after, count))
    status = m.select(taken, shown(u, status, after, top), status)
    m.put(u.sta, status | m.select(kept & full, bit["OERR"], 0))
    request(m, u.receive_line, m.now, taken & ((wanted == 0) | (wanted == after)))


def pop(m: RuleBuilder, u: UartOperands) -> Number:
    """Read RXREG: remove and return the FIFO's head. An empty FIFO returns the last character again."""
    count, data, before = m.get(u.rx_count), m.get(u.rx), m.get(u.sta)
    left = m.select(count == 0, 0, count - 1)
    elements = [m.get(u.rx, place) for place in range(FIFO)]
    status = shown(u, before, left, elements[1])
    for place, (element, following) in enumerate(pairwise(elements)):
        m.put(u.rx, m.select(left > place, following, element), place)
    m.put(u.rx_count, left)
    m.put(u.sta, m.select(count == 0, before, status))
    return data & CHARACTER


# -- rules -----------------------------------------------------------------------------------------------------------
def fire_send(m: RuleBuilder, u: UartOperands) -> None:
    """Handle the end of a sent frame, or start to send a waiting character."""
    mode, count, stored = m.get(u.mode), m.get(u.tx_count), m.get(u.sent_count)
    sent = m.get(u.shifting) != 0
    m.require((sent == 0) | ((m.get(u.end) <= m.now) & (m.get(u.at_once) == 0) & (stored < SENT)))
    m.require((((mode & u.bit["LPBACK"]) == 0) & ((m.get(u.watched) & u.tx_pin) == 0)) | (count == 0))
    m.require((m.get(u.sta) & u.bit["UTXBRK"]) == 0)
    place = m.select(sent, stored, 0)
    m.put(u.sent, m.select(sent, m.get(u.start) << 16 | m.get(u.frame), m.get(u.sent, place)), place)
    m.put(u.sent_count, m.select(sent, stored + 1, stored))
    send_next(m, u, m.now)


def fire_receive(m: RuleBuilder, u: UartOperands) -> None:
    """Complete a reception in the middle of the stop bit."""
    m.require(m.get(u.receiving) == SAMPLING)
    receive(m, u)


def fire_line(m: RuleBuilder, u: UartOperands) -> None:
    """Start the reception of a queued frame that has no errors and the receiver's own baud rate."""
    line, mode, count, head = u.line, m.get(u.mode), m.get(u.line.count), m.get(u.line.head)
    data, following = m.get(line.data, head), m.select(head + 1 == CAPACITY, 0, head + 1)
    plain = (mode & (u.bit["UARTEN"] | u.bit["LPBACK"] | u.bit["ABAUD"])) == u.bit["UARTEN"]
    m.require(plain & (m.get(u.frozen) == NEVER) & (m.get(u.receiving) == QUIET) & (count != 0))
    m.require(
        (m.get(line.bit, head) == 0) & ((data & ERRORS) == 0) & ((m.get(line.more) == 0) | (count > CAPACITY // 2))
    )
    bits, bit = length(mode), bit_time(m, u)
    wave, free = pack(mode, data), m.now + bits * bit
    earliest = m.get(line.earliest, following)
    m.put(line.head, following)
    m.put(line.count, count - 1)
    m.put(u.line_free, free)
    schedule_frame(m, u, m.now, wave, wave, bit << 8)
    begin(m, u)
    m.post(u.line_slot, m.select(count == 1, NEVER, m.select(m.below(earliest, free), free, earliest)))
