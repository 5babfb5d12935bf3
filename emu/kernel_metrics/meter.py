"""Exact cycles between two points of a running kernel, with their distribution over instructions.

Input: a `Target` stopped at the first point. Output: a `Window`. The machine single-steps only within a window.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final

from emu.debug.unwind import RETURN_BYTES
from emu.dspic30f.state.state import STACK_POINTER
from emu.kernel_metrics.observation import EXCEPTION_ENTRY
from emu.kernel_metrics.target import MeasureError, Target
from emu.system.device import flag_since
from emu.system.events import NEVER

MAX_WINDOW_CYCLES: Final = 100_000
"""Tcy after which the end of a window counts as not reachable."""
BEFORE_WINDOW: Final = -2
"""Address under which the cycles before the first instruction of a window are counted."""


@dataclass(slots=True)
class Window:
    """Interval between two points. `where` distributes its `cycles` over instruction addresses."""

    cycles: int
    interrupted: bool
    """Whether an exception was entered during the window."""
    where: Counter[int] = field(default_factory=Counter)


class Meter:
    """Measures windows by running a machine in single steps."""

    def __init__(self, target: Target) -> None:
        self.target: Final = target
        self.machine: Final = target.machine

    def measure_until(self, end: Callable[[], bool], start: int | None = None) -> Window:
        """Step until `end()` is true at an instruction boundary. `start` is the first counted cycle (default: now)."""
        machine = self.machine
        begin = machine.cycle if start is None else start
        window = Window(0, False)
        if machine.cycle > begin:
            window.where[BEFORE_WINDOW] = machine.cycle - begin
        while True:
            cycle, pc = machine.cycle, machine.pc
            if machine.service_boundary(NEVER) is not None or cycle - begin > MAX_WINDOW_CYCLES:
                raise MeasureError(
                    f"the end was not reached within {cycle - begin} cycles; the program is at {self.place(machine.pc)}"
                )
            if machine.pc != pc:
                window.interrupted = True
                window.where[EXCEPTION_ENTRY] += machine.cycle - cycle
            if end():
                window.cycles = machine.cycle - begin
                return window
            cycle, address = machine.cycle, machine.pc
            if machine.step() is not None:
                raise MeasureError(f"the machine stopped at {self.place(address)}")
            window.where[address] += machine.cycle - cycle

    def place(self, pc: int) -> str:
        """Return the source line of an address, or its symbol if it has no line."""
        line = self.target.image.lines.find(pc)
        return str(line) if line else self.target.image.symbols.text(pc).split("+")[0]

    def inside(self, name: str) -> Callable[[], bool]:
        """Return a predicate: whether the next instruction belongs to the function `name`."""
        first = self.target.address(name)
        last = first + (self.target.size(name) or 2)
        return lambda: first <= self.machine.pc < last

    def returned(self) -> Callable[[], bool]:
        """Return a predicate: whether the function that is about to be entered has returned."""
        machine = self.machine
        stack = machine.w[STACK_POINTER] - RETURN_BYTES
        back = (machine.peek(stack + 2) & 0x7F) << 16 | machine.peek(stack)
        return lambda: machine.pc == back and machine.w[STACK_POINTER] == stack

    def rise(self, irq_name: str) -> int:
        """Return the cycle of an interrupt flag's last rise."""
        chip, record = self.machine.chip, self.machine.record
        source = next(s for s in chip.interrupts.values() if s.name == irq_name)
        register, bit = source.flag
        return int(record.u64[flag_since(record, chip.sfrs[register].address, bit)])

    def level(self, irq_name: str) -> int:
        """Return the configured priority of an interrupt."""
        source = next(s for s in self.machine.chip.interrupts.values() if s.name == irq_name)
        group, shift = source.priority
        return int(self.machine.peek(group)) >> shift & 7

    def request(self, irq_name: str, priority: int) -> None:
        """Enable an interrupt at `priority` and set its flag, as a device does."""
        machine = self.machine
        source = next(s for s in machine.chip.interrupts.values() if s.name == irq_name)
        group, shift = source.priority
        machine.write(group, machine.peek(group) & ~(7 << shift) | priority << shift)
        for register, bit in (source.enable, source.flag):
            machine.write(register, machine.peek(register) | 1 << bit)

    def release(self, irq_name: str) -> None:
        """Clear an interrupt's flag, as its handler does."""
        machine = self.machine
        source = next(s for s in machine.chip.interrupts.values() if s.name == irq_name)
        register, bit = source.flag
        machine.write(register, machine.peek(register) & ~(1 << bit))
