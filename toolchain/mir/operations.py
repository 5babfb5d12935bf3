"""Operations of the machine form: `OPS` describes their operands and their effect on flags and memory.

Passes use this description instead of the name of an operation.
"""

from __future__ import annotations


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
