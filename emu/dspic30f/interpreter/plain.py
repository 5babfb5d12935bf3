"""The interpreter's builder: executes table rows directly on Python ints and the state record.

It is slow and simple, and the reference for native code. One `Interpreter` serves one CPU. The sequencer prepares it
for each instruction with `begin` and commits the stores with `commit`. Stores are deferred to the end of the row for
two reasons: an address error inhibits all of them (isa.md §14.4), and a data write overrides the same instruction's
other effects on the register (isa.md §2.2, §2.3).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from emu.dspic30f.exceptions.faults import UninitialisedPointer
from emu.dspic30f.exceptions.interrupts import Exceptions
from emu.dspic30f.interpreter import int_ops
from emu.dspic30f.isa.builder import Context, Side, Size
from emu.dspic30f.isa.flow import Value
from emu.dspic30f.state.data_space import W_END, DataSpace
from emu.dspic30f.state.modes import Modes
from emu.dspic30f.state.state import FLAGS, OA, OAB, OB, SA, SAB, SB, STACK_POINTER, State
from emu.system.events import Events
from emu.system.program import ProgramMemory

ACC_SIGN: Final = 1 << 39
OVERFLOW_FLAGS: Final = frozenset(("OA", "OB", "SA", "SB"))
"""Flags from which OAB and SAB are computed."""


class Interpreter:
    """Builder that computes with Python ints; isa/builder.py defines its methods."""

    def __init__(
        self, state: State, events: Events, data: DataSpace, program: ProgramMemory, exceptions: Exceptions
    ) -> None:
        self._state: Final = state
        self._u16: Final = state.u16
        self._at: Final = state.at
        self._events: Final = events
        self._data: Final = data
        self._program: Final = program
        self._sfr_end: Final = data.sfr_end
        self._exceptions: Final = exceptions
        self._modes: Final = Modes(state)
        self._accumulators: Final = (state.at["ACCAL"], state.at["ACCBL"])
        self.context = Context()
        self.pc = 0
        self.last = 0
        """Last cycle of the instruction; a PSV read delays it."""
        self.window = False
        """Whether the instruction has read the PSV window."""
        self.faulted = False
        """Whether the instruction has caused an address error."""
        self.math = False
        """Whether the instruction requests a math error trap."""
        self.stack_error = False
        """Whether the instruction has used a W15 address out of bounds."""
        self._window_extra = 0
        self._loads_ahead = 0
        self._stores: list[tuple[int, int, Size]] = []

    def begin(self, pc: int, last: int, loads: int, window_extra: int) -> None:
        """Prepare for the instruction at `pc`.

        Its accesses happen in cycle `last`, or `window_extra` cycles later if it reads the PSV window. The first of two
        loads happens one cycle earlier (engines.md §4.2).
        """
        self.context = self._modes.context
        self.pc = pc
        self.last = last
        self.window = self.faulted = self.math = self.stack_error = False
        self._window_extra = window_extra
        self._loads_ahead = loads - 1 if loads > 1 else 0
        self._stores.clear()
        self._state.stall = 0

    def commit(self) -> None:
        """Perform the stores, unless a store or a load is an address error. Raises TrapConflict."""
        data = self._data
        if not self.faulted and any(data.faulty(ea, size) for ea, _value, size in self._stores):
            self.faulted = True
        if not self.faulted:
            cycle = self.last - len(self._stores) + 1
            for ea, value, size in self._stores:
                if W_END <= ea < self._sfr_end:
                    self._events.arrive(cycle)
                data.write(ea, value, size)
                cycle += 1
        if self.faulted:
            self._exceptions.traps.request(self._exceptions.traps.address, self.last)

    def request_soft_traps(self, last: int) -> None:
        """Request the soft traps of the instruction that ended in cycle `last`.

        They are visible one cycle later (isa.md §14.4).
        """
        traps = self._exceptions.traps
        if self.stack_error:
            traps.request(traps.stack, last + 1)
        if self.math:
            traps.request(traps.math, last + 1)

    def select(self, c: Value, a: Value, b: Value) -> Value:
        return a if c else b

    div_trunc = staticmethod(int_ops.div_trunc)
    rem_trunc = staticmethod(int_ops.rem_trunc)
    clz16 = staticmethod(int_ops.clz16)
    ctz16 = staticmethod(int_ops.ctz16)

    def let(self, v: Value) -> Value:
        return v

    def w(self, n: int) -> Value:
        return self._u16[n]

    def set_w(self, n: int, v: Value) -> None:
        self._state.set_w(n, v)
        self._state.stall |= 1 << n

    def set_wb(self, n: int, v: Value) -> None:
        self._state.set_w_low(n, v)
        self._state.stall |= 1 << n

    def ptr(self, n: int, side: Side) -> Value:
        if not self._state.initialised >> n & 1:
            raise UninitialisedPointer(n)
        return self._u16[n]

    def set_ptr(self, n: int, v: Value, side: Side) -> None:
        self._state.set_w(n, v)
        if side == "dst":
            self._state.stall |= 1 << n

    def load(self, ea: Value, size: Size, side: Side = "src", ptr: int | None = None) -> Value:
        if ptr == STACK_POINTER:
            self.stack_error |= self._exceptions.beyond_stack(ea)
        return self._read(ea, size)

    def xload(self, ea: Value, ptr: int) -> Value:
        if self._data.in_window(ea) or ea < self._sfr_end or self._data.faulty(ea, 2):
            return self._read(ea, 2)
        return self._data.read_x(ea)

    def yload(self, ea: Value, ptr: int) -> Value:
        if self._data.faulty(ea, 2):
            self.faulted = True
        return self._data.read_y(ea)

    def store(self, ea: Value, v: Value, size: Size, ptr: int | None = None) -> None:
        if ptr == STACK_POINTER:
            self.stack_error |= self._exceptions.beyond_stack(ea)
        self._stores.append((ea, v, size))

    def _read(self, ea: int, size: int) -> int:
        if self._data.faulty(ea, size):
            self.faulted = True
        if self._data.in_window(ea) and not self.window:
            self.window = True
            self.last += self._window_extra
        if W_END <= ea < self._sfr_end:
            self._events.arrive(self.last - self._loads_ahead)
        if self._loads_ahead:
            self._loads_ahead -= 1
        return self._data.read(ea, size)

    def prog(self, address: Value) -> Value:
        return self._program.word(address)

    def table_write(self, address: Value, byte_mask: Value, v: Value) -> None:
        self._events.arrive(self.last)
        self._program.table_write(address, byte_mask, v)

    def flag(self, name: str) -> Value:
        return self._state.sr >> FLAGS[name] & 1

    def set_flags(self, **flags: Value) -> None:
        sr = self._state.sr
        for name, value in flags.items():
            bit = 1 << FLAGS[name]
            sr = sr | bit if value else sr & ~bit
        if not OVERFLOW_FLAGS.isdisjoint(flags):
            sr = sr | OAB if sr & (OA | OB) else sr & ~OAB
            sr = sr | SAB if sr & (SA | SB) else sr & ~SAB
        self._state.sr = sr

    def reg(self, name: str) -> Value:
        return self._u16[self._at[name]]

    def set_reg(self, name: str, v: Value) -> None:
        self._u16[self._at[name]] = v & 0xFFFF

    def acc(self, i: int) -> Value:
        low = self._accumulators[i]
        value = self._u16[low] | self._u16[low + 1] << 16 | (self._u16[low + 2] & 0xFF) << 32
        return (value ^ ACC_SIGN) - ACC_SIGN

    def set_acc(self, i: int, v: Value) -> None:
        low = self._accumulators[i]
        self._u16[low] = v & 0xFFFF
        self._u16[low + 1] = v >> 16 & 0xFFFF
        self._u16[low + 2] = v >> 32 & 0xFF

    def when(self, c: Value, fn: Callable[[], None]) -> None:
        if c:
            fn()

    def trap_math(self, c: Value) -> None:
        if c:
            self.math = True
