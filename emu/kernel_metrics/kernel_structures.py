"""The kernel's structures in the RAM of a machine, read by means of the debug information of its image.

Input: an image with an OpenSwarm kernel and a machine that runs it. Output: threads, events, queued messages and free
blocks as plain records. Offsets come from the debug information; only names are written down here.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final

from emu.debug.dwarf.types import Type
from emu.debug.dwarf.units import Variable, debug_of
from emu.debug.threads import STACK_FILL
from emu.image.model import Image
from emu.kernel_metrics.target import WORD, MeasureError

if TYPE_CHECKING:
    from emu.machine.machine import Machine

SYSTEM_EVENTS: Final = {
    0x01: "SYS_EVENT_TERMINATION", 0x02: "SYS_LEFTMOTOR_SPEED", 0x03: "SYS_RIGHTMOTOR_SPEED",
    0x04: "SYS_IO_1PXSENSOR", 0x05: "SYS_IO_REMOTECONTROL", 0x06: "SYS_SEND_UART1", 0x07: "SYS_1ms_TIMER",
    0x08: "SYS_IO_SELECTOR", 0x09: "SYS_UART1_RECEIVED", 0x0A: "SYS_UART1_READY", 0x0B: "SYS_SEND_UART2",
    0x0C: "SYS_UART2_RECEIVED", 0x0D: "SYS_UART2_READY", 0x0E: "SYS_DEADLINE_MISSED", 0x10: "SYS_IO_CAMERA",
    0x11: "SYS_IO_PROXIMITY", 0x12: "SYS_IO_ACCELERATION", 0x13: "SYS_IO_SOUND", 0x14: "SYS_IO_LED",
    0x15: "SYS_BLUETOOTH_RECEIVED", 0x18: "SYS_NEIGHBOUR_MESSAGE", 0x19: "SYS_NEIGHBOUR_SEEN",
    0x1A: "SYS_NEIGHBOUR_LOST", 0x1B: "SYS_SEND_NEIGHBOURS",
}  # fmt: skip
"""Names of the system's events (firmware/openswarm/include, io); the compiler keeps no anonymous enumeration."""
DRIVERS: Final = 0xFFFF
"""Owner of the drivers' subscriptions (OS_DRIVERS, kernel.h)."""
WOKEN: Final = 0x04
"""Bit of a ready thread's status: it was blocked before (OS_WOKEN, kernel.h)."""
OFF_RING: Final = 0x02
"""Bit of a control block's status: the thread is blocked or a zombie (OS_OFF_RING, kernel.h)."""
PERIODIC: Final = 0x08
"""Bit of a control block's status: a `periodic` record lies in front of the stack (SYS_PERIODIC, openswarm.h)."""
LONGEST_LIST: Final = 4096
MISSING: Final = (
    "{path} has no OpenSwarm kernel with debug information ({what} is missing): link the kernel and build with -g"
)


def event_name(identifier: int) -> str:
    """Return the name of a system event, or `event 0x40`."""
    return SYSTEM_EVENTS.get(identifier, f"event {identifier:#04x}")


@dataclass(frozen=True, slots=True)
class ThreadMemory:
    """Memory of one thread, in bytes and addresses. The system thread has no block."""

    pid: int
    pcb: int
    block: int
    """Start of the heap block; 0 for the system thread."""
    size: int
    """Bytes of the whole heap block."""
    stack: int
    """Bytes of the stack that the application configured."""
    usable: int
    """Bytes of the stack below the limit at which the kernel ends the thread."""
    unused: int
    """Usable bytes that were never written."""

    @property
    def used(self) -> int:
        """High-water mark of the stack in bytes."""
        return self.usable - self.unused


@dataclass(slots=True)
class EventMemory:
    """A registered event: its subscriptions by owner, and its gates (records of quotas)."""

    identifier: int
    subscriptions: int = 0
    by_drivers: int = 0
    """Number of the subscriptions that belong to drivers."""


