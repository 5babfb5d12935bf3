"""Blocks, frame objects and functions of the machine form.

A virtual register is one word, or an even-aligned pair if `MFunction.pairs` contains it (result of MUL, dividend of
DIV.SD).
"""

from __future__ import annotations

import copy
from dataclasses import dataclass, field

from toolchain.mir.instruction import MI
from toolchain.mir.operands import FIRST_VIRTUAL

VariableLocation = tuple[str, tuple[int, ...]]
"""DILocalVariable and its words: register, OPTIMISED_OUT or CONSTANT_WORD + value. One word -1 - k: frame object k."""
OPTIMISED_OUT, CONSTANT_WORD = 1 << 20, 1 << 21


@dataclass(slots=True)
class MBlock:
    """Basic block: straight-line code that ends in branches. Successors are named in `succs`."""

    name: str
    insts: list[MI] = field(default_factory=list)
    succs: list[str] = field(default_factory=list)
    depth: int = 0  # loop nesting depth
    address_taken: bool = False


@dataclass(slots=True)
class FrameObject:
    """Object in the frame. `fixed` is the (negative) offset of an incoming stack argument from W15 at entry."""

    size: int
    fixed: int | None = None
    spill: bool = False
    offset: int = 0


@dataclass(slots=True)
class MFunction:
    """One function in machine form."""

    name: str
    blocks: list[MBlock] = field(default_factory=list)
    frame: list[FrameObject] = field(default_factory=list)
    pairs: set[int] = field(default_factory=set)
    next_register: int = FIRST_VIRTUAL
    pair_hints: dict[int, int] = field(default_factory=dict)  # preferred high word register of each low word register
    dynamic_stack: bool = False  # W15 changes by amounts that are known only at run time
    uses_fp: bool = False  # W14 is the frame pointer
    naked: bool = False  # without prologue and epilogue
    interrupt: str = ""  # "", "no_auto_psv", "auto_psv"; "shadow" may be appended after a comma
    preserved: tuple[str, ...] = ()  # variables that an interrupt function saves in addition to registers
    preprologue: tuple[str, ...] = ()  # lines of assembly before the prologue
    tables: list[tuple[str, list[str]]] = field(default_factory=list)
    slot_of: dict[int, int] = field(default_factory=dict)  # frame object by id(IR value), for debug information
    bindings: dict[int, VariableLocation] = field(default_factory=dict)  # variable's location by debug record
    locals_base: int = 0  # offset of the locals from W15 at entry
    frame_base: tuple[int, int] = (15, 0)  # base register in the body, offset of W15 at entry
    frame_bytes: int = 0  # locals and saved registers, known after the frame pass
    temps: set[int] = field(default_factory=set)  # registers of spill code, which must not be spilled again

    def new_register(self) -> int:
        """A fresh one-word virtual register."""
        self.next_register += 1
        return self.next_register - 1

    def new_pair(self) -> int:
        """A fresh even-aligned pair."""
        r = self.new_register()
        self.pairs.add(r)
        return r

    def clone(self) -> MFunction:
        """An independent copy."""
        new = copy.copy(self)
        new.blocks = [
            MBlock(b.name, [i.clone() for i in b.insts], list(b.succs), b.depth, b.address_taken) for b in self.blocks
        ]
        new.frame = [copy.copy(o) for o in self.frame]
        new.pairs, new.pair_hints, new.temps = set(self.pairs), dict(self.pair_hints), set(self.temps)
        return new

    def block_map(self) -> dict[str, MBlock]:
        """Blocks by name."""
        return {b.name: b for b in self.blocks}

    def dump(self) -> str:
        """Text of the function for debugging."""
        out = [f"function {self.name}"]
        for b in self.blocks:
            out.append(f"{b.name}:  -> {', '.join(b.succs)}")
            out += [f"    {mi!r}" for mi in b.insts]
        return "\n".join(out)
