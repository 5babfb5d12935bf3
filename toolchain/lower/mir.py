"""Machine form: dsPIC30F instructions over virtual registers.

Registers are ints: 0..15 are W0..W15, larger ones are virtual. A virtual register is one word, or an even-aligned pair
when it is in `MFunction.pairs` (result of MUL, dividend of DIV.SD). OPS says of every operation which operands it reads
and writes and what it does to the flags; every pass asks `uses` and `defs` and nothing else.
"""

from __future__ import annotations

import copy
from dataclasses import dataclass, field

FIRST_VIRTUAL = 16


@dataclass(frozen=True, slots=True)
class Imm:
    """Literal operand: a number, or an assembler expression such as a symbol or handle(f)."""

    value: int | str

    def __str__(self) -> str:
        return f"#{self.value}"


@dataclass(frozen=True, slots=True)
class Mem:
    """Register-indirect operand.

    mode   "ind" [W]   "++" [W++]   "--" [W--]   "+" [++W]   "-" [--W]   "off" [W+off]   "idx" [W+Wi], off is a register
    """

    mode: str
    base: int
    off: int = 0


@dataclass(frozen=True, slots=True)
class Slot:
    """Memory of the frame: object number and byte offset in it."""

    index: int
    off: int = 0


@dataclass(frozen=True, slots=True)
class File:
    """Directly addressed memory: assembler expression of the address. `near` when known to lie below 0x2000."""

    expr: str
    near: bool


Operand = int | Imm | Mem | Slot | File | str


class OpInfo:
    """Operand roles, one letter each: s read, d written, b both, n neither, capital S D for even-aligned pairs (the low
    register stands for both once registers are real); flags written and read; words."""

    __slots__ = ("reads", "roles", "words", "writes")

    def __init__(self, roles: str, writes: str = "", reads: str = "", words: int = 1) -> None:
        self.roles = roles
        self.writes = writes
        self.reads = reads
        self.words = words


ARITH, LOGIC, SHIFT1 = "cznv", "zn", "czn"
OPS: dict[str, OpInfo] = {
    "mov": OpInfo("sd"),
    "lea": OpInfo("sd", ARITH, words=2),
    **{n: OpInfo("ssd", ARITH) for n in ("add", "sub", "subr")},
    **{n: OpInfo("ssd", ARITH, "cz") for n in ("addc", "subb", "subbr")},
    **{n: OpInfo("ssd", LOGIC) for n in ("and", "ior", "xor")},
    **{n: OpInfo("nb", ARITH) for n in ("addl", "subl")},
    **{n: OpInfo("nb", ARITH, "cz") for n in ("addcl", "subbl")},
    **{n: OpInfo("nb", LOGIC) for n in ("andl", "iorl", "xorl")},
    **{n: OpInfo("sd", ARITH) for n in ("inc", "inc2", "dec", "dec2", "neg")},
    "com": OpInfo("sd", LOGIC),
    "clr": OpInfo("d"),
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
    # file-register forms: address, and W0 (WREG) where named
    **{n: OpInfo("n", ARITH) for n in ("incf", "decf", "inc2f", "dec2f", "negf", "cp0f")},
    **{n: OpInfo("n", LOGIC) for n in ("comf", "movf")},
    **{n: OpInfo("n") for n in ("clrf", "setmf", "bsetf", "bclrf", "btgf")},
    **{n: OpInfo("n", SHIFT1) for n in ("slf", "lsrf", "asrf")},
    **{n: OpInfo("ns", ARITH) for n in ("addf", "subf", "cpf")},
    **{n: OpInfo("ns", ARITH, "cz") for n in ("addcf", "subbf")},
    **{n: OpInfo("ns", LOGIC) for n in ("andf", "iorf", "xorf")},
    **{n: OpInfo("nb", LOGIC) for n in ("andw", "iorw", "xorw")},
    "btstf": OpInfo("nn", "z"),
    # blocks, control
    "repmov": OpInfo("nbb", words=2),
    "repfill": OpInfo("nbs", words=2),
    "repclr": OpInfo("nb", words=2),
    "call": OpInfo("n", ARITH),
    "callr": OpInfo("s", ARITH),
    "bra": OpInfo("n"),
    "jump": OpInfo("n"),
    "jumpr": OpInfo("s"),
    "brtable": OpInfo("sn"),
    "skip": OpInfo("n"),
    "ret": OpInfo(""),
    "tailcall": OpInfo("n"),
    "shiftloop": OpInfo("", ARITH, words=5),
    "asm": OpInfo("", ARITH),
    "disi": OpInfo("n"),
    "nop": OpInfo(""),
    "text": OpInfo("", ARITH),
    "spadd": OpInfo("n", ARITH),
    "setsp": OpInfo("s"),
    "vastart": OpInfo("d", ARITH, words=2),
    **{n: OpInfo("sd") for n in ("tblrdl", "tblrdh", "tblwtl", "tblwth")},
}

READS_FLAGS = {"bra", "skip"}
CC_FLAGS = {
    "z": "z", "nz": "z", "c": "c", "nc": "c", "n": "n", "nn": "n", "lt": "nv", "ge": "nv", "gt": "znv", "le": "znv",
    "gtu": "cz", "leu": "cz", "ov": "v", "nov": "v",
}  # fmt: skip
CC_INVERSE = {
    "z": "nz", "nz": "z", "c": "nc", "nc": "c", "n": "nn", "nn": "n", "lt": "ge", "ge": "lt", "gt": "le", "le": "gt",
    "gtu": "leu", "leu": "gtu", "ov": "nov", "nov": "ov",
}  # fmt: skip
SIDE_EFFECTS = {"call", "callr", "bra", "jump", "jumpr", "brtable", "skip", "ret", "tailcall", "asm", "disi", "nop",
                "text", "spadd", "setsp", "repmov", "repfill", "repclr", "shiftloop", "tblwtl", "tblwth"}  # fmt: skip


