"""Effect of one instruction on the stack pointer and on control flow.

Stack depth counts bytes above the value of W15 at function entry, above the return address; the stack grows upward
(isa.md §3.5).  Instructions are distinguished by mnemonic and operand fields only.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from emu.dspic30f.isa.row import Insn

SP = 15
FRAME = 14
CALL_BYTES = 4  # CALL, RCALL and exceptions push two words (isa.md §7.4)
_SP_ADDRESSES = (2 * SP, 2 * SP + 1)  # data addresses of the bytes of W15 (isa.md §2.2)
_STEP = {2: -1, 3: 1, 4: -1, 5: 1}  # step by encoding of the addressing modes [Wn--] [Wn++] [--Wn] [++Wn] (isa.md §3.1)
_READS_F = frozenset(("CP", "CPB", "CP0", "BTST", "BTSS", "BTSC", "MUL"))


class Successor(Enum):
    """Successors of an instruction."""

    NEXT = "next"
    BRANCH = "branch or next"
    JUMP = "jump"
    CALL = "call, then next"
    SKIP = "next or the one after it"
    TABLE = "computed branch"
    CALL_POINTER = "call through a register"
    JUMP_POINTER = "jump through a register"
    END = "return or reset"


class StackPointerChange(Enum):
    """Kind of a change of the stack pointer, in addition to a known number of bytes."""

    MOVED = "moved by a number of bytes"
    LINK = "LNK: W14 pushed, then a frame"
    UNLINK = "ULNK: back to the frame"
    FROM_FRAME = "copied from W14"
    FRESH = "loaded with a constant: the start of another stack"
    SAVED = "copied to another register"
    RESTORED = "copied from another register"
    UNKNOWN = "set to a value not known here"


@dataclass(frozen=True, slots=True)
class Effect:
    """Effect of one instruction.

    delta           change of W15 in bytes
    target          program address for BRANCH, JUMP and CALL
    register        register to or from which W15 is copied, for SAVED and RESTORED
    pushed, popped  register of a word push or pop
    """

    flow: Successor
    pointer: StackPointerChange = StackPointerChange.MOVED
    delta: int = 0
    target: int = 0
    register: int = 0
    pushed: int | None = None
    popped: int | None = None


def effect_of(insn: Insn, address: int) -> Effect:
    """Return the effect of the instruction at program address `address`."""
    flow, target = _flow(insn, address)
    pointer, delta = _pointer(insn)
    register = {StackPointerChange.SAVED: "d", StackPointerChange.RESTORED: "s"}.get(pointer)
    pushed, popped = _passed(insn)
    return Effect(flow, pointer, delta, target, getattr(insn.x, register) if register else 0, pushed, popped)


def _passed(insn: Insn) -> tuple[int | None, int | None]:
    """Return the register of `mov wn, [w15++]` and of `mov [--w15], wn`."""
    x = insn.x
    if insn.row.mnemonic != "MOV" or "g" not in insn.row.fields or x.B:
        return None, None
    pushed = x.s if (x.g, x.h, x.d) == (0, 3, SP) else None
    popped = x.d if (x.g, x.h, x.s) == (4, 0, SP) else None
    return pushed, popped


def _flow(insn: Insn, address: int) -> tuple[Successor, int]:
    name, x = insn.row.mnemonic, insn.x
    fields = insn.row.fields
    if name in ("RETURN", "RETFIE", "RETLW", "RESET"):
        return Successor.END, 0
    if name in ("BTSS", "BTSC") or name.startswith("CPS"):
        return Successor.SKIP, 0
    if name in ("CALL", "RCALL", "GOTO", "BRA"):
        calls = name in ("CALL", "RCALL")
        if "n" not in fields:
            return (
                Successor.CALL_POINTER if calls else Successor.TABLE if name == "BRA" else Successor.JUMP_POINTER
            ), 0
        target = x.n if not fields["n"].signed else address + 2 + 2 * x.n & 0x7FFFFE
        if calls:
            return Successor.CALL, target
        conditional = name == "BRA" and "," in insn.row.syntax
        return (Successor.BRANCH if conditional else Successor.JUMP), target
    return Successor.NEXT, 0


def _pointer(insn: Insn) -> tuple[StackPointerChange, int]:
    name, x, fields = insn.row.mnemonic, insn.x, insn.row.fields
    if name == "LNK":
        return StackPointerChange.LINK, x.k
    if name == "ULNK":
        return StackPointerChange.UNLINK, 0
    if name in ("PUSH", "POP") and "f" in fields:
        if name == "POP" and x.f in _SP_ADDRESSES:
            return StackPointerChange.UNKNOWN, 0
        return StackPointerChange.MOVED, 2 if name == "PUSH" else -2
    only_read = name in _READS_F or (name == "MOV" and "d" in fields)
    if "f" in fields and x.f in _SP_ADDRESSES and not only_read:
        return StackPointerChange.UNKNOWN, 0
    return _register_effect(insn)


def _register_effect(insn: Insn) -> tuple[StackPointerChange, int]:
    """Return the effect of addressing modes with W15, arithmetic on it, and copies."""
    x, fields = insn.x, insn.row.fields
    size = 4 if insn.row.mnemonic == "MOV.D" else 1 if getattr(x, "B", 0) else 2
    delta = 0
    for register, modes in (("s", "pg"), ("d", "qh")):
        mode = next((getattr(x, m) for m in modes if m in fields), 0)
        if register in fields and getattr(x, register) == SP and mode:
            delta += _STEP.get(mode, 0) * size
    if _writes_sp(insn):
        return _arithmetic(insn)
    copied = insn.row.mnemonic == "MOV" and "g" in fields and (x.s, x.g, x.h) == (SP, 0, 0)
    return (StackPointerChange.SAVED if copied else StackPointerChange.MOVED), delta


def _writes_sp(insn: Insn) -> bool:
    """Whether W15 is the destination register."""
    x, fields = insn.x, insn.row.fields
    if "d" not in fields or ("o" in fields and "[Wd" in insn.row.syntax):
        return False
    direct = not any(m in fields and getattr(x, m) for m in "qh")
    pair = insn.row.mnemonic in ("MOV.D", "MUL.SS", "MUL.SU", "MUL.US", "MUL.UU")
    return direct and (x.d == SP or (pair and x.d == SP - 1))


def _arithmetic(insn: Insn) -> tuple[StackPointerChange, int]:
    """Return the effect of `add #n, w15`, `sub w15, #n, w15`, `inc2 w15, w15`, `mov w14, w15`; others are unknown."""
    name, x, fields = insn.row.mnemonic, insn.x, insn.row.fields
    sign = {"ADD": 1, "SUB": -1}.get(name)
    if sign and "k" in fields and ("w" not in fields or x.w == SP):
        return StackPointerChange.MOVED, sign * x.k
    step = {"INC": 1, "INC2": 2, "DEC": -1, "DEC2": -2}.get(name)
    if step and x.s == SP and x.p == 0:
        return StackPointerChange.MOVED, step
    if name == "MOV" and "g" in fields and x.g == 0 and not x.B:
        return (StackPointerChange.FROM_FRAME if x.s == FRAME else StackPointerChange.RESTORED), 0
    constant = name == "MOV" and "k" in fields
    return (StackPointerChange.FRESH if constant else StackPointerChange.UNKNOWN), 0
