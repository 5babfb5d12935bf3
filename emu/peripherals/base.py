"""What every peripheral is built with: the chip's data, the bus, the pins, and the few wires that lead to the CPU.

Hidden state lives in the record only, in cells reserved by name, so a snapshot is complete. Cells that hold a cycle
number are reserved as *moments*: when a device's clock stops (Sleep, or Idle with its SIDL bit set) and starts again,
its moments and pending events move by the time lost, and the device never notices.
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
from emu.system.rules import Rule, place_of

IDLE: Final = 1
"""Power mode after PWRSAV #1: the CPU stands, peripherals run unless their SIDL bit is set (§17)."""
SLEEP: Final = 2
"""Power mode after PWRSAV #0: the system clock stands (§17)."""


def _nothing(*_arguments: object) -> None:
    """Default of a wire nobody listens to."""


@dataclass
class CpuSignals:
    """Lines from the peripherals to the CPU. The machine fills in what it has; the defaults ignore the signal."""

    reset: Callable[[str], None] = _nothing
    """reset(cause): a peripheral resets the chip; cause is an RCON bit name, for example "WDTO"."""
    wake: Callable[[], None] = _nothing
    """The watchdog ran out while the CPU slept: execution continues (§4)."""
    stall_until: Callable[[int], None] = _nothing
    """stall_until(cycle): no instruction starts before that cycle (flash is being programmed, §16)."""
    run: Callable[[int], Any] = _nothing
    """run(cycles): let the machine run so long; whoever asks stands outside it. Returns how that ended."""
    end_run: Callable[[], None] = _nothing
    """Such a run ends at its next boundary."""
    trap: Callable[[str], None] = _nothing
    """trap(flag): set a trap flag of INTCON1; flag is its name, for example "OSCFAIL" (§5.1)."""


class Cell:
    """One scalar in the record."""

    __slots__ = ("_view", "index", "place")

    def __init__(self, record: Record, name: str, kind: str, initial: int = 0) -> None:
        self.index: Final = record.reserve(name, kind).index
        self._view: Final = {"B": record.u8, "H": record.u16, "I": record.u32, "Q": record.u64, "q": record.s64}[kind]
        self._view[self.index] = initial
        self.place: Final = place_of(record, name)
        """For rules."""

    @property
    def value(self) -> int:
        """The number held, in the range of its kind."""
        return self._view[self.index]

    @value.setter
    def value(self, number: int) -> None:
        self._view[self.index] = number

    def set(self, number: int) -> None:
        """As an assignment to `value`."""
        self._view[self.index] = number


@dataclass
class ChipContext:
    """Everything a peripheral may touch."""

    chip: Chip
    bus: Bus
    pins: Pins
    program: ProgramMemory
    cpu_signals: CpuSignals
    crystal: int
    """Frequency at OSC1 in Hz."""
    fcy: Callable[[], float] = lambda: 0.0
    """Tcy per second at present; supplied by the oscillator."""
    power_mode: Callable[[], int] = lambda: 0
    """0 while the CPU runs, IDLE or SLEEP; supplied by the watchdog."""
    in_seconds: list[int] = field(default_factory=list)
    """Event slots that are due after a time in seconds: the oscillator moves them when it changes the Tcy."""


