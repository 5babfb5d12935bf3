"""The threads of an OpenSwarm firmware, read from the kernel's own variables by their debug information.

What enters: a machine whose image has the kernel's variables. What leaves: `Thread`s. No offset of a structure and no
value of an enumeration is written down here: names are looked up, and how a thread that waits goes on is found by
letting the kernel's own code resume it, aside.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

from emu.debug.dwarf.location import Unavailable
from emu.debug.inspector import REGISTERS, Frame, Inspector, Value
from emu.debug.replay import sandboxed
from emu.dspic30f.isa.codec import decode_for_execution
from emu.dspic30f.isa.facts import facts_of
from emu.dspic30f.isa.flow import Return

if TYPE_CHECKING:
    from emu.machine.machine import Machine

RUNNING, RING, BLOCKED, PCB = "os_running", "os_ring", "os_blocked", "sys_pcb"
"""Variables and type of the kernel (firmware/openswarm/kernel/kernel.h)."""
RESUME: Final = "resume"
"""Where the port goes on with the thread in W0 (firmware/openswarm/port/dspic30f/switch.S)."""
THREAD_START: Final = "os_thread_start"
"""What calls a thread's function (same file)."""
PAINT: Final = 0xA5
"""What a stack is filled with before its first use (firmware/openswarm/kernel/stack.c)."""
MOST: Final = 256
"""Threads and steps after which a list or a resumption is taken for broken."""
BLOCKING_LEVEL: Final = 7


@dataclass(frozen=True, slots=True)
class Thread:
    """One thread. Byte counts are None where nothing tells them, as for the system thread's stack."""

    pid: int
    name: str
    """The function it runs; "main" for the system thread."""
    state: str
    """"running", "ready", "sleeping" (for a time), "blocked" (on an event) or "zombie"."""
    priority: int
    address: int
    """Of its process control block."""
    stack: tuple[int, int] | None
    """First address and end of its stack."""
    free: int | None
    """Bytes of the stack that were never written."""
    frames: tuple[Frame, ...]

    def __str__(self) -> str:
        return f"thread {self.pid} ({self.name})"

    @property
    def used(self) -> int | None:
        """High-water mark: bytes of the stack that have been in use."""
        return None if self.stack is None or self.free is None else self.stack[1] - self.stack[0] - self.free


