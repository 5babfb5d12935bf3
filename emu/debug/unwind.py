"""Call stacks from the code itself: what a function has done to W15 and the saved registers, found by running it on
symbols.

A function is walked from its first instruction to the place of interest with values that are "a register as it was at
entry, plus a constant", a constant, or unknown. That says where W15 was at entry, and so where the return address lies,
and where callee-saved registers were put. It needs no debug information and works for assembly, interrupt handlers
that change to another stack, and any compiler. The stack grows upwards; CALL and exceptions push four bytes, whose
high word carries the PC in bits 6:0 (isa.md §14.2).
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

REGISTERS: Final = 16
STACK_POINTER: Final = 15
SAVED: Final = range(8, 16)
"""W8 to W15 are what a function hands back as it found them (abi-elf.md §2)."""
RETURN_BYTES: Final = 4
LONGEST: Final = 6000
"""Instructions of one function that are walked; longer ones are given up."""
DEEPEST: Final = 64
"""Frames of one stack."""

Word = Callable[[int], int]
"""The 24-bit program word at an even address."""
Memory = Callable[[int], int | None]


@dataclass(frozen=True, slots=True)
class Known:
    """`base` plus `offset`. Base 0 to 15: that register at entry; CONSTANT: 0; JOINT + pc: W15 when `pc` was passed
    last, where ways with different W15 meet."""

    base: int
    offset: int


CONSTANT: Final = -1
JOINT: Final = 0x1000000
Symbolic = Known | None
"""None: nobody knows."""


@dataclass(slots=True)
class Picture:
    """Registers and memory by what is known of them. Memory is by the symbolic address of each word."""

    registers: list[Symbolic] = field(default_factory=lambda: [Known(n, 0) for n in range(REGISTERS)])
    memory: dict[Known, Known] = field(default_factory=dict)

    def copy(self) -> Picture:
        return Picture(list(self.registers), dict(self.memory))

    def merge(self, other: Picture, pc: int) -> bool:
        """Forget what differs from `other`, which leads to `pc` as well; whether anything was forgotten."""
        changed = False
        joint = Known(JOINT + pc, 0)
        for number, value in enumerate(self.registers):
            if value is not None and value != other.registers[number] and value != joint:
                self.registers[number] = joint if number == STACK_POINTER else None
                changed = True
        for place in [place for place, value in self.memory.items() if other.memory.get(place) != value]:
            del self.memory[place]
            changed = True
        return changed


class _Value:
    """A value on symbols: sums with constants are followed, all else is unknown."""

    __slots__ = ("known",)

    def __init__(self, known: Symbolic) -> None:
        self.known = known

    def _shifted(self, other: object, sign: int) -> _Value:
        amount = other if isinstance(other, int) else None
        if isinstance(other, _Value) and other.known is not None and other.known.base == CONSTANT:
            amount = other.known.offset
        if self.known is None or amount is None:
            return _UNKNOWN
        return _Value(Known(self.known.base, self.known.offset + sign * amount))

    def __add__(self, other: object) -> _Value:
        if isinstance(other, _Value) and self.known is not None and self.known.base == CONSTANT:
            return other._shifted(self.known.offset, 1)
        return self._shifted(other, 1)

    def __radd__(self, other: object) -> _Value:
        return self._shifted(other, 1)

    def __sub__(self, other: object) -> _Value:
        return self._shifted(other, -1)

    def __and__(self, other: object) -> _Value:
        """Masks that cut to 16 bits or clear bit 0 change no address."""
        return self if other in (0xFFFF, 0xFFFE) else _UNKNOWN

    def _lost(self, *_operands: object) -> _Value:
        return _UNKNOWN

    __rsub__ = __mul__ = __rmul__ = __rand__ = __or__ = __ror__ = __xor__ = __rxor__ = _lost
    __lshift__ = __rlshift__ = __rshift__ = __rrshift__ = __invert__ = __neg__ = _lost
    __eq__ = __ne__ = __lt__ = __le__ = __gt__ = __ge__ = _lost  # type: ignore[assignment]
    __hash__ = None  # type: ignore[assignment]


_UNKNOWN: Final = _Value(None)


def _symbolic(value: object) -> Symbolic:
    if isinstance(value, _Value):
        return value.known
    return Known(CONSTANT, value) if isinstance(value, int) else None


class _Walker:
    """A builder (isa/builder.py) that changes a `Picture`."""

    def __init__(self) -> None:
        self.context = Context()
        self.pc = 0
        self.picture = Picture()
        self.sure = True
        """Whether what happens, happens: inside `when` it may not."""

    def _unknown(self, *_arguments: object, **_more: object) -> Any:
        return _UNKNOWN

    select = div_trunc = rem_trunc = clz16 = ctz16 = prog = flag = reg = acc = xload = yload = _unknown

    def _nothing(self, *_arguments: object, **_more: object) -> None:
        """Changes nothing that is followed."""

    table_write = set_flags = set_reg = set_acc = trap_math = _nothing

    def let(self, v: Any) -> Any:
        return v

    def w(self, n: int) -> Any:
        return _Value(self.picture.registers[n])

    def ptr(self, n: int, side: Side) -> Any:
        return self.w(n)

    def set_w(self, n: int, v: Any) -> None:
        self.picture.registers[n] = _symbolic(v) if self.sure else None

    def set_wb(self, n: int, v: Any) -> None:
        self.picture.registers[n] = None

    def set_ptr(self, n: int, v: Any, side: Side) -> None:
        self.set_w(n, v)

    def load(self, ea: Any, size: Size, side: Side = "src", ptr: int | None = None) -> Any:
        place = _symbolic(ea)
        if size != 2 or place is None:
            return _UNKNOWN
        if place.base == CONSTANT and place.offset < 2 * REGISTERS:
            return self.w(place.offset >> 1)
        return _Value(self.picture.memory.get(place))

    def store(self, ea: Any, v: Any, size: Size, ptr: int | None = None) -> None:
        place = _symbolic(ea)
        if place is None:
            return  # through some pointer: the program's data, not its saved registers
        if place.base == CONSTANT and place.offset < 2 * REGISTERS:
            self.set_w(place.offset >> 1, v if size == 2 else _UNKNOWN)
            return
        value = _symbolic(v)
        if size == 2 and value is not None and self.sure:
            self.picture.memory[place] = value
        else:
            self.picture.memory.pop(place, None)

    def when(self, c: Any, fn: Callable[[], None]) -> None:
        sure, self.sure = self.sure, False
        fn()
        self.sure = sure


@lru_cache(maxsize=65536)
def _decoded(word1: int, word2: int) -> Insn | None:
    return decode_for_execution(word1, word2)


class Code:
    """Pictures of all instructions of functions, remembered by first instruction."""

    def __init__(self, word: Word, exists: Callable[[int], bool]) -> None:
        """`exists(pc)`: whether the program has anything at `pc`."""
        self._word: Final = word
        self._exists: Final = exists
        self._functions: Final[dict[int, dict[int, Picture]]] = {}

    def insn(self, pc: int) -> Insn | None:
        """The instruction at `pc`, None where none is."""
        return _decoded(self._word(pc), self._word(pc + 2)) if self._exists(pc) else None

    def picture(self, start: int, pc: int) -> Picture | None:
        """What holds before the instruction at `pc` in the function that begins at `start`; None if it is not reached
        from there."""
        if start not in self._functions:
            self._functions[start] = self._walk(start)
        return self._functions[start].get(pc)

    def _walk(self, start: int) -> dict[int, Picture]:
        pictures = {start: Picture()}
        work = [start]
        steps = 0
        while work and steps < 4 * LONGEST and len(pictures) < LONGEST:
            steps += 1
            pc = work.pop()
            for target, after in self._after(pc, pictures[pc]):
                seen = pictures.get(target)
                if seen is None:
                    pictures[target] = after
                    work.append(target)
                elif seen.merge(after, target):
                    work.append(target)
        return pictures

    def _after(self, pc: int, before: Picture) -> list[tuple[int, Picture]]:
        """The instructions that can follow inside the function, with what holds before them."""
        insn = self.insn(pc)
        if insn is None:
            return []
        walker: Any = _Walker()
        walker.pc, walker.picture = pc, before.copy()
        flow = insn.row.does(walker, insn.x)
        after: Picture = walker.picture
        next_pc = pc + 2 * insn.words
        match flow:
            case Return():
                return []
            case Goto(target):
                return [(target, after)] if isinstance(target, int) else []
            case Call():
                return [(next_pc, _returned(before, after))]
            case Branch(_, target):
                return [(target, after), (next_pc, after.copy())]
            case Skip():
                skipped = self.insn(next_pc)
                return [(next_pc + 2 * (1 if skipped is None else skipped.words), after), (next_pc, after.copy())]
            case Do():
                return [(next_pc, after)]
        return [(next_pc, after)]


def _returned(before: Picture, called: Picture) -> Picture:
    """After a call has come back: W8 to W15 and the memory as before it, W0 to W7 anything."""
    after = before.copy()
    for number in range(REGISTERS):
        if number not in SAVED:
            after.registers[number] = None
    return after


@dataclass(frozen=True, slots=True)
class Raw:
    """One frame: where it stands and what is known of its registers."""

    pc: int
    """Next instruction of the frame; of a caller, where it goes on."""
    registers: tuple[int | None, ...]
    entry: int | None
    """W15 at the function's first instruction: the return address lies in the four bytes below."""
    start: int | None
    """First instruction of the function."""
    is_handler: bool = False
    """Entered by an exception: the frame behind it was interrupted and did not call."""


