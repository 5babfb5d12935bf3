"""The readers of rules that write LLVM IR (contract: emu/system/rules.py).

A need that does not hold leaves before anything is done: an access through its slow exit, so that the sequencer makes
it; what happens at a boundary to Python.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, Final

from emu.dspic30f.interpreter.rule_paths import Ways
from emu.dspic30f.jit.translate.values import Emitter, Number, Value, truth, wide
from emu.dspic30f.jit.translate.variables import pointer
from emu.dspic30f.state.state import STACK_POINTER
from emu.system.rules import Place, Slot, place_of

if TYPE_CHECKING:
    from emu.dspic30f.core import Core
    from emu.dspic30f.jit.translate.builder import LlvmBuilder


class LlvmReader:
    """What both have in common: values."""

    def __init__(self, e: Emitter) -> None:
        self.e: Final = e

    def get(self, place: Place, index: Number = 0) -> Value:
        """Load."""
        return self.e.load(pointer(self.e, index * (place.bits // 8) + place.offset), place.bits)

    def select(self, condition: Number, a: Number, b: Number) -> Number:
        """Choice."""
        return self.e.select(condition, a, b)

    def below(self, a: Number, b: Number) -> Value:
        """Unsigned comparison."""
        return self.e.let(f"icmp ult i64 {wide(a)}, {wide(b)}", bit=True)

    def div(self, a: Number, b: Number) -> Value:
        """Unsigned quotient."""
        return self.e.let(f"udiv i64 {wide(a)}, {wide(b)}")

    def mod(self, a: Number, b: Number) -> Value:
        """Unsigned remainder."""
        return self.e.let(f"urem i64 {wide(a)}, {wide(b)}")

    def least(self, a: Number, b: Number) -> Value:
        """The lesser, unsigned."""
        return self.e.let(f"call i64 @llvm.umin.i64(i64 {wide(a)}, i64 {wide(b)})")


class NativeReader(LlvmReader):
    """One access of the instruction a builder is at; what it puts is committed with the instruction."""

    def __init__(self, b: LlvmBuilder) -> None:
        super().__init__(b.e)
        self._b: Final = b
        self.now: Final = b.now

    def get(self, place: Place, index: Number = 0) -> Value:
        """Load; flags of SR may be in variables."""
        return self._b.sr_word() if place == self._b.around.flow.sr else super().get(place, index)

    def put(self, place: Place, value: Number, index: Number = 0) -> None:
        """Store, with the instruction's other effects."""
        if place == self._b.around.flow.sr:
            self._b.pending.sr = value, 0xFFFF
            return
        e, offset = self.e, index * (place.bits // 8) + place.offset
        self._b.pending.stores.append(lambda: e.store(pointer(e, offset), value, place.bits))

    def need(self, condition: Number) -> None:
        """Leave before the instruction unless this holds."""
        self._b.guard(condition)

    def table(self, values: tuple[int, ...], index: Number) -> Number:
        """A choice for each value: an access has no constants of its own, and tables are short."""
        found: Number = values[-1]
        for number, value in enumerate(values[:-1]):
            found = self.select(index == number, value, found)
        return found

    def post(self, slot: Slot, due: Number) -> None:
        """Store the due cycle; the deadline may come nearer, so the function is left behind the instruction."""
        deadline = self.get(slot.deadline)
        self.put(slot.due, due)
        self.put(slot.deadline, self.least(deadline, due))
        self._b.pending.replanned = True


class LlvmWays(Ways):
    """Rules of flow behind an instruction, done as they are read; RA and DA of SR are in the record. `known` as for
    `Ways`; begun() is called where a way begins."""

    def __init__(
        self, e: Emitter, known: Mapping[Place, int] = MappingProxyType({}), begun: Callable[[], None] = lambda: None
    ) -> None:
        super().__init__(known)
        self.e: Final = e
        self._begun: Final = begun

    def load(self, place: Place) -> Value:
        """From the record."""
        return self.e.load(pointer(self.e, place.offset), place.bits)

    def store(self, place: Place, value: Number) -> None:
        """To the record."""
        self.e.store(pointer(self.e, place.offset), value, place.bits)

    def select(self, condition: Number, a: Number, b: Number) -> Number:
        """Choice."""
        return self.e.select(condition, a, b)

    def branches(self, condition: Number) -> Iterator[bool]:
        """Two blocks."""
        yes, no = self.e.fresh("yes"), self.e.fresh("no")
        self.e.end(f"br i1 {truth(condition)}, label %{yes}, label %{no}")
        for label, turn in ((yes, True), (no, False)):
            self.e.start(label)
            self._begun()
            yield turn


class BoundaryReader(LlvmReader):
    """What happens between two instructions, in the function of `service.py`; it is done as it is read."""

    def __init__(
        self, core: Core, e: Emitter, now: Number, otherwise: str, tables: dict[tuple[int, ...], str] | None = None
    ) -> None:
        """`otherwise`: label of the block that hands over to Python; `tables`: of a reader of the same module."""
        super().__init__(e)
        self.now: Final = now
        self._core: Final = core
        self._otherwise: Final = otherwise
        self.tables: Final[dict[tuple[int, ...], str]] = tables if tables is not None else {}
        self.posted: Final[set[Slot]] = set()
        """Slots that were posted."""

    def put(self, place: Place, value: Number, index: Number = 0) -> None:
        """Store."""
        self.e.store(pointer(self.e, index * (place.bits // 8) + place.offset), value, place.bits)

    def need(self, condition: Number) -> None:
        """Let Python do it unless this holds."""
        go = self.e.fresh("go")
        self.e.end(f"br i1 {truth(condition)}, label %{go}, label %{self._otherwise}")
        self.e.start(go)

    def post(self, slot: Slot, due: Number) -> None:
        """Store the due cycle and the deadline."""
        self.put(slot.due, due)
        self.put(slot.deadline, self.least(self.get(slot.deadline), due))
        self.posted.add(slot)

    def push(self, low: Number, high: Number, _cycle: Number) -> None:
        """Python does what does not fit into the stack."""
        state, ram = self._core.state, self._core.chip.data["ram"]
        top, limit = Place(2 * STACK_POINTER, 16), Place(2 * state.at["SPLIM"], 16)
        ea = self.get(top)
        unlimited = self.get(place_of(state.record, "cpu.limit_armed")) == 0
        self.need((unlimited | (ea + 2 <= self.get(limit))) & (ea >= ram.start) & (ea < ram.end - 2))
        for word, value in ((0, low), (2, high)):
            self.e.store(pointer(self.e, ea + word), value, 16)
        self.put(top, ea + 4)

    def handler(self, vector: Number) -> Value:
        """A word of flash."""
        return self.e.load(pointer(self.e, (vector << 1) + self._core.program.flash_offset), 32)

    def table(self, values: tuple[int, ...], index: Number) -> Value:
        """Load from a constant."""
        name = self.tables.setdefault(values, f"@table{len(self.tables)}")
        place = self.e.name()
        self.e.line(f"{place} = getelementptr [{len(values)} x i64], ptr {name}, i64 0, i64 {wide(index)}")
        return self.e.let(f"load i64, ptr {place}")

    def can_ask(self, code: Number) -> Number:
        """Native code can."""
        return code != 0

    def ask(self, code: Number, data: Number, *numbers: Number) -> Value:
        """A call; what it reads has been stored."""
        address = self.e.name()
        self.e.line(f"{address} = inttoptr i64 {wide(code)} to ptr")
        passed = "".join(f", i64 {wide(number)}" for number in (data, *numbers))
        return self.e.let(f"call i64 {address}(ptr %rec{passed})")

    def constants(self) -> str:
        """IR of the tables used so far."""
        return "\n".join(
            f"{name} = private unnamed_addr constant [{len(values)} x i64] [{', '.join(f'i64 {v}' for v in values)}]"
            for values, name in self.tables.items())  # fmt: skip

    def either(
        self, condition: Number, costly: Callable[[], tuple[Number, ...]], *others: Number
    ) -> tuple[Number, ...]:
        """A branch around it."""
        e, texts = self.e, [wide(value) for value in others]
        start, yes, done = e.block, e.fresh("yes"), e.fresh("done")
        e.end(f"br i1 {truth(condition)}, label %{yes}, label %{done}")
        e.start(yes)
        found, end = [wide(value) for value in costly()], e.block
        e.end(f"br label %{done}")
        e.start(done)
        return tuple(e.let(f"phi i64 [ {value}, %{end.label} ], [ {other}, %{start.label} ]")
                     for value, other in zip(found, texts, strict=True))  # fmt: skip

    def loop(self, count: Number, body: Callable[..., tuple[Number, ...]], *carried: Number) -> tuple[Number, ...]:
        """The test is behind the body."""

        def turn(number: Value, *values: Value) -> tuple[Value, tuple[Number, ...], Number]:
            after = body(number, *values)
            return number + 1, after, number + 1 < count

        return self._around(turn, 0, *carried)

    def scan(self, bits: Number, body: Callable[..., tuple[Number, ...]], *carried: Number) -> tuple[Number, ...]:
        """As `loop`; `bits` is not 0."""

        def turn(left: Value, *values: Value) -> tuple[Value, tuple[Number, ...], Number]:
            after = body(self.e.let(f"call i64 @llvm.cttz.i64(i64 {left.text}, i1 true)"), *values)
            rest = left & (left - 1)
            return rest, after, rest != 0

        return self._around(turn, bits, *carried)

    def _around(
        self, turn: Callable[..., tuple[Value, tuple[Number, ...], Number]], *before: Number
    ) -> tuple[Number, ...]:
        """A loop whose first value controls it: turn(*values) = what that becomes, what the others become, whether to
        go on."""
        e = self.e
        entry, texts = e.block, [wide(value) for value in before]
        loop, done = e.fresh("loop"), e.fresh("done")
        e.end(f"br label %{loop}")
        head = e.start(loop)
        values = [Value(e, e.name(), False) for _ in before]
        head.lines.extend("" for _ in values)
        control, after, more = turn(*values)
        ends = [wide(control), *(wide(value) for value in after)]
        again = truth(more)
        for place, (value, first, following) in enumerate(zip(values, texts, ends, strict=True)):
            head.lines[place] = f"{value.text} = phi i64 [ {first}, %{entry.label} ], [ {following}, %{e.block.label} ]"
        e.end(f"br i1 {again}, label %{loop}, label %{done}")
        e.start(done)
        return tuple(Value(e, text, False) for text in ends[1:])
