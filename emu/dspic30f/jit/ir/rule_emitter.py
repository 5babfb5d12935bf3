"""Rule builders that emit LLVM IR (contract: emu/system/rules.py, emu/dspic30f/interpreter/flow_rules.py).

If a requirement of a rule does not hold, native code leaves before the rule has any effect. For an access it leaves
through the slow exit, and the sequencer performs the access; at a boundary Python does the work.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, Final, Protocol

from emu.dspic30f.interpreter.rule_paths import RulePaths
from emu.dspic30f.jit.ir.deferred import DeferredEffects
from emu.dspic30f.jit.ir.values import Emitter, Number, Value, truth, wide
from emu.dspic30f.jit.ir.variables import pointer
from emu.dspic30f.jit.machine_layout import MachineLayout
from emu.dspic30f.state.state import STACK_POINTER
from emu.system.rules import Cell, EventSlot, cell_of

if TYPE_CHECKING:
    from emu.dspic30f.core import Core


class RuleEmitter:
    """Operations that all rule emitters share."""

    def __init__(self, e: Emitter) -> None:
        self.e: Final = e

    def get(self, cell: Cell, index: Number = 0) -> Value:
        """Emit a load from the record."""
        return self.e.load(pointer(self.e, index * (cell.bits // 8) + cell.offset), cell.bits)

    def select(self, condition: Number, a: Number, b: Number) -> Number:
        """Emit a selection."""
        return self.e.select(condition, a, b)

    def below(self, a: Number, b: Number) -> Value:
        """Emit an unsigned comparison."""
        return self.e.let(f"icmp ult i64 {wide(a)}, {wide(b)}", bit=True)

    def div(self, a: Number, b: Number) -> Value:
        """Emit an unsigned division."""
        return self.e.let(f"udiv i64 {wide(a)}, {wide(b)}")

    def mod(self, a: Number, b: Number) -> Value:
        """Emit an unsigned remainder."""
        return self.e.let(f"urem i64 {wide(a)}, {wide(b)}")

    def least(self, a: Number, b: Number) -> Value:
        """Emit an unsigned minimum."""
        return self.e.let(f"call i64 @llvm.umin.i64(i64 {wide(a)}, i64 {wide(b)})")

    def can_call(self, code: Number) -> Number:
        """Return whether the address of host code is not 0, so that native code can call it."""
        return code != 0

    def call(self, code: Number, data: Number, *numbers: Number) -> Value:
        """Emit a call of host code. Everything that it reads has already been stored."""
        address = self.e.name()
        self.e.line(f"{address} = inttoptr i64 {wide(code)} to ptr")
        passed = "".join(f", i64 {wide(number)}" for number in (data, *numbers))
        return self.e.let(f"call i64 {address}(ptr %rec{passed})")

    def notify(self, condition: Number, code: Number, data: Number, *numbers: Number) -> None:
        """Emit a call of host code that is skipped unless `condition` holds."""
        yes, done = self.e.fresh("yes"), self.e.fresh("done")
        self.e.end(f"br i1 {truth(condition)}, label %{yes}, label %{done}")
        self.e.start(yes)
        self.call(code, data, *numbers)
        self.e.end(f"br label %{done}")
        self.e.start(done)


class AccessContext(Protocol):
    """The part of an instruction's builder that `AccessEmitter` uses."""

    @property
    def e(self) -> Emitter: ...

    @property
    def layout(self) -> MachineLayout: ...

    @property
    def now(self) -> Number: ...

    @property
    def deferred(self) -> DeferredEffects: ...

    def sr_word(self) -> Value: ...

    def guard(self, ok: Number) -> None: ...


