"""The reader of device rules that writes LLVM IR (contract: emu/straight.py).

A need that does not hold leaves through the slow exit, before anything is done, and the sequencer makes the access.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from emu.dspic30f.jit.values import Number, Value, wide
from emu.dspic30f.jit.variables import pointer
from emu.straight import Place, Slot

if TYPE_CHECKING:
    from emu.dspic30f.jit.builder import LlvmBuilder


class NativeReader:
    """One access of the instruction a builder is at; what it puts is committed with the instruction."""

    def __init__(self, b: LlvmBuilder) -> None:
        self._b: Final = b
        self.now: Final = b.now

    def get(self, place: Place, index: Number = 0) -> Value:
        """Load."""
        return self._b.e.load(pointer(self._b.e, index * (place.bits // 8) + place.offset), place.bits)

    def put(self, place: Place, value: Number, index: Number = 0) -> None:
        """Store, with the instruction's other effects."""
        e, offset = self._b.e, index * (place.bits // 8) + place.offset
        self._b.pending.stores.append(lambda: e.store(pointer(e, offset), value, place.bits))

    def need(self, condition: Number) -> None:
        """Leave before the instruction unless this holds."""
        self._b.guard(condition)

    def select(self, condition: Number, a: Number, b: Number) -> Number:
        """Choice."""
        return self._b.select(condition, a, b)

    def below(self, a: Number, b: Number) -> Value:
        """Unsigned comparison."""
        return self._b.e.let(f"icmp ult i64 {wide(a)}, {wide(b)}", bit=True)

    def div(self, a: Number, b: Number) -> Value:
        """Unsigned quotient."""
        return self._b.e.let(f"udiv i64 {wide(a)}, {wide(b)}")

    def mod(self, a: Number, b: Number) -> Value:
        """Unsigned remainder."""
        return self._b.e.let(f"urem i64 {wide(a)}, {wide(b)}")

    def post(self, slot: Slot, due: Number) -> None:
        """Store the due cycle; the deadline may come nearer, so the function is left behind the instruction."""
        deadline = self.get(slot.deadline)
        self.put(slot.due, due)
        self.put(slot.deadline, self._b.e.let(f"call i64 @llvm.umin.i64(i64 {deadline.text}, i64 {wide(due)})"))
        self._b.pending.replanned = True
