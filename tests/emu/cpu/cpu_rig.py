"""A machine with a small assembly program in flash, and measurements of its cycles.

Programs use the syntax of the instruction table: statements on lines or separated by `|`, `label:` before one, `.word`
for a raw program word. They start at START in cycle 0. The stack limit is not armed, and all W registers count as
initialised.
"""

from __future__ import annotations

from dataclasses import dataclass

from emu.dspic30f.isa.text import parse
from emu.machine.machine import Machine
from emu.machine.stops import Stop
from emu.system.device import Irq

START = 0x200
RAM = 0x1000
STACK = 0x0900
TABLE = 0x8000
"""Data address of PSV window offset 0."""


@dataclass
class _Expression:
    value: int | None


def assemble(text: str, start: int = START) -> tuple[dict[int, int], dict[str, int]]:
    """Return the program words by address, and the labels."""
    statements, labels, pc = [], {}, start

    def value(token: str) -> _Expression:
        try:
            return _Expression(int(token, 0))
        except ValueError:
            return _Expression(labels.get(token, 0))

    for line in text.replace("|", "\n").splitlines():
        line = line.partition(";")[0].strip()
        while ":" in line:
            label, _, line = line.partition(":")
            labels[label.strip()] = pc
            line = line.strip()
        if line:
            statements.append((pc, line))
            pc += 2 if line.startswith(".word") else 2 * parse(line, value).words
    words = {}
    for pc, line in statements:
        if line.startswith(".word"):
            words[pc] = int(line.split()[1], 0)
            continue
        for offset, word in enumerate(parse(line, value).encode(pc)):
            words[pc + 2 * offset] = word
    return words, labels


class Rig:
    """Machine with an assembly program at START."""

    def __init__(self, text: str, engine: str = "plain", ipl_slip: int = 0, **w: int) -> None:
        self.machine = Machine(engine=engine, ipl_slip=ipl_slip)
        self.machine.program.put(0xF80002, 0x7FFF)  # FWDT: no watchdog
        self.machine.reset("POR")
        words, self.labels = assemble(text)
        for address, word in words.items():
            self.machine.program.put(address, word)
        self.machine.pc = START
        for number in range(15):
            self.machine.w[number] = RAM + 0x40 * number
        self.machine.w[15] = STACK
        for name, value in w.items():
            self.machine.w[int(name[1:])] = value
        self.arrivals: list[tuple[str, int]] = []

    def vector(self, address: int, label: str) -> None:
        """Point an exception vector at a label."""
        self.machine.program.put(address, self.labels[label])

    def window(self, *words: int, page: int = 1) -> None:
        """Enable PSV with `words` at the start of the window: program page 1 begins at 0x8000 (isa.md §7.8)."""
        for index, word in enumerate(words):
            self.machine.program.put(page << 15 | 2 * index, word)
        self.machine.poke("PSVPAG", page)
        self.machine.poke("CORCON", 0x0024)

    def at(self, cycle: int, action) -> None:
        """Call `action` as a device event in `cycle`."""
        slot = self.machine.events.slot(f"test {cycle}", lambda due: action())
        self.machine.events.set(slot, cycle)

    def interrupt_at(self, cycle: int, irq: int = 3, priority: int = 4) -> None:
        """Enable interrupt `irq` at `priority`; its flag is 1 from `cycle` on."""
        chip = self.machine.chip
        source = chip.interrupts[irq]
        self.enable(irq, priority)
        flag, bit = source.flag
        line = Irq(self.machine.record, self.machine.events, chip.sfrs[flag].address, bit)
        self.at(cycle, line.request)

    def enable(self, irq: int, priority: int) -> None:
        """Enable interrupt `irq` at `priority`."""
        machine = self.machine
        source = machine.chip.interrupts[irq]
        enable, bit = source.enable
        machine.poke(enable, machine.peek(enable) | 1 << bit)
        group, lsb = source.priority
        machine.poke(group, machine.peek(group) & ~(7 << lsb) | priority << lsb)

    def note(self, label: str, stop: bool = False) -> None:
        """Record every cycle in which the instruction at `label` starts; with `stop`, the run ends there."""

        def arrived() -> bool:
            self.arrivals.append((label, self.machine.cycle))
            return stop

        self.machine.hook_pc(self.labels[label], arrived)

    def run(self, cycles: int = 2000) -> Stop:
        """Run until the machine stops, for at most `cycles`."""
        return self.machine.run(cycles)

    def cycles_to(self, label: str = "end") -> int:
        """Return the cycle in which the instruction at `label` starts for the first time."""
        self.note(label, stop=True)
        stop = self.run()
        assert stop.reason == "breakpoint", stop
        return stop.cycle

    def first(self, label: str) -> int:
        """Return the cycle of the first recorded arrival at a label."""
        return next(cycle for name, cycle in self.arrivals if name == label)
