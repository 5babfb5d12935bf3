"""Data space as devices see it: which SFR bits exist, and who is told when one is read or written.

What enters: masks and reset values of a chip (data), hooks of devices. What leaves: `read`/`write` of SFR words for
the engines, `peek`/`poke` for tools. Plain memory is not handled here: engines go to the record directly.
The CPU's own registers are hooked by the CPU like any device's.
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
"""Called as hook(old, new, lanes) after the new word is in the record; lanes = 0xFFFF, 0x00FF or 0xFF00."""


@dataclass(frozen=True, slots=True)
class Access:
    """How a register word is wired on the bus; the parts are those of `Bus`."""

    writable: int
    clear_only: int
    compute: ReadHook | None
    on_read: ReadHook | None
    on_write: WriteHook | None
    rule: Rule | None


class Tap:
    """Somebody outside listens to every access of instructions to one register; see `tap`."""

    def __init__(self, remove: Callable[[], None], under: Access) -> None:
        self.hooks: tuple[Callable[[bool, int], object], ...] = ()
        self.remove: Final = remove
        self.under = under
        """What the register itself does."""

    def __bool__(self) -> bool:
        return bool(self.hooks)

    def add(self, hook: Callable[[bool, int], object]) -> Callable[[], None]:
        """Call hook(is_write, word) after each access. Returns how to remove it."""
        self.hooks = (*self.hooks, hook)
        removed = False

        def forget() -> None:
            nonlocal removed
            if not removed:
                removed = True
                place = self.hooks.index(hook)
                self.hooks = self.hooks[:place] + self.hooks[place + 1 :]

        return forget


class Bus:
    """SFR space, below `end`. Word index = address >> 1. Unimplemented bits read 0 and ignore writes."""

    def __init__(self, record: Record, events: Events, end: int) -> None:
        self.record: Final = record
        self.events: Final = events
        self.end: Final = end
        """First data address behind the SFRs (isa.md §1.2)."""
        words = end // 2
        self.writable: Final = [0] * words
        """Bits software can change freely."""
        self.clear_only: Final = [0] * words
        """Bits software can clear but not set."""
        self.reset_value: Final = [0] * words
        self.name: Final = [""] * words
        self.compute: Final[list[ReadHook | None]] = [None] * words
        """Registers that are a function of the cycle and device state; no side effects."""
        self.refresh: Final[dict[int, Callable[[int], bool]]] = {}
        """By register: refresh(cycle) has what its rule reads in the record brought up to date, if that is what native
        code waits for in `cycle`; False if not."""
        self.on_read: Final[list[ReadHook | None]] = [None] * words
        """Registers whose read changes something; returns the word read."""
        self.on_write: Final[list[WriteHook | None]] = [None] * words
        self.rules: Final[list[Rule | None]] = [None] * words
        """What accesses do in the common case; the hooks answer where a rule does not."""
        self.integers: Final = RuleInterpreter(record, events)
        self.modelled: Final = [False] * words
        """Set for registers a device or the CPU stands behind; others are reported once when touched."""
        self.off: frozenset[int] = frozenset()
        """Registers of modules that are switched off: they read 0 and ignore writes."""
        self.taps: Final[dict[int, Tap]] = {}
        """Who listens, by register; see `tap`."""
        self.watched: Final[set[int]] = set()
        """Registers every access of which somebody outside wants to see."""
        self.report: Callable[[int, bool], None] | None = None
        """Called as report(address, is_write) at the first touch of a register nobody models."""
        self._reported: set[int] = set()
        self.note: Callable[[str], None] | None = None
        """Called as note(what) the first time firmware asks a device for something that has no model."""
        self._noted: set[str] = set()

    def read(self, address: int) -> int:
        """The word at even SFR `address` (below `end`) as an instruction reads it, side effects included."""
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
        """Store `value` at even SFR `address`; only bits in `lanes` (byte writes) are touched."""
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
        """The word at even SFR `address`, without side effects."""
        hook = self.compute[address >> 1]
        return hook() if hook is not None else self.record.u16[address >> 1]

    def poke(self, address: int, value: int) -> None:
        """Set the stored word at even SFR `address`, telling nobody."""
        self.record.u16[address >> 1] = value & 0xFFFF

    def access(self, word: int) -> Access:
        """How the register with index `word` is wired, whoever listens to it."""
        under = self.taps[word].under if word in self.taps else None
        return under or Access(
            self.writable[word], self.clear_only[word], self.compute[word], self.on_read[word], self.on_write[word],
            self.rules[word],
        )  # fmt: skip

    def rewire(self, word: int, access: Access) -> None:
        """Wire it anew; who listens goes on listening."""
        self.writable[word], self.clear_only[word], self.compute[word] = (
            access.writable, access.clear_only, access.compute)  # fmt: skip
        if word in self.taps:
            self.taps[word].under = access
        else:
            self.on_read[word], self.on_write[word], self.rules[word] = access.on_read, access.on_write, access.rule

    def lacks(self, what: str) -> None:
        """Firmware has asked for `what` (register, field, and what happens instead), which has no model: told once."""
        if what not in self._noted and not self.events.quiet:
            self._noted.add(what)
            if self.note is not None:
                self.note(what)

    def _first_touch(self, word: int, is_write: bool) -> None:
        self._reported.add(word)
        if self.report is not None:
            self.report(word << 1, is_write)


def tap(bus: Bus, word: int) -> Tap:
    """Put a `Tap` between the instructions and the register with index `word`, until its `remove` is called."""
    u16, events = bus.record.u16, bus.events

    def remove() -> None:
        under = bus.access(word)
        del bus.taps[word]
        bus.rewire(word, under)
        bus.watched.discard(word)

    heard = Tap(remove, bus.access(word))

    def tapped_read() -> int:
        read = heard.under.on_read or heard.under.compute
        value = read() if read is not None else u16[word]
        if not events.quiet:
            for hook in heard.hooks:
                hook(False, value)
        return value

    def tapped_write(old: int, new: int, lanes: int) -> None:
        written = heard.under.on_write
        if written is not None:
            written(old, new, lanes)
        if not events.quiet:
            for hook in heard.hooks:
                hook(True, u16[word])

    bus.on_read[word], bus.on_write[word], bus.rules[word] = tapped_read, tapped_write, None
    bus.taps[word] = heard
    bus.watched.add(word)
    return heard
