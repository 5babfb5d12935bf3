"""Cycle accounting in native code (emu/dspic30f/cycle_accounting.py): adds cycles to cells and logs calls.

The translator sums the cycles of a block per source line and emits one addition per line at the block's end. An exit
from the middle of a block first adds the cycles up to that point. Without accounting, `CycleCounter` emits nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Final

from emu.dspic30f.cycle_log import (
    CALLED,
    ENTERED,
    ENTRY_WORDS,
    IDLE,
    LOG,
    LOG_COUNT,
    RETFIE_CELL,
    RETURNED,
    SLEPT,
)
from emu.dspic30f.jit.environment import ACCOUNTING, INTERRUPTS
from emu.dspic30f.jit.ir.deferred import DeferredEffects
from emu.dspic30f.jit.ir.values import Emitter, Number, Value, wide
from emu.dspic30f.state.state import IPL3, IPL_MASK

RowOf = Callable[[int], int]
"""Function that returns the first program address of the source line that contains an instruction."""


class CycleCounter:
    """Null counter of a translated function: emits nothing. `AccountingCounter` has the same interface."""

    unsettled: tuple[object, ...] = ()
    """Cycles that an exit would have to add. Exits that add different cycles are different IR blocks."""
    splits_repeats = False
    """Whether each iteration of a REPEAT with stores needs its own log check; exact code then runs the REPEAT."""
    checks_asleep = False
    """Whether the start of Idle can change a watched number, so that it needs `check_changes`."""

    def begin(self, emitter: Emitter, offset: Mapping[str, int]) -> None:
        """Prepare for the function that `emitter` writes."""

    def prologue(self, head: Emitter) -> None:
        """Emit the preparation of the counter into the first block of the function."""

    def add_cycles(self, pc: int, cycles: Number) -> None:
        """Account for `cycles` of the instruction at `pc`."""

    def count_execution(self, pc: int, times: Number = 1) -> None:
        """Count executions of the instruction at `pc`."""

    def count_taken(self, pc: int, times: Number = 1) -> None:
        """Count that the conditional branch or skip at `pc` is taken."""

    def flush(self) -> None:
        """Emit the additions at the end of a block."""

    def flush_at_exit(self) -> None:
        """Emit the additions at an exit from the middle of a block."""

    def select_level(self) -> None:
        """Select the cells of the new CPU priority, after a write of SR."""

    def log_call(self, site: int, target: Number, stack: Number, cycle: Number) -> None:
        """Log the call at `site`, whose return address lies at `stack`."""

    def log_return(self, site: int, target: Number, stack: Number, cycle: Number) -> None:
        """Log the return at `site`, whose return address was at `stack`."""

    def subtract_third_cycle(self, pc: int) -> None:
        """Subtract the third cycle of the RETFIE at `pc`, because an exception may replace it."""

    def begin_instruction(self, pc: int) -> None:
        """Log, in exact code, that the instruction at `pc` starts."""

    def needs_check_after(self, effects: DeferredEffects) -> Number:
        """Return whether `check_changes` is needed after an instruction with these effects."""
        return 0

    def check_changes(self, site: int, cycle: Number, next_pc: Number) -> str:
        """Emit the comparison of the state after the instruction at `site`. Return whether native code must return."""
        return "false"

    def definitions(self) -> str:
        """Return the IR of the functions that the counter calls."""
        return ""


class AccountingCounter(CycleCounter):
    """Counter that emits cycle accounting.

    `words` is the number of cells per CPU priority, `tail` the offset of the words after the cells.
    """

    def __init__(self, words: int, tail: int, row_of: RowOf) -> None:
        self._level_bytes: Final = 8 * words
        self._tail: Final = tail
        self._row_of: Final = row_of
        self._spent: Final[dict[int, Number]] = {}

    def begin(self, emitter: Emitter, offset: Mapping[str, int]) -> None:
        """Prepare for the function that `emitter` writes."""
        self._e, self._offset = emitter, offset

    @property
    def unsettled(self) -> tuple[object, ...]:  # type: ignore[override]
        """Return the cycles that an exit would add, by source line."""
        return tuple((row, n.text if isinstance(n, Value) else n) for row, n in self._spent.items())

    def prologue(self, head: Emitter) -> None:
        """Emit a variable with the address of the current CPU priority's cells."""
        head.line("%x.cells = alloca ptr")
        self._select_level(head)

    def _select_level(self, e: Emitter) -> None:
        sr, corcon = (e.load(self._record(e, self._offset[name]), 16) for name in ("SR", "CORCON"))
        level = (sr & IPL_MASK) >> IPL_MASK.bit_length() - 3 | corcon & IPL3
        accounting, cells = self._accounting(e), e.name()
        e.line(f"{cells} = getelementptr i8, ptr {accounting}, i64 {wide(level * self._level_bytes)}")
        e.line(f"store ptr {cells}, ptr %x.cells")

    @staticmethod
    def _record(e: Emitter, offset: int) -> str:
        name = e.name()
        e.line(f"{name} = getelementptr i8, ptr %rec, i64 {offset}")
        return name

    @staticmethod
    def _accounting(e: Emitter) -> str:
        word, accounting = e.name(), e.name()
        e.line(f"{word} = getelementptr i64, ptr %env, i64 {ACCOUNTING}")
        e.line(f"{accounting} = load ptr, ptr {word}")
        return accounting

    def _cell(self, pc: int) -> str:
        cells, cell = self._e.name(), self._e.name()
        self._e.line(f"{cells} = load ptr, ptr %x.cells")
        self._e.line(f"{cell} = getelementptr i64, ptr {cells}, i64 {pc >> 1}")
        return cell

    def add_cycles(self, pc: int, cycles: Number) -> None:
        """Add the cycles to the block's sums."""
        row = self._row_of(pc)
        self._spent[row] = self._spent.get(row, 0) + cycles

    def flush(self) -> None:
        """Emit the additions and clear the sums."""
        self.flush_at_exit()
        self._spent.clear()

    def flush_at_exit(self) -> None:
        """Emit the additions; keep the sums for the rest of the block."""
        for row, cycles in self._spent.items():
            cell = self._cell(row)
            self._e.store(cell, self._e.load(cell, 64) + cycles, 64)

    def select_level(self) -> None:
        """Account the cycles so far to the old CPU priority, then select the new priority's cells."""
        self.flush()
        self._select_level(self._e)

    def log_call(self, site: int, target: Number, stack: Number, cycle: Number) -> None:
        """Emit a log entry."""
        self._log(CALLED, site, target, stack, cycle)

    def log_return(self, site: int, target: Number, stack: Number, cycle: Number) -> None:
        """Emit a log entry."""
        self._log(RETURNED, site, target, stack, cycle)

    def _log(self, kind: int, site: int, target: Number, stack: Number, cycle: Number) -> None:
        e, tail = self._e, self._e.name()
        e.line(f"{tail} = getelementptr i8, ptr {self._accounting(e)}, i64 {self._tail}")
        count_word, entry = e.name(), e.name()
        e.line(f"{count_word} = getelementptr i64, ptr {tail}, i64 {LOG_COUNT}")
        count = e.load(count_word, 64)
        e.line(f"{entry} = getelementptr i64, ptr {tail}, i64 {wide(count * ENTRY_WORDS + LOG)}")
        for index, word in enumerate((cycle, (stack & 0xFFFF) << 16 | (kind | site << 32), target)):
            at = e.name()
            e.line(f"{at} = getelementptr i64, ptr {entry}, i64 {index}")
            e.store(at, word, 64)
        e.store(count_word, count + 1, 64)

    def subtract_third_cycle(self, pc: int) -> None:
        """Subtract the third cycle of a RETFIE from its cell.

        Store the cell's address, from which `AccountingBoundaryCounter.third_cycle` adds the cycle again.
        """
        e, cell, word = self._e, self._cell(self._row_of(pc)), self._e.name()
        e.store(cell, e.load(cell, 64) - 1, 64)
        e.line(f"{word} = getelementptr i8, ptr {self._accounting(e)}, i64 {self._tail + 8 * RETFIE_CELL}")
        e.line(f"store ptr {cell}, ptr {word}")


