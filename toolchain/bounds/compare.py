"""What a conditional branch says about the registers compared in front of it."""

from __future__ import annotations

from toolchain.bounds.graph import Step
from toolchain.bounds.state import State
from toolchain.bounds.values import Span, Value, ends, span

_SIGN = 0x8000
_OPPOSITE = {"LTU": "GEU", "LEU": "GTU", "LT": "GE", "LE": "GT", "Z": "NZ", "N": "NN"}
_OPPOSITE |= {b: a for a, b in _OPPOSITE.items()}
_NAMES = {"C": "GEU", "NC": "LTU"}


def refined(steps: list[Step], state: State, taken: bool) -> bool:
    """Narrow registers in `state`, which went one way behind the branch that ends `steps`; False: none can go there."""
    condition = steps[-1].insn.row.syntax.partition(" ")[2].partition(",")[0]
    condition = _NAMES.get(condition, condition)
    if condition not in _OPPOSITE:
        return True
    if not taken:
        condition = _OPPOSITE[condition]
    compared = _compared(steps)
    if compared is None:
        return True
    left, right = compared
    a = state.w[left]
    b: Value = state.w[right[1]] if isinstance(right, tuple) else right
    narrow = _narrowed(condition, a, b)
    if narrow is None:
        return False
    state.w[left] = narrow[0]
    if isinstance(right, tuple):
        state.w[right[1]] = narrow[1]
    return True


def _compared(steps: list[Step]) -> tuple[int, tuple[str, int] | int] | None:
    """Left register, and right register or number, of a word comparison whose operands still stand."""
    written = 0
    for index in range(len(steps) - 2, -1, -1):
        step = steps[index]
        row, x = step.insn.row, step.insn.x
        if row.flags:
            if row.mnemonic == "SUB" and "k" in row.fields and not x.B:
                return _subtracted(steps, index, written)
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


def _subtracted(steps: list[Step], index: int, written: int) -> tuple[int, int] | None:
    """The register a literal was subtracted from, where its value still stands, or its copy made just before."""
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


def _narrowed(condition: str, a: Value, b: Value) -> tuple[Value, Value] | None:
    """The members of a and b for which the condition can hold, None if there are none."""
    if condition in ("LT", "LE", "GT", "GE", "N", "NN"):
        low, high = ends(a), ends(b)
        if any(lo < _SIGN <= hi for lo, hi in (low, high)) or (low[0] < _SIGN) != (high[0] < _SIGN):
            return a, b  # signs differ, or are not known
        if condition in ("N", "NN"):
            condition = "LT" if condition == "N" else "GE"
        condition += "U"
    (al, ah), (bl, bh) = ends(a), ends(b)
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
    return _cut(a, al, ah), _cut(b, bl, bh)


def _cut(value: Value, lo: int, hi: int) -> Value:
    return span(lo, hi, value.mask, value.bits, value.ram) if isinstance(value, Span) else value
