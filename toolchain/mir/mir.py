"""Machine form (MIR): dsPIC30F instructions over virtual registers.

Registers are ints: 0..15 are W0..W15, larger ones are virtual. A virtual register is one word, or an even-aligned pair
if `MFunction.pairs` contains it (result of MUL, dividend of DIV.SD).

OPS describes every operation: the operands that it reads and writes, and its effect on flags and memory. Passes use
`uses`, `defs`, `reads_memory`, `writes_memory` and `has_effect` instead of the name of the operation.

Skips. A skip instruction covers the conditional instructions (`pred`) that follow it directly; the first unconditional
instruction ends them. Their number is not stored. All replacements of a conditional instruction are conditional
(`replacement`).

Volatile accesses. A memory operand carries the number of its volatile access in the source, or 0 if it is not volatile.
All words of one access have the same number; two accesses never share a number.
"""

from __future__ import annotations

import copy
from dataclasses import dataclass, field
from typing import Literal

FIRST_VIRTUAL = 16


@dataclass(frozen=True, slots=True)
class Imm:
    """Literal operand: a number, or an assembler expression such as a symbol or handle(f)."""

    value: int | str

    def __str__(self) -> str:
        return f"#{self.value}"


AddressingMode = Literal["ind", "++", "--", "+", "-", "off", "idx"]


@dataclass(frozen=True, slots=True)
class Mem:
    """Register-indirect operand.

    Modes: "ind" [W], "++" [W++], "--" [W--], "+" [++W], "-" [--W], "off" [W+off], "idx" [W+Wi] (`off` is register i).
    """

    mode: AddressingMode
    base: int
    off: int = 0
    volatile: int = 0


@dataclass(frozen=True, slots=True)
class FrameSlot:
    """Operand in the stack frame: number of the frame object and byte offset in it."""

    index: int
    off: int = 0
    volatile: int = 0


@dataclass(frozen=True, slots=True)
class FileRegister:
    """Directly addressed memory: assembler expression of the address; `near`: it is known to be below 0x2000."""

    expr: str
    near: bool
    volatile: int = 0


Operand = int | Imm | Mem | FrameSlot | FileRegister | str
MEMORY = (Mem, FrameSlot, FileRegister)
STEPPING = ("++", "--", "+", "-")


class OpInfo:
    """Description of an operation.

    roles           one letter per operand: s read, d written, b both, n neither; capital S D B for even-aligned pairs,
                    which the low register represents after allocation
    writes, reads   flags that it writes and reads
    words           size in program words
    memory          "r" and "w" if it reads or writes memory in addition to its operands
    fixed           whether it has effects besides those on registers, flags and memory, so that it cannot be moved
    """

    __slots__ = ("access", "fixed", "flags", "memory", "reads", "roles", "words", "writes")

    def __init__(
        self, roles: str, writes: str = "", reads: str = "", words: int = 1, memory: str = "", fixed: bool = False
    ) -> None:
        self.roles = roles
        self.writes = writes
        self.reads = reads
        self.words = words
        self.memory = memory
        self.fixed = fixed
        self.flags = frozenset(writes)
        self.access = tuple(ROLE_ACCESS[role] for role in roles)


# By role: is the operand read, is it written, does a conditional write read it too; real registers (1: one, 3: a pair).
ROLE_ACCESS = {
    "n": (False, False, False, 1),
    "s": (True, False, False, 1),
    "d": (False, True, True, 1),
    "b": (True, True, False, 1),
    "S": (True, False, False, 3),
    "D": (False, True, False, 3),
    "B": (True, True, False, 3),
}


def opaque(roles: str, writes: str = "", words: int = 1) -> OpInfo:
    """An instruction with unknown effects: it may access any memory and cannot be moved."""
    return OpInfo(roles, writes, words=words, memory="rw", fixed=True)


