"""The threads of an OpenSwarm firmware, read from the kernel's variables by means of debug information.

Input: a machine whose image contains the kernel's variables. Output: `Thread`s. The module looks up names and contains
no structure offsets or enumeration values. To find the registers of a suspended thread, it runs the kernel's own resume
code in a sandbox.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

from emu.debug.dwarf.location import Unavailable
from emu.debug.frame import Frame
from emu.debug.inspector import Inspector
from emu.debug.replay import sandboxed
from emu.debug.unwind import REGISTERS
from emu.debug.value import Value
from emu.dspic30f.isa.codec import decode_for_execution
from emu.dspic30f.isa.facts import facts_of
from emu.dspic30f.isa.flow import Return

if TYPE_CHECKING:
    from emu.machine.machine import Machine

RUNNING, RING, BLOCKED, PCB = "os_running", "os_ring", "os_blocked", "sys_pcb"
"""Names of variables and of a type of the kernel (firmware/openswarm/kernel/kernel.h)."""
RESUME: Final = "resume"
"""Label at which the port resumes the thread in W0 (firmware/openswarm/port/dspic30f/switch.S)."""
THREAD_START: Final = "os_thread_start"
"""Function that calls a thread's entry function (same file)."""
STACK_FILL: Final = 0xA5
"""Byte with which the kernel fills a stack before its first use (firmware/openswarm/kernel/stack.c)."""
LIMIT: Final = 256
"""Maximum number of threads in a list, or of steps of a resumption; beyond it the data counts as corrupt."""
ALL_MASKED_LEVEL: Final = 7


@dataclass(frozen=True, slots=True)
class Thread:
    """One thread. Byte counts are None if unknown, for example for the system thread's stack."""

    pid: int
    name: str
    """The thread's entry function; "main" for the system thread."""
    state: str
    """Thread state: "running", "ready", "sleeping" (for a time), "blocked" (on an event) or "zombie"."""
    priority: int
    address: int
    """Address of the thread's control block."""
    stack: tuple[int, int] | None
    """Start and end address of the thread's stack."""
    free: int | None
    """Number of bytes of the stack that were never written."""
    frames: tuple[Frame, ...]

    def __str__(self) -> str:
        return f"thread {self.pid} ({self.name})"

    def __repr__(self) -> str:
        return f"<thread {self.pid} ({self.name[:80]}): {self.state}, {self.used} bytes of stack used>"

    @property
    def used(self) -> int | None:
        """High-water mark of the stack in bytes."""
        return None if self.stack is None or self.free is None else self.stack[1] - self.stack[0] - self.free


