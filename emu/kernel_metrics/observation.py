"""Observation of a running kernel: callbacks at addresses, at changed words and at changes of the CPU priority.

Input: a machine with the plain engine. The firmware has no instrumentation and runs the same cycles as without an
observer. Every instruction and every interrupt entry passes through here, so that each callback sees the machine
between two instructions.
"""

from __future__ import annotations

from array import array
from bisect import bisect_left
from collections import Counter, defaultdict
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any, Final

from emu.dspic30f.exceptions.interrupts import Accepted
from emu.dspic30f.exceptions.power import Sleeping
from emu.dspic30f.state.state import IPL_MASK
from emu.image.model import Image
from emu.instruments.disassembly import items

if TYPE_CHECKING:
    from emu.machine.machine import Machine

DISI_LEVEL: Final = 6
"""Highest priority that DISI masks (isa.md §12)."""
EXCEPTION_ENTRY: Final = -1
"""Address under which the cycles of an exception entry are logged."""
LOGGED: Final = 1 << 20
"""Minimum number of instructions that the log keeps."""

EntryObserver = Callable[[Accepted, int, int], None]
"""observer(exception, cycle before its entry, address of the interrupted instruction)"""


class ExecutionLog:
    """Start cycles and addresses of the last `LOGGED` instructions, or of up to twice as many."""

    def __init__(self) -> None:
        self._cycles: Final = array("q")
        self._addresses: Final = array("i")

    def add(self, cycle: int, address: int) -> None:
        """Append an instruction that starts at `cycle`."""
        self._cycles.append(cycle)
        self._addresses.append(address)
        if len(self._cycles) > 2 * LOGGED:
            del self._cycles[:LOGGED]
            del self._addresses[:LOGGED]

    def cycles(self, begin: int, end: int) -> Counter[int]:
        """Return the cycles from `begin` up to `end` by instruction address."""
        found: Counter[int] = Counter()
        first = max(bisect_left(self._cycles, begin + 1) - 1, 0)
        last = bisect_left(self._cycles, end)
        for index in range(first, last):
            start = max(self._cycles[index], begin)
            stop = self._cycles[index + 1] if index + 1 < last else end
            found[self._addresses[index]] += stop - start
        return found


class Observation:
    """Callbacks on events of `machine` between `start` and `stop`. Raises ValueError for an engine other than plain."""

    def __init__(self, machine: Machine, *, logged: bool = False) -> None:
        if machine.engine != "plain":
            raise ValueError(f"observation needs the plain engine, not {machine.engine!r}")
        self._machine: Final = machine
        self._at: Final[dict[int, list[Callable[[], None]]]] = defaultdict(list)
        self._words: Final[list[list[Any]]] = []
        self._undo: Final[list[tuple[object, str]]] = []
        self.log: Final = ExecutionLog() if logged else None
        self.level_changed: Callable[[int, int, int], None] = lambda cycle, old, new: None
        """Called with the cycle, the old and the new CPU priority, DISI included, before the next instruction."""
        self.entering: EntryObserver = lambda accepted, cycle, pc: None
        """Called before the entry of an exception."""
        self.entered: EntryObserver = lambda accepted, cycle, pc: None
        """Called after the entry of an exception, at the handler's first instruction."""
        self.slept: Callable[[int, int], None] = lambda begin, end: None
        """Called with the first and the last cycle of a sleep."""
        self.is_entering = False
        """Whether an exception is entered: the interrupted code executes no instruction at its priority now."""
        self._level = 0

    def at(self, address: int, callback: Callable[[], None]) -> None:
        """Call `callback` before every execution of the instruction at a program address."""
        self._at[address].append(callback)

    def on_change(self, address: int, callback: Callable[[int, int], None]) -> None:
        """Call `callback` with the old and the new value after an instruction has changed a word of RAM."""
        self._words.append([address >> 1, self._machine.record.u16[address >> 1], callback])

    @property
    def level(self) -> int:
        """The current CPU priority, DISI included."""
        state = self._machine.state
        return max(state.ipl, DISI_LEVEL if state.disi_end > state.cycle else 0)

    def start(self) -> None:
        """Start to observe."""
        core = self._machine.core
        for owner, name, wrap in (
            (core.sequencer, "execute", self._observe_instruction),
            (core.sequencer.exceptions, "enter", self._observe_entry),
            (core.sequencer.power, "pass_time", self._observe_sleep),
        ):
            vars(owner)[name] = wrap(getattr(owner, name))
            self._undo.append((owner, name))

    def stop(self) -> None:
        """Stop observing the machine."""
        while self._undo:
            delattr(*self._undo.pop())

    def _observe_instruction(self, execute: Callable[[], None]) -> Callable[[], None]:
        state, u16, u64 = self._machine.state, self._machine.record.u16, self._machine.record.u64
        sr, disi, clock = state.at["SR"], state.at["cpu.disi_end"], state.at["cpu.cycle"]
        at, words, log = self._at, self._words, self.log
        seen = -1

        def observed() -> None:
            nonlocal seen
            pc = state.pc
            status = u16[sr] & IPL_MASK
            if status != seen or u64[disi]:
                seen = status
                self._update_level(u64[clock])
            if log is not None:
                log.add(u64[clock], pc)
            if pc in at:
                for callback in tuple(at[pc]):
                    callback()
            execute()
            for word in words:
                value = u16[word[0]]
                if value != word[1]:
                    old, word[1] = word[1], value
                    word[2](old, value)

        return observed

    def _update_level(self, cycle: int) -> None:
        old, new = self._level, self.level
        if old != new:
            self._level = new
            self.level_changed(cycle, old, new)

    def _observe_entry(self, enter: Callable[[Accepted, int], None]) -> Callable[[Accepted, int], None]:
        state = self._machine.state

        def entered(accepted: Accepted, last: int) -> None:
            cycle, pc = state.cycle, state.pc
            self.is_entering = True
            self._update_level(cycle)
            self.entering(accepted, cycle, pc)
            if self.log is not None:
                self.log.add(cycle, EXCEPTION_ENTRY)
            enter(accepted, last)
            self._update_level(cycle)
            self.is_entering = False
            self.entered(accepted, cycle, pc)

        return entered

    def _observe_sleep(self, pass_time: Callable[[int], Sleeping]) -> Callable[[int], Sleeping]:
        state = self._machine.state

        def passed(limit: int) -> Sleeping:
            before = state.cycle
            try:
                return pass_time(limit)
            finally:
                if state.cycle > before:
                    self.slept(before, state.cycle)

        return passed


