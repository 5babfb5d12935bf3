"""Device rules as text that several readers run: integers in every engine, LLVM values in native code.

A `Rule` says what an access to one register or an event does, in a straight line: it gets places of the record,
computes, says what it needs, then puts places. Nothing is put before the last `require`. Where a need does not hold
nothing has been done, and the device's own hooks answer instead, in every engine alike. So engines cannot disagree on a
rule, and what is rare stays in Python. Entering an exception is such a text too (dspic30f/exceptions.py).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Final, Protocol

from emu.system.events import Events
from emu.system.record import SIZES, Record

Number = Any
"""An int, or what a reader computes with. Rules use + - * & | ^ << >> and comparisons (signed, 64 bits), never `if`."""


@dataclass(frozen=True, slots=True)
class Cell:
    """An unsigned number in the record: byte offset and bits (8, 16, 32, 64)."""

    offset: int
    bits: int
    index: int = field(init=False, repr=False)
    """In the record's view of that width."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "index", self.offset * 8 // self.bits)


@dataclass(frozen=True, slots=True)
class EventSlot:
    """An event slot: its due cycle, and the deadline of all slots."""

    due: Cell
    deadline: Cell


def cell_of(record: Record, name: str, index: int = 0) -> Cell:
    """Element `index` of a reserved field."""
    reserved = record.fields[name]
    size = SIZES[reserved.kind]
    return Cell(reserved.offset + size * index, 8 * size)


def event_slot(record: Record, number: int) -> EventSlot:
    """The event slot with that number."""
    return EventSlot(cell_of(record, "events.due", number), cell_of(record, "events.deadline"))


@dataclass(frozen=True, slots=True)
class InterruptLine:
    """An interrupt request line: its flag, the cycle in which that was first 1, and the deadline of all slots."""

    flags: Cell
    bit: int
    since: Cell
    deadline: Cell


def request(m: RuleBuilder, line: InterruptLine, cycle: Number, when: Number = True) -> None:
    """`when` that holds, the flag is 1 from `cycle` on, if it is not already, and the engine looks."""
    word = m.get(line.flags)
    m.put(line.since, m.select(((word & line.bit) == 0) & when, cycle, m.get(line.since)))
    m.put(line.flags, m.select(when, word | line.bit, word))
    m.put(line.deadline, m.select(when, 0, m.get(line.deadline)))


class RuleBuilder(Protocol):
    """What a rule may do."""

    @property
    def now(self) -> Number:
        """Cycle of the access or event."""

    def get(self, place: Cell, index: Number = 0) -> Number:
        """The number at a place, or `index` places behind it."""

    def put(self, place: Cell, value: Number, index: Number = 0) -> None:
        """Store the low bits of a number, once the whole rule has been read."""

    def require(self, condition: Number) -> None:
        """Leave the access to the device's hooks unless this holds."""

    def select(self, condition: Number, a: Number, b: Number) -> Number:
        """`a` if `condition` else `b`."""

    def below(self, a: Number, b: Number) -> Number:
        """a < b, unsigned: NEVER is above every cycle."""

    def div(self, a: Number, b: Number) -> Number:
        """Unsigned quotient; b is not 0."""

    def mod(self, a: Number, b: Number) -> Number:
        """Unsigned remainder; b is not 0."""

    def table(self, values: tuple[int, ...], index: Number) -> Number:
        """values[index], of a table that never changes."""

    def can_call(self, code: Number) -> Number:
        """Whether `code`, an address of host code that the record names (`Record.reserve_addresses`), can be asked: it
        is not 0, and whoever reads is native code. The others leave it to the device's hooks."""

    def call(self, code: Number, data: Number, *numbers: Number) -> Number:
        """What host code answers: int64 code(record, data, numbers...). It changes nothing that a rule sees."""

    def lazy_select(
        self, condition: Number, costly: Callable[[], tuple[Number, ...]], *others: Number
    ) -> tuple[Number, ...]:
        """costly() if `condition`, else `others`; it is computed only then, and puts and needs nothing."""

    def loop(self, count: Number, body: Callable[..., tuple[Number, ...]], *carried: Number) -> tuple[Number, ...]:
        """`count` times, at least once: carried = body(number of the turn, *carried). What is left in the end."""

    def scan(self, bits: Number, body: Callable[..., tuple[Number, ...]], *carried: Number) -> tuple[Number, ...]:
        """For every bit set, from bit 0 up: carried = body(number of the bit, *carried). What is left in the end."""

    def post(self, slot: EventSlot, due: Number) -> None:
        """Let an event slot fire at cycle `due`."""


