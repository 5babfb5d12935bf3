"""Call stack unwinding by symbolic execution of the code.

The analysis runs a function from its first instruction to the PC with symbolic values. A value is "a register at
function entry plus a constant", a constant, or unknown. The result says where W15 was at entry, hence where the return
address lies, and where callee-saved registers were stored. It needs no debug information. It also works for assembly,
for interrupt handlers that switch stacks, and for any compiler. The stack grows upwards. CALL and exceptions push four
bytes; bits 6:0 of the high word are the upper part of the PC (isa.md §14.2).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any, Final

from emu.dspic30f.isa.builder import Context, Side, Size
from emu.dspic30f.isa.codec import decode_for_execution
from emu.dspic30f.isa.flow import Branch, Call, Do, Goto, Return, Skip
from emu.dspic30f.isa.row import Insn
from emu.dspic30f.state.state import STACK_POINTER

REGISTERS: Final = 16
CALLEE_SAVED: Final = range(8, 16)
"""Callee-saved registers W8 to W15 (abi-elf.md §2)."""
RETURN_BYTES: Final = 4
"""Number of bytes that a call pushes (isa.md §7.4)."""
MAX_INSTRUCTIONS: Final = 6000
"""Maximum number of instructions of an analysed function."""
MAX_FRAMES: Final = 64
"""Maximum number of frames of a call stack."""

Word = Callable[[int], int]
"""Function that returns the 24-bit program word at an even program address."""
Memory = Callable[[int], int | None]


@dataclass(frozen=True, slots=True)
class SymbolicValue:
    """Sum of a base and `offset`. Bases 0 to 15 are the registers at function entry; CONSTANT is the number 0.

    The base MERGED + pc is W15 when control last passed `pc`, where paths with different values of W15 join.
    """

    base: int
    offset: int


CONSTANT: Final = -1
MERGED: Final = 0x1000000
MaybeSymbolic = SymbolicValue | None
"""Symbolic value, or None for an unknown value."""


@dataclass(slots=True)
class FrameState:
    """Knowledge about registers and memory before one instruction. Memory words have symbolic addresses."""

    registers: list[MaybeSymbolic] = field(default_factory=lambda: [SymbolicValue(n, 0) for n in range(REGISTERS)])
    memory: dict[SymbolicValue, SymbolicValue] = field(default_factory=dict)

    def copy(self) -> FrameState:
        return FrameState(list(self.registers), dict(self.memory))

    def merge(self, other: FrameState, pc: int) -> bool:
        """Keep only the knowledge that also holds in `other`, the state from another predecessor of `pc`.

        Return whether anything changed.
        """
        changed = False
        joint = SymbolicValue(MERGED + pc, 0)
        for number, value in enumerate(self.registers):
            if value is not None and value != other.registers[number] and value != joint:
                self.registers[number] = joint if number == STACK_POINTER else None
                changed = True
        for place in [place for place, value in self.memory.items() if other.memory.get(place) != value]:
            del self.memory[place]
            changed = True
        return changed


class _Operand:
    """Symbolic operand: sums with constants are evaluated, every other result is unknown."""

    __slots__ = ("known",)

    def __init__(self, known: MaybeSymbolic) -> None:
        self.known = known

    def _shifted(self, other: object, sign: int) -> _Operand:
        amount = other if isinstance(other, int) else None
        if isinstance(other, _Operand) and other.known is not None and other.known.base == CONSTANT:
            amount = other.known.offset
        if self.known is None or amount is None:
            return _UNKNOWN
        return _Operand(SymbolicValue(self.known.base, self.known.offset + sign * amount))

    def __add__(self, other: object) -> _Operand:
        if isinstance(other, _Operand) and self.known is not None and self.known.base == CONSTANT:
            return other._shifted(self.known.offset, 1)
        return self._shifted(other, 1)

    def __radd__(self, other: object) -> _Operand:
        return self._shifted(other, 1)

    def __sub__(self, other: object) -> _Operand:
        return self._shifted(other, -1)

    def __and__(self, other: object) -> _Operand:
        """Return the operand itself for a mask that keeps 16 bits or clears bit 0, which does not change an address."""
        return self if other in (0xFFFF, 0xFFFE) else _UNKNOWN

    def _unknown_result(self, *_operands: object) -> _Operand:
        return _UNKNOWN

    __rsub__ = __mul__ = __rmul__ = __rand__ = __or__ = __ror__ = __xor__ = __rxor__ = _unknown_result
    __lshift__ = __rlshift__ = __rshift__ = __rrshift__ = __invert__ = __neg__ = _unknown_result
    __eq__ = __ne__ = __lt__ = __le__ = __gt__ = __ge__ = _unknown_result  # type: ignore[assignment]
    __hash__ = None  # type: ignore[assignment]


_UNKNOWN: Final = _Operand(None)


def _symbolic(value: object) -> MaybeSymbolic:
    if isinstance(value, _Operand):
        return value.known
    return SymbolicValue(CONSTANT, value) if isinstance(value, int) else None


class _SymbolicBuilder:
    """Builder (isa/builder.py) that applies an instruction's effects to a `FrameState`."""

    def __init__(self) -> None:
        self.context = Context()
        self.pc = 0
        self.state = FrameState()
        self.is_unconditional = True
        """Whether the current effect happens unconditionally; inside `when` it does not."""

    def _unknown(self, *_arguments: object, **_more: object) -> Any:
        return _UNKNOWN

    select = div_trunc = rem_trunc = clz16 = ctz16 = prog = flag = reg = acc = xload = yload = _unknown

    def _no_effect(self, *_arguments: object, **_more: object) -> None:
        """Ignore an effect that the analysis does not need."""

    table_write = set_flags = set_reg = set_acc = trap_math = _no_effect

    def let(self, v: Any) -> Any:
        return v

    def w(self, n: int) -> Any:
        return _Operand(self.state.registers[n])

    def ptr(self, n: int, side: Side) -> Any:
        return self.w(n)

    def set_w(self, n: int, v: Any) -> None:
        self.state.registers[n] = _symbolic(v) if self.is_unconditional else None

    def set_wb(self, n: int, v: Any) -> None:
        self.state.registers[n] = None

    def set_ptr(self, n: int, v: Any, side: Side) -> None:
        self.set_w(n, v)

    def load(self, ea: Any, size: Size, side: Side = "src", ptr: int | None = None) -> Any:
        place = _symbolic(ea)
        if size != 2 or place is None:
            return _UNKNOWN
        if place.base == CONSTANT and place.offset < 2 * REGISTERS:
            return self.w(place.offset >> 1)
        return _Operand(self.state.memory.get(place))

    def store(self, ea: Any, v: Any, size: Size, ptr: int | None = None) -> None:
        place = _symbolic(ea)
        if place is None:
            return  # a store through an unknown pointer is assumed to hit the program's data, not saved registers
        if place.base == CONSTANT and place.offset < 2 * REGISTERS:
            self.set_w(place.offset >> 1, v if size == 2 else _UNKNOWN)
            return
        value = _symbolic(v)
        if size == 2 and value is not None and self.is_unconditional:
            self.state.memory[place] = value
        else:
            self.state.memory.pop(place, None)

    def when(self, c: Any, fn: Callable[[], None]) -> None:
        is_unconditional, self.is_unconditional = self.is_unconditional, False
        fn()
        self.is_unconditional = is_unconditional


