"""The ledger in native code (emu/dspic30f/cycle_accounting.py): cycles into cells, calls into notes.

Cycles of a block are added up while it is translated and written where it ends, one addition per source line: code that
is counted runs at more than half of its speed. An exit out of the middle of a block carries what has passed until then.
Code that is not counted has none of this: `Count` writes nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Final

from emu.dspic30f.cycle_accounting import CALLED, CELL, ENTERED, IDLE, NOTE_WORDS, NOTED, NOTES, RETURNED, SLEPT
from emu.dspic30f.jit.translate.values import Emitter, Number, Value, wide
from emu.dspic30f.state.state import IPL3, IPL_MASK

LEDGER: Final = 6
"""Word of the environment: where the cells are."""
RowOf = Callable[[int], int]
"""The first program address of the source line around an instruction."""


class Count:
    """Nothing is written down."""

    unsettled: tuple[object, ...] = ()
    """What a way out of a block would carry, to tell it from others."""

    def begin(self, emitter: Emitter, offset: Mapping[str, int]) -> None:
        """A function is to be written."""

    def head(self, head: Emitter) -> None:
        """Into the first block of a function."""

    def spend(self, pc: int, cycles: Number) -> None:
        """`cycles` pass with the instruction at `pc`."""

    def settle(self) -> None:
        """The block ends here."""

    def carry(self) -> None:
        """A way out of the block begins here; the block goes on."""

    def level_changed(self) -> None:
        """SR has been written."""

    def called(self, site: int, target: Number, place: Number, cycle: Number) -> None:
        """The call at `site` has put its return address at `place`."""

    def returned(self, site: int, target: Number, place: Number, cycle: Number) -> None:
        """The return at `site` has taken its address from `place`."""

    def shortened(self, pc: int) -> None:
        """A RETFIE whose third cycle is not sure."""


class Counting(Count):
    """One function's share of the ledger. `words`: cells of a level, `tail`: bytes up to what follows the cells."""

    def __init__(self, words: int, tail: int, row_of: RowOf) -> None:
        self._level_bytes: Final = 8 * words
        self._tail: Final = tail
        self._row_of: Final = row_of
        self._spent: Final[dict[int, Number]] = {}

    def begin(self, emitter: Emitter, offset: Mapping[str, int]) -> None:
        """A function is to be written."""
        self._e, self._offset = emitter, offset

    @property
    def unsettled(self) -> tuple[object, ...]:  # type: ignore[override]
        """Cells and what goes there."""
        return tuple((row, n.text if isinstance(n, Value) else n) for row, n in self._spent.items())

    def head(self, head: Emitter) -> None:
        """Where the cells of the present level are."""
        head.line("%x.cells = alloca ptr")
        self._select_level(head)

    def _select_level(self, e: Emitter) -> None:
        sr, corcon = (e.load(self._record(e, self._offset[name]), 16) for name in ("SR", "CORCON"))
        level = (sr & IPL_MASK) >> IPL_MASK.bit_length() - 3 | corcon & IPL3
        ledger, cells = self._ledger(e), e.name()
        e.line(f"{cells} = getelementptr i8, ptr {ledger}, i64 {wide(level * self._level_bytes)}")
        e.line(f"store ptr {cells}, ptr %x.cells")

    @staticmethod
    def _record(e: Emitter, offset: int) -> str:
        name = e.name()
        e.line(f"{name} = getelementptr i8, ptr %rec, i64 {offset}")
        return name

    @staticmethod
    def _ledger(e: Emitter) -> str:
        place, ledger = e.name(), e.name()
        e.line(f"{place} = getelementptr i64, ptr %env, i64 {LEDGER}")
        e.line(f"{ledger} = load ptr, ptr {place}")
        return ledger

    def _cell(self, pc: int) -> str:
        cells, cell = self._e.name(), self._e.name()
        self._e.line(f"{cells} = load ptr, ptr %x.cells")
        self._e.line(f"{cell} = getelementptr i64, ptr {cells}, i64 {pc >> 1}")
        return cell

    def spend(self, pc: int, cycles: Number) -> None:
        """Keep it until the block ends."""
        row = self._row_of(pc)
        self._spent[row] = self._spent.get(row, 0) + cycles

    def settle(self) -> None:
        """Write what has been kept."""
        self.carry()
        self._spent.clear()

    def carry(self) -> None:
        """Write it, and keep it for those who stay."""
        for row, cycles in self._spent.items():
            cell = self._cell(row)
            self._e.store(cell, self._e.load(cell, 64) + cycles, 64)

    def level_changed(self) -> None:
        """What has passed belongs to the old level."""
        self.settle()
        self._select_level(self._e)

    def called(self, site: int, target: Number, place: Number, cycle: Number) -> None:
        """A note."""
        self._note(CALLED, site, target, place, cycle)

    def returned(self, site: int, target: Number, place: Number, cycle: Number) -> None:
        """A note."""
        self._note(RETURNED, site, target, place, cycle)

    def _note(self, kind: int, site: int, target: Number, place: Number, cycle: Number) -> None:
        e, tail = self._e, self._e.name()
        e.line(f"{tail} = getelementptr i8, ptr {self._ledger(e)}, i64 {self._tail}")
        count_place, note = e.name(), e.name()
        e.line(f"{count_place} = getelementptr i64, ptr {tail}, i64 {NOTED}")
        count = e.load(count_place, 64)
        e.line(f"{note} = getelementptr i64, ptr {tail}, i64 {wide(count * NOTE_WORDS + NOTES)}")
        for index, word in enumerate((cycle, (place & 0xFFFF) << 16 | (kind | site << 32), target)):
            at = e.name()
            e.line(f"{at} = getelementptr i64, ptr {note}, i64 {index}")
            e.store(at, word, 64)
        e.store(count_place, count + 1, 64)

    def shortened(self, pc: int) -> None:
        """Take the third cycle back, and remember where it goes if it is run after all."""
        e, cell, place = self._e, self._cell(self._row_of(pc)), self._e.name()
        e.store(cell, e.load(cell, 64) - 1, 64)
        e.line(f"{place} = getelementptr i8, ptr {self._ledger(e)}, i64 {self._tail + 8 * CELL}")
        e.line(f"store ptr {cell}, ptr {place}")


