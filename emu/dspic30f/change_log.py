"""Log of changes of watched numbers: cycle, place in the program, number and new value of each change.

Input: a connected core and what to watch. Output: entries for a consumer, in order. A change is seen after the
instruction or at the boundary that makes it, and a change by a hook before the hooked instruction. For code that the
sequencer runs, this module wraps the sequencer. Native code appends to the same memory
(jit/counters/change_counter.py). Replayed cycles and diagnosis are not logged.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Final, Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from emu.dspic30f.core import ONE_INSTRUMENT, Core
from emu.dspic30f.state.state import RUN
from emu.system.hook_filters import Filter

COUNT, SEEN = 0, 1
"""Words of the log: number of entries; the last seen values, one word for each watched number. Entries follow."""
ENTRY_WORDS: Final = 4
"""Words of an entry: cycle; program address after the change and, in the upper half, of its instruction; index of the
watched number; value."""
ENTRY: Final = np.dtype([("cycle", "<u8"), ("pc", "<u4"), ("site", "<u4"), ("number", "<u8"), ("value", "<u8")])
ROOM: Final = 4096
"""Number of entries after which native code returns, so that the consumer is called."""
BOUNDARY: Final = 0xFFFFFF
"""`Change.site` of a change that a hook or a boundary has made, for example the entry of an interrupt."""


@dataclass(frozen=True, slots=True)
class WatchedNumber:
    """An unsigned number in RAM: `size` bytes (1, 2, 4 or 8) at `address`.

    With `offset`, the number lies `offset` bytes after the place to which the pointer at `address` points. It is 0 for
    a null pointer, and outside RAM.
    """

    address: int
    size: int
    offset: int | None = None


Watched = WatchedNumber | Literal["ipl", "asleep"]
"""A number in RAM, the CPU's priority, or 1 while the CPU sleeps."""


class Change(NamedTuple):
    """A logged change. `pc` is the next instruction, `site` the one that made the change, or BOUNDARY.

    For a change of the CPU's priority by RETFIE, `site` may be either.
    """

    cycle: int
    """Cycle in which the next instruction starts, in Tcy."""
    pc: int
    site: int
    number: int
    """Index of the watched number."""
    value: int


Entries = npt.NDArray[np.void]
"""Changes as an array of ENTRY."""


def changes_in(entries: Entries) -> list[Change]:
    """Return logged entries as a list of changes."""
    return list(map(Change._make, entries.tolist()))