class Unwinder:
    """Call stacks of one program. `function_start(pc)`: first instruction of the function around, None outside the program;
    `handlers`: where exceptions enter."""

    def __init__(self, code: Code, function_start: Callable[[int], int | None], handlers: frozenset[int]) -> None:
        self._code: Final = code
        self._function_start: Final = function_start
        self._handlers: Final = handlers

    def frames(self, pc: int, registers: tuple[int | None, ...], memory: Memory) -> list[Raw]:
        """Frames from the innermost out; `memory(address)` is the word of RAM there, None where none is."""
        frames: list[Raw] = []
        called = False
        while len(frames) < DEEPEST:
            start, picture = self._picture(pc, called)
            if start is None or picture is None:
                frames.append(Raw(pc, registers, None, start))
                break
            solved = _solved(picture, registers, memory)
            entry = solved.get(STACK_POINTER)
            handler = start in self._handlers
            frames.append(Raw(pc, registers, entry, start, handler))
            if entry is None:
                break
            low, high = memory(entry - RETURN_BYTES), memory(entry - 2)
            if low is None or high is None:
                break
            pc = (high & 0x7F) << 16 | low & 0xFFFE
            called = not handler
            if not self._plausible(pc, called) or any(one.pc == pc and one.entry == entry for one in frames[:-1]):
                break
            registers = (*(solved.get(n) for n in range(STACK_POINTER)), entry - RETURN_BYTES & 0xFFFF)
        return frames

    def _plausible(self, pc: int, called: bool) -> bool:
        """Whether a function can have been called from, or interrupted, there."""
        return _call_before(self._code, pc) is not None if called else self._function_start(pc) is not None

    def _picture(self, pc: int, called: bool) -> tuple[int | None, Picture | None]:
        """What the function around has done to registers and stack before it goes on at `pc`."""
        call = _call_before(self._code, pc) if called else None
        start = self._function_start(pc if call is None else call)
        if start is None:
            return None, None
        picture = self._code.picture(start, pc)
        if picture is None and call is not None:  # a call that never comes back ends the function
            before = self._code.picture(start, call)
            picture = _returned(before, before) if before is not None else None
        return start, picture


def _call_before(code: Code, pc: int) -> int | None:
    """Address of the call that returns to `pc`, None if there is none."""
    for words in (2, 1):
        insn = code.insn(pc - 2 * words) if pc >= 2 * words else None
        if insn is not None and insn.words == words and insn.row.mnemonic in ("CALL", "RCALL"):
            return pc - 2 * words
    return None


def _solved(picture: Picture, registers: tuple[int | None, ...], memory: Memory) -> dict[int, int]:
    """What the symbols stand for: registers at entry by number, and W15 at joints, from what is in registers and memory
    now."""
    solved = {CONSTANT: 0}
    for number in (STACK_POINTER, *range(STACK_POINTER)):
        known, value = picture.registers[number], registers[number]
        if known is not None and value is not None:
            solved.setdefault(known.base, value - known.offset & 0xFFFF)
    changed = True
    while changed:
        changed = False
        for place, known in picture.memory.items():
            if known.base not in solved and place.base in solved:
                value = memory(solved[place.base] + place.offset & 0xFFFF)
                if value is not None:
                    solved[known.base] = value - known.offset & 0xFFFF
                    changed = True
    return solved