@lru_cache(maxsize=65536)
def _decoded(word1: int, word2: int) -> Insn | None:
    return decode_for_execution(word1, word2)


class CodeAnalysis:
    """Symbolic states before every instruction of the functions analysed so far."""

    def __init__(self, word: Word, has_code: Callable[[int], bool]) -> None:
        """`has_code(pc)` returns whether the program defines an instruction at `pc`."""
        self._word: Final = word
        self._has_code: Final = has_code
        self._functions: Final[dict[int, dict[int, FrameState]]] = {}

    def insn(self, pc: int) -> Insn | None:
        """Return the instruction at `pc`, None if there is none or it is invalid."""
        return _decoded(self._word(pc), self._word(pc + 2)) if self._has_code(pc) else None

    def state_before(self, start: int, pc: int) -> FrameState | None:
        """Return the state before the instruction at `pc`, in the function that begins at `start`.

        Return None if the function does not reach `pc`.
        """
        if start not in self._functions:
            self._functions[start] = self._analyse(start)
        return self._functions[start].get(pc)

    def _analyse(self, start: int) -> dict[int, FrameState]:
        states = {start: FrameState()}
        work = [start]
        steps = 0
        while work and steps < 4 * MAX_INSTRUCTIONS and len(states) < MAX_INSTRUCTIONS:
            steps += 1
            pc = work.pop()
            for target, after in self._successors(pc, states[pc]):
                seen = states.get(target)
                if seen is None:
                    states[target] = after
                    work.append(target)
                elif seen.merge(after, target):
                    work.append(target)
        return states

    def _successors(self, pc: int, before: FrameState) -> list[tuple[int, FrameState]]:
        """Return the possible next instructions of the function, each with the state before it."""
        insn = self.insn(pc)
        if insn is None:
            return []
        builder: Any = _SymbolicBuilder()
        builder.pc, builder.state = pc, before.copy()
        flow = insn.row.does(builder, insn.x)
        after: FrameState = builder.state
        next_pc = pc + 2 * insn.words
        match flow:
            case Return():
                return []
            case Goto(target):
                return [(target, after)] if isinstance(target, int) else []
            case Call():
                return [(next_pc, _after_call(before, after))]
            case Branch(_, target):
                return [(target, after), (next_pc, after.copy())]
            case Skip():
                skipped = self.insn(next_pc)
                return [(next_pc + 2 * (1 if skipped is None else skipped.words), after), (next_pc, after.copy())]
            case Do():
                return [(next_pc, after)]
        return [(next_pc, after)]


