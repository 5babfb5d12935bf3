"""Machine code on symbolic inputs: the instruction table's `does` with z3 values, along every path of a function.

`results(words, inputs)` runs loop-free code from its first word to RETURN. Registers start as free 16-bit values.
Memory is one z3 array of bytes. Nothing of an instruction's meaning is written here: all of it comes from the table.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import z3

from emu.dspic30f.isa import codec, flow
from emu.dspic30f.isa.builder import Context

BITS = 48
"""Width of the integers the table computes with; products of two words need 33."""
MOST_STEPS = 4000


bounds: dict[str, tuple[Any, Any]] | None = None
"""None: products are computed in bits. Else by their factors: the unknown that stands for one, what is known of it."""


@contextmanager
def unknown_products() -> Iterator[dict[str, tuple[Any, Any]]]:
    """Inside, a product is any number within the bounds of its factors: what holds for those holds for products, and
    the solver need not look into multipliers."""
    global bounds
    bounds = {}
    try:
        yield bounds
    finally:
        bounds = None


def times(a: Any, b: Any) -> Any:
    """a * b as the table has it."""
    if bounds is None:
        return a * b
    a, b = sorted((z3.simplify(a), z3.simplify(b)), key=z3.is_bv_value)
    key = f"{a} * {b}"
    if key not in bounds:
        p, word = z3.BitVec(key, BITS), (1 << 16) - 1
        words = z3.Implies(z3.And(z3.ULE(a, word), z3.ULE(b, word)), z3.ULE(p, word * word))
        signed = z3.And(a >= -(1 << 15), a < 1 << 15, z3.ULE(b, word))
        within = z3.And(p >= -(1 << 15) * word, p <= ((1 << 15) - 1) * word)
        bounds[key] = p, z3.And(words, z3.Implies(signed, within))
    return bounds[key][0]


def number(v: Any) -> Any:
    """A table value as a term."""
    return v.term if isinstance(v, Int) else z3.BitVecVal(int(v), BITS)


class Int:
    """A table value: the operators of `builder.py`, comparisons giving 0 or 1."""

    __slots__ = ("term",)

    def __init__(self, term: Any) -> None:
        self.term = term

    def _with(self, make: Callable[[Any, Any], Any], other: Any, swapped: bool = False) -> Int:
        a, b = self.term, number(other)
        return Int(make(b, a) if swapped else make(a, b))

    def _truth(self, make: Callable[[Any, Any], Any], other: Any) -> Int:
        return Int(z3.If(make(self.term, number(other)), z3.BitVecVal(1, BITS), z3.BitVecVal(0, BITS)))

    def __add__(self, o: Any) -> Int:
        return self._with(lambda a, b: a + b, o)

    __radd__ = __add__

    def __sub__(self, o: Any) -> Int:
        return self._with(lambda a, b: a - b, o)

    def __rsub__(self, o: Any) -> Int:
        return self._with(lambda a, b: a - b, o, swapped=True)

    def __mul__(self, o: Any) -> Int:
        return self._with(times, o)

    __rmul__ = __mul__

    def __and__(self, o: Any) -> Int:
        return self._with(lambda a, b: a & b, o)

    __rand__ = __and__

    def __or__(self, o: Any) -> Int:
        return self._with(lambda a, b: a | b, o)

    __ror__ = __or__

    def __xor__(self, o: Any) -> Int:
        return self._with(lambda a, b: a ^ b, o)

    __rxor__ = __xor__

    def __lshift__(self, o: Any) -> Int:
        return self._with(lambda a, b: a << b, o)

    def __rlshift__(self, o: Any) -> Int:
        return self._with(lambda a, b: a << b, o, swapped=True)

    def __rshift__(self, o: Any) -> Int:
        return self._with(lambda a, b: a >> b, o)

    def __rrshift__(self, o: Any) -> Int:
        return self._with(lambda a, b: a >> b, o, swapped=True)

    def __neg__(self) -> Int:
        return Int(-self.term)

    def __invert__(self) -> Int:
        return Int(~self.term)

    def __lt__(self, o: Any) -> Int:
        return self._truth(lambda a, b: a < b, o)

    def __le__(self, o: Any) -> Int:
        return self._truth(lambda a, b: a <= b, o)

    def __gt__(self, o: Any) -> Int:
        return self._truth(lambda a, b: a > b, o)

    def __ge__(self, o: Any) -> Int:
        return self._truth(lambda a, b: a >= b, o)

    def __eq__(self, o: object) -> Int:  # type: ignore[override]
        return self._truth(lambda a, b: a == b, o)

    def __ne__(self, o: object) -> Int:  # type: ignore[override]
        return self._truth(lambda a, b: a != b, o)

    __hash__ = None  # type: ignore[assignment]


def widened(term: Any) -> Int:
    """A term of fewer bits, zero-extended."""
    return Int(z3.ZeroExt(BITS - term.size(), term))


@dataclass
class State:
    """Registers (16-bit terms), flags (0 or 1 as `Int`), memory, and the conditions of the path so far."""

    w: list[Any]
    flags: dict[str, Any]
    memory: Any
    path: list[Any] = field(default_factory=list)

    def copy(self) -> State:
        """An independent state."""
        return State(list(self.w), dict(self.flags), self.memory, list(self.path))


def start() -> State:
    """Every register, flag and byte is free."""
    flags = {n: widened(z3.BitVec(n, 1)) for n in ("C", "Z", "OV", "N", "DC", "OA", "OB", "SA", "SB")}
    w = [z3.BitVec(f"w{n}", 16) for n in range(16)]
    return State(w, flags, z3.Array("memory", z3.BitVecSort(16), z3.BitVecSort(8)))


class Machine:
    """The table's builder over a `State`. What no compiled function uses is absent and raises AttributeError."""

    context = Context()

    def __init__(self, state: State, pc: int) -> None:
        self.state = state
        self.pc = pc

    def select(self, c: Any, a: Any, b: Any) -> Int:
        """`a` if `c` else `b`."""
        return Int(z3.If(number(c) != 0, number(a), number(b)))

    def let(self, v: Any) -> Any:
        """Terms share their parts already."""
        return v

    def w(self, n: int) -> Int:
        """Wn."""
        return widened(self.state.w[n])

    def set_w(self, n: int, v: Any) -> None:
        """Wn = v, which a RETLW or a move may give as a plain int."""
        self.state.w[n] = z3.Extract(15, 0, number(v))

    def set_wb(self, n: int, v: Any) -> None:
        """The low byte only."""
        self.state.w[n] = z3.Concat(z3.Extract(15, 8, self.state.w[n]), z3.Extract(7, 0, number(v)))

    def ptr(self, n: int, side: str) -> Int:
        """Wn as a pointer."""
        return self.w(n)

    def set_ptr(self, n: int, v: Any, side: str) -> None:
        """Pointer update."""
        self.set_w(n, v)

    def load(self, ea: Any, size: int, side: str = "src", ptr: int | None = None) -> Int:
        """Bytes of the array, low byte first."""
        at = z3.Extract(15, 0, number(ea))
        parts = [z3.Select(self.state.memory, at + k) for k in range(size)]
        return widened(parts[0] if size == 1 else z3.Concat(parts[1], parts[0]))

    def store(self, ea: Any, v: Any, size: int, ptr: int | None = None) -> None:
        """The same for writing."""
        at, value = z3.Extract(15, 0, number(ea)), number(v)
        for k in range(size):
            self.state.memory = z3.Store(self.state.memory, at + k, z3.Extract(8 * k + 7, 8 * k, value))

    def flag(self, name: str) -> Any:
        """0 or 1."""
        return self.state.flags[name]

    def set_flags(self, **flags: Any) -> None:
        """Their lowest bits."""
        for name, v in flags.items():
            self.state.flags[name] = Int(number(v) & 1)