class Threads:
    """The threads as they are now. Empty without an OpenSwarm kernel, or before it has begun."""

    def __init__(self, inspector: Inspector) -> None:
        self._inspector: Final = inspector
        self._machine: Final[Machine] = inspector.machine
        variable = inspector.variable(RUNNING)
        pcb = variable.type.target if variable is not None else None
        self._pcb: Final = pcb if pcb is not None and pcb.bytes else None

    def all(self) -> list[Thread]:
        """All threads: the ready ones in the order of their turns, then the blocked ones."""
        return [self._thread(pcb, blocked) for pcb, blocked in self._blocks()]

    def memory_of_others(self, address: int) -> list[range]:
        """Stack and control block of every thread but the one whose control block is at `address`."""
        found = []
        for pcb, _ in self._blocks():
            first = _number(pcb, "block")
            if first and pcb.address is not None and pcb.address != address:
                found.append(range(first, pcb.address + pcb.type.bytes))
        return found

    def running(self) -> str:
        """`thread 1 (worker)`: who runs, or would if no interrupt did; empty if there are no threads."""
        pcb = self._pointer(RUNNING)
        if pcb is None:
            return ""
        return str(self._thread(pcb, False))

    def _pointer(self, name: str) -> Value | None:
        """What a pointer variable of the kernel points to."""
        variable = self._inspector.variable(name) if self._pcb is not None else None
        if variable is None:
            return None
        value = self._inspector.value(variable)
        return value[0] if value.get() else None

    def _blocks(self) -> Iterator[tuple[Value, bool]]:
        """Process control blocks, and whether each is off the ring."""
        seen: set[int] = set()
        for name, blocked in ((RING, False), (BLOCKED, True)):
            pcb = self._pointer(name)
            while pcb is not None and pcb.address is not None and pcb.address not in seen and len(seen) < MOST:
                seen.add(pcb.address)
                yield pcb, blocked
                following = pcb["next"]
                pcb = following[0] if following.get() else None

    def _thread(self, pcb: Value, blocked: bool) -> Thread:
        pid = _number(pcb, "pid")
        runs = self._pointer(RUNNING)
        is_running = runs is not None and runs.address == pcb.address
        is_zombie = _number(pcb, "block") == pcb.address  # its stack is given back
        frames = () if is_zombie else tuple(self._frames(pcb, is_running))
        state = "running" if is_running and not blocked else "ready"
        if blocked:
            state = "zombie" if is_zombie else "blocked" if pcb["on"]["awaited"].get() else "sleeping"
        stack, free = self._stack(pcb)
        name = self._name(pid, frames)
        return Thread(pid, name, state, _number(pcb, "priority"), pcb.address or 0, stack, free, frames)

    def _name(self, pid: int, frames: tuple[Frame, ...]) -> str:
        """The function that the kernel's starting code calls."""
        names = [frame.function for frame in frames if frame.kind == "call"]
        if THREAD_START in names[1:]:
            return names[names.index(THREAD_START, 1) - 1]
        if pid == 0:
            return "main"
        return names[-1] if names else "?"

    def _stack(self, pcb: Value) -> tuple[tuple[int, int] | None, int | None]:
        """The stack lies between the start of the thread's block and its control block; what is above the limit is the
        port's."""
        first, end = _number(pcb, "block"), _number(pcb, "limit") + 2
        ram = self._inspector.image.chip.data["ram"]
        if not first or not ram.start <= first < end <= ram.end:
            return None, None
        data = self._machine.peek_bytes(first, end - first)
        return (first, end), len(data) - len(data.rstrip(bytes([PAINT])))

    def _frames(self, pcb: Value, is_running: bool) -> list[Frame]:
        if is_running and self._is_on_own_stack(pcb):
            return self._inspector.frames()
        place = self._inspector.image.symbols.find(RESUME)
        if place is None or pcb.address is None:
            return []
        found = self._resumed(place.address, pcb.address)
        return self._inspector.frames(*found) if found is not None else []

    def _is_on_own_stack(self, pcb: Value) -> bool:
        """Whether the call stack of the machine leads back to this thread: no switch has put it aside."""
        first, end = _number(pcb, "block"), _number(pcb, "limit") + 2
        frames = self._inspector.frames()
        tops = [frame.raw.registers[REGISTERS - 1] for frame in frames]
        if not first:  # the system thread: on no other thread's stack
            names = {frame.function for frame in frames}
            return "main" in names or not names & {"os_schedule", "os_slice_end", "hal_idle"}
        return any(top is not None and first <= top <= end + MOST for top in tops)

    def _resumed(self, resume: int, pcb: int) -> tuple[int, tuple[int | None, ...]] | None:
        """PC and registers a thread that waits will go on with: the port's code runs up to its return, aside."""
        machine = self._machine
        with sandboxed(machine):
            machine.pc = resume
            machine.w[0] = pcb
            machine.state.ipl = BLOCKING_LEVEL
            for _ in range(MOST):
                insn = decode_for_execution(machine.program.word(machine.pc), machine.program.word(machine.pc + 2))
                if insn is None or machine.step() is not None or machine.state.intcon1 & machine.core.traps.flags:
                    return None  # what was saved is no longer there: a thread that has given up its context
                if facts_of(insn).flow is Return:
                    return machine.pc, self._inspector.registers()
        return None


def _number(pcb: Value, name: str) -> Any:
    """A member as a number, 0 if this kernel has none of that name."""
    try:
        return pcb[name].get()
    except (KeyError, Unavailable):
        return 0