class BoundaryCounter:
    """Null counter of native boundaries: emits nothing. `AccountingBoundaryCounter` has the same interface."""

    is_native = True
    """Whether native code handles boundaries; otherwise it returns to Python for each of them."""
    returns_after_retfie = False
    """Whether native code returns after every RETFIE."""

    def idle(self, prefix: str, until: str) -> str:
        """Return IR that accounts for the cycles from %cycle to `until` as Idle. `prefix` makes its names unique."""
        return ""

    def entered(self, start: str, handler: str, site: str, stack: str, level: str, ipl: str, since: str) -> str:
        """Return IR that accounts for the cycles from %cycle to `start` as entry of `handler` at CPU priority `ipl`.

        `site` was pushed at `stack`; the interrupt of `level` was requested in cycle `since`.
        """
        return ""

    def third_cycle(self) -> str:
        """Return IR that adds a cycle to the RETFIE that ran last, whose log entry is the last one."""
        return ""


class AccountingBoundaryCounter(BoundaryCounter):
    """Counter of native boundaries with cycle accounting.

    It locates the cells relative to the environment word %entered.
    """

    def __init__(self, words: int, tail: int) -> None:
        self._level_bytes: Final = 8 * words
        self._tail: Final = tail

    def _log(self, p: str, kind: str, words: tuple[str, str, str]) -> str:
        """Return IR that appends a log entry. `kind` is its second word; `words` are the three others."""
        return f"""  %{p}.np = getelementptr i64, ptr %{p}.tail, i64 {LOG_COUNT}
  %{p}.n = load i64, ptr %{p}.np
  %{p}.n1 = add i64 %{p}.n, 1
  store i64 %{p}.n1, ptr %{p}.np
  %{p}.nw = mul i64 %{p}.n, {ENTRY_WORDS}
  %{p}.no = add i64 %{p}.nw, {LOG}
  %{p}.w0 = getelementptr i64, ptr %{p}.tail, i64 %{p}.no
  store i64 {words[0]}, ptr %{p}.w0
  %{p}.w1 = getelementptr i64, ptr %{p}.w0, i64 1
  store i64 {kind}, ptr %{p}.w1
  %{p}.w2 = getelementptr i64, ptr %{p}.w0, i64 2
  store i64 {words[1]}, ptr %{p}.w2
  %{p}.w3 = getelementptr i64, ptr %{p}.w0, i64 3
  store i64 {words[2]}, ptr %{p}.w3"""

    def _find(self, p: str) -> str:
        return f"""  %{p}.lp = getelementptr i64, ptr %entered, i64 {ACCOUNTING - INTERRUPTS}
  %{p}.accounting = load ptr, ptr %{p}.lp
  %{p}.tail = getelementptr i8, ptr %{p}.accounting, i64 {self._tail}"""

    def idle(self, prefix: str, until: str) -> str:
        """Return IR that adds to the idle cycles and logs the sleep."""
        p = f"c.{prefix}"
        return f"""{self._find(p)}
  %{p}.ip = getelementptr i64, ptr %{p}.tail, i64 {IDLE}
  %{p}.old = load i64, ptr %{p}.ip
  %{p}.slept = sub i64 {until}, %cycle
  %{p}.new = add i64 %{p}.old, %{p}.slept
  store i64 %{p}.new, ptr %{p}.ip
  %{p}.long = shl i64 %{p}.slept, 32
{self._log(p, str(SLEPT), (until, f"%{p}.long", "0"))}"""

    def entered(self, start: str, handler: str, site: str, stack: str, level: str, ipl: str, since: str) -> str:
        """Return IR that adds to the handler's cell and logs the entry."""
        p = "c.in"
        return f"""{self._find(p)}
  %{p}.level = mul i64 {ipl}, {self._level_bytes}
  %{p}.cells = getelementptr i8, ptr %{p}.accounting, i64 %{p}.level
  %{p}.word = lshr i64 {handler}, 1
  %{p}.cell = getelementptr i64, ptr %{p}.cells, i64 %{p}.word
  %{p}.old = load i64, ptr %{p}.cell
  %{p}.took = sub i64 {start}, %cycle
  %{p}.new = add i64 %{p}.old, %{p}.took
  store i64 %{p}.new, ptr %{p}.cell
  %{p}.site = shl i64 {site}, 32
  %{p}.sp = shl i64 {stack}, 16
  %{p}.lev = shl i64 {level}, 8
  %{p}.k1 = or i64 %{p}.site, %{p}.sp
  %{p}.k2 = or i64 %{p}.k1, %{p}.lev
  %{p}.k3 = or i64 %{p}.k2, {ENTERED}
  %{p}.long = shl i64 %{p}.took, 32
  %{p}.where = or i64 %{p}.long, {handler}
{self._log(p, f"%{p}.k3", (start, f"%{p}.where", since))}"""

    def third_cycle(self) -> str:
        """Return IR that adds to the cell that `AccountingCounter.subtract_third_cycle` has stored."""

        return f"""  %c.lp = getelementptr i64, ptr %env, i64 {ACCOUNTING}
  %c.accounting = load ptr, ptr %c.lp
  %c.tail = getelementptr i8, ptr %c.accounting, i64 {self._tail}
  %c.place = getelementptr i64, ptr %c.tail, i64 {RETFIE_CELL}
  %c.cell = load ptr, ptr %c.place
  %c.old = load i64, ptr %c.cell
  %c.new = add i64 %c.old, 1
  store i64 %c.new, ptr %c.cell
  %c.np = getelementptr i64, ptr %c.tail, i64 {LOG_COUNT}
  %c.n = load i64, ptr %c.np
  %c.nw = mul i64 %c.n, {ENTRY_WORDS}
  %c.no = add i64 %c.nw, {LOG - ENTRY_WORDS}
  %c.note = getelementptr i64, ptr %c.tail, i64 %c.no
  %c.at = load i64, ptr %c.note
  %c.at1 = add i64 %c.at, 1
  store i64 %c.at1, ptr %c.note"""