class Threads:
    """The current threads. There are none without an OpenSwarm kernel, or before it has started."""

    def __init__(self, inspector: Inspector) -> None:
        self._inspector: Final = inspector
        self._machine: Final[Machine] = inspector.machine
        variable = inspector.variable(RUNNING)
        pcb = variable.type.target if variable is not None else None
        self._pcb: Final = pcb if pcb is not None and pcb.bytes else None

    def all(self) -> list[Thread]:
        """Return all threads: the ready ones in scheduling order, then the blocked ones."""
        return [self._thread(pcb, blocked) for pcb, blocked in self._control_blocks()]

    def memory_of_others(self, address: int) -> list[range]:
        """Return the stack and control block of every thread except the one whose control block is at `address`."""
        found = []
        for pcb, _ in self._control_blocks():
            first = _number(pcb, "block")
            if first and pcb.address is not None and pcb.address != address:
                found.append(range(first, pcb.address + pcb.type.bytes))
        return found

    def running(self) -> str:
        """Return the running or interrupted thread as text `thread 1 (worker)`; empty if there are no threads."""
        pcb = self._dereference(RUNNING)
        if pcb is None:
            return ""
        return str(self._thread(pcb, False))

    def _dereference(self, name: str) -> Value | None:
        """Return the target of a pointer variable of the kernel, None for a null pointer."""
        variable = self._inspector.variable(name) if self._pcb is not None else None
        if variable is None:
            return None
        value = self._inspector.value(variable)
        return value[0] if value.get() else None

    def _control_blocks(self) -> Iterator[tuple[Value, bool]]:
        """Yield each thread's control block, and whether the thread is blocked, that is, not in the ready ring."""
        seen: set[int] = set()
        for name, blocked in ((RING, False), (BLOCKED, True)):
            pcb = self._dereference(name)
            while pcb is not None and pcb.address is not None and pcb.address not in seen and len(seen) < LIMIT:
                seen.add(pcb.address)
                yield pcb, blocked
                following = pcb["next"]
                pcb = following[0] if following.get() else None

    def _thread(self, pcb: Value, blocked: bool) -> Thread:
        pid = _number(pcb, "pid")
        runs = self._dereference(RUNNING)
        is_running = runs is not None and runs.address == pcb.address
        is_zombie = _number(pcb, "block") == pcb.address  # the kernel has freed the stack of a zombie
        frames = () if is_zombie else tuple(self._frames(pcb, is_running))
        state = "running" if is_running and not blocked else "ready"
        if blocked:
            state = "zombie" if is_zombie else "blocked" if pcb["event_or_slice"]["awaited"].get() else "sleeping"
        stack, free = self._stack(pcb)
        name = self._name(pid, frames)
        return Thread(pid, name, state, _number(pcb, "priority"), pcb.address or 0, stack, free, frames)

    def _name(self, pid: int, frames: tuple[Frame, ...]) -> str:
        """Return the entry function of a thread, which the kernel's start code calls."""
        names = [frame.function for frame in frames if frame.kind == "call"]
        if THREAD_START in names[1:]:
            return names[names.index(THREAD_START, 1) - 1]
        if pid == 0:
            return "main"
        return names[-1] if names else "?"

    def _stack(self, pcb: Value) -> tuple[tuple[int, int] | None, int | None]:
        """Return the bounds of a thread's stack and its number of unused bytes.

        The stack lies between the start of the thread's memory block and its control block. The port uses the part
        above the limit.
        """
        first, end = _number(pcb, "block"), _number(pcb, "limit") + 2
        ram = self._inspector.image.chip.data["ram"]
        if not first or not ram.start <= first < end <= ram.end:
            return None, None
        data = self._machine.peek_bytes(first, end - first)
        return (first, end), len(data) - len(data.rstrip(bytes([STACK_FILL])))

    def _frames(self, pcb: Value, is_running: bool) -> list[Frame]:
        if is_running and self._is_on_own_stack(pcb):
            return self._inspector.frames()
        place = self._inspector.image.symbols.find(RESUME)
        if place is None or pcb.address is None:
            return []
        found = self._resume_state(place.address, pcb.address)
        return self._inspector.frames(*found) if found is not None else []

    def _is_on_own_stack(self, pcb: Value) -> bool:
        """Whether the machine's call stack leads back to this thread; then no context switch has suspended it."""
        first, end = _number(pcb, "block"), _number(pcb, "limit") + 2
        frames = self._inspector.frames()
        tops = [frame.raw.registers[REGISTERS - 1] for frame in frames]
        if not first:  # the system thread runs if the stack belongs to no other thread
            names = {frame.function for frame in frames}
            return "main" in names or not names & {"os_schedule", "os_slice_end", "hal_idle"}
        return any(top is not None and first <= top <= end + LIMIT for top in tops)

    def _resume_state(self, resume: int, pcb: int) -> tuple[int, tuple[int | None, ...]] | None:
        """Return the PC and registers with which a suspended thread will resume.

        The port's resume code runs up to its return in a sandbox.
        """
        machine = self._machine
        with sandboxed(machine):
            machine.pc = resume
            machine.w[0] = pcb
            machine.state.ipl = ALL_MASKED_LEVEL
            for _ in range(LIMIT):
                insn = decode_for_execution(machine.program.word(machine.pc), machine.program.word(machine.pc + 2))
                if insn is None or machine.step() is not None or machine.state.intcon1 & machine.core.traps.flags:
                    return None  # the saved context no longer exists: the thread has discarded it
                if facts_of(insn).flow is Return:
                    return machine.pc, self._inspector.registers()
        return None


def _number(pcb: Value, name: str) -> Any:
    """Return a member as a number, 0 if this kernel has no member of that name."""
    try:
        return pcb[name].get()
    except (KeyError, Unavailable):
        return 0
