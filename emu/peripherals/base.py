"""Base class of the peripherals, their context (chip, bus, pins, CPU signals) and their cells in the record.

A device keeps its state only in record cells, so a snapshot is complete. Cells that hold a cycle number are called
*timestamps*. If a device's clock stops (Sleep, or Idle with its SIDL bit set) and resumes, `thaw` shifts its timestamps
and pending events by the lost time.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Final

from emu.chips.chip import Chip
from emu.peripherals.pins import Pins
from emu.system.bus import Bus
from emu.system.device import Device, Irq, Register
from emu.system.events import NEVER
from emu.system.program import ProgramMemory
from emu.system.record import Record
from emu.system.rules import Rule, cell_of

IDLE: Final = 1
"""Power mode after PWRSAV #1: the CPU is stopped, peripherals run unless their SIDL bit is set (§17)."""
SLEEP: Final = 2
"""Power mode after PWRSAV #0: the system clock is stopped (§17)."""


def _ignore(*_arguments: object) -> None:
    """Ignore a signal. Every callback has this default."""


@dataclass
class CpuSignals:
    """Signals from the peripherals to the CPU. The machine sets the callbacks; the defaults ignore the signal."""

    reset: Callable[[str], None] = _ignore
    """reset(cause): a peripheral resets the chip; cause is an RCON bit name, for example "WDTO"."""
    wake: Callable[[], None] = _ignore
    """Called when the watchdog expires while the CPU sleeps: execution continues (§4)."""
    stall_until: Callable[[int], None] = _ignore
    """stall_until(cycle): the CPU starts no instruction before that cycle, while flash is programmed (§16)."""
    run: Callable[[int], Any] = _ignore
    """run(cycles): run the machine for at most that many cycles and return a `Stop`.

    Only for callers outside the machine.
    """
    end_run: Callable[[], None] = _ignore
    """End the current `run` at the next instruction boundary."""
    trap: Callable[[str], None] = _ignore
    """trap(flag): set a trap flag of INTCON1; flag is its name, for example "OSCFAIL" (§5.1)."""


class StateCell:
    """One scalar in the machine's record."""

    __slots__ = ("_view", "cell", "index")

    def __init__(self, record: Record, name: str, kind: str, initial: int = 0) -> None:
        self.index: Final = record.reserve(name, kind).index
        self._view: Final = record.view(kind)
        self._view[self.index] = initial
        self.cell: Final = cell_of(record, name)
        """The scalar as an operand for rules."""

    @property
    def value(self) -> int:
        """The stored number, within the range of its kind."""
        return self._view[self.index]

    @value.setter
    def value(self, number: int) -> None:
        self._view[self.index] = number

    def set(self, number: int) -> None:
        """Assign `value`; for use as a callback."""
        self._view[self.index] = number


@dataclass
class ChipContext:
    """Shared objects that a device may use."""

    chip: Chip
    bus: Bus
    pins: Pins
    program: ProgramMemory
    cpu_signals: CpuSignals
    crystal: int
    """Frequency at OSC1 in Hz."""
    fcy: Callable[[], float] = lambda: 0.0
    """Tcy per second at the current clock. The oscillator sets it."""
    power_mode: Callable[[], int] = lambda: 0
    """0 while the CPU runs, else IDLE or SLEEP. The watchdog sets it."""
    in_seconds: list[int] = field(default_factory=list)
    """Event slots whose delay is a time in seconds. The oscillator reschedules them when it changes the Tcy."""


