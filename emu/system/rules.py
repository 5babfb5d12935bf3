"""Rule language: device rules as straight-line functions that are interpreted on ints or compiled to native code.

A `Rule` describes one access to a register, or one event. It is written against a `RuleBuilder`: it reads cells of the
record, computes, states its requirements, then stores into cells. It stores nothing before the last `require`. If a
requirement does not hold, the rule has had no effect, and the device's hooks handle the access in every engine. So
engines cannot disagree on a rule, and rare cases remain in Python. The entry of an exception is such a function too
(dspic30f/exceptions/exceptions.py).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Final, Protocol

from emu.system.events import Events
from emu.system.record import SIZES, Record

Number = Any
"""An int, or a builder's value type. Rules use + - * & | ^ << >> and signed 64-bit comparisons, never `if`."""


@dataclass(frozen=True, slots=True)
class Cell:
    """Location of an unsigned number in the record: byte offset and width (8, 16, 32 or 64 bits)."""

    offset: int
    bits: int
    index: int = field(init=False, repr=False)
    """Index in the record's view for that width."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "index", self.offset * 8 // self.bits)


@dataclass(frozen=True, slots=True)
class EventSlot:
    """Cells of an event slot: its due cycle, and the common deadline of all slots."""

    due: Cell
    deadline: Cell


def cell_of(record: Record, name: str, index: int = 0) -> Cell:
    """Return the cell of element `index` of a reserved field."""
    reserved = record.fields[name]
    size = SIZES[reserved.kind]
    return Cell(reserved.offset + size * index, 8 * size)


def event_slot(record: Record, number: int) -> EventSlot:
    """Return the cells of the event slot with number `number`."""
    return EventSlot(cell_of(record, "events.due", number), cell_of(record, "events.deadline"))


@dataclass(frozen=True, slots=True)
class InterruptLine:
    """Cells of an interrupt request line: its flag, the cycle in which the flag became 1, and the common deadline."""

    flags: Cell
    bit: int
    since: Cell
    deadline: Cell


def request(m: RuleBuilder, line: InterruptLine, cycle: Number, when: Number = True) -> None:
    """If `when` holds, set the interrupt flag, unless already set, from `cycle` on; request a boundary check."""
    word = m.get(line.flags)
    m.put(line.since, m.select(((word & line.bit) == 0) & when, cycle, m.get(line.since)))
    m.put(line.flags, m.select(when, word | line.bit, word))
    m.put(line.deadline, m.select(when, 0, m.get(line.deadline)))


class RuleBuilder(Protocol):
    """Operations that rules may use. Each engine implements them."""

    @property
    def now(self) -> Number:
        """Return the cycle of the access or event."""

    def get(self, cell: Cell, index: Number = 0) -> Number:
        """Return the number in a cell, or in the cell that is `index` cells after it."""

    def put(self, cell: Cell, value: Number, index: Number = 0) -> None:
        """Store the low bits of a number in a cell, after the whole rule has been evaluated."""

    def require(self, condition: Number) -> None:
        """Leave the access to the device's hooks unless `condition` holds."""

    def select(self, condition: Number, a: Number, b: Number) -> Number:
        """Return `a` if `condition` holds, else `b`."""

    def below(self, a: Number, b: Number) -> Number:
        """Return a < b as unsigned numbers, for which NEVER is greater than every cycle."""

    def div(self, a: Number, b: Number) -> Number:
        """Return the unsigned quotient; b must not be 0."""

    def mod(self, a: Number, b: Number) -> Number:
        """Return the unsigned remainder; b must not be 0."""

    def table(self, values: tuple[int, ...], index: Number) -> Number:
        """Return values[index] from a constant table."""

    def can_call(self, code: Number) -> Number:
        """Return whether host code can be called.

        `code` is its address in the record (`Record.reserve_addresses`). It can be called if the address is not 0 and
        the rule runs in native code. Other engines leave the access to the device's hooks.
        """

    def call(self, code: Number, data: Number, *numbers: Number) -> Number:
        """Call host code: int64 code(record, data, numbers...). It must not change anything that a rule reads."""

    def notify(self, condition: Number, code: Number, data: Number, *numbers: Number) -> None:
        """Call host code as `call` does, but after all stores of the rule, and only if `condition` holds.

        If it may hold, the rule requires `can_call(code)`.
        """

    def lazy_select(
        self, condition: Number, costly: Callable[[], tuple[Number, ...]], *others: Number
    ) -> tuple[Number, ...]:
        """Return costly() if `condition` holds, else `others`.

        costly() is evaluated only if it is needed. It must not store or require.
        """

    def loop(self, count: Number, body: Callable[..., tuple[Number, ...]], *carried: Number) -> tuple[Number, ...]:
        """Repeat `carried = body(iteration, *carried)` `count` times, at least once. Return the last `carried`."""

    def scan(self, bits: Number, body: Callable[..., tuple[Number, ...]], *carried: Number) -> tuple[Number, ...]:
        """Repeat `carried = body(bit number, *carried)` for every set bit, from bit 0 up. Return the last `carried`."""

    def post(self, slot: EventSlot, due: Number) -> None:
        """Post an event slot for the cycle `due`."""