ARITH, LOGIC, SHIFT1 = "cznv", "zn", "czn"
OPS: dict[str, OpInfo] = {
    "mov": OpInfo("sd"),
    "movlow": OpInfo("sb"),  # replaces the low byte of a register
    **{n: OpInfo("bs", LOGIC) for n in ("iorlow", "xorlow")},  # byte operations on the low byte of a register
    "lea": OpInfo("nd", ARITH, words=2),
    **{n: OpInfo("ssd", ARITH) for n in ("add", "sub", "subr")},
    **{n: OpInfo("ssd", ARITH, "cz") for n in ("addc", "subb", "subbr")},
    **{n: OpInfo("ssd", LOGIC) for n in ("and", "ior", "xor")},
    **{n: OpInfo("nb", ARITH) for n in ("addl", "subl")},
    **{n: OpInfo("nb", ARITH, "cz") for n in ("addcl", "subbl")},
    **{n: OpInfo("nb", LOGIC) for n in ("andl", "iorl", "xorl")},
    **{n: OpInfo("sd", ARITH) for n in ("inc", "inc2", "dec", "dec2", "neg")},
    "com": OpInfo("sd", LOGIC),
    "clr": OpInfo("d"),
    "clrd": OpInfo("D"),
    "borrow": OpInfo("d", ARITH, "cz"),
    "setm": OpInfo("d"),
    **{n: OpInfo("ssd", LOGIC) for n in ("sl", "lsr", "asr")},
    **{n: OpInfo("sd", SHIFT1) for n in ("sl1", "lsr1", "asr1")},
    **{n: OpInfo("sd", SHIFT1, "c") for n in ("rlc", "rrc")},
    **{n: OpInfo("sd", LOGIC) for n in ("rlnc", "rrnc")},
    "se": OpInfo("sd", SHIFT1),
    "ze": OpInfo("sd", SHIFT1),
    "swap": OpInfo("b"),
    "exch": OpInfo("bb"),
    **{n: OpInfo("bn") for n in ("bset", "bclr", "btg")},
    "btst": OpInfo("sn", "z"),
    "btstc": OpInfo("sn", "c"),
    "btstv": OpInfo("ss", "z"),
    "cp": OpInfo("ss", ARITH),
    "cpb": OpInfo("ss", ARITH, "cz"),
    "cp0": OpInfo("s", ARITH),
    **{f"mul.{k}": OpInfo("ssD") for k in ("ss", "uu", "su", "us")},
    **{n: OpInfo("ss", ARITH, words=2) for n in ("div.s", "div.u")},
    **{n: OpInfo("Ss", ARITH, words=2) for n in ("div.sd", "div.ud")},
    "ff1l": OpInfo("sd", "c"),
    "ff1r": OpInfo("sd", "c"),
    "split": OpInfo("ddS", words=0),
    "splitlo": OpInfo("dS", words=0),
    "join": OpInfo("Dss", words=0),
    "movd": OpInfo("SD"),
    # file-register forms: address, then W0 (WREG) if it is an operand
    **{n: OpInfo("b", ARITH) for n in ("incf", "decf", "inc2f", "dec2f", "negf")},
    "cp0f": OpInfo("s", ARITH),
    "comf": OpInfo("b", LOGIC),
    **{n: OpInfo("d") for n in ("clrf", "setmf")},
    **{n: OpInfo("bn") for n in ("bsetf", "bclrf", "btgf")},
    **{n: OpInfo("b", SHIFT1) for n in ("slf", "lsrf", "asrf")},
    **{n: OpInfo("bs", ARITH) for n in ("addf", "subf")},
    **{n: OpInfo("bs", ARITH, "cz") for n in ("addcf", "subbf")},
    **{n: OpInfo("bs", LOGIC) for n in ("andf", "iorf", "xorf")},
    **{n: OpInfo("sb", LOGIC) for n in ("andw", "iorw", "xorw")},
    "btstf": OpInfo("sn", "z"),
    # copies and fills of memory blocks, with pointers in registers
    "repmov": OpInfo("nbb", words=2, memory="rw"),
    "repfill": OpInfo("nbs", words=2, memory="w"),
    "repclr": OpInfo("nb", words=2, memory="w"),
    # skip covers all conditional instructions that follow it, CPSxx and BTSx cover one (isa.md §7.3)
    "skip": OpInfo("n", fixed=True),
    **{n: OpInfo("ss", fixed=True) for n in ("cpseq", "cpsne", "cpslt", "cpsgt")},
    **{n: OpInfo("sn", fixed=True) for n in ("btsc", "btss", "btscf", "btssf")},
    # control flow
    "call": opaque("n", ARITH),
    "callr": opaque("s", ARITH),
    "bra": OpInfo("n", fixed=True),
    "jump": OpInfo("n", fixed=True),
    "jumpr": OpInfo("s", fixed=True),
    "brtable": OpInfo("sn", fixed=True),
    "ret": opaque(""),
    "tailcall": opaque("n"),
    "shiftloop": OpInfo("", ARITH, words=5, fixed=True),
    "asm": opaque("", ARITH),
    "disi": opaque("n"),
    "begin_atomic": opaque("", ARITH, words=4),
    "end_atomic": opaque("", words=0),
    "text": opaque("", ARITH),
    "spadd": opaque("n", ARITH),
    "setsp": opaque("s"),
    **{n: OpInfo("sd", memory="r", fixed=True) for n in ("tblrdl", "tblrdh")},
    **{n: opaque("sd") for n in ("tblwtl", "tblwth")},
}

SKIPS = {"skip", "cpseq", "cpsne", "cpslt", "cpsgt", "btsc", "btss", "btscf", "btssf"}
READS_FLAGS = {"bra", "skip"}
NZ = frozenset("zn")
CC_FLAGS = {
    "z": "z", "nz": "z", "c": "c", "nc": "c", "n": "n", "nn": "n", "lt": "nv", "ge": "nv", "gt": "znv", "le": "znv",
    "gtu": "cz", "leu": "cz", "ov": "v", "nov": "v",
}  # fmt: skip
CC_INVERSE = {
    "z": "nz", "nz": "z", "c": "nc", "nc": "c", "n": "nn", "nn": "n", "lt": "ge", "ge": "lt", "gt": "le", "le": "gt",
    "gtu": "leu", "leu": "gtu", "ov": "nov", "nov": "ov",
}  # fmt: skip


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
        text = f"{self.op}{cc}{'.b' if self.byte else ''} " + ", ".join(map(_show, self.args))
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


def _show(a: Operand) -> str:
    if isinstance(a, int):
        return f"w{a}" if a < FIRST_VIRTUAL else f"v{a}"
    return str(a)


VariableClaim = tuple[str, tuple[int, ...], tuple[int, ...]]
"""A claim: DILocalVariable, the registers of its words, and the values that the registers must contain."""
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
