"""SPI1/2 (§12): master and slave, 8 and 16 bits, double-buffered.

The environment exchanges words. As master, the module calls `exchange(word, bits)` at the end of each transfer. As
slave, it is clocked by an external master, which calls `clock_word(word, bit_tcy)`. The levels of SCK and SDO are
functions of the cycle. The module's logic is in `rules.py`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Final

from emu.chips.chip import SpiSite
from emu.peripherals.base import ChipContext, Peripheral
from emu.peripherals.interrupt_lines import Interrupts
from emu.peripherals.pins import parse_pin
from emu.peripherals.ports.ports import Port
from emu.peripherals.spi.rules import (
    SpiOperands,
    begin,
    bit_time,
    finish,
    fire,
    push,
    read_buffer,
    undriven_word,
    waits_to_begin,
    word_bits,
)
from emu.system.events import NEVER
from emu.system.rules import Rule, cell_of, event_slot


class Spi(Peripheral):
    """One SPI module."""

    def __init__(self, site: SpiSite, context: ChipContext, interrupts: Interrupts, ports: dict[int, Port]) -> None:
        super().__init__(f"spi{site.number}", context)
        self._line: Final = interrupts.line(site.irq)
        prefix = f"SPI{site.number}"
        self.stat: Final = self.register(prefix + "STAT")
        self.con: Final = self.register(prefix + "CON")
        self.buf: Final = self.register(prefix + "BUF")
        self.idle_bit = (self.stat, "SPISIDL")
        self.stat.written_by(self._stat_written)
        self.con.written_by(self._con_written)
        self.buf.computed(lambda: self._received.value)
        self._exchange: Callable[[int, int], int] | None = None
        self._has_device: Final = self.cell("has_device", "B")
        self.on_slave_word: Callable[[int, int], None] | None = None
        """on_slave_word(word, cycle): called for each word that an external master has clocked out of this module."""
        self._pins: Final = {role: parse_pin(getattr(site, f"{role}_pin")) for role in ("sck", "sdi", "sdo", "ss")}
        self._ports: Final = ports
        self._waiting: Final = self.cell("waiting", "H")
        self._shift: Final = self.cell("shift", "H")
        self._reply: Final = self.cell("reply", "H")
        self._received: Final = self.cell("received", "H")
        self._busy: Final = self.cell("busy", "B")
        self._start: Final = self.timestamp("start", NEVER)
        self._bit: Final = self.cell("bit", "I")
        self._step: Final = self.slot("step", self._due)
        self._operands: Final = self._rule_operands()
        integers, operands = self.bus.integers, self._operands
        self.buf.set_rule(Rule(operands, writes=push, reads_with_effect=read_buffer))
        self.buf.read_by(lambda: read_buffer(integers, operands))
        self.buf.written_by(self._push)
        self.set_event_rule(self._step, Rule(operands, fires=fire))

    def _rule_operands(self) -> SpiOperands:
        sfrs, (port, pin) = self.context.chip.sfrs, self._pins["sdi"]
        fields = {**sfrs[self.stat.name].fields, **sfrs[self.con.name].fields}
        cells = {name: name for name in ("waiting", "shift", "received", "busy", "start", "has_device")}
        return SpiOperands(
            stat=self.stat.cell,
            con=self.con.cell,
            buf=self.buf.cell,
            bit={name: ((1 << width) - 1) << lsb for name, (lsb, width) in fields.items()},
            spre=fields["SPRE"][0],
            level=cell_of(self.record, "pins.level", port),
            sdi=pin,
            logged=cell_of(self.record, "pins.logged"),
            step=event_slot(self.record, self._step),
            line=self._line.line,
            **{
                cell: cell_of(self.record, f"{self.name}.{name}") for cell, name in (cells | {"bit_tcy": "bit"}).items()
            },
        )

    @property
    def exchange(self) -> Callable[[int, int], int] | None:
        """exchange(word, bits) -> word: the connected device, used while this module is master."""
        return self._exchange

    @exchange.setter
    def exchange(self, device: Callable[[int, int], int] | None) -> None:
        self._exchange = device
        self._has_device.value = device is not None

    @property
    def word_bits(self) -> int:
        """Word length, 8 or 16 bits (MODE16)."""
        return int(word_bits(self.bus.integers, self._operands))

    @property
    def bit_time(self) -> int:
        """Bit time in Tcy as master."""
        return int(bit_time(self.bus.integers, self._operands))

    # -- transfers ---------------------------------------------------------------------------------------------------

    def _push(self, _old: int, new: int, lanes: int) -> None:
        push(self.bus.integers, self._operands, new, lanes)

    def _due(self, due: int) -> None:
        rules, operands = self.bus.integers, self._operands
        if self._busy.value:
            out = self._shift.value
            if not self.con["MSTEN"]:
                word = self._reply.value
                if self.on_slave_word is not None:
                    self.on_slave_word(out, due)
            elif self.exchange is None:
                word = int(undriven_word(rules, operands))
            else:
                word = self.exchange(out, self.word_bits)
            finish(rules, operands, word)
        if waits_to_begin(rules, operands):
            begin(rules, operands, due, self.bit_time)
            self._log_word()

    def clock_word(self, word: int, bit_tcy: int = 16) -> bool:
        """Clock one word through this module as an external master, starting now. Return False if it cannot receive."""
        port, pin = self._pins["ss"]
        selected = not self.con["SSEN"] or not self.context.pins.level[port] & pin
        if not self.stat["SPIEN"] or self.con["MSTEN"] or self._busy.value or self.is_frozen or not selected:
            return False
        self._reply.value = word
        begin(self.bus.integers, self._operands, self.now + 1, bit_tcy)
        self._log_word()
        return True

    # -- pins --------------------------------------------------------------------------------------------------------

    def _take_pins(self) -> None:
        """Take or return the pins as SPIEN requires: SCK, SDI and, unless DISSDO is set, SDO (§12)."""
        if not self.stat["SPIEN"]:
            for port, pin in self._pins.values():
                self._ports[port].release(pin)
        else:
            roles = {"sck": bool(self.con["MSTEN"]), "sdi": False, "sdo": not self.con["DISSDO"]}
            for role, drive in roles.items():
                port, pin = self._pins[role]
                if role == "sdo" and not drive:
                    self._ports[port].release(pin)
                else:
                    self._ports[port].claim(pin, drive, self.con["CKP"] if role == "sck" else 0)
        self.restored()
        port, following = self._pins["sck"][0], self.now + 1
        self.context.pins.log_level(following, port, self._waveform_pins(), self.bits(following))

    def bits(self, cycle: int) -> int:
        """Return the levels of SCK and SDO (§12).

        CKP is the idle level; CKE = 1 means that data changes on the edge from active to idle.
        """
        idle = self.con["CKP"]
        clock, data = idle, 0
        if self._busy.value and cycle >= self._start.value:
            index, phase = divmod(cycle - self._start.value, max(self._bit.value, 1))
            active_first = not self.con["CKE"]
            clock = idle ^ (2 * phase < self._bit.value) ^ (not active_first)
            data = self._shift.value >> max(self.word_bits - 1 - index, 0) & 1
        return (self._pins["sck"][1] if clock else 0) | (self._pins["sdo"][1] if data else 0)

    def rises(self, mask: int, after: int, until: int) -> int:
        """Report no rising edges, because no other device is clocked by SCK."""
        return 0

    def nth_rise(self, mask: int, after: int, count: int) -> int:
        """Report no rising edges, because no other device is clocked by SCK."""
        return NEVER

    def constant_until(self, cycle: int) -> int:
        """Return `cycle` (no guarantee), because idle levels depend on control bits that are plain storage."""
        return cycle

    def changes(self, after: int, until: int) -> Iterable[tuple[int, int, int]]:
        """Return no edges, because `_log_word` logs them."""
        return ()

    def _log_word(self) -> None:
        """Append the edges of the word that begins to the log of pin changes, if there is one."""
        pins, (port, clock) = self.context.pins, self._pins["sck"]
        if pins.edges is None:
            return
        mask = self._waveform_pins()
        start, bit = self._start.value, self._bit.value
        for index in range(self.word_bits):
            for cycle in (start + index * bit, start + index * bit + (bit + 1) // 2):
                pins.log_level(cycle, port, mask, self.bits(cycle))
        pins.log_level(start + self.word_bits * bit, port, mask & clock, clock if self.con["CKP"] else 0)

    def restored(self) -> None:
        """Attach the waveform to SDO and, as master, to SCK while the module is on."""
        self._has_device.value = self._exchange is not None
        port = self._pins["sck"][0]
        self.context.pins.detach(port, self)
        mask = self._waveform_pins()
        if mask:
            self.context.pins.attach(port, mask, self)

    def _waveform_pins(self) -> int:
        """Return the mask of SDO and, as master, SCK while the module is on."""
        mask = self._pins["sck"][1] if self.con["MSTEN"] else 0
        mask |= 0 if self.con["DISSDO"] else self._pins["sdo"][1]
        return mask if self.stat["SPIEN"] else 0

    # -- control -----------------------------------------------------------------------------------------------------

    def _con_written(self, _old: int, _new: int, _lanes: int) -> None:
        if self.con["FRMEN"]:
            self.bus.report_unmodelled(f"{self.con.name}.FRMEN: frame sync pulses")
        self._take_pins()

    def _stat_written(self, old: int, new: int, _lanes: int) -> None:
        enable = 1 << self.context.chip.sfrs[self.stat.name].fields["SPIEN"][0]
        if (old ^ new) & enable:
            if not new & enable:
                self._clear()
            self._take_pins()

    def _clear(self) -> None:
        """Clear buffers and flags, as a write of SPIEN = 0 does (§12)."""
        for flag in ("SPITBF", "SPIRBF", "SPIROV"):
            self.stat[flag] = 0
        self._busy.value = 0
        self._start.value = NEVER
        self.events.cancel(self._step)

    def release_pins(self) -> None:
        """Release all pins to LAT and TRIS, because SPIEN is 0."""
        self._take_pins()

    def stops_in(self, mode: int) -> bool:
        """Whether the clock stops.

        UNVERIFIED: a slave, which has an external clock, continues in Sleep; §12 does not cover this.
        """
        return bool(self.con["MSTEN"]) and super().stops_in(mode)

    def freeze(self, cycle: int, mode: int) -> None:
        """Stop the clock. UNVERIFIED: the current word is lost, the word in TXB remains; §12 does not cover Sleep."""
        self._busy.value = 0
        self._start.value = NEVER
        self.events.cancel(self._step)
        super().freeze(cycle, mode)

    def thaw(self, cycle: int) -> None:
        """Resume the clock and send the word in TXB."""
        super().thaw(cycle)
        if self.stat["SPITBF"]:
            self.events.set(self._step, cycle + 1)

    def reset(self, power_on: bool) -> None:
        """Reset to off, with empty buffers."""
        self._clear()
        self._received.value = 0
        self.restored()