class Peripheral(Device):
    """Base class of the peripherals: registers, interrupt lines, cells and event slots by name."""

    idle_bit: tuple[Register, str] | None = None
    """Control register and bit name (xSIDL) of the bit that stops the device in Idle."""

    def __init__(self, name: str, context: ChipContext) -> None:
        super().__init__(name, context.bus)
        self.context: Final = context
        self._timestamps: Final[list[StateCell]] = []
        self._slots: Final[list[tuple[int, StateCell]]] = []
        self._frozen: Final = self.cell("frozen", "Q", NEVER)

    def register(self, name: str) -> Register:
        """The register called `name` in the chip's data. Raises KeyError if the chip has none."""
        sfr = self.context.chip.sfrs[name]
        return Register(self.bus, name, sfr.address, sfr.fields)

    def irq(self, number: int) -> Irq:
        """The request line of interrupt `number` (natural order)."""
        flag, bit = self.context.chip.interrupts[number].flag
        return Irq(self.record, self.events, self.context.chip.sfrs[flag].address, bit)

    def cell(self, purpose: str, kind: str = "I", initial: int = 0) -> StateCell:
        """Reserve a scalar of hidden state, named `<device>.<purpose>`."""
        return StateCell(self.record, f"{self.name}.{purpose}", kind, initial)

    def array(self, purpose: str, kind: str, count: int) -> memoryview[int]:
        """Reserve `count` elements of hidden state ("B", "H", "I" or "Q"), named `<device>.<purpose>`."""
        return self.record.reserve_array(f"{self.name}.{purpose}", kind, count)

    def timestamp(self, purpose: str, initial: int = 0) -> StateCell:
        """Reserve a timestamp: a cell that holds a cycle number of this device's clock."""
        cell = self.cell(purpose, "Q", initial)
        self._timestamps.append(cell)
        return cell

    def slot(self, purpose: str, fire: Callable[[int], None], *, in_seconds: bool = False) -> int:
        """Reserve an event slot that runs on this device's clock.

        `in_seconds`: the delay is a time in seconds and does not depend on the length of a Tcy.
        """
        slot = self.events.slot(f"{self.name}.{purpose}", fire)
        self._slots.append((slot, self.cell(f"{purpose}.held", "Q", NEVER)))
        if in_seconds:
            self.context.in_seconds.append(slot)
        return slot

    def set_event_rule(self, slot: int, rule: Rule) -> None:
        """Let `rule` handle the events of `slot` if its conditions hold."""
        self.events.set_rule(slot, rule, self.bus.integers.fire)

    @property
    def clock(self) -> int:
        """The device's own time: the current cycle, or the cycle at which its clock stopped."""
        return min(self.events.now, self._frozen.value)

    def power_up(self, power_on: bool) -> None:
        """Restart the clock, cancel pending events and reset the device."""
        self._frozen.value = NEVER
        for slot, held in self._slots:
            self.events.cancel(slot)
            held.value = NEVER
        self.reset(power_on)

    def remaining_delay(self, slot: int) -> int:
        """Return the delay in Tcy that `slot` had left when the clock stopped; NEVER if it was not pending."""
        held = next(cell.value for one, cell in self._slots if one == slot)
        return NEVER if held == NEVER else held - self._frozen.value

    def restart(self) -> None:
        """Reset only this device, after PMD has cleared its registers."""
        self.power_up(power_on=False)
        self.release_pins()

    def release_pins(self) -> None:
        """Release the device's pins to LAT and TRIS. At a chip reset, the ports do this (§6)."""

    def before_disable(self) -> None:
        """Prepare the device before PMD clears its registers."""

    def stops_in(self, mode: int) -> bool:
        """Whether the device's clock stops in power mode `mode`."""
        if mode == SLEEP:
            return True
        return mode == IDLE and self.idle_bit is not None and bool(self.idle_bit[0][self.idle_bit[1]])

    def freeze(self, cycle: int, mode: int) -> None:
        """Stop the device's clock in power mode `mode` and suspend its pending events."""
        self._frozen.value = cycle
        for slot, held in self._slots:
            held.value = self.events.due(slot)
            self.events.cancel(slot)

    def thaw(self, cycle: int) -> None:
        """Resume the device's clock at `cycle`. Shift timestamps and pending events by the lost time."""
        lost = cycle - self._frozen.value
        self._frozen.value = NEVER
        for cell in self._timestamps:
            if cell.value != NEVER:
                cell.value += lost
        for slot, held in self._slots:
            if held.value != NEVER:
                self.events.set(slot, held.value + lost)
                held.value = NEVER

    @property
    def is_frozen(self) -> bool:
        """Whether the device's clock is stopped."""
        return self._frozen.value != NEVER

    def restored(self) -> None:
        """Rebuild state derived from the record, after a snapshot was restored."""