class HookObservation:
    """The callbacks at addresses and at changed words of `Observation`, for every engine and at full speed.

    Hooks after the instructions that store to a word detect its changes. Raises ValueError for a word that the image
    may also store to through a pointer (`stores_to`).
    """

    def __init__(self, machine: Machine) -> None:
        self._machine: Final = machine
        self._hooks: Final[list[tuple[int, Callable[[], None]]]] = []
        self._undo: Final[list[Callable[[], None]]] = []

    def at(self, address: int, callback: Callable[[], None]) -> None:
        """Call `callback` before every execution of the instruction at a program address."""
        self._hooks.append((address, callback))

    def on_change(self, address: int, callback: Callable[[int, int], None]) -> None:
        """Call `callback` with the old and the new value after an instruction has changed a word of RAM."""
        image, machine = self._machine.image, self._machine
        behind = stores_to(image, address) if image is not None else None
        if behind is None:
            raise ValueError(f"stores to {address:#06x} may go through a pointer: observe it with the plain engine")
        seen = machine.peek(address)

        def compare() -> None:
            nonlocal seen
            now = machine.peek(address)
            if now != seen:
                before, seen = seen, now
                callback(before, now)

        self._hooks.extend((place, compare) for place in behind)

    def start(self) -> None:
        """Start to observe."""
        for address, callback in self._hooks:
            self._undo.append(self._machine.hook_pc(address, partial(_call, callback)))

    def stop(self) -> None:
        """Stop observing the machine."""
        while self._undo:
            self._undo.pop()()


def _call(callback: Callable[[], None]) -> None:
    """Call a callback as a hook that lets the machine continue."""
    callback()


def stores_to(image: Image, address: int) -> list[int] | None:
    """Return the addresses that follow all instructions that name a word of RAM as their destination.

    Return None if the image takes the word's address, so that it may also be stored to through a pointer.
    """
    found = image.symbols.variable_at(address)
    if found is None:
        return None
    symbol, distance = found
    name = f"{symbol.name}+{distance:#x}" if distance else symbol.name
    behind = []
    for item in items(image, 0, image.chip.program["flash"].end):
        operands = [one.strip() for one in item.text.partition(" ")[2].split(",")]
        if f"#{name}" in operands:
            return None
        if operands[-1] == name:
            behind.append(item.address + 2 * len(item.words))
    return behind
