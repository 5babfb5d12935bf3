"""Instructions of the machine form (`MI`), pair moves and skips.

A skip instruction covers the conditional instructions (`pred`) that follow it directly; the first unconditional
instruction ends them. Their number is not stored. All replacements of a conditional instruction are conditional
(`replacement`).
"""

from __future__ import annotations

from dataclasses import dataclass

from toolchain.mir.operands import (
    FIRST_VIRTUAL,
    MEMORY,
    STEPPING,
    FileRegister,
    FrameSlot,
    Imm,
    Mem,
    Operand,
    operand_text,
)
from toolchain.mir.operations import CC_FLAGS, NZ, OPS, READS_FLAGS

VariableClaim = tuple[str, tuple[int, ...], tuple[int, ...]]
"""A claim: DILocalVariable, the registers of its words, and the values that the registers must contain."""


class MI:
    """One machine instruction.

    byte    whether it is the byte-sized form
    cc      condition of bra and skip
    pred    conditional: executed only if the skip before it is not taken; its results are therefore also inputs
    also_uses, also_defs   implicit registers (calls, DIV, inline assembly)
    late    indices of the operands that are read after the results are written (DIV divisor)
    tail    of a call: the callee does not access this frame, and only the epilogue follows
    epilogue        whether the frame pass has inserted it before RETURN
    claims          locations of source variables before the instruction
    written_values  for each register that it writes, the number of the value that the register then contains
    values_before   the same for copies before it that allocation removed
    text    template of inline assembly; \\0n:m\\0 represents operand n with modifier m
    """

    __slots__ = (
        "also_defs",
        "also_uses",
        "args",
        "byte",
        "cc",
        "claims",
        "epilogue",
        "info",
        "late",
        "line",
        "op",
        "pred",
        "tail",
        "text",
        "values_before",
        "written_values",
    )

    def __init__(self, op: str, *args: Operand, byte: bool = False, cc: str = "", line: str | None = None) -> None:
        self.op = op
        self.info = OPS[op]
        self.args = list(args)
        self.byte = byte
        self.cc = cc
        self.pred = False
        self.also_uses: tuple[int, ...] = ()
        self.also_defs: tuple[int, ...] = ()
        self.late: tuple[int, ...] = ()
        self.line = line
        self.tail = False
        self.epilogue = False
        self.claims: tuple[VariableClaim, ...] = ()
        self.written_values: dict[int, int] = {}
        self.values_before: dict[int, int] = {}
        self.text = ""

    def register(self, k: int) -> int:
        """Operand `k`, which is a register."""
        a = self.args[k]
        assert isinstance(a, int)
        return a

    def number(self, k: int) -> int:
        """Value of operand `k`, which is a literal number."""
        a = self.args[k]
        assert isinstance(a, Imm)
        assert isinstance(a.value, int)
        return a.value

    def slot(self, k: int) -> FrameSlot:
        """Operand `k`, which is in the frame."""
        a = self.args[k]
        assert isinstance(a, FrameSlot)
        return a

    @property
    def target(self) -> str:
        """Name of the block that bra or jump branches to."""
        return str(self.args[0])

    def uses(self) -> list[int]:
        """Registers that the instruction reads."""
        out = list(self.also_uses)
        for role, a in zip(self.info.roles, self.args, strict=False):
            if a.__class__ is int:
                if role in "sb" or (self.pred and role == "d"):
                    out.append(a)
                elif role in "SB":
                    out += (a, a + 1) if a < FIRST_VIRTUAL else (a,)
            elif a.__class__ is Mem:
                out.append(a.base)
                if a.mode == "idx":
                    out.append(a.off)
        return out

    def defs(self) -> list[int]:
        """Registers that the instruction writes."""
        out = list(self.also_defs)
        for role, a in zip(self.info.roles, self.args, strict=False):
            if a.__class__ is int:
                if role in "db":
                    out.append(a)
                elif role in "DB":
                    out += (a, a + 1) if a < FIRST_VIRTUAL else (a,)
            elif a.__class__ is Mem and a.mode in STEPPING:
                out.append(a.base)
        return out

    def register_sets(self) -> tuple[int, int]:
        """Registers read and registers written, as bit sets of `liveness` (bit n for register n)."""
        used = defined = 0
        if self.also_uses:
            for r in self.also_uses:
                used |= 1 << r
        if self.also_defs:
            for r in self.also_defs:
                defined |= 1 << r
        for a, (reads, writes, partly, real) in zip(self.args, self.info.access, strict=False):
            if a.__class__ is int:
                bit = (real if a < FIRST_VIRTUAL else 1) << a
                if reads or (partly and self.pred):
                    used |= bit
                if writes:
                    defined |= bit
            elif a.__class__ is Mem:
                used |= 1 << a.base
                if a.mode == "idx":
                    used |= 1 << a.off
                elif a.mode in STEPPING:
                    defined |= 1 << a.base
        return used, defined

    def map_registers(self, rename: dict[int, int]) -> None:
        """Rename registers in place."""
        for k, a in enumerate(self.args):
            if a.__class__ is int:
                self.args[k] = rename.get(a, a)
            elif a.__class__ is Mem:
                base = rename.get(a.base, a.base)
                off = rename.get(a.off, a.off) if a.mode == "idx" else a.off
                if base != a.base or off != a.off:
                    self.args[k] = Mem(a.mode, base, off, a.volatile)
        if self.also_uses:
            self.also_uses = tuple(rename.get(r, r) for r in self.also_uses)
        if self.also_defs:
            self.also_defs = tuple(rename.get(r, r) for r in self.also_defs)

    def clone(self) -> MI:
        """An independent copy."""
        new = MI.__new__(MI)  # faster than copy.copy(); the allocator clones functions up to three times
        new.op, new.info, new.args = self.op, self.info, list(self.args)
        new.byte, new.cc, new.pred, new.late, new.line = self.byte, self.cc, self.pred, self.late, self.line
        new.also_uses, new.also_defs = self.also_uses, self.also_defs
        new.tail, new.epilogue, new.text = self.tail, self.epilogue, self.text
        new.claims, new.written_values, new.values_before = self.claims, self.written_values, self.values_before
        return new

    @property
    def volatile(self) -> int:
        """Number of the volatile access that the instruction belongs to, 0 if there is none."""
        for a in self.args:
            if isinstance(a, MEMORY) and a.volatile:
                return a.volatile
        return 0

    def _memory(self, roles: str) -> bool:
        return any(role in roles and isinstance(a, MEMORY) for role, a in zip(self.info.roles, self.args, strict=False))

    def reads_memory(self) -> bool:
        """Whether the instruction reads memory."""
        return "r" in self.info.memory or self._memory("sSbB")

    def writes_memory(self) -> bool:
        """Whether the instruction writes memory."""
        return "w" in self.info.memory or self._memory("dDbB")

    def has_effect(self) -> bool:
        """Whether it has effects besides those on registers and flags. Modifying a pointer counts as an effect."""
        if self.info.fixed or self.info.memory or self.volatile or self._memory("dDbB"):
            return True
        return any(a.__class__ is Mem and a.mode in STEPPING for a in self.args)

    def replacement(self, made: list[MI]) -> list[MI]:
        """Return the instructions `made` that replace this one; they are made conditional if this one is."""
        for mi in made:
            mi.pred = self.pred
        return made

    def is_copy(self) -> bool:
        """Whether the instruction is an unconditional word move between registers."""
        return (
            self.op == "mov"
            and self.args[0].__class__ is int
            and self.args[1].__class__ is int
            and not self.pred
            and not self.byte
        )

    def flags_read(self) -> str:
        """Flags that the instruction reads."""
        return CC_FLAGS.get(self.cc, "") if self.op in READS_FLAGS else self.info.reads

    def flags_written(self) -> str:
        """Flags that the instruction writes; a byte move from a near address sets N and Z (isa.md §6.2)."""
        if self.op == "mov" and self.byte and isinstance(self.args[0], FileRegister):
            return "zn"
        return self.info.writes

    def flags_written_set(self) -> frozenset[str]:
        """`flags_written` as a set."""
        return NZ if self.op == "mov" and self.byte and isinstance(self.args[0], FileRegister) else self.info.flags

    def __repr__(self) -> str:
        cc = f".{self.cc}" if self.cc else ""
        text = f"{self.op}{cc}{'.b' if self.byte else ''} " + ", ".join(map(operand_text, self.args))
        if self.also_uses or self.also_defs:
            text += f"  uses {list(self.also_uses)} defs {list(self.also_defs)}"
        return ("? " if self.pred else "") + text


@dataclass(frozen=True, slots=True)
class PairMove:
    """Operands of split, splitlo and join, which copy words out of a register pair or into it."""

    pair: int
    words: tuple[int, ...]  # low word first
    into_pair: bool


def pair_move(mi: MI) -> PairMove | None:
    """The operands of split, splitlo or join; None for other operations."""
    match mi.op:
        case "split":
            return PairMove(mi.register(2), (mi.register(0), mi.register(1)), False)
        case "splitlo":
            return PairMove(mi.register(1), (mi.register(0),), False)
        case "join":
            return PairMove(mi.register(0), (mi.register(1), mi.register(2)), True)
    return None


def covered_count(insts: list[MI], at: int) -> int:
    """Number of instructions that the skip at position `at` covers."""
    end = at + 1
    while end < len(insts) and insts[end].pred:
        end += 1
    return end - at - 1
