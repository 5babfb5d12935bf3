"""Refinement of register values by the condition of a branch."""

from __future__ import annotations

from dataclasses import dataclass

from toolchain.bounds.abstract.state import AbstractState
from toolchain.bounds.abstract.values import Interval, Value, extremes, interval
from toolchain.bounds.graph import Instruction

_SIGN = 0x8000
_OPPOSITE = {"LTU": "GEU", "LEU": "GTU", "LT": "GE", "LE": "GT", "Z": "NZ", "N": "NN"}
_OPPOSITE |= {b: a for a, b in _OPPOSITE.items()}
_ALIASES = {"C": "GEU", "NC": "LTU"}


_WIDTH = 0x10000
_DIFFERENCES = {
    "Z": [(0, 0)],
    "NZ": [(-_WIDTH, -1), (1, _WIDTH)],
    "N": [(-_SIGN, -1), (_SIGN, _WIDTH - 1)],
    "NN": [(-_WIDTH, -_SIGN - 1), (0, _SIGN - 1)],
    "GEU": [(0, _WIDTH)],
    "GTU": [(1, _WIDTH)],
    "LTU": [(-_WIDTH, -1)],
    "LEU": [(-_WIDTH, 0)],
}
"""Intervals of the difference for which a condition holds.  Conditions that read OV are not refined."""


