"""Transfer functions: the instruction table evaluated on abstract states.

In: an abstract state and an instruction.  Out: the state after it, and its cycles (isa.md §13).  A read through an
unknown pointer counts as a PSV window read, one or two cycles longer, unless the pointer is known to address RAM.
A store through an unknown pointer is assumed not to change the stack, unless an untracked location has a stack address.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from emu.dspic30f.isa.builder import Context, Side, Size
from toolchain.abi.target import SFR_END, W_END, register
from toolchain.bounds.abstract.state import NO_ADDRESS, AbstractState, StackAreas, is_unknown_address
from toolchain.bounds.abstract.values import (
    ACCUMULATOR,
    BIT,
    BYTE,
    PROGRAM_WORD,
    RAM_POINTER,
    WINDOW,
    WORD,
    Interval,
    Value,
    extremes,
    interval,
    known_bits,
    union,
)
from toolchain.bounds.annotations.flow_facts import (
    DO_LOOP_CUT_SHORT,
    DO_REGISTER_WRITTEN,
    SPECIAL_ADDRESSING,
    STACK_POINTER_OVERWRITTEN,
)

SR, CORCON, TBLPAG, DISICNT, INTCON1 = map(register, ("SR", "CORCON", "TBLPAG", "DISICNT", "INTCON1"))
LOOP_REGISTERS = tuple(map(register, ("DCOUNT", "DOSTARTL", "DOSTARTH", "DOENDL", "DOENDH")))
DCOUNT, DOSTARTL, DOSTARTH, DOENDL, DOENDH = LOOP_REGISTERS
DL = 0x0700
"""Bits of CORCON that count active DO loops (isa.md §2.4)."""
NSTDIS = 1 << 15
"""Bit of INTCON1 that disables interrupt nesting (isa.md §14.1)."""
COUNTS = 0x3FFF
"""Greatest value of DCOUNT and DISICNT."""
ENABLES = {register("MODCON"): 0xC000, register("XBREV"): 0x8000}
"""By register (MODCON, XBREV): the bits that enable modulo and bit-reversed addressing (isa.md §8)."""
EDT = 1 << 11
"""Bit of CORCON that ends a DO loop early (isa.md §7.6)."""
IPL3 = TRAP = 8
"""Bit of CORCON that a trap sets and code can only clear; it adds 8 to the CPU priority (isa.md §2.4)."""
STACK = 15
"""W15; an unknown W15 is assumed to address RAM."""
MAX_TABLE = 64
"""Greatest number of entries of a constant table that one load enumerates."""
IPL_BITS = 0xE0


@dataclass(slots=True)
class ImageModel:
    """Facts of the image that no instruction changes: code, constants, and the set of tracked data."""

    stack_areas: StackAreas
    program_words: dict[int, int]
    """24-bit words by program address."""
    psv_bytes: dict[int, int] | None
    """Bytes of the PSV window by data address; None if the image has no constants: no pointer points into it."""
    tracked_words: set[int] = field(default_factory=set)
    """Word addresses of tracked variables: only the analysed code changes them."""
    pointers_in_ram: Callable[[int], bool] = lambda _pc: False
    """Whether all pointers that the instruction at an address loads point into RAM."""
    priorities: Mapping[int, list[tuple[int, str, int]]] = field(default_factory=dict)
    """Interrupt priority registers: address -> (shift, name, annotated level) of each interrupt with a handler."""
    enable_registers: frozenset[int] = frozenset()
    """Addresses of interrupt enable registers."""


def is_constant(value: Value) -> bool:
    """Whether a set has exactly one member."""
    return not isinstance(value, Interval)


def priority_range(status: Value) -> tuple[int, int]:
    """Return the least and the greatest CPU priority that a value written to SR sets."""
    mask, bits = known_bits(status)
    low = (bits & mask & IPL_BITS) >> 5
    return low, low | (~mask & IPL_BITS) >> 5


class TransferFunctions:
    """A `Builder` (emu.dspic30f.isa.builder) on abstract states."""

    def __init__(self, model: ImageModel) -> None:
        self.context = Context()
        self.model = model
        self.pc = 0
        self.state = AbstractState()
        self.reads_window = False
        self.unknown_store = False
        """Whether a store through an unknown address has been executed."""
        self.unbounded_reason: str | None = None
        """Reason why the instruction has no bound, None if it has one."""
        self.lowest_stack_read = NO_ADDRESS
        """Lowest stack address that the instruction has read."""
        self.overwrote_registers = False
        """Whether a store may have changed flags or registers that branches test."""
        self.disabled_nesting = False
        """Whether the instruction has disabled interrupt nesting."""
        self.priority_change: str | None = None
        """The interrupt whose priority has been set to a value that contradicts its annotation."""
        self._saw = NO_ADDRESS
        self._stores: list[tuple[Value, Value, Size]] = []

    def begin(self, pc: int, state: AbstractState) -> None:
        """Prepare for the instruction at `pc`."""
        self.pc, self.state, self.reads_window, self._saw = pc, state, False, NO_ADDRESS
        self.unbounded_reason, self.lowest_stack_read, self.overwrote_registers = None, NO_ADDRESS, False
        self._stores.clear()

    def commit(self) -> None:
        """Execute the pending stores."""
        for ea, value, size in self._stores:
            self._write(ea, value, size)

    # -- values --------------------------------------------------------------------------------------------------

    def select(self, c: Value, a: Value, b: Value) -> Value:
        return (a if c else b) if is_constant(c) else union(a, b)

    def div_trunc(self, a: Value, b: Value) -> Value:
        (al, ah), (bl, bh) = extremes(a), extremes(b)
        if is_constant(a) and is_constant(b):
            return 0 if not b else abs(a) // abs(b) * (1 if (a < 0) == (b < 0) else -1)
        least = max(1, min(abs(bl), abs(bh))) if (bl > 0) == (bh > 0) and bl and bh else 1
        most = max(abs(al), abs(ah)) // least
        return interval(0 if al >= 0 and bl >= 0 else -most, most)

    def rem_trunc(self, a: Value, b: Value) -> Value:
        (al, ah), (bl, bh) = extremes(a), extremes(b)
        if is_constant(a) and is_constant(b):
            return 0 if not b else abs(a) % abs(b) * (1 if a >= 0 else -1)
        most = min(max(abs(al), abs(ah)), max(abs(bl), abs(bh), 1) - 1)
        return interval(0 if al >= 0 else -most, 0 if ah <= 0 else most)

    def clz16(self, v: Value) -> Value:
        lo, hi = extremes(v)
        return interval(16 - min(hi, 0xFFFF).bit_length(), 16 - max(lo, 0).bit_length())

    def ctz16(self, v: Value) -> Value:
        return ((v & -v).bit_length() - 1 if v else 16) if is_constant(v) else interval(0, 16)

    def let(self, v: Value) -> Value:
        return v

    # -- registers -----------------------------------------------------------------------------------------------

    def w(self, n: int) -> Value:
        value = self.state.w[n]
        if self.model.stack_areas.points_into(value):
            self._saw = min(self._saw, extremes(value)[0])
        return value

    def _note(self, value: Value) -> None:
        """Record a leak if an unknown value has been computed from a stack address."""
        if self._saw < NO_ADDRESS and is_unknown_address(value):
            self.state.lowest_leak = min(self.state.lowest_leak, self._saw)

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
        if self.model.stack_areas.points_into(self.state.w[n]):
            self._saw = min(self._saw, extremes(self.state.w[n])[0])
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
        """Do nothing: accumulators are not tracked."""

    def when(self, c: Value, fn: Callable[[], None]) -> None:
        if not is_constant(c):
            before = self.state.w.copy(), self.state.flags.copy()
            fn()
            self.state.w = [union(a, b) for a, b in zip(before[0], self.state.w, strict=True)]
            self.state.flags = {n: union(before[1][n], v) for n, v in self.state.flags.items()}
        elif c:
            fn()

    def trap_math(self, c: Value) -> None:
        """Do nothing: traps are analysed as separate entries."""

    # -- memory --------------------------------------------------------------------------------------------------

    def load(self, ea: Value, size: Size, side: Side = "src", ptr: int | None = None) -> Value:
        value = (BYTE if size == 1 else WORD) if ptr == STACK and not is_constant(ea) else self._read(ea, size)
        if self.model.stack_areas.points_into(value):
            self._saw = min(self._saw, extremes(value)[0])
        return value

    def xload(self, ea: Value, ptr: int) -> Value:
        return self._read(ea, 2)

    def yload(self, ea: Value, ptr: int) -> Value:
        return WORD

    def store(self, ea: Value, v: Value, size: Size, ptr: int | None = None) -> None:
        self._stores.append((ea, v & (0xFF if size == 1 else 0xFFFF), size))

    def prog(self, address: Value) -> Value:
        return self.model.program_words.get(address, PROGRAM_WORD) if is_constant(address) else PROGRAM_WORD

    def table_write(self, address: Value, byte_mask: Value, v: Value) -> None:
        """Do nothing: code and constants are assumed not to change."""

    def _read(self, ea: Value, size: Size) -> Value:
        low, high = extremes(ea)
        if any(low < end and start <= high for start, end in self.model.stack_areas.ranges) and not is_unknown_address(
            ea
        ):
            self.lowest_stack_read = min(self.lowest_stack_read, low)
        unknown = BYTE if size == 1 else RAM_POINTER if self.model.pointers_in_ram(self.pc) else WORD
        if is_constant(ea):
            if ea >= WINDOW:
                self.reads_window = True
                return self._constant(ea, size, unknown)
            return self._variable(ea, size, unknown)
        if ea.hi >= WINDOW and not ea.ram and self.model.psv_bytes is not None:
            self.reads_window = True
            places = range(ea.lo, ea.hi + 1, size)
            if ea.lo >= WINDOW and len(places) <= MAX_TABLE:
                values = [self._constant(place, size, unknown) for place in places]
                result = values[0]
                for value in values[1:]:
                    result = union(result, value)
                return result
        return unknown

    def _constant(self, ea: int, size: Size, unknown: Value) -> Value:
        window = self.model.psv_bytes or {}
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
        """Return the value of SR or DISICNT, and within a DO loop of CORCON and the loop registers; None for others."""
        state = self.state
        if ea == SR:
            return self._status()
        if ea == DISICNT:
            return interval(0, min(COUNTS, state.disi_remaining))
        if not state.do_loops:
            return None
        if ea == CORCON:
            return state.mem[ea] & ~DL | Interval(0, DL, ~DL, 0) if ea in state.mem else WORD
        if ea not in LOOP_REGISTERS:
            return None
        start, end, count = state.do_loops[-1]
        return (count, start & 0xFFFF, start >> 16, end & 0xFFFF, end >> 16)[LOOP_REGISTERS.index(ea)]

    def _status(self) -> Value:
        """Return the value of SR; priority bits are known if all possible priorities agree on them."""
        low, high = self.state.ipl
        agree = ~(low ^ high) << 5 & IPL_BITS
        return Interval(0, 0xFFFF, ~0xFFFF | agree, low << 5 & agree)

    def _write(self, ea: Value, value: Value, size: Size) -> None:
        state, area = self.state, self.model.stack_areas
        if is_constant(ea):
            if ea == CORCON and known_bits(~value)[1] & known_bits(value)[0] & IPL3:
                state.ipl = state.ipl[0] & ~TRAP, state.ipl[1] & ~TRAP
            self._control(ea, value, size)
            if ea < W_END:
                self._register(ea, value, size)
            elif ea & ~1 == SR:
                if not ea & 1:
                    self._set_status(value)
            elif ea == TBLPAG:
                state.regs["TBLPAG"] = value
            elif ea & ~1 in self.model.enable_registers:
                self._enable(ea & ~1, value if size == 2 else WORD)
            elif area.contains(ea) or ea & ~1 in self.model.tracked_words:
                self._keep(ea, value, size)
                return
            if area.points_into(value) and state.w[15] is not value:
                state.lowest_leak = min(state.lowest_leak, extremes(value)[0])
            return
        if area.points_into(value) and state.w[15] is not value:  # not W15 itself: above it the stack holds no data
            state.lowest_leak = min(state.lowest_leak, extremes(value)[0])
        if not is_unknown_address(ea):
            low, high = extremes(ea)
            self._forget(low, high + size - 1)
            if low < SFR_END:
                self._store_to_unknown_register(low, min(high + size, SFR_END) - 1, value if size == 2 else WORD)
            return
        self.unknown_store = True
        if state.lowest_leak < NO_ADDRESS:
            for lo, hi in area.ranges:
                self._forget(lo, hi)

    def _register(self, ea: int, value: Value, size: Size) -> None:
        """Store to a working register; a byte store keeps the other byte."""
        self.overwrote_registers = True
        number = ea >> 1
        if size == 2:
            self.set_w(number, value)
        elif ea & 1:
            self.set_w(number, self.state.w[number] & 0xFF | (value & 0xFF) << 8)
        else:
            self.set_wb(number, value)

    def _control(self, ea: int, value: Value, size: Size) -> None:
        """Store to a register that controls DO loops, interrupts or addressing modes.

        An unknown value is assumed to restore one read before: EDT is 0, addressing modes are unchanged.
        """
        shift = 8 * (ea & 1) if size == 1 else 0
        register, (mask, bits) = ea & ~1, known_bits(value)
        if size == 1:
            mask &= 0xFF
        ones, zeros = (mask & bits) << shift, (mask & ~bits) << shift
        reached = 0xFFFF if size == 2 else 0xFF << shift
        state = self.state
        if register in LOOP_REGISTERS:
            self._loop_register(register, value, size)
        elif register == DISICNT:
            blocked = extremes(value)[1] & COUNTS if size == 2 and extremes(value)[1] <= COUNTS else COUNTS
            state.disi_end = state.time + blocked + 1 if blocked else 0
        elif register == INTCON1 and ones & NSTDIS:
            self.disabled_nesting = True
        elif register in self.model.priorities:
            self._priorities(register, ones, zeros)
        elif register == CORCON and EDT & reached & ~zeros:
            if state.do_loops:
                start, end, count = state.do_loops[-1]
                state.do_loops = (*state.do_loops[:-1], (start, end, interval(0, extremes(count)[1])))
            elif ones & EDT:
                self.unbounded_reason = DO_LOOP_CUT_SHORT
        elif ones & ENABLES.get(register, 0):
            self.unbounded_reason = SPECIAL_ADDRESSING

    def _enable(self, register: int, value: Value) -> None:
        """Store to an interrupt enable register: track whether it is 0."""
        if is_constant(value) and not value:
            self.state.regs[f"{register:#x}"] = 0
        else:
            self.state.regs.pop(f"{register:#x}", None)

    def disabled(self, state: AbstractState) -> bool:
        """Whether all interrupt enable registers are known to be 0."""
        return all(f"{register:#x}" in state.regs for register in self.model.enable_registers)

    def _loop_register(self, register: int, value: Value, size: int) -> None:
        """Store to DCOUNT, DOSTART or DOEND.

        Outside a DO loop, or with an unknown W15, the store restores the loop of another context (a thread switch).
        """
        state = self.state
        if not state.do_loops or not is_constant(state.w[STACK]):
            return
        start, end, _ = state.do_loops[-1]
        if register == DCOUNT and size == 2 and extremes(value)[1] <= COUNTS:
            state.do_loops = (*state.do_loops[:-1], (start, end, value))
        elif size == 1 or not is_constant(value) or value != self._core_register(register):
            self.unbounded_reason = DO_REGISTER_WRITTEN

    def _priorities(self, register: int, ones: int, zeros: int) -> None:
        """Store to an interrupt priority register: each field may become its annotated level or 0.

        ones, zeros  masks of the bits known to be 1 and 0
        """
        for shift, name, annotated in self.model.priorities[register]:
            on, off = ones >> shift & 7, zeros >> shift & 7
            if all(on & ~level or off & level for level in (0, annotated)):
                self.priority_change = f"{name}: {on}" if on | off == 7 else name

    def _store_to_unknown_register(self, low: int, high: int, value: Value) -> None:
        """Store `value` to an unknown register within low..high of the SFR space."""
        self.overwrote_registers = True
        state = self.state
        for number in range(low >> 1, min(high >> 1, STACK - 1) + 1):
            state.w[number] = union(state.w[number], value)
        if low <= 2 * STACK + 1 and high >= 2 * STACK:
            self.unbounded_reason = STACK_POINTER_OVERWRITTEN
        if low <= SR <= high:
            self._set_status(BYTE)
        if state.do_loops and low <= DOENDH + 1 and high >= DCOUNT:
            self.unbounded_reason = DO_REGISTER_WRITTEN
        for at in self.model.enable_registers:
            state.regs.pop(f"{at:#x}", None)
        self.disabled_nesting |= low <= INTCON1 + 1 and high >= INTCON1
        if low <= CORCON + 1 and high >= CORCON:
            state.ipl = state.ipl[0] & ~TRAP, state.ipl[1]
            if state.do_loops:
                start, end, count = state.do_loops[-1]
                state.do_loops = (*state.do_loops[:-1], (start, end, interval(0, extremes(count)[1])))

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
        """Make the stack contents in lo..hi unknown."""
        mem, area = self.state.mem, self.model.stack_areas
        for key in [k for k in mem if lo - 1 <= (k if k >= 0 else ~k) <= hi]:
            value = mem.pop(key)
            if area.points_into(value):
                self.state.lowest_leak = min(self.state.lowest_leak, extremes(value)[0])

    def _set_status(self, value: Value) -> None:
        self.overwrote_registers = True
        low, high = priority_range(value)
        mask, bits = known_bits(value)
        self.state.ipl = self.state.ipl[0] & TRAP | low, self.state.ipl[1] & TRAP | high
        for name, bit in (("C", 0), ("Z", 1), ("OV", 2), ("N", 3)):
            self.state.flags[name] = bits >> bit & 1 if mask >> bit & 1 else BIT
