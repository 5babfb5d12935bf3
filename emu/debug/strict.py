"""Strict mode (`--strict`): report as faults the accesses that hardware permits but that are almost always errors.

- Null page: an access through a pointer to an address below the first peripheral register (W and core registers).
- Uninitialised read: a load from RAM of which no byte was written since power-on or since the stack shrank below it.

An instruction that copies from memory to memory does not count as a read: it copies the initialisation marks. Reads
above W15 relative to W15 are the compiler's stack probes and are permitted. The marks, one per data address, lie in the
machine's record, so snapshots and replays contain them. Strict mode needs the plain engine.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Final

from emu.debug.dwarf.location import Unavailable
from emu.debug.inspector import Inspector
from emu.debug.threads import RUNNING, Threads
from emu.dspic30f.exceptions.faults import DebuggerWord, Violation
from emu.dspic30f.isa.builder import Side, Size
from emu.dspic30f.isa.facts import facts_of
from emu.dspic30f.state.state import STACK_POINTER

if TYPE_CHECKING:
    from emu.machine.machine import Machine


class StrictMode:
    """Memory observer that checks every instruction of `machine`, which must use the plain engine.

    Pass the class as `observer` to `Machine`.
    """

    def __init__(self, machine: Machine) -> None:
        self._machine: Final = machine
        ram = machine.chip.data["ram"]
        self._ram: Final = ram
        self._null_end: Final = machine.chip.sfrs["INTCON1"].address
        marks = machine.record.reserve("strict.written", "B", ram.end)
        self._written: Final = machine.record.u8[marks.offset : marks.offset + ram.end]
        self._violation = ""
        """Description of the current instruction's first violation."""
        self._copying = False
        """Whether the current instruction copies from memory to memory."""
        self._copies_uninitialised = False
        """Whether the current memory-to-memory copy has read uninitialised memory."""
        self._inspector: Inspector | None = None
        self._foreign_stacks: tuple[object, list[range]] = (None, [])
        """Control block of the running thread, and stacks of all other threads."""
        core = machine.core
        self._load, self._store = core.builder.load, core.builder.store
        self._write, self._execute = core.data.write, core.sequencer.execute
        replacements: tuple[tuple[Any, str, Callable[..., Any]], ...] = (
            (core.builder, "load", self._checked_load),
            (core.builder, "store", self._checked_store),
            (core.data, "write", self._marking_write),
            (core.sequencer, "execute", self._checked_execute),
        )
        for owner, name, method in replacements:
            vars(owner)[name] = method

    def on_power_on(self) -> None:
        """Mark the whole RAM as uninitialised."""
        self._written[:] = bytes(len(self._written))

    def on_external_write(self, address: int, size: int) -> None:
        """Mark bytes written by `poke` as initialised."""
        end = min(address + size, len(self._written))
        for at in range(address, end):
            self._written[at] = 1

    def _checked_execute(self) -> None:
        state = self._machine.state
        pc, top = state.pc, self._machine.w[STACK_POINTER]
        self._violation = ""
        try:
            insn = self._machine.core.sequencer.fetch(pc).insn if self._machine.program.executable(pc) else None
        except DebuggerWord:
            insn = None
        self._copying = (
            insn is not None and facts_of(insn).loads > 0 and facts_of(insn).stores > 0 and "MOV" in insn.row.mnemonic
        )
        self._copies_uninitialised = False
        self._execute()
        lower = self._machine.w[STACK_POINTER]
        if lower < top and insn is not None and not insn.row.mnemonic.startswith("MOV"):
            for at in range(max(lower, self._ram.start), min(top, self._ram.end)):
                self._written[at] = 0
        if self._violation:
            raise Violation(self._violation, pc)

    def _checked_load(self, ea: int, size: Size, side: Side = "src", ptr: int | None = None) -> Any:
        if ptr is not None and ea < self._null_end:
            self._report(f"null pointer: reading {size} byte{'s' * (size - 1)} at {ea:#06x}")
        elif self._ram.start <= ea <= self._ram.end - size and not any(self._written[ea : ea + size]):
            if self._copying:
                self._copies_uninitialised = True
            elif ptr != STACK_POINTER or ea < self._machine.w[STACK_POINTER]:
                self._report(f"uninitialised read of {size} byte{'s' * (size - 1)} at {ea:#06x}{self._symbol(ea)}")
        return self._load(ea, size, side, ptr)

    def _checked_store(self, ea: int, v: Any, size: Size, ptr: int | None = None) -> None:
        if ptr is not None and ea < self._null_end:
            self._report(f"null pointer: writing {size} byte{'s' * (size - 1)} at {ea:#06x}")
        elif ptr is not None and ea >= self._ram.start and not self._machine.state.ipl:
            self._check_stack(ea, size)
        self._store(ea, v, size, ptr)

    def _marking_write(self, ea: int, value: int, size: int) -> None:
        self._write(ea, value, size)
        for at in range(ea, min(ea + size, len(self._written))):
            self._written[at] = not self._copies_uninitialised

    def _report(self, text: str) -> None:
        self._violation = self._violation or text

    def _symbol(self, address: int) -> str:
        """Return the variable at `address` as text ` (name+offset)`, empty if there is none."""
        image = self._machine.image
        found = image.symbols.variable_at(address) if image is not None else None
        if found is None:
            return ""
        symbol, distance = found
        return f" ({symbol.name.removeprefix('_')}{f'+{distance}' if distance else ''})"

    def _check_stack(self, ea: int, size: int) -> None:
        """Report a violation if the running thread stores into another thread's memory."""
        image = self._machine.image
        if image is None:
            return
        if self._inspector is None or self._inspector.image is not image:
            self._inspector = Inspector(self._machine)
        symbol = image.symbols.find(RUNNING)
        if symbol is None:
            return
        running = self._machine.record.u16[symbol.address >> 1]
        if self._foreign_stacks[0] != running:
            self._foreign_stacks = (running, _stacks_of_others(self._inspector, running))
        if any(ea in stack for stack in self._foreign_stacks[1]):
            self._report(f"writing {size} byte{'s' * (size - 1)} at {ea:#06x}, into the stack of another thread")


def _stacks_of_others(inspector: Inspector, running: int) -> list[range]:
    """Return the memory of all threads except `running`; empty if the kernel's variables cannot be read."""
    try:
        return Threads(inspector).memory_of_others(running)
    except (Unavailable, KeyError, TypeError, ValueError):
        return []