@dataclass(frozen=True)
class Rule:
    """What accesses to one register do, or an event slot that falls due; None: that has no rule."""

    operands: Any
    reads: Callable[[Any, Any], Number] | None = None
    """reads(reader, places): the word an instruction reads."""
    writes: Callable[[Any, Any, Number, int], bool] | None = None
    """writes(reader, places, value, lanes): the register written; False: no rule for these lanes. `lanes` = 0xFFFF,
    0x00FF or 0xFF00 is known when the rule is read, the value need not be."""
    fires: Callable[[Any, Any], None] | None = None
    """fires(reader, places): the slot is idle already; the rule may post it again."""
    reads_with_effect: Callable[[Any, Any], Number] | None = None
    """takes(reader, places): as `reads`, and the device changes by it."""

    def __repr__(self) -> str:
        functions = (self.reads, self.reads_with_effect, self.writes, self.fires)
        names = [function.__qualname__ for function in functions if function is not None]
        return f"Rule({self.operands!r}, {', '.join(names)})"


class RuleNotApplicable(Exception):
    """A need does not hold."""


class IntegerOperations:
    """What a reader on ints computes with, no machine behind it."""

    def select(self, condition: Number, a: Number, b: Number) -> Number:
        return a if condition else b

    def below(self, a: int, b: int) -> bool:
        return a < b

    def div(self, a: int, b: int) -> int:
        return a // b

    def mod(self, a: int, b: int) -> int:
        return a % b

    def table(self, values: tuple[int, ...], index: int) -> int:
        return values[index]

    def can_call(self, _code: int) -> bool:
        return False

    def call(self, _code: int, _data: int, *_numbers: int) -> int:
        raise RuleNotApplicable

    def lazy_select(self, condition: Number, costly: Callable[[], tuple[int, ...]], *others: int) -> tuple[int, ...]:
        return costly() if condition else others

    def loop(self, count: int, body: Callable[..., tuple[int, ...]], *carried: int) -> tuple[int, ...]:
        for turn in range(count):
            carried = body(turn, *carried)
        return carried

    def scan(self, bits: int, body: Callable[..., tuple[int, ...]], *carried: int) -> tuple[int, ...]:
        while bits:
            carried = body((bits & -bits).bit_length() - 1, *carried)
            bits &= bits - 1
        return carried


INTEGER_OPERATIONS: Final[Any] = IntegerOperations()


class RuleInterpreter(IntegerOperations):
    """The reader on ints: runs rules on the record itself."""

    def __init__(self, record: Record, events: Events) -> None:
        self._events: Final = events
        self._views: Final = {8: record.u8, 16: record.u16, 32: record.u32, 64: record.u64}
        self._tops: Final = {bits: (1 << bits) - 1 for bits in self._views}

    def read(self, rule: Rule) -> int | None:
        """The word read now, or None where the hooks answer."""
        reads = rule.reads or rule.reads_with_effect
        if reads is None:
            return None
        try:
            return int(reads(self, rule.operands))
        except RuleNotApplicable:
            return None

    def write(self, rule: Rule, value: int, lanes: int) -> bool:
        """Whether the rule did it."""
        if rule.writes is None:
            return False
        try:
            return rule.writes(self, rule.operands, value, lanes)
        except RuleNotApplicable:
            return False

    def fire(self, rule: Rule) -> bool:
        """Whether the rule did it."""
        if rule.fires is None:
            return False
        try:
            rule.fires(self, rule.operands)
        except RuleNotApplicable:
            return False
        return True

    @property
    def now(self) -> int:
        return self._events.now

    def get(self, place: Cell, index: int = 0) -> int:
        return self._views[place.bits][place.index + index]

    def put(self, place: Cell, value: int, index: int = 0) -> None:
        self._views[place.bits][place.index + index] = value & self._tops[place.bits]

    def require(self, condition: Number) -> None:
        if not condition:
            raise RuleNotApplicable

    def post(self, slot: EventSlot, due: int) -> None:
        self.put(slot.due, due)
        if due < self.get(slot.deadline):
            self.put(slot.deadline, due)
