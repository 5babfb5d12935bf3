"""Symbolic machine: evaluates the instruction table on z3 terms.

The semantics of instructions come from the table alone.  Observable actions of the code (volatile accesses, calls,
assembly statements) are compared, in order, with the events of one path of the source (`Event`).
"""

from __future__ import annotations

from collections.abc import Callable, Set
from dataclasses import dataclass, field
from typing import Any, Final

import z3

from emu.dspic30f.isa.builder import Context
from emu.dspic30f.isa.row import Insn
from emu.image.elf_facts import PSV_WINDOW
from toolchain.abi.target import SFR_END, W_END, register
from toolchain.proof.memory import STACK, StackFrame, SymbolicMemory, bytes_of, concat
from toolchain.proof.path import Event
from toolchain.proof.solver import Refuted, Undecided, check, require
from toolchain.proof.terms import (
    BITS,
    SymbolicInteger,
    Term,
    constant_value,
    holds,
    is_narrow,
    is_short,
    lowest_bit,
    narrow,
    truth_number,
    vector,
    wide,
    word,
)

CORE: Final = {register(name): name for name in ("TBLPAG", "PSVPAG", "RCOUNT")}
"""Core registers that an interrupt handler saves."""
PSVPAG: Final = register("PSVPAG")
ACCUMULATORS: Final = tuple(SymbolicInteger(z3.SignExt(BITS - 40, z3.BitVec(f"ACC{name}", 40))) for name in "AB")
"""Accumulators at entry."""
SINGLE_BIT: Final = ("BSET", "BCLR", "BTG", "BTSS", "BTSC", "BTST", "BTSTS", "BSW")
"""Instructions that access the whole word of a device register even if they address one byte (isa.md §5.4)."""


@dataclass
class MachineState:
    """State of the symbolic machine on one path: registers are ints or 16-bit terms, `event` is the next event."""

    w: list[Any]
    memory: SymbolicMemory
    pc: int
    flags: dict[str, Any] = field(default_factory=dict)
    frame: dict[int, Term] = field(default_factory=dict)
    accumulators: list[Any] = field(default_factory=lambda: list(ACCUMULATORS))
    regs: dict[str, Any] = field(default_factory=dict)
    path: list[Term] = field(default_factory=list)
    event: int = 0
    accessed_bytes: frozenset[int] = frozenset()
    """Bytes of the current event's access that have been accessed."""
    top: int = STACK
    """W15 before the instruction."""
    trace: list[MachineState] = field(default_factory=list)
    """Earlier states at the watched addresses (`CodeExecution.watched`)."""

    def copy(self) -> MachineState:
        """Return an independent copy."""
        return MachineState([*self.w], self.memory.copy(), self.pc, dict(self.flags), dict(self.frame),
                     [*self.accumulators], dict(self.regs), [*self.path], self.event, self.accessed_bytes, self.top,
                     [*self.trace])  # fmt: skip

    def forget_flags(self) -> None:
        """Make all flags unknown."""
        for name in ("C", "Z", "OV", "N", "DC"):
            self.flags[name] = truth_number(z3.FreshConst(z3.BoolSort(), "flag"))


