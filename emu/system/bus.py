"""The bus: implemented SFR bits, and dispatch of register accesses to the hooks and rules of devices.

Inputs: masks and reset values of a chip, and hooks of devices. Outputs: `read` and `write` of SFR words for engines,
`peek` and `poke` for tools. Engines access plain memory directly in the record. The CPU hooks its own registers as a
device does.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from emu.system.events import Events
from emu.system.record import Record
from emu.system.rules import Rule, RuleInterpreter

ReadHook = Callable[[], int]
WriteHook = Callable[[int, int, int], None]
"""hook(old, new, lanes): called after the new word is stored in the record. `lanes` is 0xFFFF, 0x00FF or 0xFF00."""


@dataclass(frozen=True, slots=True)
class RegisterWiring:
    """Wiring of one register: its entries in the tables of `Bus`."""

    writable: int
    clear_only: int
    compute: ReadHook | None
    on_read: ReadHook | None
    on_write: WriteHook | None
    rule: Rule | None


class Tap:
    """Observers of all accesses that instructions make to one register; see `tap`."""

    def __init__(self, remove: Callable[[], None], wiring: RegisterWiring) -> None:
        self.hooks: tuple[Callable[[bool, int], object], ...] = ()
        self.remove: Final = remove
        self.wiring = wiring
        """Wiring of the register as it is without the tap."""

    def __bool__(self) -> bool:
        return bool(self.hooks)

    def add(self, hook: Callable[[bool, int], object]) -> Callable[[], None]:
        """Call hook(is_write, word) after each access. Return a function that removes the hook."""
        self.hooks = (*self.hooks, hook)
        removed = False

        def forget() -> None:
            nonlocal removed
            if not removed:
                removed = True
                index = self.hooks.index(hook)
                self.hooks = self.hooks[:index] + self.hooks[index + 1 :]

        return forget


class Bus:
    """SFR space, below the address `end`. The tables are indexed by address >> 1.

    Unimplemented bits read 0 and ignore writes.
    """

    def __init__(self, record: Record, events: Events, end: int) -> None:
        self.record: Final = record
        self.events: Final = events
        self.end: Final = end
        """First data address after the SFRs (isa.md §1.2)."""
        words = end // 2
        self.writable: Final = [0] * words
        """Mask of the bits that software can both set and clear."""
        self.clear_only: Final = [0] * words
        """Mask of the bits that software can only clear."""
        self.reset_value: Final = [0] * words
        self.name: Final = [""] * words
        self.compute: Final[list[ReadHook | None]] = [None] * words
        """Read hooks without side effects; they compute a register from the cycle and device state."""
        self.refresh: Final[dict[int, Callable[[int], bool]]] = {}
        """refresh(cycle) of each register: updates the cells that the register's rule reads.

        It is called when native code waits for them in `cycle`, and returns False if it cannot update them.
        """
        self.on_read: Final[list[ReadHook | None]] = [None] * words
        """Read hooks that change a device's state; they return the word."""
        self.on_write: Final[list[WriteHook | None]] = [None] * words
        self.rules: Final[list[Rule | None]] = [None] * words
        """Rules of registers. Hooks handle the accesses that a rule does not cover."""
        self.integers: Final = RuleInterpreter(record, events)
        self.modelled: Final = [False] * words
        """Whether a device or the CPU implements a register. For others, the first access is reported."""
        self.off: frozenset[int] = frozenset()
        """Registers of disabled modules, which read 0 and ignore writes."""
        self.taps: Final[dict[int, Tap]] = {}
        """Taps by register; see `tap`."""
        self.watched: Final[set[int]] = set()
        """Registers with a tap. All accesses to them go through Python."""
        self.report: Callable[[int, bool], None] | None = None
        """report(address, is_write): called at the first access to a register that is not modelled."""
        self._reported: set[int] = set()
        self.note: Callable[[str], None] | None = None
        """note(what): called when firmware first uses a function that is not modelled."""
        self._noted: set[str] = set()

    def read(self, address: int) -> int:
        """Return the word at the even SFR `address` as read by an instruction, with side effects."""
        word = address >> 1
        rule = self.rules[word]
        if rule is not None and (shown := self.integers.read(rule)) is not None:
            return shown
        hook = self.on_read[word] or self.compute[word]
        if hook is not None:
            return hook()
        if not self.modelled[word] and word not in self._reported:
            self._first_touch(word, False)
        return self.record.u16[word]

    def write(self, address: int, value: int, lanes: int = 0xFFFF) -> None:
        """Write the bits `lanes` of `value` to the even SFR `address`, as an instruction does."""
        word = address >> 1
        rule = self.rules[word]
        if rule is not None and self.integers.write(rule, value, lanes):
            return
        u16 = self.record.u16
        old = u16[word]
        free = self.writable[word] & lanes
        new = (old & ~free) | (value & free)
        clearing = self.clear_only[word] & lanes
        if clearing:
            new &= value | ~clearing
        u16[word] = new
        hook = self.on_write[word]
        if hook is not None:
            hook(old, new, lanes)
        elif not self.modelled[word] and word not in self._reported:
            self._first_touch(word, True)

    def peek(self, address: int) -> int:
        """Return the word at the even SFR `address`, without side effects."""
        hook = self.compute[address >> 1]
        return self.events.peek(hook) if hook is not None else self.record.u16[address >> 1]

    def poke(self, address: int, value: int) -> None:
        """Set the stored word at the even SFR `address`, without calling hooks."""
        self.record.u16[address >> 1] = value & 0xFFFF

    def access(self, word: int) -> RegisterWiring:
        """Return the wiring of the register with index `word` as it is without its tap."""
        wiring = self.taps[word].wiring if word in self.taps else None
        return wiring or RegisterWiring(
            self.writable[word], self.clear_only[word], self.compute[word], self.on_read[word], self.on_write[word],
            self.rules[word],
        )  # fmt: skip

    def rewire(self, word: int, wiring: RegisterWiring) -> None:
        """Replace the wiring of the register with index `word` and keep its tap."""
        self.writable[word], self.clear_only[word], self.compute[word] = (
            wiring.writable, wiring.clear_only, wiring.compute)  # fmt: skip
        if word in self.taps:
            self.taps[word].wiring = wiring
        else:
            self.on_read[word], self.on_write[word], self.rules[word] = wiring.on_read, wiring.on_write, wiring.rule

    def report_unmodelled(self, what: str) -> None:
        """Report once that firmware uses `what`, which is not modelled: register, field and the behaviour instead."""
        if what not in self._noted and not self.events.quiet:
            self._noted.add(what)
            if self.note is not None:
                self.note(what)

    def _first_touch(self, word: int, is_write: bool) -> None:
        self._reported.add(word)
        if self.report is not None:
            self.report(word << 1, is_write)


def tap(bus: Bus, word: int) -> Tap:
    """Insert a `Tap` between instructions and the register with index `word`. Its `remove` ends this."""
    u16, events = bus.record.u16, bus.events

    def remove() -> None:
        wiring = bus.access(word)
        del bus.taps[word]
        bus.rewire(word, wiring)
        bus.watched.discard(word)

    inserted = Tap(remove, bus.access(word))

    def tapped_read() -> int:
        read = inserted.wiring.on_read or inserted.wiring.compute
        value = read() if read is not None else u16[word]
        if not events.quiet:
            for hook in inserted.hooks:
                hook(False, value)
        return value

    def tapped_write(old: int, new: int, lanes: int) -> None:
        written = inserted.wiring.on_write
        if written is not None:
            written(old, new, lanes)
        if not events.quiet:
            for hook in inserted.hooks:
                hook(True, u16[word])

    bus.on_read[word], bus.on_write[word], bus.rules[word] = tapped_read, tapped_write, None
    bus.taps[word] = inserted
    bus.watched.add(word)
    return inserted