def _after_call(before: FrameState, called: FrameState) -> FrameState:
    """Return the state after a call: W0 to W7 are unknown, W8 to W15 and memory are unchanged."""
    after = before.copy()
    for number in range(REGISTERS):
        if number not in CALLEE_SAVED:
            after.registers[number] = None
    return after


@dataclass(frozen=True, slots=True)
class RawFrame:
    """One physical frame: its PC and the known values of its registers."""

    pc: int
    """Address of the frame's next instruction; for a caller, the return address."""
    registers: tuple[int | None, ...]
    entry: int | None
    """Stack pointer that identifies the call.

    dsPIC30F: W15 at the function's first instruction; the return address lies in the four bytes below it.
    AVR: SP after the function's return.
    """
    start: int | None
    """Address of the function's first instruction."""
    is_handler: bool = False
    """Whether an exception entered this frame, so that the next outer frame was interrupted and made no call."""


class Unwinder:
    """Call stack unwinder of one program.

    `function_start(pc)` returns the first instruction of the function that contains `pc`, None outside the program.
    `handlers` are the entries of exception handlers.
    """

    def __init__(
        self, code: CodeAnalysis, function_start: Callable[[int], int | None], handlers: frozenset[int]
    ) -> None:
        self._code: Final = code
        self._function_start: Final = function_start
        self._handlers: Final = handlers

    def frames(self, pc: int, registers: tuple[int | None, ...], memory: Memory) -> list[RawFrame]:
        """Return the frames, innermost first. `memory(address)` returns a word of RAM, None outside RAM."""
        frames: list[RawFrame] = []
        called = False
        while len(frames) < MAX_FRAMES:
            start, state = self._state_at(pc, called)
            if start is None or state is None:
                frames.append(RawFrame(pc, registers, None, start))
                break
            solved = _solve(state, registers, memory)
            entry = solved.get(STACK_POINTER)
            handler = start in self._handlers
            frames.append(RawFrame(pc, registers, entry, start, handler))
            if entry is None:
                break
            low, high = memory(entry - RETURN_BYTES), memory(entry - 2)
            if low is None or high is None:
                break
            pc = (high & 0x7F) << 16 | low & 0xFFFE
            called = not handler
            if not self._is_plausible(pc, called) or any(one.pc == pc and one.entry == entry for one in frames[:-1]):
                break
            registers = (*(solved.get(n) for n in range(STACK_POINTER)), entry - RETURN_BYTES & 0xFFFF)
        return frames

    def _is_plausible(self, pc: int, called: bool) -> bool:
        """Whether `pc` can be a return address.

        For an interrupted frame, any instruction of the program is plausible.
        """
        return _call_before(self._code, pc) is not None if called else self._function_start(pc) is not None

    def _state_at(self, pc: int, called: bool) -> tuple[int | None, FrameState | None]:
        """Return the start of the function that contains `pc`, and the state before `pc`."""
        call = _call_before(self._code, pc) if called else None
        start = self._function_start(pc if call is None else call)
        if start is None:
            return None, None
        state = self._code.state_before(start, pc)
        if state is None and call is not None:  # the analysis ends a function at a call that never returns
            before = self._code.state_before(start, call)
            state = _after_call(before, before) if before is not None else None
        return start, state


def _call_before(code: CodeAnalysis, pc: int) -> int | None:
    """Return the address of the call whose return address is `pc`, None if there is none."""
    for words in (2, 1):
        insn = code.insn(pc - 2 * words) if pc >= 2 * words else None
        if insn is not None and insn.words == words and insn.row.mnemonic in ("CALL", "RCALL"):
            return pc - 2 * words
    return None


def _solve(state: FrameState, registers: tuple[int | None, ...], memory: Memory) -> dict[int, int]:
    """Return the values of the symbolic bases, computed from the frame's registers and memory.

    Bases are the registers at function entry, by number, and the values of W15 at merge points.
    """
    solved = {CONSTANT: 0}
    for number in (STACK_POINTER, *range(STACK_POINTER)):
        known, value = state.registers[number], registers[number]
        if known is not None and value is not None:
            solved.setdefault(known.base, value - known.offset & 0xFFFF)
    changed = True
    while changed:
        changed = False
        for place, known in state.memory.items():
            if known.base not in solved and place.base in solved:
                value = memory(solved[place.base] + place.offset & 0xFFFF)
                if value is not None:
                    solved[known.base] = value - known.offset & 0xFFFF
                    changed = True
    return solved
