"""Selection of the IR operation `select` (conditional values).

Adjacent selects on one condition share a test and a skip. Each starts with one of its two values; the covered
instruction replaces it by the other value. That instruction is a move, a constant load, or an operation on the first.
"""

from __future__ import annotations

from toolchain.ir.model import ConstInt, Instr, Undef, Value
from toolchain.mir.instruction import MI
from toolchain.mir.operands import Imm
from toolchain.mir.operations import CC_INVERSE
from toolchain.select.arith import apply_rule
from toolchain.select.compare import condition
from toolchain.select.context import Handler, SelectionContext
from toolchain.select.rules import CARRY_OP, REGISTER_OP, immediate_rule

CONDITIONAL = frozenset(("add", "sub", "and", "or", "xor"))
# For a shift by one: operation on the first word, operation on the other words, order of the words.
SHIFT_BY_ONE = {"shl": ("sl1", "rlc", 1), "lshr": ("lsr1", "rrc", -1), "ashr": ("asr1", "rrc", -1)}


def select_select(s: SelectionContext, i: Instr) -> None:
    """Select `i` and the selects directly before it on the same condition."""
    if _undefined(s, i):
        return
    group = _group(s, i)
    when = min((False, True), key=lambda w: sum(_cost(s, g, w) for g in group))
    shifted = _shifted_out(s, i, when) if len(group) == 1 else None
    outer, s.out = s.out, []
    cc = shifted or condition(s, i.args[0], i)
    test, s.out = s.out, outer
    skip = CC_INVERSE[cc] if when else cc
    if len(group) == 1:
        skip = _strict(i, skip)
    bodies = [mi for g in group for mi in _alternative(s, g, when, shifted is not None)]
    s.out += test
    if bodies:
        s.emit("skip", "", cc=skip)
    for mi in bodies:
        mi.pred = True
    s.out += bodies


def _undefined(s: SelectionContext, i: Instr) -> bool:
    """If one of the two values is undefined, select the other; return whether one is."""
    _, a, b = i.args
    if not isinstance(a, Undef) and not isinstance(b, Undef):
        return False
    _assign(s, b if isinstance(a, Undef) else a, s.value_regs(i))
    return True


def _assign(s: SelectionContext, v: Value, d: tuple[int, ...]) -> None:
    """Emit d = v as copies or constant loads."""
    if s.is_leaf(v):
        for k, r in enumerate(d):
            s.load_leaf(v, k, r)
    else:
        for x, r in zip(s.value_regs(v), d, strict=True):
            s.copy(x, r)


def _group(s: SelectionContext, i: Instr) -> list[Instr]:
    """`i`, and the used selects directly before it with the same condition that do not depend on each other."""
    group = [i]
    for j in reversed(s.block.instrs[: s.block.instrs.index(i)]):
        same = j.op == "select" and j.args[0] is i.args[0] and not any(isinstance(a, Undef) for a in j.args)
        if not same or id(j) not in s.needed or id(j) in s.folded:
            break
        if any(a is j or (isinstance(a, Instr) and j in a.args) for g in group for a in g.args):
            break
        s.folded.add(id(j))
        group.insert(0, j)
    return group


def _starts_from(i: Instr, when: bool) -> tuple[Value, Value]:
    """(initial value, value set under the skip); the covered instructions are executed if the condition is `when`."""
    return (i.args[2], i.args[1]) if when else (i.args[1], i.args[2])


def _cost(s: SelectionContext, i: Instr, when: bool) -> int:
    """Cost of a select in quarter words, to choose between its two forms."""
    base, other = _starts_from(i, when)
    cost = 1 if when else 0
    if _operation(s, i, base, other) is not None:
        cost -= 16
    if isinstance(base, Instr) and base.op == "phi" and i in base.args:  # the value stays in the register of the phi
        cost -= 12
    if s.is_leaf(base) and not s.is_leaf(other):
        cost += 8
    elif not s.is_leaf(base) and not s.is_leaf(other) and s.single_use(base) and not s.single_use(other):
        cost -= 4
    return cost


def _strict(i: Instr, skip: str) -> str:
    """The condition of a minimum or maximum made strict, as CPSLT and CPSGT are; for equal values both are correct.

    Comparisons with a constant are excluded: the constant may have been replaced by its neighbour."""
    c = i.args[0]
    if not isinstance(c, Instr) or c.op != "icmp" or any(isinstance(v, ConstInt) for v in c.args):
        return skip
    if {id(v) for v in c.args} == {id(v) for v in i.args[1:]}:
        return {"ge": "gt", "le": "lt"}.get(skip, skip)
    return skip


def _alternative(s: SelectionContext, i: Instr, when: bool, shifted: bool) -> list[MI]:
    """Emit the initial value of a select; return the instructions that replace it by the other value."""
    base, other = _starts_from(i, when)
    d = s.value_regs(i)
    operation = _operation(s, i, base, other)
    if operation is not None:
        return _operate(s, operation, base, d, shifted)
    if not s.is_leaf(other):
        s.value_regs(other)
    _assign(s, base, d)
    outer, s.out = s.out, []
    _assign(s, other, d)
    body, s.out = s.out, outer
    return body


# ---------------------------------------------------------------------------------------------------------------------
# operations under the skip