@dataclass(frozen=True)
class Rule:
    """Rules of the accesses to one register, or of an event slot. None: there is no rule for that kind of access."""

    operands: Any
    reads: Callable[[Any, Any], Number] | None = None
    """reads(builder, operands): returns the word that an instruction reads."""
    writes: Callable[[Any, Any, Number, int], bool] | None = None
    """writes(builder, operands, value, lanes): writes the register. Returns False if it has no rule for these lanes.

    `lanes` is 0xFFFF, 0x00FF or 0xFF00 and constant; the value need not be constant.
    """
    fires: Callable[[Any, Any], None] | None = None
    """fires(builder, operands): handles the event. The slot is already idle; the rule may post it again."""
    reads_with_effect: Callable[[Any, Any], Number] | None = None
    """As `reads`, for a read that changes the device's state."""

    def __repr__(self) -> str:
        functions = (self.reads, self.reads_with_effect, self.writes, self.fires)
        names = [function.__qualname__ for function in functions if function is not None]
        return f"Rule({self.operands!r}, {', '.join(names)})"


class RuleNotApplicable(Exception):
    """A requirement of a rule does not hold."""


class IntegerOperations:
    """Computing operations of a builder on ints, which need no machine."""

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

    def notify(self, condition: Number, _code: int, _data: int, *_numbers: int) -> None:
        assert not condition, "a rule that may notify requires can_call"

    def lazy_select(self, condition: Number, costly: Callable[[], tuple[int, ...]], *others: int) -> tuple[int, ...]:
        return costly() if condition else others

    def loop(self, count: int, body: Callable[..., tuple[int, ...]], *carried: int) -> tuple[int, ...]:
        for iteration in range(count):
            carried = body(iteration, *carried)
        return carried

    def scan(self, bits: int, body: Callable[..., tuple[int, ...]], *carried: int) -> tuple[int, ...]:
        while bits:
            carried = body((bits & -bits).bit_length() - 1, *carried)
            bits &= bits - 1
        return carried


INTEGER_OPERATIONS: Final[Any] = IntegerOperations()


class RuleInterpreter(IntegerOperations):
    """Builder on ints: executes rules on a machine's record."""

    def __init__(self, record: Record, events: Events) -> None:
        self._events: Final = events
        self._views: Final = {8: record.u8, 16: record.u16, 32: record.u32, 64: record.u64}
        self._masks: Final = {bits: (1 << bits) - 1 for bits in self._views}

    def read(self, rule: Rule) -> int | None:
        """Return the word that `rule` reads; None if the hooks must handle the access."""
        reads = rule.reads or rule.reads_with_effect
        if reads is None:
            return None
        try:
            return int(reads(self, rule.operands))
        except RuleNotApplicable:
            return None

    def write(self, rule: Rule, value: int, lanes: int) -> bool:
        """Write by `rule`. Return False if the hooks must handle the access."""
        if rule.writes is None:
            return False
        try:
            return rule.writes(self, rule.operands, value, lanes)
        except RuleNotApplicable:
            return False

    def fire(self, rule: Rule) -> bool:
        """Handle an event by `rule`. Return False if the slot's function must handle it."""
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

    def get(self, cell: Cell, index: int = 0) -> int:
        return self._views[cell.bits][cell.index + index]

    def put(self, cell: Cell, value: int, index: int = 0) -> None:
        self._views[cell.bits][cell.index + index] = value & self._masks[cell.bits]

    def require(self, condition: Number) -> None:
        if not condition:
            raise RuleNotApplicable

    def post(self, slot: EventSlot, due: int) -> None:
        self.put(slot.due, due)
        if due < self.get(slot.deadline):
            self.put(slot.deadline, due)