@dataclass(slots=True)
class KernelMemory:
    """Everything that the kernel has allocated at one instant."""

    heap_used: int
    threads: list[ThreadMemory]
    events: dict[int, EventMemory]
    gates: int
    queued: Counter[int] = field(default_factory=Counter)
    """Number of queued messages by event; -1 stands for blocks without event, which a driver has returned."""
    queued_bytes: Counter[int] = field(default_factory=Counter)
    """Heap bytes of these messages."""
    held: int = 0
    """Number of messages that threads have received and not cleared."""
    held_bytes: int = 0
    """Heap bytes of these messages."""


class KernelStructures:
    """Addresses and offsets of the kernel in one image. Raises MeasureError for an image without it."""

    def __init__(self, image: Image) -> None:
        self.image: Final = image
        self._debug: Final = debug_of(image)
        pcb, event = self._type("struct sys_pcb"), self._type("struct event")
        subscription, message = self._type("struct subscription"), self._type("union message")
        self.pcb_bytes: Final = pcb.bytes
        self.event_bytes: Final = event.bytes
        self.subscription_bytes: Final = subscription.bytes
        self.message_bytes: Final = message.bytes
        self._pcb: Final = {name: self._offset(pcb, name) for name in ("limit", "status", "block", "next", "pid")}
        self._awaited: Final = self._offset(pcb, "event_or_slice", "awaited")
        self.result_offset: Final = self._offset(pcb, "wait", "result")
        self._event: Final = {name: self._offset(event, name) for name in ("id", "next", "subscribers")}
        self._subscription: Final = {name: self._offset(subscription, name) for name in ("next", "handler", "pid")}
        self._message: Final = {name: self._offset(message, "queued", name) for name in ("next", "event", "size")}
        self._data_size: Final = self._offset(message, "data", "size")
        self.running: Final = self.address("os_running")
        self.statistics: Final = self.address("os_statistics")
        self.queue_end: Final = self.address("queue_end")
        self._ring, self._blocked = self.address("os_ring"), self.address("os_blocked")
        self._events: Final = self.address("events")
        self._buckets: Final = self._variable("events").type.bytes // WORD
        self._queues: Final = [a for a in map(self.find, ("delivery_batch", "event_queue")) if a is not None]
        self.memory: Final = self.address("os_memory")
        self.memory_end: Final = self.memory + self._variable("os_memory").type.bytes
        self._cleanups, self._held_mutexes = self.find("cleanups"), self.find("held")

    # Addresses and offsets

    def _type(self, name: str) -> Type:
        found = self._debug.type(name)
        if found is None or not found.bytes:
            raise MeasureError(MISSING.format(path=self.image.path, what=f"type {name}"))
        return found

    def _offset(self, kind: Type, *path: str) -> int:
        offset = 0
        for name in path:
            member = kind.member(name)
            if member is None:
                raise MeasureError(MISSING.format(path=self.image.path, what=f"member {name}"))
            offset, kind = offset + member.offset, member.type
        return offset

    def _variable(self, name: str) -> Variable:
        """Return a variable of the kernel; an application may have one of the same name."""
        same = [one for one in self._debug.globals.get(name, []) if one.location is not None]
        same.sort(key=lambda one: not any(part in one.file for part in ("/kernel/", "/option/")))
        if not same:
            raise MeasureError(MISSING.format(path=self.image.path, what=f"variable {name}"))
        return same[0]

    def address(self, name: str) -> int:
        """Return the data address of a kernel variable. Raises MeasureError if the image lacks it."""
        location = self._variable(name).location
        code = location.at(0) if location is not None else None
        place = int.from_bytes(code[1:5], "little") if code is not None and len(code) == 1 + 4 else 0
        if not place:
            raise MeasureError(MISSING.format(path=self.image.path, what=f"variable {name}"))
        return place

    def find(self, name: str) -> int | None:
        """Return the data address of a kernel variable, None if the image lacks it."""
        try:
            return self.address(name)
        except MeasureError:
            return None

    def code(self, name: str) -> int:
        """Return the address of a kernel function. Raises MeasureError if the image lacks it."""
        symbol = self.image.symbols.find(name)
        if symbol is None or symbol.space != "code":
            raise MeasureError(MISSING.format(path=self.image.path, what=f"function {name}"))
        return symbol.address

    def target(self, pointer: int) -> int:
        """Return the address of the function that a 16-bit function pointer denotes, through its jump if it has one."""
        word = self.image.word(pointer) or 0
        if word >> 16 == 0x04:  # GOTO (isa.md §7)
            return (self.image.word(pointer + 2) or 0) << 16 & 0x7F0000 | word & 0xFFFF
        return pointer

    def function_name(self, pointer: int) -> str:
        """Return the C name of the function that a pointer denotes."""
        address = self.target(pointer)
        function = self._debug.function(address)
        if function is not None and function.name:
            return function.name
        symbol = self.image.symbols.code(address)
        return symbol[0].name.removeprefix("_") if symbol is not None else f"{address:#06x}"

    # Lists

    def list_from(self, machine: Machine, first: int, link: int) -> Iterator[int]:
        """Yield the addresses of a linked list's elements; the link is at offset `link` of an element."""
        for _ in range(LONGEST_LIST):
            if not first:
                return
            yield first
            first = machine.peek(first + link)
        raise MeasureError("a list of the kernel does not end")

    def control_blocks(self, machine: Machine) -> list[int]:
        """Return the addresses of all control blocks: the ring of ready threads, then the blocked list."""
        found: list[int] = []
        pcb = machine.peek(self._ring)
        while pcb and pcb not in found and len(found) < LONGEST_LIST:
            found.append(pcb)
            pcb = machine.peek(pcb + self._pcb["next"])
        blocked = machine.peek(self._blocked)
        return found + [one for one in self.list_from(machine, blocked, self._pcb["next"]) if one not in found]

    def pid(self, machine: Machine, pcb: int) -> int:
        """Return the process identifier of a control block."""
        return machine.peek(pcb + self._pcb["pid"])

    def is_woken(self, machine: Machine, pcb: int) -> bool:
        """Whether a thread that enters the ring was blocked before; else it is new."""
        return bool(machine.peek(pcb + self._pcb["status"], 1) & WOKEN)

    def thread(self, machine: Machine, pcb: int) -> ThreadMemory:
        """Return the memory of the thread with the control block at `pcb`."""
        block = machine.peek(pcb + self._pcb["block"])
        pid = self.pid(machine, pcb)
        if not self.memory <= block < pcb:  # the system thread, or a zombie without a stack
            size = self.pcb_bytes if self.memory <= pcb < self.memory_end else 0
            return ThreadMemory(pid, pcb, 0, size, 0, 0, 0)
        timed = machine.peek(pcb + self._pcb["status"], 1) & PERIODIC
        periodic = self._debug.type("periodic") if timed else None
        first = block + (periodic.bytes if periodic is not None else 0)
        usable = max(machine.peek(pcb + self._pcb["limit"]) + WORD - first, 0)
        painted = machine.peek_bytes(first, usable) if usable else b""
        unused = len(painted) - len(painted.rstrip(bytes([STACK_FILL])))
        return ThreadMemory(pid, pcb, block, pcb + self.pcb_bytes - block, pcb - first, usable, unused)

    def events(self, machine: Machine) -> Iterator[tuple[int, int, bool]]:
        """Yield (address, identifier, whether it is a quota's gate) of all events.

        A gate has an identifier that belongs to another bucket.
        """
        for bucket in range(self._buckets):
            first = machine.peek(self._events + WORD * bucket)
            for event in self.list_from(machine, first, self._event["next"]):
                identifier = machine.peek(event + self._event["id"])
                yield event, identifier, identifier % self._buckets != bucket

    def subscriptions(self, machine: Machine, event: int) -> Iterator[tuple[int, int]]:
        """Yield (PID, handler pointer) of the subscriptions of the event at an address."""
        first = machine.peek(event + self._event["subscribers"])
        for one in self.list_from(machine, first, self._subscription["next"]):
            yield (machine.peek(one + self._subscription["pid"]), machine.peek(one + self._subscription["handler"]))

    def message(self, machine: Machine, message: int) -> tuple[int, int]:
        """Return (event address, payload bytes) of a queued message."""
        return machine.peek(message + self._message["event"]), machine.peek(message + self._message["size"])

    def event_id(self, machine: Machine, event: int) -> int:
        """Return the identifier of the event at an address."""
        return machine.peek(event + self._event["id"])

    def heap_used(self, machine: Machine) -> int:
        """Return the allocated bytes as counted by the allocator."""
        return machine.peek(self.statistics)

    def nodes(self, machine: Machine) -> tuple[Counter[int], Counter[int]]:
        """Return the numbers of cleanup nodes and of owned mutexes by the address of the thread's control block."""
        found: list[Counter[int]] = []
        for head, name, owner in (
            (self._cleanups, "sys_cleanup", "thread"), (self._held_mutexes, "sys_mutex", "owner"),
        ):  # fmt: skip
            count: Counter[int] = Counter()
            kind = self._debug.type(name) if head is not None else None
            if head is not None and kind is not None:
                at, link = self._offset(kind, owner), self._offset(kind, "next")
                count.update(machine.peek(one + at) for one in self.list_from(machine, machine.peek(head), link))
            found.append(count)
        return found[0], found[1]

    def size_of(self, name: str) -> int:
        """Return the bytes of a type of the kernel, 0 if the image does not use it."""
        kind = self._debug.type(name)
        return kind.bytes if kind is not None else 0

    def rounded(self, size: int) -> int:
        """Return the heap bytes of a block of `size` bytes."""
        return size + size % WORD

    def queued(self, machine: Machine) -> dict[int, tuple[int, int]]:
        """Return the number of queued messages and their heap bytes by event; -1 for blocks without event."""
        found: dict[int, tuple[int, int]] = {}
        for head in self._queues:
            for one in self.list_from(machine, machine.peek(head), self._message["next"]):
                event, size = self.message(machine, one)
                identifier = self.event_id(machine, event) if event else -1
                count, total = found.get(identifier, (0, 0))
                found[identifier] = count + 1, total + self.rounded(self.message_bytes + size)
        return found

    def read(self, machine: Machine) -> KernelMemory:
        """Return all allocations. The kernel's lists must be consistent: call it while a thread runs."""
        threads = [self.thread(machine, pcb) for pcb in self.control_blocks(machine)]
        events: dict[int, EventMemory] = {}
        gates = 0
        for event, identifier, is_gate in self.events(machine):
            gates += is_gate
            if not is_gate:
                owners = [pid for pid, _handler in self.subscriptions(machine, event)]
                events[identifier] = EventMemory(identifier, len(owners), owners.count(DRIVERS))
        found = KernelMemory(self.heap_used(machine), threads, events, gates)
        for identifier, (count, size) in self.queued(machine).items():
            found.queued[identifier], found.queued_bytes[identifier] = count, size
        results = {self._result(machine, pcb) for pcb in self.control_blocks(machine)} - {0}
        found.held = len(results)
        for one in results:
            found.held_bytes += self.rounded(self.message_bytes + machine.peek(one + self._data_size))
        return found

    def _result(self, machine: Machine, pcb: int) -> int:
        """Return the address of the message that a thread has received and not cleared; 0 if it has none."""
        waits = machine.peek(pcb + self._pcb["status"], 1) & OFF_RING and machine.peek(pcb + self._awaited)
        return 0 if waits else machine.peek(pcb + self.result_offset)
