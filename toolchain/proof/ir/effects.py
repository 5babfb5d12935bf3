"""Effects of LLVM IR on a path: memory accesses and calls."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

import z3

from toolchain.abi.target import SFR_END
from toolchain.ir.model import ParameterAttributes, Value
from toolchain.proof.ir.operands import OperandValues
from toolchain.proof.memory import StackFrame
from toolchain.proof.path import Event, Path
from toolchain.proof.terms import Term, constant_value


class Effects(OperandValues):
    """Operands, memory accesses and calls on a path; `frame` has the addresses of the function's variables."""

    def __init__(self, frame: StackFrame, address: Callable[[str], int]) -> None:
        super().__init__(address)
        self.frame: Final = frame

    def access(self, path: Path, address: Term, size: int, even: bool) -> Term:
        """Return an accessed address; assume that it is outside the private frame and, for words, even."""
        if constant_value(address) is None:
            path.assumptions.append(self.frame.avoids_private_bytes(address, size))
            path.preferences.append(z3.And(z3.UGE(address, SFR_END), z3.ULT(address, self.frame.lowest - size)))
            if size > 1 and even:
                path.assumptions.append(z3.Extract(0, 0, address) == 0)
        return address

    def record_call(
        self, path: Path, target: Any, values: list[Value], attributes: list[ParameterAttributes] | None = None
    ) -> Event:
        """Record a call, which may change all memory that escapes."""
        attributes = attributes or [{} for _ in values]
        arguments = [(v, self.value(path, v), k) for v, k in zip(values, attributes, strict=True)]
        event = Event("call", target, arguments=arguments, memory=path.memory.copy())
        path.fix_store_order(barrier=False)
        path.events.append(event)
        self.havoc_memory(path, event)
        return event

    def havoc_memory(self, path: Path, event: Event) -> None:
        """Make all memory unknown after an event, except for variables whose addresses do not escape."""
        event.memory_after = z3.Array(f"memory.{len(path.events)}", z3.BitVecSort(16), z3.BitVecSort(8))
        path.memory.havoc(event.memory_after, self.frame.unescaped_bytes())
