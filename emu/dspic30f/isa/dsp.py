"""Accumulator arithmetic: multiply, saturate, round, and the MAC-class prefetch (isa.md §8)."""

from __future__ import annotations

from collections.abc import Callable

from .addressing import advance, destination, signed16, source
from .builder import Builder, Side
from .fields import Operands
from .flow import Value
from .row import Does

GUARD = 1 << 39  # an accumulator's range is -GUARD .. GUARD - 1
LIMIT = 1 << 31  # its 1.31 range is -LIMIT .. LIMIT - 1
MULTIPLICANDS = {0: (4, 5), 1: (4, 6), 2: (4, 7), 4: (5, 6), 5: (5, 7), 6: (6, 7)}  # by field mmm, §8.1
NO_PREFETCH, WITH_OFFSET, OFFSET_REGISTER = 4, 12, 12
PREFETCH_STEP = {0: 0, 1: 2, 2: 4, 3: 6, 5: -6, 6: -4, 7: -2}  # pointer step in bytes by iiii<2:0> or jjjj<2:0>
WRITE_BACK = 13
WRITE_BACK_INDIRECT, NO_WRITE_BACK = 1, 2  # values of field aa; 0 means W13 direct


def plus(acc: Value, v: Value) -> Value:
    return acc + v


def minus(acc: Value, v: Value) -> Value:
    return acc - v


def replace(acc: Value, v: Value) -> Value:
    return v


def opposite(acc: Value, v: Value) -> Value:
    return -acc


def negate(acc: Value, v: Value) -> Value:
    return -v


def signed40(m: Builder, v: Value) -> Value:
    """Return the low 40 bits as a signed number."""
    return m.let((v + GUARD & 2 * GUARD - 1) - GUARD)


def outside(v: Value, limit: int) -> Value:
    """Return 1 if v is not in -limit .. limit - 1, else 0."""
    return (v < -limit) | (v >= limit)


def clamp(m: Builder, v: Value, limit: int) -> Value:
    """Return v clamped to -limit .. limit - 1."""
    return m.select(v < -limit, -limit, m.select(v >= limit, limit - 1, v))


def accumulate(m: Builder, a: int, exact: Value, keep: Value = 0) -> None:
    """Write an operation's exact result to accumulator ``a``, with saturation, OA/SA and traps (isa.md §8.3, §8.5).

    If ``keep`` is 1, nothing changes.
    """
    c = m.context
    v = m.let(exact)
    guard, sticky = ("OB", "SB") if a else ("OA", "SA")
    saturate = c.satb if a else c.sata
    wide = m.let(outside(v, GUARD))
    if not saturate:
        stored, overflow = signed40(m, v), wide
    elif c.accsat:
        stored, overflow = m.let(clamp(m, v, GUARD)), wide
    else:
        stored = m.let(clamp(m, v, LIMIT))
        overflow = m.let(stored != v)
    overflow = m.let(overflow & (keep == 0))
    in_guard = m.let(outside(stored, LIMIT))
    m.set_acc(a, m.select(keep, m.acc(a), stored))
    m.set_flags(**{guard: m.select(keep, m.flag(guard), in_guard), sticky: m.flag(sticky) | overflow})
    if c.ovbte if a else c.ovate:
        m.trap_math(in_guard & (keep == 0))
    if c.covte:
        m.trap_math(wide & (keep == 0))


def product(m: Builder, a: Value, b: Value) -> Value:
    """Return the exact product of two 16-bit values, as CORCON.US and CORCON.IF specify."""
    if not m.context.us:
        a, b = signed16(m, a), signed16(m, b)
    return a * b if m.context.if_ else a * b * 2


def shifted(m: Builder, v: Value, right: int) -> Value:
    """Return v >> right; a negative count shifts left."""
    return v >> right if right >= 0 else v << -right


def rounded_word(m: Builder, v: Value, rounding: bool) -> Value:
    """Return the word that SAC and write-back store for the 40-bit value v, or SAC.R if ``rounding`` (§8.4)."""
    if rounding and m.context.rnd:
        v = v + 0x8000
    elif rounding:  # convergent rounding: a tie goes to the even word
        low = m.let(v & 0xFFFF)
        up = (low > 0x8000) | (low == 0x8000) & (v >> 16 & 1)
        v = v + (up << 16)
    if m.context.satdw:
        v = clamp(m, m.let(v), LIMIT)
    return m.let(v >> 16 & 0xFFFF)


def on_accumulators(op: Callable[[Value, Value], Value]) -> Does:
    """Return the function for Acc <- op(Acc, other accumulator)."""

    def does(m: Builder, x: Operands) -> None:
        accumulate(m, x.A, op(m.acc(x.A), m.acc(1 - x.A)))

    return does


def load_accumulator(op: Callable[[Value, Value], Value]) -> Does:
    """Return the function for Acc <- op(Acc, Ws << 16 >> Slit4)."""

    def does(m: Builder, x: Operands) -> None:
        word = source(m, x, 2, mode=x.g).read()
        accumulate(m, x.A, op(m.acc(x.A), signed40(m, shifted(m, signed16(m, word) << 16, x.r))))

    return does


