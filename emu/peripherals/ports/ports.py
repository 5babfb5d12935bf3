"""I/O ports, change notification and the external interrupt pins (§6, §5.5)."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Final

from emu.peripherals.base import ChipContext, Peripheral
from emu.peripherals.interrupt_lines import Interrupts
from emu.peripherals.pins import PORTS, parse_pin
from emu.peripherals.ports.rules import ByteStream, PortOperands, read_port, write_latch, write_port
from emu.system.events import NEVER
from emu.system.rules import Rule, cell_of


class Port(Peripheral):
    """One port: TRIS, PORT and LAT, and the pins that other peripherals use."""

    def __init__(self, letter: str, context: ChipContext) -> None:
        super().__init__("port" + letter, context)
        self.index: Final = PORTS.index(letter)
        self.mask: Final = context.chip.sfrs["TRIS" + letter].mask
        context.pins.analog[self.index] = ~self.mask & 0xFFFF  # pins that the package lacks read 0
        self.tris: Final = self.register("TRIS" + letter)
        self.port: Final = self.register("PORT" + letter)
        self.lat: Final = self.register("LAT" + letter)
        self.tris.written_by(self._changed)
        self.lat.written_by(self._changed)
        self.port.written_by(self._port_written)
        self.port.computed(lambda: self.context.pins.read_port(self.index, self.now))
        self._owned: Final = self.cell("owned", "H")
        self._own_drive: Final = self.cell("own_drive", "H")
        self._own_level: Final = self.cell("own_level", "H")
        self._set_rules()

    def _set_rules(self, byte_stream: ByteStream | None = None) -> None:
        """Set the rules of PORT and LAT. `byte_stream` describes bytes that an external device outputs on the pins."""
        record = self.record
        arrays = ("output", "level", "drive", "analog", "eager", "lazy", "before", "waveform_pins", "constant_levels",
                  "constant_until", "changed")  # fmt: skip
        operands = PortOperands(
            number=self.index,
            implemented=self.context.chip.sfrs[self.lat.name].writable,
            lat=self.lat.cell,
            port=self.port.cell,
            owned=self._owned.cell,
            ring=cell_of(record, "pins.ring"),
            ring_size=record.fields["pins.ring"].count,
            ring_count=cell_of(record, "pins.ring_count"),
            byte_stream=byte_stream,
            native=self.context.pins.native_cell(self.index),
            **{name: cell_of(record, f"pins.{name}", self.index) for name in arrays},
        )
        self.lat.set_rule(Rule(operands, None, write_latch))
        self.port.set_rule(Rule(operands, read_port, write_port))

    def attach_byte_stream(self, byte_stream: ByteStream, refresh: Callable[[int], bool]) -> None:
        """Let rules read the bytes of an attached waveform from the record. For `refresh` see `Bus.refresh`."""
        self._set_rules(byte_stream)
        self.bus.refresh[self.port.address >> 1] = refresh

    def stops_in(self, mode: int) -> bool:
        """Return False: latches and pin watchers work in every power mode."""
        return False

    def reset(self, power_on: bool) -> None:
        """Reset: all pins become inputs (TRIS = ones), and peripherals release them to the port.

        LAT does not change; its value is undefined.
        """
        self._owned.value = 0
        self._own_drive.value = 0
        self._own_level.value = 0
        self._drive(self.now)

    def claim(self, mask: int, drive: bool, level: int) -> None:
        """Take pins for a peripheral from the next cycle on.

        Drive them with `level` if `drive`, else leave them undriven.
        """
        self._owned.value |= mask
        self._own_drive.value = self._own_drive.value & ~mask | (mask if drive else 0)
        self._own_level.value = self._own_level.value & ~mask | (mask if level else 0)
        self._drive(self.now + 1)

    def release_now(self, mask: int) -> None:
        """Release pins to LAT and TRIS in the current cycle. Events call this."""
        self._owned.value &= ~mask
        self._drive(self.now)

    def claim_now(self, mask: int, drive: bool, level: int) -> None:
        """Take pins for a peripheral in the current cycle. Events call this."""
        self._owned.value |= mask
        self._own_drive.value = self._own_drive.value & ~mask | (mask if drive else 0)
        self._own_level.value = self._own_level.value & ~mask | (mask if level else 0)
        self._drive(self.now)

    def drive_now(self, mask: int, owned: int, levels: int, cycle: int) -> None:
        """From `cycle` on, drive the pins in `owned` with `levels`, and release the others in `mask`."""
        self._owned.value = self._owned.value & ~mask | owned
        self._own_drive.value = self._own_drive.value & ~mask | owned
        self._own_level.value = self._own_level.value & ~mask | levels & owned
        self._drive(cycle)

    def release(self, mask: int) -> None:
        """Release pins to LAT and TRIS from the next cycle on."""
        self._owned.value &= ~mask
        self._drive(self.now + 1)

    def _port_written(self, _old: int, new: int, lanes: int) -> None:
        """Handle a write to PORT, which writes LAT. Read-modify-write instructions thus copy pin levels to LAT (§6)."""
        self.lat.value = (self.lat.value & ~lanes | new & lanes) & self.mask
        self._drive(self.now + 1)

    def _changed(self, _old: int, _new: int, _lanes: int) -> None:
        self._drive(self.now + 1)

    def _drive(self, cycle: int) -> None:
        owned = self._owned.value
        pins = self.context.pins
        pins.drive[self.index] = (self._own_drive.value & owned | ~self.tris.value & ~owned) & self.mask
        pins.output[self.index] = (self._own_level.value & owned | self.lat.value & ~owned) & self.mask
        pins.apply(self.index, cycle, by_chip=True)


class ChangeNotice(Peripheral):
    """CN0-CN23: CNIF rises one cycle after an enabled input pin changes (§6.2). Controls the pull-ups of open pins."""

    def __init__(self, context: ChipContext, irq: int) -> None:
        super().__init__("cn", context)
        self._enables: Final = [self.register(name) for name in ("CNEN1", "CNEN2")]
        self._pullups: Final = [self.register(name) for name in ("CNPU1", "CNPU2")]
        for register in self._pullups:
            register.written_by(self._pull)
        self._line: Final = self.irq(irq)
        self._flag: Final = self.slot("flag", lambda _due: self._line.request())
        self._pins: Final = [(number, *parse_pin(name)) for number, name in enumerate(context.chip.change_pins) if name]
        self._tris: Final = {port: context.chip.sfrs["TRIS" + PORTS[port]].address >> 1 for _, port, _ in self._pins}
        for port in self._tris:
            mask = sum(bit for _, pin_port, bit in self._pins if pin_port == port)
            context.pins.watch_port(port, mask, partial(self._edge, port), inputs_only=True)

    def stops_in(self, mode: int) -> bool:
        """Return False: change notification can wake the chip from Sleep."""
        return False

    def reset(self, power_on: bool) -> None:
        """Reset: all pull-ups are off."""
        self._pull(0, 0, 0)

    def _edge(self, port: int, cycle: int, changed: int, _levels: int) -> None:
        """Post the rise of CNIF for a change of an enabled input pin.

        UNVERIFIED: silicon compares with the level at the last PORT read, this model with the level one Tcy earlier.
        """
        inputs = changed & self.record.u16[self._tris[port]]
        enabled = self._enables[0].value | self._enables[1].value << 16
        for number, pin_port, bit in self._pins:
            if pin_port == port and inputs & bit and enabled >> number & 1:
                if self.events.due(self._flag) == NEVER:
                    self.events.set(self._flag, cycle + 1)
                return

    def _pull(self, _old: int, _new: int, _lanes: int) -> None:
        pulled = self._pullups[0].value | self._pullups[1].value << 16
        for port in self._tris:
            self.context.pins.pullup[port] = sum(
                bit for number, pin_port, bit in self._pins if pin_port == port and pulled >> number & 1
            )
            self.context.pins.apply(port, self.now + 1)


class ExternalInterrupts(Peripheral):
    """INT0-INT4: a flag rises one cycle after the selected edge on its pin, whatever drives the pin (§5.5)."""

    def __init__(self, context: ChipContext, interrupts: Interrupts) -> None:
        super().__init__("int", context)
        self._interrupts: Final = interrupts
        self._control: Final = context.chip.sfrs["INTCON2"].address >> 1
        self._waiting: Final = self.cell("waiting", "B")
        self._flag: Final = self.slot("flag", self._raise)
        self._irqs: Final = [irq for _, irq in context.chip.external_pins]
        self.on_int0: Callable[[int], None] | None = None
        """Called with the cycle in which the INT0 flag rises, which is an ADC trigger (§13)."""
        for number, (pin, _) in enumerate(context.chip.external_pins):
            context.pins.watch(pin, partial(self._edge, number))

    def stops_in(self, mode: int) -> bool:
        """Return False: external interrupts can wake the chip from Sleep."""
        return False

    def reset(self, power_on: bool) -> None:
        """Reset: discard pending edges."""
        self._waiting.value = 0

    def _edge(self, number: int, cycle: int, changed: int, levels: int) -> None:
        falling_edge_chosen = self.record.u16[self._control] >> number & 1
        if bool(levels & changed) != bool(falling_edge_chosen):
            self._waiting.value |= 1 << number
            if self.events.due(self._flag) == NEVER:
                self.events.set(self._flag, cycle + 1)

    def _raise(self, due: int) -> None:
        waiting = self._waiting.value
        self._waiting.value = 0
        for number, irq in enumerate(self._irqs):
            if waiting >> number & 1:
                self._interrupts.line(irq).request()
        if waiting & 1 and self.on_int0 is not None:
            self.on_int0(due)