class ChangeLog:
    """Logs the changes of `watched` between `start` and `stop` to `consumer`.

    The consumer receives arrays of entries, which are valid until it returns.
    `leaves` says when native code returns so that the consumer sees a change at once: None means only for a full log,
    () at each change, a filter at changes after which it holds. Its comparisons may name fixed RAM addresses only.
    With `every_write`, a store to a watched number is logged even if it leaves the value unchanged.
    """

    def __init__(
        self,
        core: Core,
        watched: Sequence[Watched],
        consumer: Callable[[Entries], object],
        leaves: Filter | None = None,
        every_write: bool = False,
    ) -> None:
        self._core: Final = core
        self.watched: Final = tuple(watched)
        self.leaves: Final = leaves
        self.every_write: Final = every_write
        self._stores: Final[list[tuple[int, int]]] = []
        """Address and size of the stores that the sequencer has made since the last check."""
        self._consumer: Final = consumer
        self.first: Final = SEEN + len(self.watched)
        """Index of the first entry's first word."""
        self._words: Final = (ctypes.c_uint64 * (self.first + ENTRY_WORDS * (ROOM + 2 * len(self.watched))))()
        self._entries: Final[Entries] = np.frombuffer(memoryview(self._words).cast("B"), ENTRY, offset=8 * self.first)
        self.address: Final = ctypes.addressof(self._words)
        """Host address of the log."""
        self._getters: Final = [_getter(core, one) for one in self.watched]
        self._undo: Final[list[Callable[[], None]]] = []
        self._is_stale = True
        """Whether unlogged cycles have passed since the values were seen."""

    def start(self) -> None:
        """Start to log what the sequencer does."""
        sequencer = self._core.sequencer
        if "execute" in vars(sequencer):
            raise ValueError(ONE_INSTRUMENT)
        self.before_run()
        for name, wrapper in (
            ("execute", self._around_instruction), ("boundary", self._after_boundary),
            ("after_retfie", self._after_instruction),
        ):  # fmt: skip
            vars(sequencer)[name] = wrapper(getattr(sequencer, name))
            self._undo.append(partial(delattr, sequencer, name))
        if self.every_write:
            self._record_stores()

    def _record_stores(self) -> None:
        """Record the stores that the sequencer makes from now on."""
        space = self._core.data
        write = space.write

        def recorded(ea: int, value: int, size: int) -> None:
            self._stores.append((ea, size))
            write(ea, value, size)

        vars(space)["write"] = recorded
        self._undo.append(partial(delattr, space, "write"))

    def stop(self) -> None:
        """Restore the sequencer and deliver the remaining changes."""
        while self._undo:
            self._undo.pop()()
        self.after_run()

    def before_run(self) -> None:
        """Prepare for a run of native code: forget what happened in cycles that are not logged."""
        if self._core.events.quiet:
            self._is_stale = True
        elif self._is_stale:
            self._is_stale = False
            for index, get in enumerate(self._getters):
                self._words[SEEN + index] = get()

    def after_run(self) -> None:
        """Pass the entries to the consumer and empty the log."""
        count = self._words[COUNT]
        if not count:
            return
        self._words[COUNT] = 0
        if self._is_stale:
            return
        self._consumer(self._entries[:count])

    def after_hooks(self) -> None:
        """Log what hooks have changed before the instruction at PC, and deliver all entries."""
        self.before_run()
        self._log_changes(BOUNDARY)

    def after_native_run(self) -> None:
        """Log what a native boundary has changed before an address without native code, then deliver all entries."""
        self._log_changes(BOUNDARY)
        self.after_run()

    def _around_instruction(self, execute: Callable[[], None]) -> Callable[[], None]:
        logged = self._after_instruction(execute)

        def watched() -> None:
            self.after_hooks()
            logged()

        return watched

    def _after_instruction(self, execute: Callable[[], None]) -> Callable[[], None]:
        state = self._core.state

        def watched() -> None:
            site = state.pc
            self.before_run()
            try:
                execute()
            finally:
                self._log_changes(site)

        return watched

    def _after_boundary(self, boundary: Callable[[int], bool]) -> Callable[[int], bool]:
        def watched(limit: int) -> bool:
            self.before_run()
            try:
                return boundary(limit)
            finally:
                self._log_changes(BOUNDARY)

        return watched

    def _log_changes(self, site: int) -> None:
        """Log the numbers that have changed, and deliver them."""
        stores = self._stores[:]
        self._stores.clear()
        if self._is_stale:
            return
        words, state = self._words, self._core.state
        for index, get in enumerate(self._getters):
            value = get()
            if value != words[SEEN + index] or any(_is_hit(self.watched[index], store) for store in stores):
                words[SEEN + index] = value
                entry = self.first + ENTRY_WORDS * words[COUNT]
                words[entry : entry + ENTRY_WORDS] = [state.cycle, site << 32 | state.pc, index, value]
                words[COUNT] += 1
        if words[COUNT]:
            self.after_run()


def _is_hit(one: Watched, store: tuple[int, int]) -> bool:
    """Return whether a store hits a number at a fixed address."""
    ea, size = store
    return isinstance(one, WatchedNumber) and ea < one.address + one.size and one.address < ea + size


def _getter(core: Core, one: Watched) -> Callable[[], Any]:
    """Return the function that reads a watched number."""
    state, record, ram = core.state, core.record, core.chip.data["ram"]
    if one == "ipl":
        return lambda: state.ipl
    if one == "asleep":
        return lambda: int(state.mode != RUN)
    data, address, size, offset = record.bytes, one.address, one.size, one.offset
    if offset is None:
        return lambda: int.from_bytes(data[address : address + size], "little")

    def pointed() -> int:
        block = record.u16[address >> 1]
        place = block + offset & 0xFFFF
        inside = block and ram.start <= place <= ram.end - size
        return int.from_bytes(data[place : place + size], "little") if inside else 0

    return pointed