def store_accumulator(rounding: bool) -> Does:
    """Return the function for Wd <- bits 31:16 of Acc >> Slit4.

    UNVERIFIED: a left shift is truncated to 40 bits before saturation.
    """

    def does(m: Builder, x: Operands) -> None:
        value = signed40(m, shifted(m, m.acc(x.A), x.r))
        destination(m, x, 2, mode=x.h).write(rounded_word(m, value, rounding))

    return does


def shift_accumulator(count_of: Callable[[Builder, Operands], Value]) -> Does:
    """Return the function for Acc <- Acc >> count. A count beyond 16 causes a math trap and no change (isa.md §8.5)."""

    def does(m: Builder, x: Operands) -> None:
        count = m.let(count_of(m, x))
        refused = m.let(outside(count, 16) & (count != 16))
        right = m.select((count > 0) & (refused == 0), count, 0)
        left = m.select((count < 0) & (refused == 0), -count, 0)
        m.trap_math(refused)
        accumulate(m, x.A, m.acc(x.A) << left >> right, keep=refused)

    return does


def literal_count(m: Builder, x: Operands) -> Value:
    return x.k


def register_count(m: Builder, x: Operands) -> Value:
    """Return Wb<5:0> as a signed number."""
    return ((m.w(x.s) & 0x3F) ^ 0x20) - 0x20


class Prefetch:
    """X and Y prefetch of a MAC-class instruction: forms addresses first, reads data later (isa.md §8.1, §8.2)."""

    __slots__ = ("m", "x_ea", "x_pointer", "y_ea", "y_pointer")

    def __init__(self, m: Builder, x: Operands) -> None:
        self.m = m
        self.x_pointer, self.y_pointer = 8 + (x.i >> 3), 10 + (x.j >> 3)
        self.x_ea = self._address(x.i, self.x_pointer, "x")
        self.y_ea = self._address(x.j, self.y_pointer, "y")

    def _address(self, code: int, pointer: int, side: Side) -> Value | None:
        if code == NO_PREFETCH:
            return None
        m, value = self.m, self.m.ptr(pointer, side)
        if code == WITH_OFFSET:
            return advance(m, pointer, value, signed16(m, m.ptr(OFFSET_REGISTER, side)), side)
        if PREFETCH_STEP[code & 7]:
            m.set_ptr(pointer, advance(m, pointer, value, PREFETCH_STEP[code & 7], side), side)
        return value

    def read_x(self) -> Value:
        return None if self.x_ea is None else self.m.xload(self.x_ea, self.x_pointer)

    def read_y(self) -> Value:
        return None if self.y_ea is None else self.m.yload(self.y_ea, self.y_pointer)


def mac_class(op: Callable[[Value, Value], Value] | None, square: bool = False, write_back: bool = True) -> Does:
    """Return the function for Acc <- op(Acc, product), with prefetch and write-back.

    With ``op`` None, the accumulator does not change (MOVSAC).
    """

    def does(m: Builder, x: Operands) -> None:
        first, second = (4 + x.m, 4 + x.m) if square else MULTIPLICANDS[x.m] if op else (4, 4)
        a, b = m.w(first), m.w(second)
        prefetch = Prefetch(m, x)
        target = None
        if write_back and x.a == WRITE_BACK_INDIRECT:
            target = m.ptr(WRITE_BACK, "dst")
        x_data, y_data = prefetch.read_x(), prefetch.read_y()
        if op is not None:
            accumulate(m, x.A, op(m.acc(x.A), product(m, a, b)))
        if write_back and x.a != NO_WRITE_BACK:
            word = rounded_word(m, m.acc(1 - x.A), rounding=True)
            if target is None:
                m.set_w(WRITE_BACK, word)
            else:
                m.set_ptr(WRITE_BACK, advance(m, WRITE_BACK, target, 2, "dst"), "dst")
                m.store(target, word, 2, ptr=WRITE_BACK)
        if x_data is not None:
            m.set_w(4 + x.x, x_data)
        if y_data is not None:  # UNVERIFIED: if both destinations are equal, the Y value remains (isa.md §22 item 18)
            m.set_w(4 + x.y, y_data)

    return does


def clear_accumulator(m: Builder, x: Operands) -> None:
    """Execute CLR: Acc, Ox and Sx become 0. Prefetch and write-back are as in MAC."""
    mac_class(None)(m, x)
    m.set_acc(x.A, 0)
    m.set_flags(**({"OB": 0, "SB": 0} if x.A else {"OA": 0, "SA": 0}))


def euclidean(op: Callable[[Value, Value], Value]) -> Does:
    """Return the function of ED and EDAC: Acc <- op(Acc, Wm * Wm); Wxd <- [Wx] - [Wy]."""

    def does(m: Builder, x: Operands) -> None:
        a = m.w(4 + x.m)
        prefetch = Prefetch(m, x)
        difference = prefetch.read_x() - prefetch.read_y()
        accumulate(m, x.A, op(m.acc(x.A), product(m, a, a)))
        m.set_w(4 + x.x, difference)

    return does
