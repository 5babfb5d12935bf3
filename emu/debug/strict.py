"""`--strict`: what the hardware lets pass and a program hardly ever means is a fault. Runs in the plain engine.

- null page: access through a pointer below the first peripheral register, to the W registers and the core's;
- uninitialised reads: a load of RAM of which no byte was written since power-on, or since the stack shrank below it;
- a foreign stack: a store of an OpenSwarm thread, outside the kernel, into another one's stack or control block.

A copy from memory to memory in one instruction is no read: it makes the copy as uninitialised as the original. Reads
above W15 relative to it are the compiler's stack probes and let through. What is known of each byte lies in the
machine's record, so snapshots and replays have it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Final

from emu.debug.dwarf.location import Unavailable
from emu.debug.inspector import Inside
from emu.debug.threads import RUNNING, Threads
from emu.dspic30f.exceptions.faults import Breakpoint, Violation
from emu.dspic30f.isa.builder import Side, Size
from emu.dspic30f.isa.facts import facts_of
from emu.dspic30f.state.state import STACK_POINTER
from emu.system.record import Record

if TYPE_CHECKING:
    from emu.machine.machine import Machine


def reserve(record: Record, ram_end: int) -> int:
    """Room for one mark per data address below `ram_end`, before the record is used; its offset."""
    return record.reserve("strict.written", "B", ram_end).offset


class Strict:
    """Watches every instruction of one machine, whose engine must be "plain"."""

    def __init__(self, machine: Machine, offset: int) -> None:
        self._machine: Final = machine
        ram = machine.chip.data["ram"]
        self._ram: Final = ram
        self._null_end: Final = machine.chip.sfrs["INTCON1"].address
        self._written: Final = machine.record.u8[offset : offset + ram.end]
        self._found = ""
        self._copying = False
        self._undefined = False
        """The copy in progress has read uninitialised memory."""
        self._inside: Inside | None = None
        self._foreign: tuple[object, list[range]] = (None, [])
        core = machine.core
        self._load, self._store = core.builder.load, core.builder.store
        self._write, self._execute = core.data.write, core.sequencer.execute
        replacements: tuple[tuple[Any, str, Callable[..., Any]], ...] = (
            (core.builder, "load", self._loads),
            (core.builder, "store", self._stores),
            (core.data, "write", self._writes),
            (core.sequencer, "execute", self._executes),
        )
        for owner, name, method in replacements:
            vars(owner)[name] = method

    def power_on(self) -> None:
        """RAM holds nothing anyone has written."""
        self._written[:] = bytes(len(self._written))

    def written(self, address: int, size: int) -> None:
        """Somebody outside has set memory."""
        end = min(address + size, len(self._written))
        for at in range(address, end):
            self._written[at] = 1

    def _executes(self) -> None:
        state = self._machine.state
        pc, top = state.pc, self._machine.w[STACK_POINTER]
        self._found = ""
        try:
            insn = self._machine.core.sequencer.fetch(pc).insn if self._machine.program.executable(pc) else None
        except Breakpoint:
            insn = None
        self._copying = (
            insn is not None and facts_of(insn).loads > 0 and facts_of(insn).stores > 0 and "MOV" in insn.row.mnemonic
        )
        self._undefined = False
        self._execute()
        lower = self._machine.w[STACK_POINTER]
        if lower < top and insn is not None and not insn.row.mnemonic.startswith("MOV"):
            for at in range(max(lower, self._ram.start), min(top, self._ram.end)):
                self._written[at] = 0
        if self._found:
            raise Violation(self._found, pc)

    def _loads(self, ea: int, size: Size, side: Side = "src", ptr: int | None = None) -> Any:
        if ptr is not None and ea < self._null_end:
            self._violated(f"null pointer: reading {size} byte{'s' * (size - 1)} at {ea:#06x}")
        elif self._ram.start <= ea <= self._ram.end - size and not any(self._written[ea : ea + size]):
            if self._copying:
                self._undefined = True
            elif ptr != STACK_POINTER or ea < self._machine.w[STACK_POINTER]:
                self._violated(
                    f"reading {size} byte{'s' * (size - 1)} at {ea:#06x}{self._name(ea)}, which nobody has written"
                )
        return self._load(ea, size, side, ptr)

    def _stores(self, ea: int, v: Any, size: Size, ptr: int | None = None) -> None:
        if ptr is not None and ea < self._null_end:
            self._violated(f"null pointer: writing {size} byte{'s' * (size - 1)} at {ea:#06x}")
        elif ptr is not None and ea >= self._ram.start and not self._machine.state.ipl:
            self._check_stack(ea, size)
        self._store(ea, v, size, ptr)

    def _writes(self, ea: int, value: int, size: int) -> None:
        self._write(ea, value, size)
        for at in range(ea, min(ea + size, len(self._written))):
            self._written[at] = not self._undefined

    def _violated(self, text: str) -> None:
        self._found = self._found or text

    def _name(self, address: int) -> str:
        image = self._machine.image
        found = image.symbols.data(address) if image is not None else None
        if found is None:
            return ""
        symbol, distance = found
        return f" ({symbol.name.removeprefix('_')}{f'+{distance}' if distance else ''})"

    def _check_stack(self, ea: int, size: int) -> None:
        """Whether a thread writes into what belongs to another."""
        if self._machine.image is None:
            return
        if self._inside is None or self._inside.image is not self._machine.image:
            self._inside = Inside(self._machine)
        symbol = self._machine.image.symbols.find(RUNNING)
        if symbol is None:
            return
        running = self._machine.record.u16[symbol.address >> 1]
        if self._foreign[0] != running:
            self._foreign = (running, self._others(running))
        if any(ea in stack for stack in self._foreign[1]):
            self._violated(f"writing {size} byte{'s' * (size - 1)} at {ea:#06x}, into the stack of another thread")

    def _others(self, running: int) -> list[range]:
        assert self._inside is not None
        try:
            return Threads(self._inside).blocks_but(running)
        except (Unavailable, KeyError, TypeError, ValueError):
            return []