@dataclass(frozen=True, slots=True)
class FlagResult:
    """The result that set the flags and that a register still contains: a member of lo..hi, modulo 2**16.

    borrows  whether the result is a difference, which is negative if C is clear
    """

    register: int
    lo: int
    hi: int
    borrows: bool

    @classmethod
    def of(cls, step: Instruction, before: list[Value], after: list[Value]) -> FlagResult:
        """Return the result of the instruction that set the flags, from the registers before and after it."""
        row, x = step.insn.row, step.insn.x
        less = _DECREMENTS.get(row.mnemonic)
        source = x.s if less is not None else 0
        if row.mnemonic == "SUB" and "k" in row.fields:
            less, source = x.k, x.w if "w" in row.fields else x.d
        if less is None or ("p" in row.fields and x.p):
            return cls(x.d, *extremes(after[x.d]), False)
        lo, hi = extremes(before[source])
        return cls(x.d, lo - less, hi - less, True)

    def restrict(self, condition: str, now: Value) -> Value | None:
        """Return the members of the register value `now` for which `condition` can hold, None if there are none."""
        if condition not in _DIFFERENCES or (condition.endswith("U") and not self.borrows):
            return now
        parts = [(max(self.lo, a), min(self.hi, b)) for a, b in _DIFFERENCES[condition]]
        parts = [(a, b) for a, b in parts if a <= b]
        if not parts:
            return None
        if any(a // _WIDTH != b // _WIDTH for a, b in parts):
            return now  # the interval wraps around zero
        low, high = extremes(now)
        least = max(low, min(a % _WIDTH for a, _ in parts))
        most = min(high, max(b % _WIDTH for _, b in parts))
        return _clamp(now, least, most) if least <= most else now


_FLAG_SETTERS = {"ADD", "SUB", "INC", "INC2", "DEC", "DEC2", "AND", "IOR", "XOR", "LSR", "ASR", "SL", "NEG", "COM"}
"""Mnemonics of instructions that set Z and N from the value they write."""
_DECREMENTS = {"DEC": 1, "DEC2": 2}


def flag_setter_index(steps: list[Instruction]) -> int | None:
    """Return the index of the instruction that set the flags, if its result is still in its register at the end.

    None if there is no such instruction.
    """
    written = 0
    for index in range(len(steps) - 1, -1, -1):
        row, x = steps[index].insn.row, steps[index].insn.x
        if row.flags:
            if row.mnemonic not in _FLAG_SETTERS or "d" not in row.fields:
                return None
            if ("B" in row.fields and x.B) or ("q" in row.fields and x.q):
                return None
            return None if written >> x.d & 1 else index
        written |= steps[index].writes
    return None


def refine(steps: list[Instruction], state: AbstractState, taken: bool, result: FlagResult | None = None) -> bool:
    """Narrow registers of `state` by the branch that ends `steps`; return False if that outcome is impossible.

    taken   whether the branch is taken
    result  the result that set the flags, None if its register has been overwritten
    """
    condition = steps[-1].insn.row.syntax.partition(" ")[2].partition(",")[0]
    condition = _ALIASES.get(condition, condition)
    if condition not in _OPPOSITE:
        return True
    if not taken:
        condition = _OPPOSITE[condition]
    if result is not None:
        left_over = result.restrict(condition, state.w[result.register])
        if left_over is None:
            return False
        state.w[result.register] = left_over
    compared = _compared_operands(steps)
    if compared is None:
        return True
    left, right = compared
    a = state.w[left]
    b: Value = state.w[right[1]] if isinstance(right, tuple) else right
    narrow = _narrow(condition, a, b)
    if narrow is None:
        return False
    state.w[left] = narrow[0]
    if isinstance(right, tuple):
        state.w[right[1]] = narrow[1]
    return True


def _compared_operands(steps: list[Instruction]) -> tuple[int, tuple[str, int] | int] | None:
    """Return left register, and right register or literal, of the word comparison before the branch.

    None if there is none, or if an operand has been overwritten.
    """
    written = 0
    for index in range(len(steps) - 2, -1, -1):
        step = steps[index]
        row, x = step.insn.row, step.insn.x
        if row.flags:
            if row.mnemonic == "SUB" and "k" in row.fields and not x.B:
                return _subtraction_operands(steps, index, written)
            if row.mnemonic not in ("CP", "CP0") or ("B" in row.fields and x.B) or "f" in row.fields:
                return None
            if "p" in row.fields and x.p:
                return None
            left = x.w if row.mnemonic == "CP" else x.s
            right: tuple[str, int] | int = 0
            if row.mnemonic == "CP":
                right = x.k if "k" in row.fields else ("w", x.s)
            masks = 1 << left | (1 << right[1] if isinstance(right, tuple) else 0)
            return None if written & masks else (left, right)
        written |= step.writes
    return None


def _subtraction_operands(steps: list[Instruction], index: int, written: int) -> tuple[int, int] | None:
    """Return (register, literal) of a subtraction whose minuend is still in that register or in a copy of it."""
    insn = steps[index].insn
    x, fields = insn.x, insn.row.fields
    if "w" in fields:  # Wd <- Wb - lit5
        kept = x.q == 0 and x.d != x.w and not written >> x.w & 1
        return (x.w, x.k) if kept else None
    if index == 0 or "f" in fields:
        return None
    copy = steps[index - 1].insn
    if copy.row.mnemonic != "MOV" or "g" not in copy.row.fields or copy.x.B or copy.x.g or copy.x.h:
        return None
    other = copy.x.d if copy.x.s == x.d else copy.x.s if copy.x.d == x.d else x.d
    return (other, x.k) if other != x.d and not written >> other & 1 else None


def _narrow(condition: str, a: Value, b: Value) -> tuple[Value, Value] | None:
    """Return the members of a and b for which `a condition b` can hold, None if there are none."""
    if condition in ("LT", "LE", "GT", "GE", "N", "NN"):
        low, high = extremes(a), extremes(b)
        if any(lo < _SIGN <= hi for lo, hi in (low, high)) or (low[0] < _SIGN) != (high[0] < _SIGN):
            return a, b  # the signs differ or are unknown
        if condition in ("N", "NN"):
            condition = "LT" if condition == "N" else "GE"
        condition += "U"
    (al, ah), (bl, bh) = extremes(a), extremes(b)
    match condition:
        case "Z":
            al, ah = max(al, bl), min(ah, bh)
            bl, bh = al, ah
        case "NZ":
            if bl == bh:
                al, ah = al + (al == bl), ah - (ah == bl)
            elif al == ah:
                bl, bh = bl + (bl == al), bh - (bh == al)
        case "LTU":
            ah, bl = min(ah, bh - 1), max(bl, al + 1)
        case "LEU":
            ah, bl = min(ah, bh), max(bl, al)
        case "GTU":
            al, bh = max(al, bl + 1), min(bh, ah - 1)
        case "GEU":
            al, bh = max(al, bl), min(bh, ah)
    if al > ah or bl > bh:
        return None
    return _clamp(a, al, ah), _clamp(b, bl, bh)


def _clamp(value: Value, lo: int, hi: int) -> Value:
    if not isinstance(value, Interval):
        return value
    if 0 < lo < value.least <= hi:
        lo = value.least
    return interval(lo, hi, value.mask, value.bits, value.ram)