def results(words: list[int]) -> Iterator[State]:
    """States at RETURN on every path that some input takes. AssertionError for code that is not loop-free."""
    work = [(0, start())]
    steps = 0
    while work:
        at, state = work.pop()
        while True:
            steps += 1
            assert steps < MOST_STEPS, "not loop-free"
            insn = codec.decode(words[at], words[at + 1] if at + 1 < len(words) else 0)
            assert insn is not None, f"word {words[at]:06x}"
            machine = Machine(state, 2 * at)
            asked = insn.row.does(machine, insn.x)
            at += insn.words
            if asked is None:
                continue
            if isinstance(asked, flow.Return):
                yield state
                break
            if isinstance(asked, flow.Goto):
                assert isinstance(asked.target, int)
                assert asked.target // 2 > at - insn.words, "jumps back"
                at = asked.target // 2
                continue
            assert isinstance(asked, flow.Branch | flow.Skip), asked
            if isinstance(asked, flow.Branch):
                there = asked.target // 2
            else:
                following = codec.decode(words[at], words[at + 1] if at + 1 < len(words) else 0)
                assert following is not None
                there = at + following.words
            assert there >= at, "jumps back"
            taken = number(asked.cond) != 0
            other = state.copy()
            other.path.append(taken)
            if _possible(other):
                work.append((there, other))
            state.path.append(z3.Not(taken))
            if not _possible(state):
                break


def _possible(state: State) -> bool:
    solver = z3.Solver()
    solver.add(*state.path)
    return bool(solver.check() != z3.unsat)