class BoundaryCount:
    """What native boundaries write down: nothing."""

    def idle(self, prefix: str, until: str) -> str:
        """IR behind which the cycles from %cycle to `until` count as Idle; `prefix` makes names unique."""
        return ""

    def entered(self, start: str, handler: str, site: str, place: str, level: str, since: str) -> str:
        """IR behind which those from %cycle to `start` count for `handler` at `level`; `site` was pushed at `place`,
        the request rose in cycle `since`."""
        return ""

    def third_cycle(self) -> str:
        """IR that counts a cycle for the RETFIE run last, whose note is the last one."""
        return ""


class BoundaryCounting(BoundaryCount):
    """Into the ledger, which is found from %entered, word `entered` of the environment."""

    def __init__(self, words: int, tail: int, entered: int) -> None:
        self._level_bytes: Final = 8 * words
        self._tail: Final = tail
        self._entered: Final = entered

    def _note(self, p: str, kind: str, words: tuple[str, str, str]) -> str:
        """A note; `kind` and `words` name i64 values, the first and third word being given."""
        return f"""  %{p}.np = getelementptr i64, ptr %{p}.tail, i64 {NOTED}
  %{p}.n = load i64, ptr %{p}.np
  %{p}.n1 = add i64 %{p}.n, 1
  store i64 %{p}.n1, ptr %{p}.np
  %{p}.nw = mul i64 %{p}.n, {NOTE_WORDS}
  %{p}.no = add i64 %{p}.nw, {NOTES}
  %{p}.w0 = getelementptr i64, ptr %{p}.tail, i64 %{p}.no
  store i64 {words[0]}, ptr %{p}.w0
  %{p}.w1 = getelementptr i64, ptr %{p}.w0, i64 1
  store i64 {kind}, ptr %{p}.w1
  %{p}.w2 = getelementptr i64, ptr %{p}.w0, i64 2
  store i64 {words[1]}, ptr %{p}.w2
  %{p}.w3 = getelementptr i64, ptr %{p}.w0, i64 3
  store i64 {words[2]}, ptr %{p}.w3"""

    def _find(self, p: str) -> str:
        return f"""  %{p}.lp = getelementptr i64, ptr %entered, i64 {LEDGER - self._entered}
  %{p}.ledger = load ptr, ptr %{p}.lp
  %{p}.tail = getelementptr i8, ptr %{p}.ledger, i64 {self._tail}"""

    def idle(self, prefix: str, until: str) -> str:
        """Into the word of Idle, and a note."""
        p = f"c.{prefix}"
        return f"""{self._find(p)}
  %{p}.ip = getelementptr i64, ptr %{p}.tail, i64 {IDLE}
  %{p}.old = load i64, ptr %{p}.ip
  %{p}.slept = sub i64 {until}, %cycle
  %{p}.new = add i64 %{p}.old, %{p}.slept
  store i64 %{p}.new, ptr %{p}.ip
  %{p}.long = shl i64 %{p}.slept, 32
{self._note(p, str(SLEPT), (until, f"%{p}.long", "0"))}"""

    def entered(self, start: str, handler: str, site: str, place: str, level: str, since: str) -> str:
        """Into the handler's cell, and a note."""
        p = "c.in"
        return f"""{self._find(p)}
  %{p}.level = mul i64 {level}, {self._level_bytes}
  %{p}.cells = getelementptr i8, ptr %{p}.ledger, i64 %{p}.level
  %{p}.word = lshr i64 {handler}, 1
  %{p}.cell = getelementptr i64, ptr %{p}.cells, i64 %{p}.word
  %{p}.old = load i64, ptr %{p}.cell
  %{p}.took = sub i64 {start}, %cycle
  %{p}.new = add i64 %{p}.old, %{p}.took
  store i64 %{p}.new, ptr %{p}.cell
  %{p}.site = shl i64 {site}, 32
  %{p}.sp = shl i64 {place}, 16
  %{p}.lev = shl i64 {level}, 8
  %{p}.k1 = or i64 %{p}.site, %{p}.sp
  %{p}.k2 = or i64 %{p}.k1, %{p}.lev
  %{p}.k3 = or i64 %{p}.k2, {ENTERED}
  %{p}.long = shl i64 %{p}.took, 32
  %{p}.where = or i64 %{p}.long, {handler}
{self._note(p, f"%{p}.k3", (start, f"%{p}.where", since))}"""

    def third_cycle(self) -> str:
        """Where `Counting.shortened` has said."""
        return f"""  %c.lp = getelementptr i64, ptr %env, i64 {LEDGER}
  %c.ledger = load ptr, ptr %c.lp
  %c.tail = getelementptr i8, ptr %c.ledger, i64 {self._tail}
  %c.place = getelementptr i64, ptr %c.tail, i64 {CELL}
  %c.cell = load ptr, ptr %c.place
  %c.old = load i64, ptr %c.cell
  %c.new = add i64 %c.old, 1
  store i64 %c.new, ptr %c.cell
  %c.np = getelementptr i64, ptr %c.tail, i64 {NOTED}
  %c.n = load i64, ptr %c.np
  %c.nw = mul i64 %c.n, {NOTE_WORDS}
  %c.no = add i64 %c.nw, {NOTES - NOTE_WORDS}
  %c.note = getelementptr i64, ptr %c.tail, i64 %c.no
  %c.at = load i64, ptr %c.note
  %c.at1 = add i64 %c.at, 1
  store i64 %c.at1, ptr %c.note"""