class MI:
    """One machine instruction.

    byte    byte-sized form
    cc      condition of bra and skip
    count   skip: how many following instructions are conditional
    pred    conditional: executed only when the skip before it is not taken, so its results are also inputs
    also_uses, also_defs   implicit registers (calls, DIV, inline assembly)
    late    indices into args of registers that must survive past the definition (DIV divisor)
    """

    __slots__ = ("also_defs", "also_uses", "args", "byte", "cc", "count", "epilogue", "info", "late", "line",
                 "op", "pred", "tail",
                 "text", "variables", "volatile")  # fmt: skip

    def __init__(self, op: str, *args: Operand, byte: bool = False, cc: str = "", line: str | None = None) -> None:
        self.op = op
        self.info = OPS[op]
        self.args = list(args)
        self.byte = byte
        self.cc = cc
        self.count = 0
        self.pred = False
        self.also_uses: tuple[int, ...] = ()
        self.also_defs: tuple[int, ...] = ()
        self.late: tuple[int, ...] = ()
        self.line = line
        self.volatile = False
        self.tail = False  # call: the callee does not look at our frame, and nothing follows but the epilogue
        self.epilogue = False  # put before RETURN by the frame pass
        self.variables: tuple[Located, ...] | None = None  # variables in registers behind it; None: as before
        self.text = ""  # asm: template; \0n:m\0 stands for operand n with modifier m

    def uses(self) -> list[int]:
        """Registers read."""
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
        """Registers written."""
        out = list(self.also_defs)
        for role, a in zip(self.info.roles, self.args, strict=False):
            if a.__class__ is int:
                if role in "db":
                    out.append(a)
                elif role in "DB":
                    out += (a, a + 1) if a < FIRST_VIRTUAL else (a,)
            elif a.__class__ is Mem and a.mode in ("++", "--", "+", "-"):
                out.append(a.base)
        return out

    def map_registers(self, rename: dict[int, int]) -> None:
        """Replace registers, in place."""
        for k, a in enumerate(self.args):
            if a.__class__ is int:
                self.args[k] = rename.get(a, a)
            elif a.__class__ is Mem:
                base = rename.get(a.base, a.base)
                off = rename.get(a.off, a.off) if a.mode == "idx" else a.off
                if base != a.base or off != a.off:
                    self.args[k] = Mem(a.mode, base, off)
        if self.also_uses:
            self.also_uses = tuple(rename.get(r, r) for r in self.also_uses)
        if self.also_defs:
            self.also_defs = tuple(rename.get(r, r) for r in self.also_defs)

    def clone(self) -> MI:
        """An independent copy."""
        new = copy.copy(self)
        new.args = list(self.args)
        return new

    def is_copy(self) -> bool:
        """A plain word move between registers."""
        return (
            self.op == "mov"
            and self.args[0].__class__ is int
            and self.args[1].__class__ is int
            and not self.pred
            and not self.byte
        )

    def flags_read(self) -> str:
        """Flags this instruction looks at."""
        return CC_FLAGS.get(self.cc, "") if self.op in READS_FLAGS else self.info.reads

    def __repr__(self) -> str:
        cc = f".{self.cc}" if self.cc else ""
        text = f"{self.op}{cc}{'.b' if self.byte else ''} " + ", ".join(map(_show, self.args))
        if self.also_uses or self.also_defs:
            text += f"  uses {list(self.also_uses)} defs {list(self.also_defs)}"
        return ("? " if self.pred else "") + text


def _show(a: Operand) -> str:
    if isinstance(a, int):
        return f"w{a}" if a < FIRST_VIRTUAL else f"v{a}"
    return str(a)


Located = tuple[str, tuple[int, ...]]  # DILocalVariable, registers of its words


@dataclass(slots=True)
class MBlock:
    """Straight-line code; ends in branches. Successors by name."""

    name: str
    insts: list[MI] = field(default_factory=list)
    succs: list[str] = field(default_factory=list)
    depth: int = 0  # loop nesting
    address_taken: bool = False
    variables: tuple[Located, ...] = ()  # variables in registers at the start


@dataclass(slots=True)
class FrameObject:
    """One piece of the frame. `fixed`: offset of an incoming stack argument from W15 at entry (negative)."""

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
    pair_hints: dict[int, int] = field(default_factory=dict)  # low word register -> high word register
    dynamic_stack: bool = False  # W15 moves by amounts unknown here
    uses_fp: bool = False  # W14 is the frame pointer
    interrupt: str = ""  # "", "no_auto_psv", "auto_psv"; "shadow" may be appended after a comma
    tables: list[tuple[str, list[str]]] = field(default_factory=list)
    slot_of: dict[int, int] = field(default_factory=dict)  # id(IR value) -> frame object, for debug information
    in_registers: list[Located] = field(default_factory=list)  # source variables and the registers of their values
    locals_base: int = 0  # offset of the locals from W15 at entry
    frame_base: tuple[int, int] = (15, 0)  # register, and W15 at entry relative to it, in the body
    frame_bytes: int = 0  # locals and saved registers, known after the frame pass
    temps: set[int] = field(default_factory=set)  # registers that must not be spilled again

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
        """Readable listing."""
        out = [f"function {self.name}"]
        for b in self.blocks:
            out.append(f"{b.name}:  -> {', '.join(b.succs)}")
            out += [f"    {mi!r}" for mi in b.insts]
        return "\n".join(out)
