"""UART1/2 (§10): FIFOs, bit-exact line timing, error flags, interrupt modes, loopback, break, autobaud.

The environment exchanges bytes with cycles: `on_byte(byte, start_cycle)` is called when a frame has left the pin, and
`feed(bytes)` queues frames that arrive at line rate. The level of the TX pin is a function of the cycle. `rules.py` has
the common cases; this module handles all others.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from re import Match
from typing import Final

from emu.chips.chip import UartSite
from emu.peripherals.base import SLEEP, ChipContext, Peripheral
from emu.peripherals.interrupt_lines import Interrupts
from emu.peripherals.pins import parse_pin
from emu.peripherals.ports.ports import Port
from emu.peripherals.timers.input_capture import Capture
from emu.peripherals.uart.expect import OutputMatcher, Pattern
from emu.peripherals.uart.frame import first_stop, has_parity, length, pack, sample, stops
from emu.peripherals.uart.rules import (
    CHARACTER,
    COMING,
    FIFO,
    QUIET,
    SENT,
    UartOperands,
    begin,
    bit_time,
    edge,
    fire_line,
    fire_receive,
    fire_send,
    pop,
    push,
    receive,
    schedule_frame,
    send_next,
    shown,
)
from emu.peripherals.uart.rx_queue import BREAK, FRAMING_ERROR, PARITY_ERROR, WAIT_FOR_RECEIVER, QueuedFrame, RxQueue
from emu.peripherals.uart.tx_pin import TxPin
from emu.system.events import NEVER
from emu.system.observers import Listeners
from emu.system.rules import Rule, cell_of, event_slot

_NO_SENT: Final = memoryview(bytes(8 * SENT)).cast("Q")


class Uart(Peripheral):
    """One UART. Bit time is 16 (BRG + 1) Tcy (§10)."""

    def __init__(self, site: UartSite, context: ChipContext, interrupts: Interrupts, ports: dict[int, Port]) -> None:
        super().__init__(f"u{site.number}", context)
        self.site: Final = site
        self._interrupts: Final = interrupts
        prefix = f"U{site.number}"
        self.mode: Final = self.register(prefix + "MODE")
        self.sta: Final = self.register(prefix + "STA")
        self.txreg: Final = self.register(prefix + "TXREG")
        self.rxreg: Final = self.register(prefix + "RXREG")
        self.brg: Final = self.register(prefix + "BRG")
        self.idle_bit = (self.mode, "USIDL")
        self.mode.written_by(self._mode_written)
        self.sta.written_by(self._sta_written)
        self.txreg.computed(lambda: 0)
        self.rxreg.computed(lambda: self._rx[0] & CHARACTER)
        self.brg.written_by(self._brg_written)
        self._matcher: OutputMatcher | None = None
        self._at_once: Final = self.cell("at_once", "B")
        """Whether an eager listener must be called in the cycle in which a character has been sent."""
        self._sent: Final = self.array("sent", "Q", SENT)
        """Sent characters not yet reported to the listeners: start cycle of the start bit << 16 | character."""
        self._sent_count: Final = self.cell("sent_count", "B")
        self._listeners: Final[Listeners[[int, int]]] = Listeners(self.events, self._at_once.set)
        self._capture: Capture | None = None
        self._uarten: Final = 1 << context.chip.sfrs[prefix + "MODE"].fields["UARTEN"][0]
        tx_port, self._tx_pin = parse_pin(site.tx_pin)
        rx_port, self._rx_pin = parse_pin(site.rx_pin)
        self._tx_port: Final = ports[tx_port]
        self._rx_port: Final = ports[rx_port]

        self._clock: Final = self.timestamp("clock")
        """Cycle in which the baud rate generator last started from 0."""
        self._tx: Final = self.array("tx", "H", FIFO)
        self._tx_count: Final = self.cell("tx_count", "B")
        self._shifting: Final = self.cell("shifting", "B")
        self._frame: Final = self.cell("frame", "H")
        self._wave: Final = self.cell("wave", "H")
        self._start: Final = self.timestamp("start", NEVER)
        """Start cycle of the start bit of the frame in TSR."""
        self._end: Final = self.timestamp("end", NEVER)
        self._bit_began: Final = self.timestamp("bit_began", NEVER)
        """Start cycle of bit 0 in `wave`: the start bit, or the bit during which BRG was written."""
        self._tx_event: Final = self.slot("tx", self._tx_due)
        self._break_event: Final = self.slot("break", self._break_due)
        self._break_began: Final = self.timestamp("break_began", NEVER)
        """First cycle in which UTXBRK holds TX low; NEVER without a break."""
        self._break_start: Final = self.timestamp("break_start", NEVER)
        self._break_ended: Final = self.timestamp("break_ended", NEVER)
        """First and last cycle of TX low, of the break that `_break_due` will report."""
        self._pin: Final = TxPin(context.pins, tx_port, self._tx_pin, self._tx_level)

        self._rx: Final = self.array("rx", "H", FIFO + 1)
        """Receive FIFO: data in bits 8:0, error bits above. The last element is the character in the shift register."""
        self._rx_count: Final = self.cell("rx_count", "B")
        self._held: Final = self.cell("held", "B")
        """Whether the shift register holds a character because the FIFO is full."""
        self._receiving: Final = self.cell("receiving", "B")
        self._incoming: Final = self.cell("incoming", "H")
        self._done: Final = self.timestamp("done", NEVER)
        self._rx_event: Final = self.slot("rx", self._rx_due)
        self._rx_wave: Final = self.cell("rx_wave", "H")
        self._rx_start: Final = self.timestamp("rx_start", NEVER)
        self._rx_bit: Final = self.cell("rx_bit", "I")
        """Bit time of the sender in Tcy/256."""
        self._edge_bit: Final = self.cell("edge_bit", "B")
        self._edge_event: Final = self.slot("edge", self._edge_due)

        self.line: Final = RxQueue(self.record, self.name)
        self._line_free: Final = self.cell("line_free", "Q")
        """First cycle in which the line is free for another frame."""
        self._line_event: Final = self.events.slot(f"{self.name}.line", self._line_due)
        self._operands: Final = self._rule_operands()
        self._set_rules(self._operands)

    def _rule_operands(self) -> UartOperands:
        sfrs = self.context.chip.sfrs
        cells = ("clock", "tx", "tx_count", "shifting", "frame", "wave", "start", "end", "bit_began", "rx", "rx_count",
                 "held", "receiving", "incoming", "done", "rx_wave", "rx_start", "rx_bit", "line_free", "frozen",
                 "at_once", "sent", "sent_count")  # fmt: skip
        fields = {**sfrs[self.mode.name].fields, **sfrs[self.sta.name].fields}
        return UartOperands(
            mode=self.mode.cell,
            sta=self.sta.cell,
            brg=self.brg.cell,
            txreg=self.txreg.cell,
            bit={name: ((1 << width) - 1) << lsb for name, (lsb, width) in fields.items()},
            urxisel=fields["URXISEL"][0],
            writable=sfrs[self.txreg.name].writable,
            watched=cell_of(self.record, "pins.eager", self._tx_port.index),
            tx_pin=self._tx_pin,
            line=self.line.operands,
            send_slot=event_slot(self.record, self._tx_event),
            receive_slot=event_slot(self.record, self._rx_event),
            line_slot=event_slot(self.record, self._line_event),
            send_line=self._interrupts.line(self.site.tx_irq).line,
            receive_line=self._interrupts.line(self.site.rx_irq).line,
            **{name: cell_of(self.record, f"{self.name}.{name}") for name in cells},
        )

    def _set_rules(self, operands: UartOperands) -> None:
        """Set the rules of registers and events. Register hooks run the same functions, not as rules of the bus."""
        integers = self.bus.integers
        self.txreg.set_rule(Rule(operands, writes=push))
        self.txreg.written_by(lambda _old, new, lanes: self._push(new, lanes))
        self.rxreg.set_rule(Rule(operands, reads_with_effect=pop))
        self.rxreg.read_by(lambda: pop(integers, operands))
        self.set_event_rule(self._tx_event, Rule(operands, fires=fire_send))
        self.set_event_rule(self._rx_event, Rule(operands, fires=fire_receive))
        self.set_event_rule(self._line_event, Rule(operands, fires=fire_line))

    def listen(
        self, listener: Callable[[int, int], object], *, part: bool = False, lazy: bool = False
    ) -> Callable[[], None]:
        """Call listener(byte, start_cycle) for every frame sent on TX. `start_cycle` is the start of its start bit.

        Return a function that removes the listener. `part`: the listener is a board part whose state depends on the
        bytes. `lazy`: the call may come later than the end of the frame, but before the run ends. A machine runs faster
        if all listeners are lazy.
        """
        return self._listeners.add(listener, part=part, lazy=lazy)

    def deliver_sent(self) -> None:
        """Call the listeners for the sent characters stored in the record, then clear the store."""
        count = self._sent_count.value
        if count:
            entries = self._sent[:count].tolist()
            self._sent_count.value = 0
            self._sent[:count] = _NO_SENT[:count]
            for entry in entries:
                self._listeners(entry & 0xFFFF, entry >> 16)

    @property
    def on_byte(self) -> Callable[[int, int], object] | None:
        """A single listener, replaced by assignment, in addition to those added by `listen`."""
        return self._listeners.assigned

    @on_byte.setter
    def on_byte(self, listener: Callable[[int, int], object] | None) -> None:
        self._listeners.assigned = listener

    def expect(self, pattern: Pattern, *, within: float) -> Match[bytes]:
        """Run the machine until `pattern` has been sent, for at most `within` ms of simulated time.

        Text and bytes match literally; a compiled bytes pattern is searched. The search starts after the last match.
        The first call starts to collect output. The machine stops in the cycle in which the last byte of the match has
        left the pin. Raises ExpectError (an AssertionError) with the output received instead, and with any fault.
        """
        if self._matcher is None:
            self._matcher = OutputMatcher(
                self.name.upper().replace("U", "UART", 1), self.context.cpu_signals, self.context.fcy, lambda: self.now
            )
            self.listen(self._matcher.on_byte, lazy=True)
        remove = self.listen(lambda _byte, _start: None)  # an eager listener, so that a match ends the run immediately
        try:
            return self._matcher.expect(pattern, within, self.drain)
        finally:
            remove()

    def connect_capture(self, capture: Capture) -> None:
        """Set the capture channel that ABAUD connects to the receive pin."""
        self._capture = capture

    # -- settings ----------------------------------------------------------------------------------------------------

    @property
    def bit_time(self) -> int:
        """Bit time in Tcy: 16 (BRG + 1)."""
        return int(bit_time(self.bus.integers, self._operands))

    def __repr__(self) -> str:
        return f"<Uart {self.site.number}, {'enabled' if self.is_enabled else 'disabled'}>"

    @property
    def is_enabled(self) -> bool:
        """Whether UARTEN is set."""
        return bool(self.mode.value & self._uarten)

    @property
    def is_sending_enabled(self) -> bool:
        """Whether UARTEN and UTXEN are set."""
        return self.is_enabled and bool(self.sta["UTXEN"])

    # -- transmit ----------------------------------------------------------------------------------------------------

    def _push(self, value: int, lanes: int) -> None:
        push(self.bus.integers, self._operands, value, lanes)

    def _tx_due(self, due: int) -> None:
        """Handle the end of a sent frame, or start to send a waiting character."""
        if self._shifting.value and due < self._end.value:
            return
        if self._shifting.value:
            self._shifting.value = 0
            self.deliver_sent()  # loopback disconnects only the receive pin; the frame is sent on TX (§10)
            if self._break_began.value > self._start.value:  # during a break the line has no start bit
                self._listeners(0 if self.sta["UTXBRK"] else self._frame.value, self._start.value)
        waits = self._tx_count.value > 0
        send_next(self.bus.integers, self._operands, due)
        if waits:
            start, mode = self._start.value, self.mode.value
            if self._break_began.value <= start:
                return
            self._pin.log_frame(start, self._wave.value, length(mode), self.bit_time)
            if self.mode["LPBACK"]:
                self._receive_frame(start, self._frame.value, 0)

    def _switch_break(self, on: bool) -> None:
        """Begin or end a break: TX is low while UTXBRK is set and the transmitter is enabled (§10.1).

        A receiver takes the falling edge for a start bit. After the time of a frame it has a zero byte without a stop
        bit, if TX is still low; after a shorter break it has the bits that were high. A break that begins inside a
        frame has no start bit of its own.
        """
        following = self.now + 1
        if on == (self._break_began.value != NEVER):
            return
        self._pin.log_level(following, not on)
        if not on:
            self._break_ended.value = following
            self._break_began.value = NEVER
            return
        self._break_began.value = following
        if self._shifting.value and self._start.value < following:
            return
        self._break_ended.value = NEVER
        self._break_start.value = following
        self.events.set(self._break_event, following + length(self.mode.value) * self.bit_time)
        if self.mode["LPBACK"] and self._receiving.value == QUIET:
            self._receive_frame(following, BREAK, 0)

    def _break_due(self, due: int) -> None:
        """Report the byte that a receiver makes of a break, at the end of the frame that the break began."""
        low = min(self._break_ended.value, due) - self._break_start.value
        zeros = (2 * low + self.bit_time) // (2 * self.bit_time)  # number of bits whose middle is low
        if zeros:  # a receiver rejects a start bit that is high in its middle
            bits = first_stop(self.mode.value) - has_parity(self.mode.value) - 1
            self.deliver_sent()
            self._listeners((1 << bits) - 1 & ~((1 << zeros - 1) - 1), self._break_start.value)

    def _tx_level(self, cycle: int) -> int:
        """Return the level of TX at `cycle`; 1 is idle."""
        if self._break_began.value <= cycle:
            return 0
        if not self._shifting.value or cycle < self._start.value:
            return 1
        return self._wave.value >> (cycle - self._bit_began.value) // self.bit_time & 1

    def drain(self) -> None:
        """Send all characters left in the transmitter, as a real UART does after the program has stopped."""
        self.deliver_sent()
        while self._shifting.value or (self._tx_count.value and self.is_sending_enabled):
            self.events.cancel(self._tx_event)
            self._tx_due(self._end.value if self._shifting.value else self.now + 1)

    # -- receive -----------------------------------------------------------------------------------------------------

    def feed(
        self, data: str | bytes | Iterable[int], cycle: int | None = None, *, errors: int = 0, baud: float = 0
    ) -> None:
        """Queue frames that arrive back to back on RX, at this UART's own bit time or at `baud` bits per second.

        If `cycle` is given, the first start bit is not before that cycle, and a disabled receiver loses the frames.
        Otherwise the sender waits until the receiver is enabled. `errors` may combine FRAMING_ERROR, PARITY_ERROR and
        BREAK. Text is sent as Latin-1. Raises UnicodeEncodeError (a ValueError) for other characters.
        """
        if isinstance(data, str):
            data = data.encode("latin-1")
        bit = round(self.context.fcy() * 256 / baud) if baud else 0
        marks = errors | (WAIT_FOR_RECEIVER if cycle is None else 0)
        self.line.put(QueuedFrame(cycle or 0, byte & 0x1FF | marks, bit) for byte in data)
        self._plan_line()

    def _plan_line(self) -> None:
        """Post the start bit of the frame at the head of the queue."""
        frame = self.line.head()
        if frame is None or (frame.data & WAIT_FOR_RECEIVER and not self._is_listening):
            self.events.cancel(self._line_event)
            return
        self.events.set(self._line_event, max(frame.earliest, self._line_free.value, self.now + 1))

    @property
    def _is_listening(self) -> bool:
        return self.is_enabled and (not self.is_frozen or bool(self.mode["WAKE"]))

    def drop_next_frame(self) -> bool:
        """Remove the next queued frame. Return whether there was one."""
        if self.line.head() is None:
            return False
        self.line.drop()
        self._plan_line()
        return True

    def _line_due(self, due: int) -> None:
        """Handle the start of a start bit on the RX pin."""
        frame = self.line.head()
        if frame is None:
            return
        self.line.drop()
        bits = length(self.mode.value)
        self._line_free.value = due + (bits * frame.bit + 255 >> 8 if frame.bit else bits * self.bit_time)
        if self.mode["WAKE"] and self.is_frozen:
            self._interrupts.line(self.site.rx_irq).request()
            self.mode["WAKE"] = 0
        elif self.is_enabled and not self.is_frozen and not self.mode["LPBACK"] and self._receiving.value == QUIET:
            self._receive_frame(due, frame.data, frame.bit)
        self._plan_line()

    def _receive_frame(self, start: int, data: int, bit_q8: int) -> None:
        """Sample a frame whose start bit begins at cycle `start`. `bit_q8` is the sender's bit time in Tcy/256."""
        mode, rules, operands = self.mode.value, self.bus.integers, self._operands
        wave, bits, stop = pack(mode, data), length(mode), first_stop(mode)
        if data & PARITY_ERROR and has_parity(mode):
            wave ^= 1 << stop - 1
        if data & (FRAMING_ERROR | BREAK):
            wave &= 0 if data & BREAK else (1 << stop) - 1
        tick = self.brg.value + 1
        sampled = wave if not bit_q8 else sample(wave, bits, edge(rules, operands, start, tick) - start, tick, bit_q8)
        schedule_frame(rules, operands, start, wave, sampled, bit_q8 or self.bit_time << 8)
        self._receiving.value = COMING
        if start > self.now:
            self.events.set(self._rx_event, start)
        else:
            self._rx_due(start)

    def _rx_due(self, due: int) -> None:
        rules = self.bus.integers
        if self._receiving.value != COMING:
            receive(rules, self._operands)
            return
        begin(rules, self._operands)
        if self.mode["ABAUD"]:
            self._edge_bit.value = 0
            self.events.set(self._edge_event, due)

    def _show_top(self) -> None:
        """Set URXDA, PERR and FERR for the character at the head of the FIFO (§10.2)."""
        self.sta.value = int(shown(self._operands, self.sta.value, self._rx_count.value, self._rx[0]))

    def _edge_due(self, due: int) -> None:
        """Report the edges of the RX pin, from the start bit on, to the capture module (autobaud)."""
        bit = self._edge_bit.value
        wave = self._rx_wave.value
        if self._capture is not None:
            self._capture.edge(due, bool(wave >> bit & 1))
        for index in range(bit + 1, 16):
            if wave >> index & 1 != wave >> bit & 1:
                self._edge_bit.value = index
                edge = self._rx_start.value + (index * self._rx_bit.value + 128 >> 8)
                self.events.set(self._edge_event, max(edge, due + 1))
                return

    # -- control -----------------------------------------------------------------------------------------------------

    def _mode_written(self, old: int, new: int, _lanes: int) -> None:
        enable = 1 << self.context.chip.sfrs[self.mode.name].fields["UARTEN"][0]
        if (old ^ new) & enable:
            if new & enable:
                self._clock.value = self.now + 1
                self._rx_port.claim(self._rx_pin, drive=False, level=0)
                self._transmitter_switched(self.is_sending_enabled)
                self._switch_break(bool(self.sta["UTXBRK"]) and self.is_sending_enabled)
            else:
                self._abort()
        if "ALTIO" in self.context.chip.sfrs[self.mode.name].fields and self.mode["ALTIO"]:
            # UNVERIFIED: the package does not connect the alternate pins (§10).
            self.bus.report_unmodelled(f"{self.mode.name}.ALTIO: the UART keeps its standard pins")
        self.restored()
        self._plan_line()

    def _sta_written(self, old: int, new: int, _lanes: int) -> None:
        fields = self.context.chip.sfrs[self.sta.name].fields
        utxen, utxbrk, oerr = (1 << fields[name][0] for name in ("UTXEN", "UTXBRK", "OERR"))
        if (old ^ new) & utxen and self.is_enabled:
            self._transmitter_switched(bool(new & utxen))
        self._switch_break(bool(new & utxbrk) and self.is_sending_enabled)
        if old & oerr and not new & oerr:  # only a change from 1 to 0 flushes the FIFO (§10.2)
            self._rx_count.value = 0
            self._held.value = 0
            self._show_top()

    def _transmitter_switched(self, on: bool) -> None:
        """Enable or disable the transmitter, which is on while UARTEN and UTXEN are both 1 (§10.1)."""
        self.restored()
        if on:
            self._tx_port.claim(self._tx_pin, drive=True, level=1)
            self._interrupts.line(self.site.tx_irq).request()
            if self._tx_count.value:
                self._clock.value = self.now + 1
                self.events.set(self._tx_event, self.now + 1)
            return
        self._switch_break(False)
        self._tx_port.release(self._tx_pin)
        self._tx_count.value = 0
        self._shifting.value = 0
        self._start.value = self._end.value = NEVER
        self.events.cancel(self._tx_event)
        self.sta["UTXBF"] = 0
        self.sta["TRMT"] = 1

    def _abort(self) -> None:
        """Handle UARTEN = 0: clear FIFOs, flags and the baud counter; keep MODE and BRG (§10.1)."""
        self._transmitter_switched(False)
        self._rx_port.release(self._rx_pin)
        self._rx_count.value = 0
        self._held.value = 0
        self._stop_receiving()
        for flag in ("URXDA", "OERR", "FERR", "PERR", "UTXEN", "UTXBRK"):
            self.sta[flag] = 0

    def _stop_receiving(self) -> None:
        """Abort a reception, whose character is lost."""
        self._receiving.value = QUIET
        for slot in (self._rx_event, self._edge_event):
            self.events.cancel(slot)
        self.sta["RIDLE"] = 1

    def release_pins(self) -> None:
        """Release TX and RX to LAT and TRIS."""
        self._tx_port.release(self._tx_pin)
        self._rx_port.release(self._rx_pin)

    def _brg_written(self, old: int, _new: int, _lanes: int) -> None:
        """Handle a write to BRG. The baud counter restarts (§10), so the current bit lasts one more bit time.

        UNVERIFIED: a character that is being received keeps its initial rate.
        """
        following, before, bit = self.now + 1, 16 * (old + 1), self.bit_time
        self._clock.value = following
        if not self._shifting.value or following >= self._end.value:
            return
        in_loopback = bool(self.mode["LPBACK"]) and self._receiving.value and self._rx_start.value == self._start.value
        began = self._bit_began.value
        passed = max(following - began, 0) // before
        bits = (self._end.value - began) // before - passed
        if following > began:
            self._wave.value >>= passed
            self._bit_began.value = following
        else:  # the start bit has not begun yet
            self._start.value = self._bit_began.value = following + bit
        self._end.value = self._bit_began.value + bits * bit
        self.events.set(self._tx_event, self._end.value)
        if in_loopback:  # in loopback, the receiver follows the transmitter
            self._rx_start.value = self._start.value
            self._done.value = self._end.value - stops(self.mode.value) * bit + bit // 2
            is_coming = self._receiving.value == COMING
            self.events.set(self._rx_event, self._start.value if is_coming else self._done.value)

    # -- power and reset ---------------------------------------------------------------------------------------------

    def reset(self, power_on: bool) -> None:
        """Reset to disabled and empty. Queued frames belong to the environment and remain."""
        self.restored()
        self._tx_count.value = self._shifting.value = 0
        self._rx_count.value = self._held.value = self._receiving.value = 0
        self._start.value = self._end.value = NEVER
        self._break_began.value = NEVER
        self._clock.value = 0
        self._plan_line()

    def freeze(self, cycle: int, mode: int) -> None:
        """Stop the clock. Idle with USIDL suspends transfers. Sleep aborts them, and TX then idles high.

        UNVERIFIED: Sleep also aborts a reception in progress; §10 does not say so.
        """
        if mode == SLEEP and (self._shifting.value or self._tx_count.value):
            self.events.cancel(self._tx_event)
            self._tx_count.value = self._shifting.value = 0
            self._start.value = self._end.value = NEVER
            self.sta["UTXBF"] = 0
            self.sta["TRMT"] = 1
        if mode == SLEEP:
            self._stop_receiving()
        super().freeze(cycle, mode)

    def restored(self) -> None:
        """Attach the waveform to the TX pin while the transmitter is enabled."""
        if self.is_sending_enabled:
            self.context.pins.attach(self._tx_port.index, self._tx_pin, self._pin)
        else:
            self.context.pins.detach(self._tx_port.index, self._pin)
        self._at_once.set(self._listeners.urgent)
        if self._capture is not None:
            self._capture.autobaud = bool(self.mode["ABAUD"])

    def thaw(self, cycle: int) -> None:
        """Resume the clock. Frames that waited for the receiver may then arrive."""
        super().thaw(cycle)
        self._plan_line()
