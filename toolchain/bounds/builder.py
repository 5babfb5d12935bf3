"""The instruction table on sets of values: one more reader of the rows beside integers, Python and LLVM.

What enters: a state and an instruction.  What leaves: the state behind it and what it costs (isa.md §13).  A pointer
that is not known reads the PSV window, which takes a cycle or two more, unless it is known to lead into RAM; as a
destination it spares the stack until an address of the stack has got out of sight.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from emu.dspic30f.isa.builder import Context, Side, Size
from toolchain.abi.target import SFR_END, W_END, register
from toolchain.bounds.abstract.state import NOWHERE, Area, State, hides
from toolchain.bounds.abstract.values import (
    ACCUMULATOR,
    BYTE,
    EITHER,
    LINK,
    PROGRAM,
    WINDOW,
    WORD,
    Span,
    Value,
    ends,
    known,
    span,
    union,
)
from toolchain.bounds.annotations.rules import ADDRESSING, EARLY, LOOP_REGISTER, STACK_POINTER

SR, CORCON, TBLPAG, DISICNT, INTCON1 = map(register, ("SR", "CORCON", "TBLPAG", "DISICNT", "INTCON1"))
LOOP_REGISTERS = tuple(map(register, ("DCOUNT", "DOSTARTL", "DOSTARTH", "DOENDL", "DOENDH")))
DCOUNT, DOSTARTL, DOSTARTH, DOENDL, DOENDH = LOOP_REGISTERS
DL = 0x0700
"""Bits of CORCON that count open DO loops (isa.md §2.4)."""
NSTDIS = 1 << 15
"""Bit of INTCON1 with which no interrupt interrupts another (isa.md §14.1)."""
COUNTS = 0x3FFF
"""What DCOUNT and DISICNT hold at most."""
ENABLES = {register("MODCON"): 0xC000, register("XBREV"): 0x8000}
"""MODCON and XBREV: the bits that turn modulo and bit-reversed addressing on (isa.md §8)."""
EDT = 1 << 11
"""Bit of CORCON that ends a DO loop early (isa.md §7.6)."""
IPL3 = TRAP = 8
"""Bit of CORCON that a trap sets and code can only clear, and what it adds to the priority (isa.md §2.4)."""
STACK = 15
"""W15, which leads into RAM wherever it is not known."""
TABLE = 64
"""Most places of a constant table that one load looks at."""
IPL_BITS = 0xE0
ANY_IPL = (0, 7)


@dataclass(slots=True)
class World:
    """What does not change: constants of the image and which data is tracked."""

    area: Area
    program: dict[int, int]
    """24-bit words by program address."""
    window: dict[int, int] | None
    """Bytes of the PSV window by data address; None: the image has no constants there, and no pointer leads there."""
    private: set[int] = field(default_factory=set)
    """Word addresses of variables that nobody but the code looked at changes."""
    links_in_ram: Callable[[int], bool] = lambda _pc: False
    """Whether the instruction at an address finds nothing but RAM behind pointers it loads."""
    priorities: Mapping[int, list[tuple[int, str, int]]] = field(default_factory=dict)
    """Registers that give interrupts their priority: address -> shift, name, told level of each that has a handler."""
    enables: frozenset[int] = frozenset()
    """Registers that enable interrupts."""


def exact(value: Value) -> bool:
    """Whether it is one integer."""
    return not isinstance(value, Span)


def levels_in(status: Value) -> tuple[int, int]:
    """Least and greatest priority that a value for SR sets."""
    mask, bits = known(status)
    low = (bits & mask & IPL_BITS) >> 5
    return low, low | (~mask & IPL_BITS) >> 5


class Abstract:
    """A `Builder` (emu.dspic30f.isa.builder) on sets."""

    def __init__(self, world: World) -> None:
        self.context = Context()
        self.world = world
        self.pc = 0
        self.state = State()
        self.window = False
        self.wild = False
        """Something was stored where the address said nothing."""
        self.refused: str | None = None
        """Why what the instruction does has no bound."""
        self.lowest = NOWHERE
        """The lowest address of a stack it has read."""
        self.rewrote = False
        """Whether a store has reached flags or registers that branches ask for."""
        self.unnested = False
        """Whether it has turned nesting off."""
        self.level: str | None = None
        """Which interrupt it has given another priority than is told."""
        self._saw = NOWHERE
        self._stores: list[tuple[Value, Value, Size]] = []

    def begin(self, pc: int, state: State) -> None:
        """Prepare for the instruction at `pc`."""
        self.pc, self.state, self.window, self._saw = pc, state, False, NOWHERE
        self.refused, self.lowest, self.rewrote = None, NOWHERE, False
        self._stores.clear()

    def commit(self) -> None:
        """Let the stores happen."""
        for ea, value, size in self._stores:
            self._write(ea, value, size)

    # -- values --------------------------------------------------------------------------------------------------

    def select(self, c: Value, a: Value, b: Value) -> Value:
        return (a if c else b) if exact(c) else union(a, b)

    def div_trunc(self, a: Value, b: Value) -> Value:
        (al, ah), (bl, bh) = ends(a), ends(b)
        if exact(a) and exact(b):
            return 0 if not b else abs(a) // abs(b) * (1 if (a < 0) == (b < 0) else -1)
        least = max(1, min(abs(bl), abs(bh))) if (bl > 0) == (bh > 0) and bl and bh else 1
        most = max(abs(al), abs(ah)) // least
        return span(0 if al >= 0 and bl >= 0 else -most, most)

    def rem_trunc(self, a: Value, b: Value) -> Value:
        (al, ah), (bl, bh) = ends(a), ends(b)
        if exact(a) and exact(b):
            return 0 if not b else abs(a) % abs(b) * (1 if a >= 0 else -1)
        most = min(max(abs(al), abs(ah)), max(abs(bl), abs(bh), 1) - 1)
        return span(0 if al >= 0 else -most, 0 if ah <= 0 else most)

    def clz16(self, v: Value) -> Value:
        lo, hi = ends(v)
        return span(16 - min(hi, 0xFFFF).bit_length(), 16 - max(lo, 0).bit_length())

    def ctz16(self, v: Value) -> Value:
        return ((v & -v).bit_length() - 1 if v else 16) if exact(v) else span(0, 16)

    def let(self, v: Value) -> Value:
        return v

    # -- registers -----------------------------------------------------------------------------------------------

    def w(self, n: int) -> Value:
        value = self.state.w[n]
        if self.world.area.inside(value):
            self._saw = min(self._saw, ends(value)[0])
        return value

    def _note(self, value: Value) -> None:
        """Something wide made of an address of the stack hides it."""
        if self._saw < NOWHERE and hides(value):
            self.state.leaked = min(self.state.leaked, self._saw)

    def set_w(self, n: int, v: Value) -> None:
        v = v & 0xFFFF
        if n == 15:
            v = v & 0xFFFE
        self._note(v)
        self.state.w[n] = v

    def set_wb(self, n: int, v: Value) -> None:
        old = self.state.w[n]
        self.state.w[n] = old & 0xFF00 | v & 0xFF

    def ptr(self, n: int, side: Side) -> Value:
        return self.state.w[n]

    def set_ptr(self, n: int, v: Value, side: Side) -> None:
        if self.world.area.inside(self.state.w[n]):
            self._saw = min(self._saw, ends(self.state.w[n])[0])
        self.set_w(n, v)

    def flag(self, name: str) -> Value:
        return self.state.flags[name]

    def set_flags(self, **flags: Value) -> None:
        self.state.flags.update(flags)

    def reg(self, name: str) -> Value:
        return self.state.regs.get(name, WORD)

    def set_reg(self, name: str, v: Value) -> None:
        if name in ("RCOUNT", "TBLPAG"):
            v = v & 0xFFFF
        self.state.regs[name] = v

    def acc(self, i: int) -> Value:
        return ACCUMULATOR

    def set_acc(self, i: int, v: Value) -> None:
        """Accumulators decide nothing but flags."""

    def when(self, c: Value, fn: Callable[[], None]) -> None:
        if not exact(c):
            before = self.state.w.copy(), self.state.flags.copy()
            fn()
            self.state.w = [union(a, b) for a, b in zip(before[0], self.state.w, strict=True)]
            self.state.flags = {n: union(before[1][n], v) for n, v in self.state.flags.items()}
        elif c:
            fn()

    def trap_math(self, c: Value) -> None:
        """A trap is an entry of its own."""

    # -- memory --------------------------------------------------------------------------------------------------

    def load(self, ea: Value, size: Size, side: Side = "src", ptr: int | None = None) -> Value:
        value = (BYTE if size == 1 else WORD) if ptr == STACK and not exact(ea) else self._read(ea, size)
        if self.world.area.inside(value):
            self._saw = min(self._saw, ends(value)[0])
        return value

    def xload(self, ea: Value, ptr: int) -> Value:
        return self._read(ea, 2)

    def yload(self, ea: Value, ptr: int) -> Value:
        return WORD

    def store(self, ea: Value, v: Value, size: Size, ptr: int | None = None) -> None:
        self._stores.append((ea, v & (0xFF if size == 1 else 0xFFFF), size))

    def prog(self, address: Value) -> Value:
        return self.world.program.get(address, PROGRAM) if exact(address) else PROGRAM

    def table_write(self, address: Value, byte_mask: Value, v: Value) -> None:
        """Flash is not written in the code looked at."""

    def _read(self, ea: Value, size: Size) -> Value:
        low, high = ends(ea)
        if any(low < end and start <= high for start, end in self.world.area.ranges) and not hides(ea):
            self.lowest = min(self.lowest, low)
        unknown = BYTE if size == 1 else LINK if self.world.links_in_ram(self.pc) else WORD
        if exact(ea):
            if ea >= WINDOW:
                self.window = True
                return self._constant(ea, size, unknown)
            return self._variable(ea, size, unknown)
        if ea.hi >= WINDOW and not ea.ram and self.world.window is not None:
            self.window = True
            places = range(ea.lo, ea.hi + 1, size)
            if ea.lo >= WINDOW and len(places) <= TABLE:
                values = [self._constant(place, size, unknown) for place in places]
                result = values[0]
                for value in values[1:]:
                    result = union(result, value)
                return result
        return unknown

    def _constant(self, ea: int, size: Size, unknown: Value) -> Value:
        window = self.world.window or {}
        found = [window.get(ea + i) for i in range(size)]
        return unknown if None in found else sum(byte << 8 * i for i, byte in enumerate(found) if byte is not None)

    def _variable(self, ea: int, size: Size, unknown: Value) -> Value:
        state, mem = self.state, self.state.mem
        if ea < W_END:
            word = state.w[ea >> 1]
            return word if size == 2 else word >> 8 * (ea & 1) & 0xFF
        register = self._core_register(ea & ~1)
        if register is not None:
            return register if size == 2 else register >> 8 * (ea & 1) & 0xFF
        if size == 2:
            if ea in mem:
                return mem[ea]
            low, high = mem.get(~ea), mem.get(~(ea + 1))
            return unknown if low is None or high is None else low | high << 8
        if ea & ~1 in mem:
            return mem[ea & ~1] >> 8 * (ea & 1) & 0xFF
        return mem.get(~ea, BYTE)

    def _core_register(self, ea: int) -> Value | None:
        """What is known of SR, of DISICNT, and within a DO loop of CORCON and the registers of the loop."""
        state = self.state
        if ea == SR:
            return self._status()
        if ea == DISICNT:
            return span(0, min(COUNTS, state.blocked))
        if not state.loops:
            return None
        if ea == CORCON:
            return state.mem[ea] & ~DL | Span(0, DL, ~DL, 0) if ea in state.mem else WORD
        if ea not in LOOP_REGISTERS:
            return None
        start, end, count = state.loops[-1]
        return (count, start & 0xFFFF, start >> 16, end & 0xFFFF, end >> 16)[LOOP_REGISTERS.index(ea)]

    def _status(self) -> Value:
        """SR: of it the level is known where it is one."""
        low, high = self.state.ipl
        agree = ~(low ^ high) << 5 & IPL_BITS
        return Span(0, 0xFFFF, ~0xFFFF | agree, low << 5 & agree)

    def _write(self, ea: Value, value: Value, size: Size) -> None:
        state, area = self.state, self.world.area
        if exact(ea):
            if ea == CORCON and known(~value)[1] & known(value)[0] & IPL3:
                state.ipl = state.ipl[0] & ~TRAP, state.ipl[1] & ~TRAP
            self._control(ea, value, size)
            if ea < W_END:
                self._register(ea, value, size)
            elif ea & ~1 == SR:
                if not ea & 1:
                    self._set_status(value)
            elif ea == TBLPAG:
                state.regs["TBLPAG"] = value
            elif ea & ~1 in self.world.enables:
                self._enable(ea & ~1, value if size == 2 else WORD)
            elif area.holds(ea) or ea & ~1 in self.world.private:
                self._keep(ea, value, size)
                return
            if area.inside(value) and state.w[15] is not value:
                state.leaked = min(state.leaked, ends(value)[0])
            return
        if area.inside(value) and state.w[15] is not value:  # nothing lives behind the top of the stack
            state.leaked = min(state.leaked, ends(value)[0])
        if not hides(ea):
            low, high = ends(ea)
            self._forget(low, high + size - 1)
            if low < SFR_END:
                self._overwritten(low, min(high + size, SFR_END) - 1, value if size == 2 else WORD)
            return
        self.wild = True
        if state.leaked < NOWHERE:
            for lo, hi in area.ranges:
                self._forget(lo, hi)

    def _register(self, ea: int, value: Value, size: Size) -> None:
        """A store to a working register, of which a byte leaves the other."""
        self.rewrote = True
        number = ea >> 1
        if size == 2:
            self.set_w(number, value)
        elif ea & 1:
            self.set_w(number, self.state.w[number] & 0xFF | (value & 0xFF) << 8)
        else:
            self.set_wb(number, value)

    def _control(self, ea: int, value: Value, size: Size) -> None:
        """A store to what governs DO loops and the arithmetic of addresses. A value that is not known is one that was
        read there, in which EDT is 0 and addressing as it was."""
        shift = 8 * (ea & 1) if size == 1 else 0
        register, (mask, bits) = ea & ~1, known(value)
        if size == 1:
            mask &= 0xFF
        ones, zeros = (mask & bits) << shift, (mask & ~bits) << shift
        reached = 0xFFFF if size == 2 else 0xFF << shift
        state = self.state
        if register in LOOP_REGISTERS:
            self._loop_register(register, value, size)
        elif register == DISICNT:
            blocked = ends(value)[1] & COUNTS if size == 2 and ends(value)[1] <= COUNTS else COUNTS
            state.disi = state.time + blocked + 1 if blocked else 0
        elif register == INTCON1 and ones & NSTDIS:
            self.unnested = True
        elif register in self.world.priorities:
            self._priorities(register, ones, zeros)
        elif register == CORCON and EDT & reached & ~zeros:
            if state.loops:
                start, end, count = state.loops[-1]
                state.loops = (*state.loops[:-1], (start, end, span(0, ends(count)[1])))
            elif ones & EDT:
                self.refused = EARLY
        elif ones & ENABLES.get(register, 0):
            self.refused = ADDRESSING

    def _enable(self, register: int, value: Value) -> None:
        """A store that enables interrupts, or none."""
        if exact(value) and not value:
            self.state.regs[f"{register:#x}"] = 0
        else:
            self.state.regs.pop(f"{register:#x}", None)

    def disabled(self, state: State) -> bool:
        """Whether no interrupt is enabled: then none is requested."""
        return all(f"{register:#x}" in state.regs for register in self.world.enables)

    def _loop_register(self, register: int, value: Value, size: int) -> None:
        """A store to DCOUNT, DOSTART or DOEND. Without an open loop of ours it is somebody else's that is brought back,
        so on a stack that is not ours: a change of threads."""
        state = self.state
        if not state.loops or not exact(state.w[STACK]):
            return
        start, end, _ = state.loops[-1]
        if register == DCOUNT and size == 2 and ends(value)[1] <= COUNTS:
            state.loops = (*state.loops[:-1], (start, end, value))
        elif size == 1 or not exact(value) or value != self._core_register(register):
            self.refused = LOOP_REGISTER

    def _priorities(self, register: int, ones: int, zeros: int) -> None:
        """A store to the priorities of interrupts, of which bits are known: each may be set to what is told, or off."""
        for shift, name, told in self.world.priorities[register]:
            on, off = ones >> shift & 7, zeros >> shift & 7
            if all(on & ~level or off & level for level in (0, told)):
                self.level = f"{name}: {on}" if on | off == 7 else name

    def _overwritten(self, low: int, high: int, value: Value) -> None:
        """One of the registers in the SFR space was written, which is not known; it may hold `value`."""
        self.rewrote = True
        state = self.state
        for number in range(low >> 1, min(high >> 1, STACK - 1) + 1):
            state.w[number] = union(state.w[number], value)
        if low <= 2 * STACK + 1 and high >= 2 * STACK:
            self.refused = STACK_POINTER
        if low <= SR <= high:
            self._set_status(BYTE)
        if state.loops and low <= DOENDH + 1 and high >= DCOUNT:
            self.refused = LOOP_REGISTER
        for at in self.world.enables:
            state.regs.pop(f"{at:#x}", None)
        self.unnested |= low <= INTCON1 + 1 and high >= INTCON1
        if low <= CORCON + 1 and high >= CORCON:
            state.ipl = state.ipl[0] & ~TRAP, state.ipl[1]
            if state.loops:
                start, end, count = state.loops[-1]
                state.loops = (*state.loops[:-1], (start, end, span(0, ends(count)[1])))

    def _keep(self, ea: int, value: Value, size: Size) -> None:
        mem = self.state.mem
        if size == 2:
            mem[ea] = value
            mem.pop(~ea, None)
            mem.pop(~(ea + 1), None)
            return
        word = mem.pop(ea & ~1, None)
        if word is not None:
            mem[~(ea & ~1)], mem[~(ea | 1)] = word & 0xFF, word >> 8 & 0xFF
        mem[~ea] = value

    def _forget(self, lo: int, hi: int) -> None:
        """Nothing is known of the stack between two addresses any more."""
        mem, area = self.state.mem, self.world.area
        for key in [k for k in mem if lo - 1 <= (k if k >= 0 else ~k) <= hi]:
            value = mem.pop(key)
            if area.inside(value):
                self.state.leaked = min(self.state.leaked, ends(value)[0])

    def _set_status(self, value: Value) -> None:
        self.rewrote = True
        low, high = levels_in(value)
        mask, bits = known(value)
        self.state.ipl = self.state.ipl[0] & TRAP | low, self.state.ipl[1] & TRAP | high
        for name, bit in (("C", 0), ("Z", 1), ("OV", 2), ("N", 3)):
            self.state.flags[name] = bits >> bit & 1 if mask >> bit & 1 else EITHER