class AccessEmitter(RuleEmitter):
    """Emitter for rules of a translated instruction: its register accesses, and its effects on devices.

    All stores are deferred to the end of the instruction.
    """

    def __init__(self, b: AccessContext) -> None:
        super().__init__(b.e)
        self._b: Final = b
        self.now: Final = b.now

    def get(self, cell: Cell, index: Number = 0) -> Value:
        """Emit a load from the record; SR is composed from the flag variables."""
        return self._b.sr_word() if cell == self._b.layout.flow.sr else super().get(cell, index)

    def put(self, cell: Cell, value: Number, index: Number = 0) -> None:
        """Defer a store to the end of the translated instruction."""
        if cell == self._b.layout.flow.sr:
            self._b.deferred.sr = value, 0xFFFF
            return
        e, offset = self.e, index * (cell.bits // 8) + cell.offset
        self._b.deferred.stores.append(lambda: e.store(pointer(e, offset), value, cell.bits))

    def require(self, condition: Number) -> None:
        """Leave native code before the instruction unless `condition` holds."""
        self._b.guard(condition)

    def table(self, values: tuple[int, ...], index: Number) -> Number:
        """Emit a chain of selections, because tables of accesses are short."""
        found: Number = values[-1]
        for number, value in enumerate(values[:-1]):
            found = self.select(index == number, value, found)
        return found

    def notify(self, condition: Number, code: Number, data: Number, *numbers: Number) -> None:
        """Defer the call to the end of the translated instruction."""
        self._b.deferred.stores.append(lambda: RuleEmitter.notify(self, condition, code, data, *numbers))

    def post(self, slot: EventSlot, due: Number) -> None:
        """Defer the posting of an event. Native code returns after the instruction: the deadline may become earlier."""
        deadline = self.get(slot.deadline)
        self.put(slot.due, due)
        self.put(slot.deadline, self.least(deadline, due))
        self._b.deferred.deadline_moved = True


class LlvmRulePaths(RulePaths):
    """Emitter of flow rules that run after an instruction. RA and DA of SR are always in the record.

    `known` is as for `RulePaths`. `on_path()` is called at the start of each path.
    """

    def __init__(
        self, e: Emitter, known: Mapping[Cell, int] = MappingProxyType({}), on_path: Callable[[], None] = lambda: None
    ) -> None:
        super().__init__(known)
        self.e: Final = e
        self._on_path: Final = on_path

    def load(self, cell: Cell) -> Value:
        """Emit a load from the record."""
        return self.e.load(pointer(self.e, cell.offset), cell.bits)

    def store(self, cell: Cell, value: Number) -> None:
        """Emit a store to the record."""
        self.e.store(pointer(self.e, cell.offset), value, cell.bits)

    def select(self, condition: Number, a: Number, b: Number) -> Number:
        """Emit a selection."""
        return self.e.select(condition, a, b)

    def branches(self, condition: Number) -> Iterator[bool]:
        """Emit a conditional branch and start its two blocks in turn."""
        yes, no = self.e.fresh("yes"), self.e.fresh("no")
        self.e.end(f"br i1 {truth(condition)}, label %{yes}, label %{no}")
        for label, decision in ((yes, True), (no, False)):
            self.e.start(label)
            self._on_path()
            yield decision


class BoundaryEmitter(RuleEmitter):
    """Emitter for rules of events, exceptions and indirect accesses. It emits effects in the order of the rule."""

    def __init__(
        self, core: Core, e: Emitter, now: Number, otherwise: str, tables: dict[tuple[int, ...], str] | None = None
    ) -> None:
        """`otherwise` is the label of the block that leaves the work to Python.

        `tables` shares the constants of another emitter for the same module.
        """
        super().__init__(e)
        self.now: Final = now
        self._core: Final = core
        self._otherwise: Final = otherwise
        self.tables: Final[dict[tuple[int, ...], str]] = tables if tables is not None else {}
        self.posted: Final[set[EventSlot]] = set()
        """Event slots that a rule has posted."""

    def put(self, cell: Cell, value: Number, index: Number = 0) -> None:
        """Emit a store to the record."""
        self.e.store(pointer(self.e, index * (cell.bits // 8) + cell.offset), value, cell.bits)

    def require(self, condition: Number) -> None:
        """Branch to `otherwise` unless `condition` holds."""
        go = self.e.fresh("go")
        self.e.end(f"br i1 {truth(condition)}, label %{go}, label %{self._otherwise}")
        self.e.start(go)

    def post(self, slot: EventSlot, due: Number) -> None:
        """Emit stores of the due cycle and the deadline."""
        self.put(slot.due, due)
        self.put(slot.deadline, self.least(self.get(slot.deadline), due))
        self.posted.add(slot)

    def push(self, low: Number, high: Number, _cycle: Number) -> None:
        """Emit a push of two words. Python handles a push that does not fit on the stack."""
        state, ram = self._core.state, self._core.chip.data["ram"]
        top, limit = Cell(2 * STACK_POINTER, 16), Cell(2 * state.at["SPLIM"], 16)
        ea = self.get(top)
        unlimited = self.get(cell_of(state.record, "cpu.limit_armed")) == 0
        self.require((unlimited | (ea + 2 <= self.get(limit))) & (ea >= ram.start) & (ea < ram.end - 2))
        for word, value in ((0, low), (2, high)):
            self.e.store(pointer(self.e, ea + word), value, 16)
        self.put(top, ea + 4)

    def handler(self, vector: Number) -> Value:
        """Emit a load of the handler address from a vector in flash."""
        return self.e.load(pointer(self.e, (vector << 1) + self._core.program.flash_offset), 32)

    def table(self, values: tuple[int, ...], index: Number) -> Value:
        """Emit a load from a constant array."""
        name = self.tables.setdefault(values, f"@table{len(self.tables)}")
        element = self.e.name()
        self.e.line(f"{element} = getelementptr [{len(values)} x i64], ptr {name}, i64 0, i64 {wide(index)}")
        return self.e.let(f"load i64, ptr {element}")

    def constants(self) -> str:
        """Return the IR of the constant arrays used so far."""
        return "\n".join(
            f"{name} = private unnamed_addr constant [{len(values)} x i64] [{', '.join(f'i64 {v}' for v in values)}]"
            for values, name in self.tables.items())  # fmt: skip

    def lazy_select(
        self, condition: Number, costly: Callable[[], tuple[Number, ...]], *others: Number
    ) -> tuple[Number, ...]:
        """Emit a branch that skips the computation of `costly` unless `condition` holds."""
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
        """Emit a loop whose test follows the body."""

        def iteration(number: Value, *values: Value) -> tuple[Value, tuple[Number, ...], Number]:
            after = body(number, *values)
            return number + 1, after, number + 1 < count

        return self._emit_loop(iteration, 0, *carried)

    def scan(self, bits: Number, body: Callable[..., tuple[Number, ...]], *carried: Number) -> tuple[Number, ...]:
        """Emit a loop over the set bits of `bits`, which is not 0."""

        def iteration(left: Value, *values: Value) -> tuple[Value, tuple[Number, ...], Number]:
            after = body(self.e.let(f"call i64 @llvm.cttz.i64(i64 {left.text}, i1 true)"), *values)
            rest = left & (left - 1)
            return rest, after, rest != 0

        return self._emit_loop(iteration, bits, *carried)

    def _emit_loop(
        self, iteration: Callable[..., tuple[Value, tuple[Number, ...], Number]], *before: Number
    ) -> tuple[Number, ...]:
        """Emit a loop over values, of which the first controls the loop.

        iteration(*values) returns the next control value, the next other values, and whether to continue.
        """
        e = self.e
        entry, texts = e.block, [wide(value) for value in before]
        loop, done = e.fresh("loop"), e.fresh("done")
        e.end(f"br label %{loop}")
        head = e.start(loop)
        values = [Value(e, e.name(), False) for _ in before]
        head.lines.extend("" for _ in values)
        control, after, more = iteration(*values)
        ends = [wide(control), *(wide(value) for value in after)]
        again = truth(more)
        for line, (value, first, following) in enumerate(zip(values, texts, ends, strict=True)):
            head.lines[line] = f"{value.text} = phi i64 [ {first}, %{entry.label} ], [ {following}, %{e.block.label} ]"
        e.end(f"br i1 {again}, label %{loop}, label %{done}")
        e.start(done)
        return tuple(Value(e, text, False) for text in ends[1:])
