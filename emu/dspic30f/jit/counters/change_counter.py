"""Log of changes in native code (emu/dspic30f/change_log.py).

After an instruction that may have written a watched number, native code compares it with its last seen value. The
comparison of addresses is inlined: a store to a fixed address that is not watched costs nothing. Changes at boundaries
are seen at the next entry of a function, because every boundary leaves the function before it.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from emu.dspic30f.change_log import BOUNDARY, COUNT, ENTRY_WORDS, ROOM, SEEN, ChangeLog, Watched, WatchedNumber
from emu.dspic30f.jit.counters.cycle_counters import BoundaryCounter, CycleCounter
from emu.dspic30f.jit.environment import ACCOUNTING
from emu.dspic30f.jit.exit_reasons import CHANGED
from emu.dspic30f.jit.ir.comparison import compare
from emu.dspic30f.jit.ir.deferred import DeferredEffects
from emu.dspic30f.jit.ir.values import Emitter, Number, Value, truth, wide
from emu.dspic30f.jit.ir.variables import pointer
from emu.dspic30f.state.state import IPL3, IPL_MASK, RUN


class ChangeCounter(CycleCounter):
    """Counter of one translated function that emits the log of changes. `ram` is the address range of RAM."""

    splits_repeats = True

    def __init__(self, log: ChangeLog, ram: tuple[int, int]) -> None:
        self._log: Final = log
        self._ram: Final = ram
        self.checks_asleep = "asleep" in log.watched
        self._hits: Number = 0
        """Bit n is set if the instruction has stored to watched number n; used with `ChangeLog.every_write` only."""

    def begin(self, emitter: Emitter, offset: Mapping[str, int]) -> None:
        """Prepare for the function that `emitter` writes."""
        self._e, self._offset = emitter, offset

    def prologue(self, head: Emitter) -> None:
        """Emit the address of the log, and the search for changes that a boundary has made."""
        head.line(f"%x.logword = getelementptr i64, ptr %env, i64 {ACCOUNTING}")
        head.line("%x.log = load ptr, ptr %x.logword")
        changed: Number = 0
        for index, one in enumerate(self._log.watched):
            changed = (self._number(head, one) != _word(head, "%x.log", SEEN + index)) | changed
        check, leave, on = (head.fresh(name) for name in ("check", "leave", "on"))
        cycle = head.load(pointer(head, self._offset["cpu.cycle"]), 64)
        here = head.load(pointer(head, self._offset["cpu.pc"]), 32)
        head.end(f"br i1 {truth(changed)}, label %{check}, label %{on}")
        head.start(check)
        leaves = _emit_log_call(head, cycle, here | BOUNDARY << 32, 0)
        head.end(f"br i1 {leaves}, label %{leave}, label %{on}")
        head.start(leave)
        head.end(f"ret i64 {CHANGED}")
        head.start(on)

    def needs_check_after(self, effects: DeferredEffects) -> Number:
        """Return whether an instruction with these effects may have changed a watched number."""
        found: Number = int(effects.sr is not None and "ipl" in self._log.watched)
        self._hits = 0
        for ea, size in effects.ram_stores:
            for index, one in enumerate(self._log.watched):
                if isinstance(one, WatchedNumber):
                    hit = self._is_hit(ea, size, one)
                    found = hit | found
                    self._hits = (hit << index) | self._hits if self._log.every_write else 0
        return found

    def check_changes(self, site: int, cycle: Number, next_pc: Number) -> str:
        """Emit the comparison of all watched numbers after the instruction at `site`.

        Return an IR operand that is true if native code must return to Python.
        """
        return _emit_log_call(self._e, cycle, next_pc | site << 32, self._hits)

    def definitions(self) -> str:
        """Return the IR of the function that compares all watched numbers and logs the changes."""
        e, log = Emitter(), self._log
        e.start("first")
        for index, one in enumerate(log.watched):
            value, (changed, after) = self._number(e, one), (e.fresh("changed"), e.fresh("after"))
            hit = Value(e, "%hits", False) >> index & 1
            logs = (value != _word(e, "%log", SEEN + index)) | (hit != 0)
            e.end(f"br i1 {truth(logs)}, label %{changed}, label %{after}")
            e.start(changed)
            e.store(_place(e, "%log", SEEN + index), value, 64)
            count = _word(e, "%log", COUNT)
            entry: tuple[Number, ...] = Value(e, "%cycle", False), Value(e, "%where", False), index, value
            for word, content in enumerate(entry):
                e.store(_place(e, "%log", count * ENTRY_WORDS + log.first + word), content, 64)
            e.store(_place(e, "%log", COUNT), count + 1, 64)
            e.end(f"br label %{after}")
            e.start(after)
        leaves: Number = _word(e, "%log", COUNT) >= (1 if log.leaves == () else ROOM)
        if log.leaves:
            holds: Number = 1
            for comparison in log.leaves:
                found = e.load(pointer(e, comparison.address), 8 * comparison.size)
                holds = compare(comparison, found) & holds
            leaves = holds | leaves
        e.end(f"ret i1 {truth(leaves)}")
        parameters = "ptr noalias %rec, ptr noalias %log, i64 %cycle, i64 %where, i64 %hits"
        return f"define internal i1 @check_changes({parameters}) noinline {{\n{e.text()}\n}}\n"

    def _number(self, e: Emitter, one: Watched) -> Value:
        """Emit a read of a watched number from the record."""
        if one == "asleep":
            return (e.load(pointer(e, self._offset["cpu.mode"]), 16) != RUN) | Value(e, "0", False)
        if one == "ipl":
            sr, corcon = (e.load(pointer(e, self._offset[name]), 16) for name in ("SR", "CORCON"))
            return (sr & IPL_MASK) >> IPL_MASK.bit_length() - 3 | corcon & IPL3
        if one.offset is None:
            return e.load(pointer(e, one.address), 8 * one.size)
        block = e.load(pointer(e, one.address), 16)
        place, (first, end) = (block + one.offset) & 0xFFFF, self._ram
        inside = (block != 0) & (place >= first) & (place <= end - one.size)
        found = e.load(pointer(e, e.select(inside, place, first)), 8 * one.size)
        chosen = e.select(inside, found, 0)
        assert isinstance(chosen, Value)
        return chosen

    def _is_hit(self, ea: Number, size: int, one: WatchedNumber) -> Number:
        """Return whether a store of `size` bytes at `ea` may change a watched number."""
        e = self._e
        if one.offset is None:
            return _overlap(e, ea, size, one.address, one.size)
        target = e.load(pointer(e, one.address), 16) + one.offset
        return _overlap(e, ea, size, one.address, 2) | _overlap(e, ea, size, target, one.size)


class ChangeBoundaryCounter(BoundaryCounter):
    """Counter of native boundaries with a log of changes. After a RETFIE, Python checks before the boundary."""

    returns_after_retfie = True


def _emit_log_call(e: Emitter, cycle: Number, where: Number, hits: Number) -> str:
    numbers = ", ".join(f"i64 {wide(one)}" for one in (cycle, where, hits))
    return e.let(f"call i1 @check_changes(ptr %rec, ptr %x.log, {numbers})", bit=True).text


def _place(e: Emitter, log: str, word: Number) -> str:
    name = e.name()
    e.line(f"{name} = getelementptr i64, ptr {log}, i64 {wide(word)}")
    return name


def _word(e: Emitter, log: str, word: int) -> Value:
    return e.load(_place(e, log, word), 64)


def _overlap(e: Emitter, ea: Number, size: int, address: Number, length: int) -> Number:
    """Return whether `size` bytes at `ea` overlap `length` bytes at `address`."""
    distance = (ea - address + (size - 1)) & 0xFFFF
    if isinstance(distance, int):
        return int(distance < length + size - 1)
    return e.let(f"icmp ult i64 {distance.text}, {length + size - 1}", bit=True)
