"""Objects of the kernel model: threads, events, messages, options, and the sizes that a port gives them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any

Handler = Callable[[int, int, "Message"], bool]
"""handler(pid, event, message): False unsubscribes the handler."""
Condition = Callable[["Message"], bool]
Code = Iterator[str]
"""Code of a thread. It yields a reason whenever it gives up the CPU: see `Threads.resume`."""


class Error(IntEnum):
    """sys_error: cause of the last failure of a call."""

    OK, CONTEXT, MEMORY, EVENT, PROCESS, ARGUMENT, BUSY = range(7)


class State(IntEnum):
    """sys_state of a thread."""

    NEW, READY, BLOCKED, ZOMBIE, RUNNING, UNKNOWN = range(6)


@dataclass(frozen=True)
class Sizes:
    """Sizes in bytes and limits of a port, in the order in which the interpreter prints them."""

    step: int
    """Granularity of allocations."""
    thread: int
    """Control block of a thread, above its stack."""
    event: int
    subscription: int
    message: int
    """Header in front of the payload of a message."""
    period: int
    """Control data in front of the stack of a periodic thread."""
    default_stack: int
    minimum_stack: int
    small_payload: int
    """Maximum payload from an ISR."""
    maximum_payload: int
    kernel_stack: int
    loss_counters: int
    maximum_speed: int
    remote_events: int
    remote_memory: int

    def rounded(self, size: int) -> int:
        """Return the heap bytes that an allocation of `size` bytes takes."""
        return -(-size // self.step) * self.step


@dataclass(slots=True, eq=False)
class Message:
    """A queued payload. Its readers share it; the last one frees it."""

    event: Event | None
    """None: the event was unregistered after the message was sent."""
    payload: bytes
    readers: int = 0
    """Threads that own it as their wait result."""

    @property
    def value(self) -> int:
        """Return the first two payload bytes as a number, zero-extended."""
        return int.from_bytes(self.payload[:2], "little")


@dataclass(slots=True, eq=False)
class Subscription:
    """A handler of an event on behalf of a thread; pid None: of a driver."""

    handler: Handler
    pid: int | None
    condition: Condition | None


@dataclass(slots=True, eq=False)
class Event:
    """A registered event. Registering its number again later makes another event."""

    number: int
    subscriptions: list[Subscription] = field(default_factory=list)
    quota: Quota | None = None


@dataclass(slots=True, eq=False)
class Period:
    """Timing of a periodic thread in ms."""

    length: int
    deadline: int
    release: int
    due: int
    missed: bool = False
    """The miss of this period's deadline is reported."""


@dataclass(slots=True, eq=False)
class Thread:
    """A thread, from its start until its memory is freed."""

    pid: int
    code: Code
    priority: int = 0
    stack: int = 0
    period: Period | None = None
    joinable: bool = False
    state: State = State.NEW
    error: Error = Error.OK
    result: Message | None = None
    """Wait result, until the thread clears it or waits again."""
    awaited: Event | Notification | Semaphore | None = None
    condition: Condition | None = None
    wake: int | None = None
    """Time at which its wait ends; None: never."""
    woken: bool = False
    """It has waited and not run since; sys_woken_first reads and clears this."""
    cleanups: list[Cleanup] = field(default_factory=list)


@dataclass(frozen=True)
class Configuration:
    """sys_process_config. `code` makes what the thread executes; None: no entry function."""

    code: Callable[[], Code] | None
    stack: int = 0
    priority: int = 0
    periodic: bool = False
    unknown_flags: bool = False
    period_ms: int = 0
    deadline_ms: int = 0


@dataclass(slots=True, eq=False)
class Mutex:
    ceiling: int
    owner: Thread | None = None
    base: int = 0
    """Priority of the owner before it locked any mutex."""
    waiters: list[Thread] = field(default_factory=list)


@dataclass(slots=True, eq=False)
class Cleanup:
    """A cleanup object. `run` is None while it is not pushed."""

    run: Callable[[], Any] | None = None


@dataclass(slots=True, eq=False)
class Quota:
    most: int = 0
    latest: bool = False
    event: Event | None = None
    dropped: int = 0


@dataclass(slots=True, eq=False)
class Notification:
    bits: int = 0
    value: int = 0
    awaited: int = 0
    """Bits for which a thread waits."""


@dataclass(slots=True, eq=False)
class Semaphore:
    count: int = 0


@dataclass(slots=True, eq=False)
class Timer:
    event: int = 0
    value: int = 0
    due: int = 0
    period: int = 0
    """0: once."""


@dataclass(slots=True, eq=False)
class Service:
    configuration: Configuration
    limit_ms: int
    restarts: int
    pid: int = 0
    fed: int = 0
    bitten: int = 0