class Peripheral(Device):
    """Base of the peripherals: registers, interrupt lines, cells and event slots by name."""

    idle_bit: tuple[Register, str] | None = None
    """Control register and name of the bit that stops the device in Idle."""

    def __init__(self, name: str, context: ChipContext) -> None:
        super().__init__(name, context.bus)
        self.context: Final = context
        self._moments: Final[list[Cell]] = []
        self._slots: Final[list[tuple[int, Cell]]] = []
        self._frozen: Final = self.cell("frozen", "Q", NEVER)

    def register(self, name: str) -> Register:
        """The register called `name` in the chip's data. Raises KeyError if the chip has none."""
        sfr = self.context.chip.sfrs[name]
        return Register(self.bus, name, sfr.address, sfr.fields)

    def irq(self, number: int) -> Irq:
        """The request line of interrupt `number` (natural order)."""
        flag, bit = self.context.chip.interrupts[number].flag
        return Irq(self.record, self.events, self.context.chip.sfrs[flag].address, bit)

    def cell(self, purpose: str, kind: str = "I", initial: int = 0) -> Cell:
        """Reserve a scalar of hidden state under `<device>.<purpose>`."""
        return Cell(self.record, f"{self.name}.{purpose}", kind, initial)

    def array(self, purpose: str, kind: str, count: int) -> memoryview[int]:
        """Reserve `count` elements of hidden state ("B", "H", "I" or "Q") under `<device>.<purpose>`."""
        field = self.record.reserve(f"{self.name}.{purpose}", kind, count)
        view = {"B": self.record.u8, "H": self.record.u16, "I": self.record.u32, "Q": self.record.u64}[kind]
        return view[field.index : field.index + count]

    def moment(self, purpose: str, initial: int = 0) -> Cell:
        """Reserve a cell that holds a cycle number of this device's own clock."""
        cell = self.cell(purpose, "Q", initial)
        self._moments.append(cell)
        return cell

    def slot(self, purpose: str, fire: Callable[[int], None], *, in_seconds: bool = False) -> int:
        """Claim an event slot that belongs to this device's clock. `in_seconds`: another Tcy does not change how long
        it takes."""
        slot = self.events.slot(f"{self.name}.{purpose}", fire)
        self._slots.append((slot, self.cell(f"{purpose}.held", "Q", NEVER)))
        if in_seconds:
            self.context.in_seconds.append(slot)
        return slot

    def ruled(self, slot: int, rule: Rule) -> None:
        """Events of `slot` follow `rule` where it can say what they do."""
        self.events.ruled(slot, rule, self.bus.integers.fire)

    @property
    def clock(self) -> int:
        """The device's own time: the current cycle, or the cycle its clock stopped at."""
        return min(self.events.now, self._frozen.value)

    def power_up(self, power_on: bool) -> None:
        """Forget stopped clocks and pending events, then come up as after a reset."""
        self._frozen.value = NEVER
        for slot, held in self._slots:
            self.events.cancel(slot)
            held.value = NEVER
        self.reset(power_on)

    def remaining_delay(self, slot: int) -> int:
        """How many Tcy behind the stop of this device's clock `slot` is due, NEVER if nothing of it waits."""
        held = next(cell.value for one, cell in self._slots if one == slot)
        return NEVER if held == NEVER else held - self._frozen.value

    def restart(self) -> None:
        """As after a reset of this device alone, which has lost what its registers held."""
        self.power_up(power_on=False)
        self.release_pins()

    def release_pins(self) -> None:
        """Leave pins the device has taken to LAT and TRIS. A reset of the chip does that by itself (§6)."""

    def before_disable(self) -> None:
        """PMD is about to clear the device's registers."""

    def stops_in(self, mode: int) -> bool:
        """Whether the device's clock stands in power mode `mode`."""
        if mode == SLEEP:
            return True
        return mode == IDLE and self.idle_bit is not None and bool(self.idle_bit[0][self.idle_bit[1]])

    def freeze(self, cycle: int, mode: int) -> None:
        """The device's clock stops in power mode `mode`: what is due later waits."""
        self._frozen.value = cycle
        for slot, held in self._slots:
            held.value = self.events.due(slot)
            self.events.cancel(slot)

    def thaw(self, cycle: int) -> None:
        """The device's clock runs again from `cycle`; moments and pending events move by the time lost."""
        lost = cycle - self._frozen.value
        self._frozen.value = NEVER
        for cell in self._moments:
            if cell.value != NEVER:
                cell.value += lost
        for slot, held in self._slots:
            if held.value != NEVER:
                self.events.set(slot, held.value + lost)
                held.value = NEVER

    @property
    def is_frozen(self) -> bool:
        """Whether the device's clock stands."""
        return self._frozen.value != NEVER

    def restored(self) -> None:
        """The record was replaced by a snapshot: rebuild whatever is derived from it."""