def _operation(s: SelectionContext, i: Instr, base: Value, other: Value) -> Instr | None:
    """`other` if it is base op x or 0 - base without another user, so that a skip can cover it; else None."""
    if not isinstance(other, Instr) or other.op not in CONDITIONAL or not s.single_use(other):
        return None
    if not s.same_block(other) or s.is_leaf(base) or id(other) in s.register_values or i.type.bits not in (8, 16, 32):
        return None
    a, b = other.args
    if other.op == "sub" and b is base and isinstance(a, ConstInt) and not a.value:
        return other
    return other if a is base else None


def _operate(s: SelectionContext, operation: Instr, base: Value, d: tuple[int, ...], shifted: bool) -> list[MI]:
    """Emit d = base; return the instructions of d = d op x. Constants without an immediate form are loaded first."""
    byte = base.type.bits == 8
    s.folded.add(id(operation))
    negated = operation.args[0] is not base
    x = operation.args[1]
    operands = [] if negated else [_operand(s, operation.op, x, k, byte) for k in range(len(d))]
    if shifted:
        assert isinstance(base, Instr)
        _shift_out(s, base, d)
    else:
        for source, r in zip(s.value_regs(base), d, strict=True):
            s.copy(source, r)
    outer, s.out = s.out, []
    if negated and len(d) == 1:
        s.emit("neg", d[0], d[0], byte=byte)
    elif negated:
        for k, r in enumerate(d):
            s.emit("subbr" if k else "subr", r, Imm(0), r)
    else:
        for k, (r, operand) in enumerate(zip(d, operands, strict=True)):
            _apply(s, operation.op, operand, r, k, byte)
    body, s.out = s.out, outer
    return body


def _operand(s: SelectionContext, op: str, x: Value, k: int, byte: bool) -> int | ConstInt:
    """Word k of the second operand: a register, or a constant with an immediate form."""
    if not isinstance(x, ConstInt):
        return s.leaf_word(x, k) if s.is_leaf(x) else s.value_regs(x)[k]
    ones = 0xFF if byte else 0xFFFF
    word = ConstInt(x.type, x.value >> 16 * k & ones)
    if x.type.bits > 16 and op in ("add", "sub"):  # every word but the last produces a carry for the next one
        return word if word.value <= 31 else s.leaf_word(x, k)
    name, value = ("add", -word.value & ones) if op == "sub" else (op, word.value)
    return word if _changes_nothing(op, word) or immediate_rule(name, value, 8 if byte else 16) else s.leaf_word(x, k)


def _changes_nothing(op: str, word: ConstInt) -> bool:
    """Whether a word of a constant is neutral for an operation on several words."""
    return word.type.bits > 16 and op in ("and", "or", "xor") and word.value == (0xFFFF if op == "and" else 0)


def _apply(s: SelectionContext, op: str, operand: int | ConstInt, r: int, k: int, byte: bool) -> None:
    """Emit r = r op operand for word k of a value."""
    name = (CARRY_OP if k else REGISTER_OP)[op]
    if isinstance(operand, int):
        s.emit(name, r, operand, r, byte=byte)
    elif operand.type.bits > 16 and op in ("add", "sub"):
        s.emit(name, r, Imm(operand.value), r)
    elif not _changes_nothing(op, operand):
        bits = 8 if byte else 16
        value = -operand.value & ((1 << bits) - 1) if op == "sub" else operand.value
        name = "add" if op == "sub" else op
        apply_rule(s, immediate_rule(name, value, bits), name, r, value, r, byte)


# ---------------------------------------------------------------------------------------------------------------------
# selects on the bit that a shift by one moves out


def _shifted_out(s: SelectionContext, i: Instr, when: bool) -> str | None:
    """Condition on the carry for a select whose initial value is x shifted by one and whose test is the bit moved out.

    None for other selects."""
    base, other = _starts_from(i, when)
    operation, c = _operation(s, i, base, other), i.args[0]
    if operation is None or operation.args[0] is not base or base.type.bits not in (16, 32):
        return None
    if not isinstance(base, Instr) or base.op not in SHIFT_BY_ONE or not isinstance(c, Instr) or c.op != "icmp":
        return None
    x, n = base.args
    tested, zero = c.args
    if s.is_leaf(x) or not isinstance(n, ConstInt) or n.value != 1 or not isinstance(zero, ConstInt):
        return None
    if base.op == "shl" and tested is x and (c.pred, zero.signed) in (("slt", 0), ("sgt", -1)):
        return "c" if c.pred == "slt" else "nc"
    moved_out = base.type.bits - 1 if base.op == "shl" else 0
    if c.pred in ("eq", "ne") and not zero.value and _only_bit(tested, x, moved_out):
        return "c" if c.pred == "ne" else "nc"
    return None


def _only_bit(masked: Value, x: Value, bit: int) -> bool:
    """Whether a value is x & 1 << bit, or (low word of x) & 1 << bit."""
    if not isinstance(masked, Instr) or masked.op != "and":
        return False
    a, mask = masked.args
    same = a is x or (isinstance(a, Instr) and a.op == "trunc" and a.args[0] is x and bit < a.type.bits)
    return same and isinstance(mask, ConstInt) and mask.value == 1 << bit


def _shift_out(s: SelectionContext, base: Instr, d: tuple[int, ...]) -> None:
    """Emit d = x shifted by one; the bit moved out is in the carry."""
    first, rest, order = SHIFT_BY_ONE[base.op]
    for k, (source, r) in enumerate(list(zip(s.value_regs(base.args[0]), d, strict=True))[::order]):
        s.emit(rest if k else first, source, r)


HANDLERS: dict[str, Handler] = {"select": select_select}