class SymbolicMachine:
    """A `Builder` (emu.dspic30f.isa.builder) on z3 terms."""

    context = Context()

    def __init__(self, frame: StackFrame, events: list[Event], assumed: list[Term], page: Term, entry: Term) -> None:
        self.page: Final = page
        """Value of PSVPAG for constants."""
        self.before: Final = {at: z3.BitVec(name, 16) for at, name in CORE.items()} | {PSVPAG: entry}
        """Values of the registers of CORE at entry, by address."""
        self.frame: Final = frame
        self.events: Final = events
        self.assumptions: Final = assumed
        self.state: MachineState
        self.check_memory: Callable[[Event], None] = lambda e: None
        """Check of memory against the stores that must precede an event."""
        self.volatile: Set[int] = frozenset()
        """Bytes of RAM that may be accessed only where the source accesses them."""
        self.insn: Insn
        self.pc = 0

    def begin(self, state: MachineState, insn: Insn) -> None:
        """Prepare for the instruction at the state's PC."""
        self.state, self.insn, self.pc = state, insn, state.pc
        self._forget_above_stack_pointer(state)

    def _forget_above_stack_pointer(self, state: MachineState) -> None:
        """Make bytes above W15 unknown: an interrupt may overwrite them before any instruction."""
        top = state.w[15]
        places = {at for at in state.memory.written if self.frame.is_object(at)}
        if top < state.top:
            places |= {at for start, size in self.frame.objects.values() for at in range(start, start + size)}
        for bytes_there, places_there in ((state.memory.written, places), (state.frame, list(state.frame))):
            for at in places_there:
                if at >= top:
                    bytes_there[at] = z3.FreshConst(z3.BitVecSort(8), "free")
        state.top = top

    @property
    def conditions(self) -> list[Term]:
        """All conditions of the current state."""
        return [*self.assumptions, *self.state.path]

    # -- values ------------------------------------------------------------------------------------------------------

    def select(self, c: Any, a: Any, b: Any) -> Any:
        if isinstance(c, int):
            return a if c else b
        chosen = holds(c)
        small = is_narrow(a) and is_narrow(b)
        low = z3.If(chosen, word(a), word(b))
        return narrow(low) if small else SymbolicInteger(z3.If(chosen, wide(a), wide(b)), low)

    def div_trunc(self, a: Any, b: Any) -> Any:
        if isinstance(a, int) and isinstance(b, int):
            return 0 if not b else abs(a) // abs(b) * (1 if (a < 0) == (b < 0) else -1)
        if is_narrow(a) and is_narrow(b):
            return narrow(z3.If(word(b) == 0, vector(0, 16), z3.UDiv(word(a), word(b))))
        quotient = z3.If(wide(b) == 0, vector(0, BITS), wide(a) / wide(b))
        if is_short(a) and is_short(b):
            return SymbolicInteger(quotient, z3.If(word(b) == 0, vector(0, 16), word(a) / word(b)))
        return SymbolicInteger(quotient)

    def rem_trunc(self, a: Any, b: Any) -> Any:
        if isinstance(a, int) and isinstance(b, int):
            return 0 if not b else abs(a) % abs(b) * (1 if a >= 0 else -1)
        if is_narrow(a) and is_narrow(b):
            return narrow(z3.If(word(b) == 0, vector(0, 16), z3.URem(word(a), word(b))))
        rest = z3.If(wide(b) == 0, vector(0, BITS), z3.SRem(wide(a), wide(b)))
        if is_short(a) and is_short(b):
            return SymbolicInteger(rest, z3.If(word(b) == 0, vector(0, 16), z3.SRem(word(a), word(b))))
        return SymbolicInteger(rest)

    def clz16(self, v: Any) -> Any:
        return self._zeros(word(v), range(16), lambda k: 15 - k)

    def ctz16(self, v: Any) -> Any:
        return self._zeros(word(v), range(15, -1, -1), lambda k: k)

    def _zeros(self, term: Term, order: range, count: Any) -> Any:
        found = vector(16, 16)
        for k in order:
            found = z3.If(z3.Extract(k, k, term) == 1, vector(count(k), 16), found)
        return narrow(found)

    def let(self, v: Any) -> Any:
        return v

    # -- registers ---------------------------------------------------------------------------------------------------

    def w(self, n: int) -> Any:
        value = self.state.w[n]
        return value if isinstance(value, int) else narrow(value)

    def set_w(self, n: int, v: Any) -> None:
        if isinstance(v, int):
            self.state.w[n] = v & (0xFFFE if n == 15 else 0xFFFF)
            return
        place = constant_value(v.word)
        self.state.w[n] = v.word if place is None else place
        if n == 15 and place is None:
            raise Undecided("W15 changes by an unknown amount")

    def set_wb(self, n: int, v: Any) -> None:
        old = word(self.w(n))
        self.set_w(n, narrow(z3.simplify(z3.Concat(z3.Extract(15, 8, old), z3.Extract(7, 0, word(v))))))

    def ptr(self, n: int, side: str) -> Any:
        return self.w(n)

    def set_ptr(self, n: int, v: Any, side: str) -> None:
        self.set_w(n, v)

    def flag(self, name: str) -> Any:
        if name not in self.state.flags:
            self.state.flags[name] = truth_number(z3.Bool(f"flag.{name}"))
        return self.state.flags[name]

    def set_flags(self, **flags: Any) -> None:
        self.state.flags.update({name: lowest_bit(v) for name, v in flags.items()})

    def reg(self, name: str) -> Any:
        if name not in self.state.regs:
            raise Undecided(f"the register {name}")
        return self.state.regs[name]

    def set_reg(self, name: str, v: Any) -> None:
        self.state.regs[name] = v

    def acc(self, i: int) -> Any:
        return self.state.accumulators[i]

    def set_acc(self, i: int, v: Any) -> None:
        self.state.accumulators[i] = v

    def when(self, c: Any, fn: Any) -> None:
        if not isinstance(c, int):
            raise Undecided("an effect that depends on data")
        if c:
            fn()

    def trap_math(self, c: Any) -> None:
        require(z3.Not(holds(c)), self.conditions, "a math error trap")

    def prog(self, address: Any) -> Any:
        raise Undecided("a table read")

    def table_write(self, address: Any, byte_mask: Any, v: Any) -> None:
        raise Undecided("a table write")

    def xload(self, ea: Any, ptr: int) -> Any:
        return self.load(ea, 2)

    def yload(self, ea: Any, ptr: int) -> Any:
        return self.load(ea, 2)

    # -- memory ------------------------------------------------------------------------------------------------------

    def load(self, ea: Any, size: int, side: str = "src", ptr: int | None = None) -> Any:
        at = self._place(ea, size)
        seen = self._event("read", at, size)
        if seen is not None:
            return narrow(seen)
        if isinstance(at, int):
            if at < W_END:
                return (
                    narrow(z3.Extract(7, 0, z3.LShR(word(self.w(at // 2)), 8 * (at & 1))))
                    if size == 1
                    else self.w(at // 2)
                )
            if at in CORE and size == 2:
                return narrow(self.core(at))
            self._not_volatile(at, size)
            if at < SFR_END:
                raise Refuted(f"reads the register at {at:#x}, where the source does not")
            if self.frame.is_private(at):
                value = concat([self.frame_byte(at + k) for k in range(size)])
                place = constant_value(value)
                return narrow(value) if place is None else place
        elif size == 2:
            require(z3.Extract(0, 0, at) == 0, self.conditions, "reads a word at an odd address")
        self._check_psv_page(at)
        return narrow(self.state.memory.read(at, size))

    def store(self, ea: Any, v: Any, size: int, ptr: int | None = None) -> None:
        at, value = self._place(ea, size), z3.Extract(8 * size - 1, 0, word(v)) if size == 1 else word(v)
        if self._event("write", at, size, value) is not None:
            return
        if isinstance(at, int):
            if at < W_END:
                (self.set_w if size == 2 else self.set_wb)(at // 2, v)
                return
            if at in CORE and size == 2:
                self.state.regs[CORE[at]] = narrow(value)
                return
            self._not_volatile(at, size)
            if at < SFR_END:
                raise Refuted(f"writes the register at {at:#x}, where the source does not")
            if self.frame.is_private(at):
                for k, part in enumerate(bytes_of(value)):
                    self.state.frame[at + k] = part
                return
        else:
            require(
                self.frame.avoids_private_bytes(at, size), self.conditions, "writes to its own frame through a pointer"
            )
            if size == 2:
                require(z3.Extract(0, 0, at) == 0, self.conditions, "writes a word at an odd address")
        self.state.memory.write(at, value)

    def _not_volatile(self, at: int, size: int) -> None:
        if not self.volatile.isdisjoint(range(at, at + size)):
            raise Refuted(f"accesses the volatile byte at {at:#x}, where the source does not")

    def _place(self, ea: Any, size: int) -> Any:
        found = ea if isinstance(ea, int) else constant_value(ea.word)
        if found is not None and found & (size - 1):
            raise Refuted(f"a word at the odd address {found:#x}")
        return ea.word if found is None else found

    def _check_psv_page(self, at: Any) -> None:
        """Check that a read in the PSV window uses the page of constants."""
        page = self.core(PSVPAG)
        if not page.eq(self.page):
            constant = z3.UGE(vector(at, 16) if isinstance(at, int) else at, vector(PSV_WINDOW, 16))
            require(z3.Or(z3.Not(constant), page == self.page), self.conditions, "reads a constant by another PSVPAG")

    def core(self, at: int) -> Term:
        """Return a register of CORE as a term."""
        if CORE[at] not in self.state.regs:
            self.state.regs[CORE[at]] = narrow(self.before[at])
        return word(self.state.regs[CORE[at]])

    def frame_byte(self, at: int) -> Term:
        """Return a byte of the private frame."""
        if at not in self.state.frame:
            self.state.frame[at] = z3.BitVec(f"stack.{at:x}", 8)
        return self.state.frame[at]

    # -- observable events -------------------------------------------------------------------------------------------

    def expected(self) -> Event | None:
        """Return the next event of the source, None after the last."""
        return self.events[self.state.event] if self.state.event < len(self.events) else None

    def advance(self) -> None:
        """Advance to the event after the next one."""
        self.state.event += 1
        self.state.accessed_bytes = frozenset()

    def _event(self, kind: str, at: Any, size: int, value: Term | None = None) -> Term | None:
        """Execute an access as the source's next volatile access; return its value, None if the accesses differ."""
        e = self.expected()
        if e is None or e.kind != kind:
            return None
        distance = self._distance(at, e, size)
        if distance is None:
            return None
        if distance in self.state.accessed_bytes:
            raise Refuted(f"executes a {kind} twice that the source executes once")
        part = z3.Extract(8 * (distance + size) - 1, 8 * distance, e.value)
        single = size == 1 and self.insn.row.syntax.startswith(SINGLE_BIT)
        whole = e.size == 2 and single
        if e.aligned and size < min(e.size, 2) and not single:
            raise Refuted(f"splits the {kind} of a word into bytes")
        if kind == "write":
            assert value is not None
            require(
                part == value,
                self.conditions,
                f"writes another value than the source to {at if not isinstance(at, int) else hex(at)}",
            )
            if whole:
                self._check_other_byte(e, distance)
        if e.memory is not None and not self.state.accessed_bytes:
            self.check_memory(e)
        bytes_done = set(range(e.size)) if whole else self.state.accessed_bytes | set(range(distance, distance + size))
        self.state.accessed_bytes = frozenset(bytes_done)
        if len(bytes_done) == e.size:
            self.advance()
        return z3.simplify(part)

    def _distance(self, at: Any, e: Event, size: int) -> int | None:
        """Return the byte offset of an access within the access of the event, None if it is outside."""
        start = constant_value(e.address)
        if isinstance(at, int) and start is not None:
            distance = at - start
            return distance if 0 <= distance <= e.size - size else None
        here = vector(at, 16) if isinstance(at, int) else at
        return next((k for k in range(0, e.size, size) if self._same(here, e.address + k)), None)

    def _check_other_byte(self, e: Event, distance: int) -> None:
        """Check that a single-bit write leaves the register's other byte as the source has read it."""
        before = self.events[self.state.event - 1] if self.state.event else None
        if before is None or before.kind != "read" or before.size != 2 or not self._same(before.address, e.address):
            raise Refuted("writes a single bit where the source did not read the register immediately before")
        other = 8 * (1 - distance)
        same = z3.Extract(other + 7, other, e.value) == z3.Extract(other + 7, other, before.value)
        require(same, self.conditions, "does not write a byte of a register that the source changes")

    def _same(self, a: Any, b: Any) -> bool:
        if a is b:
            return True
        found, _ = check([*self.conditions, a != b])
        if found == z3.unknown:
            raise Undecided("the solver gave up: whether two addresses are equal")
        return bool(found == z3.unsat)
