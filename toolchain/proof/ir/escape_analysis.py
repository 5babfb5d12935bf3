"""Escape analysis of a function's IR: variables whose addresses escape, and bytes accessed only as volatile.

A location is a variable, `@name` or `%name`, and a byte offset, None if an index is not constant.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TypeAlias

from toolchain.ir.model import ConstInt, Function, GlobalRef, Instr, Type, Value, size_of, struct_offsets

VariableByte: TypeAlias = tuple[str, int | None]


class Accesses:
    """Accesses of one function to its variables."""

    def __init__(self, f: Function) -> None:
        self._instrs = [i for b in f.blocks for i in b.instrs]
        self._places: dict[int, VariableByte] = {id(i): (f"%{i.name}", 0) for i in self._instrs if i.op == "alloca"}
        addresses = [i for i in self._instrs if i.op == "getelementptr"]
        found = -1
        while found != len(self._places):  # repeat until stable, because blocks are in no particular order
            found = len(self._places)
            for i in addresses:
                base = self._place(i.args[0])
                if base is not None:
                    offset = offset_of(i)
                    whole = None if base[1] is None or offset is None else base[1] + offset
                    self._places[id(i)] = base[0], whole

    def _place(self, v: Value) -> VariableByte | None:
        return (f"@{v.name}", v.offset) if isinstance(v, GlobalRef) else self._places.get(id(v))

    def _uses(self) -> Iterator[tuple[Instr, int, VariableByte]]:
        for i in self._instrs:
            for n, a in enumerate(i.args):
                place = self._place(a)
                if place is not None:
                    yield i, n, place

    def escaped(self) -> set[str]:
        """Return the frame variables, without `%`, whose addresses are used for more than loads and stores."""
        return {root[1:] for i, n, (root, _) in self._uses() if root[0] == "%" and not _stays(i, n)}

    def volatile(self) -> set[VariableByte]:
        """Return the bytes that the function accesses by volatile accesses only."""
        known: dict[bool, set[VariableByte]] = {True: set(), False: set()}
        mixed: set[str] = set()
        for i, n, (root, at) in self._uses():
            if (i.op == "load" and n == 0) or (i.op == "store" and n == 1):
                t = i.type if i.op == "load" else i.args[0].type
                if at is not None:
                    known[i.volatile] |= {(root, at + k) for k in range(size_of(t))}
                elif not i.volatile:
                    mixed.add(root)
            elif i.op in ("phi", "select") or (i.op == "call" and _name(i).startswith("llvm.mem")):
                mixed.add(root)
        return {place for place in known[True] - known[False] if place[0] not in mixed}


def offset_of(i: Instr) -> int | None:
    """Return the byte offset of a getelementptr, None if an index is not constant."""
    t, total = i.extra["type"], 0
    assert isinstance(t, Type)
    for k, index in enumerate(i.args[1:]):
        if not isinstance(index, ConstInt):
            return None
        if k and t.kind == "struct":
            total += struct_offsets(t)[index.value]
            t = t.elems[index.value]
        else:
            t = t.elems[0] if k else t
            total += index.signed * size_of(t)
    return total


def _name(i: Instr) -> str:
    return str(getattr(i.args[-1], "name", ""))


def _stays(i: Instr, n: int) -> bool:
    """Whether an address operand is only loaded from, stored to or offset."""
    if i.op in ("load", "getelementptr"):
        return n == 0
    if i.op == "store":
        return n == 1
    if i.op != "call" or not _name(i).startswith("llvm."):
        return False
    return not _name(i).startswith("llvm.mem") or isinstance(i.args[2], ConstInt)  # else a library call
