"""Executes a program with the kernel model, as interpreter.c does with the kernel, and returns the records."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from types import GeneratorType
from typing import Any

from tests.firmware.model import schedulers
from tests.firmware.model.kernel import Kernel
from tests.firmware.model.program import END, ENTRY, FIRST, LIMITS, Code, Kind, Program, Record
from tests.firmware.model.state import (
    Cleanup,
    Configuration,
    Message,
    Mutex,
    Notification,
    Quota,
    Semaphore,
    Service,
    Sizes,
    Timer,
)  # fmt: skip
from tests.firmware.model.threads import ALWAYS

NOTHING, SKIPPED = 0xFFFF, 0xEEEE
EVENTS = (0x40, 0x41, 0x48, 0x07, 0x01, 0x02, 0x0E, 0x99)


class Finished(Exception):
    """The run has reached its limit of records or idle times."""


class Machine(Kernel):
    """A kernel whose run ends after a number of idle times."""

    idles = 0
    at_boundary: Callable[[], None] | None = None

    def boundary(self) -> None:
        if self.at_boundary is not None and not self.in_isr:
            self.at_boundary()

    def idle(self) -> None:
        self.idles += 1
        if self.idles == LIMITS["MOST_IDLES"]:
            raise Finished
        super().idle()


class Place:
    """The operation that runs, and the data of the running handler or condition."""

    def __init__(self, kind: Kind, number: int, data: Message | None = None) -> None:
        self.kind, self.number, self.data, self.index = kind, FIRST[kind] + number, data, 0


def digest(message: Message) -> int:
    """Return a checksum of size and payload."""
    total = len(message.payload)
    for byte in message.payload:
        total = total * 31 + byte & 0xFFFF
    return total


def lowest_pid(kernel: Any) -> Any:
    return min(kernel.ready, key=lambda thread: thread.pid)


def lowest_priority(kernel: Any) -> Any:
    return min(kernel.ready, key=lambda thread: thread.priority)


SCHEDULERS = (
    schedulers.ROUND_ROBIN, schedulers.WOKEN_FIRST, schedulers.FIXED_PRIORITY, schedulers.EARLIEST_DEADLINE,
    schedulers.Scheduler(lowest_pid, True), schedulers.Scheduler(lowest_priority, False),
    schedulers.Scheduler(None, True), None,
)  # fmt: skip


class Executor:
    """One run of a program."""

    def __init__(self, program: Program, sizes: Sizes, later: tuple[int, int, int] = (-1, 0, 0)) -> None:
        """Prepare a run. later: when the interrupt of LATER occurs. It gives the number of records before it, the
        time, and the number of boundaries passed at that time since the last record."""
        self.program = program
        self.later, self.later_used, self.later_came = later, False, False
        self.records: list[Record] = []
        self.slots = [0, 0, 0, 0]
        self.starts = 0
        self.results: dict[int, Message | None] = {}
        self.kernel = self.k = Machine(sizes, self.main())
        step, small = sizes.step, sizes.small_payload
        self.sizes = (0, 1, 2, 3, 9, 16, 17, small, small + 1, 1025)
        self.stacks = {4: sizes.default_stack + 2 * step, 8: sizes.minimum_stack - step}
        self.handlers = [self.handler(n) for n in range(4)] + [None]
        self.conditions = [None] + [self.condition(n) for n in range(3)]
        self.mutexes = [Mutex(0), Mutex(2), Mutex(3)]
        self.cleanups = [*(Cleanup() for _ in range(4)), None]
        self.quotas = [Quota(), Quota()]
        self.notifications = [Notification(), Notification()]
        self.semaphores = [Semaphore(), Semaphore(0xFFFE)]
        self.timers = [Timer(), Timer()]
        self.services = [
            Service(Configuration(self.thread(0), priority=1), 3, 2),
            Service(Configuration(self.thread(1), priority=2), 0, ALWAYS),
            Service(Configuration(self.thread(1), stack=step, priority=2), 3, 1),
        ]
        self.actions = self.operations()

    def run(self, base: int) -> list[Record]:
        """Run to the limit and return the records. `base`: heap bytes that the board took before."""
        self.k.heap = self.k.peak = base
        with suppress(Finished):
            self.k.resume()
        self.final_state()
        return self.records

    # ---- Records ---------------------------------------------------------------------------------------------------

    def put(self, place: Place, code: int, result: Any, extra: int = 0) -> None:
        k = self.k
        pid, error = k.process_id(), k.last_error()
        heap = 0 if place.kind is Kind.ISR else k.heap
        self.records.append((place.number, place.kind, place.index, code, pid, int(result or 0) & 0xFFFF, int(error),
                             heap, k.now & 0xFFFF, extra))  # fmt: skip
        if len(self.records) == LIMITS["MOST_RECORDS"] and place.kind is not Kind.FINAL:
            raise Finished

    # ---- Scripts ---------------------------------------------------------------------------------------------------

    def main(self) -> Iterator[str]:
        yield from self.steps(Place(Kind.MAIN, 0))
        while True:
            self.k.end_section()
            yield from self.k.settle()
            sleeping = self.k.sleep(60000)
            if sleeping is not None:
                yield from sleeping

    def thread(self, number: int) -> Callable[[], Iterator[str]]:
        def code() -> Iterator[str]:
            place = Place(Kind.THREAD, number)
            yield from self.interrupted()
            self.put(place, ENTRY, 0)
            yield from self.steps(place)

        return code

    def steps(self, place: Place) -> Iterator[str]:
        """Perform the operations of a script of main or of a thread."""
        k = self.k
        for index, (code, a, b, c) in enumerate(self.program.scripts[place.number].operations):
            place.index = index
            k.boundary()
            result = self.actions[code](place, a, b, c)
            if type(result) is GeneratorType:
                result = yield from result
            yield from self.interrupted()
            seen = self.finished(place, code, a, result)
            yield from self.interrupted()
            self.put(place, code, *seen)
        place.index = len(self.program.scripts[place.number].operations)
        yield from self.interrupted()
        self.put(place, END, 0)

    def interrupted(self) -> Iterator[str]:
        k = self.k
        k.boundary()
        while (k.forced or k.slice_over) and not k.depth and k.started:
            yield "preempted"
            k.boundary()

    def at_once(self, place: Place, result: int = 0) -> bool:
        """Perform the operations of another script and return its answer."""
        script, data = self.program.scripts[place.number], place.data
        self.k.boundary()
        self.put(place, ENTRY, result, digest(data) if data is not None else 0)
        for index, (code, a, b, c) in enumerate(script.operations):
            place.index = index
            self.k.boundary()
            returned = self.actions[code](place, a, b, c)
            self.k.boundary()
            seen = self.finished(place, code, a, returned)
            self.k.boundary()
            self.put(place, code, *seen)
        place.index = len(script.operations)
        self.k.boundary()
        self.put(place, END, 0)
        return bool(data.value & 1 if script.answer == 2 and data is not None else script.answer)

    def handler(self, number: int) -> Callable[[int, int, Message], bool]:
        return lambda pid, event, message: self.at_once(
            Place(Kind.HANDLER, number, message), (pid * 256 + event) & 0xFFFF
        )

    def condition(self, number: int) -> Callable[[Message], bool]:
        return lambda message: self.at_once(Place(Kind.CONDITION, number, message))

    def finished(self, place: Place, code: int, a: int, result: Any) -> tuple[Any, int]:
        """Store what a call has returned and return the results to record."""
        if code in (Code.START_PROCESS, Code.START_WITH, Code.START_JOINABLE):
            if result not in (0, SKIPPED):
                self.slots[a] = result
        elif code in (Code.WAIT_EVENT, Code.WAIT_CONDITION, Code.WAIT_TIMEOUT):
            if result is None and self.k.last_error() == 1:
                return NOTHING, 0
            self.store(place, result)
            return self.seen(result)
        elif code in (Code.WAIT_NOTIFICATION, Code.WAIT_SEMAPHORE, Code.WAIT_SEMAPHORE_TIMEOUT):
            if place.kind <= Kind.THREAD:
                self.store(place, None)  # the wait may have freed it
            if code == Code.WAIT_NOTIFICATION:
                return result, self.notifications[a].value
        elif code == Code.READ:
            return self.seen(result)
        elif code == Code.MOTOR_SPEEDS:
            return result[0], result[1] & 0xFFFF
        return result, 0

    def seen(self, message: Message | None) -> tuple[int, int]:
        return (NOTHING, 0) if message is None else (message.value, digest(message))

    def stored(self, place: Place) -> Message | None:
        return self.results.get(self.k.process_id()) if place.kind <= Kind.THREAD else place.data

    def store(self, place: Place, message: Message | None) -> None:
        if place.kind <= Kind.THREAD:
            self.results[self.k.process_id()] = message
        else:
            place.data = message

    def pid(self, operand: int) -> int:
        """Return the PID that an operand denotes: of a slot, main, the caller, no thread, or a service."""
        if operand < 4:
            return self.slots[operand]
        return (0, self.k.process_id(), 0xFFFF, 77, self.services[0].pid, self.services[1].pid)[operand - 4]

    def configuration(self, number: int, what: int) -> Configuration:
        """Return the configuration that interpreter.c calls configured(number, what)."""
        code, kind, priority = self.thread(number), what >> 2, what & 3
        periods = {1: (3, 2), 2: (1, 1), 3: (8, 4), 5: (2, 3)}
        if kind in periods:
            period, deadline = periods[kind]
            return Configuration(code, 0, priority, True, False, period, deadline)
        return Configuration(None if kind == 7 else code, self.stacks.get(kind, 0), priority, unknown_flags=kind == 6)

    # ---- Operations ------------------------------------------------------------------------------------------------

    def start(self, start: Callable[..., Any], *arguments: Any) -> Any:
        if self.starts == LIMITS["MOST_STARTS"]:
            return SKIPPED
        self.starts += 1
        return start(*arguments)

    def send(self, a: int, b: int, c: int) -> Any:
        size = self.sizes[b]
        payload = None if size == 9 and c == 0 else bytes((c + i) & 0xFF for i in range(size))
        return self.k.send_event(EVENTS[a], payload, size)

    def statistic(self, a: int) -> int:
        return 0 if a == 0 and self.later_used else self.k.statistics()[a]

    def clear(self, p: Place) -> bool:
        self.k.clear(self.stored(p))
        self.store(p, None)
        return True

    def push(self, a: int, b: int) -> Any:
        run = None if b == 3 else lambda: self.at_once(Place(Kind.CLEANUP, b))
        return self.k.push_cleanup(self.cleanups[a], run)

    def end_slice(self) -> None:
        self.k.slice_over = True

    def interrupt(self, a: int) -> None:
        self.k.in_isr = True
        self.at_once(Place(Kind.ISR, a))
        self.k.in_isr = False

    def arrive(self, a: int, robot: int, value: int) -> None:
        k = self.k
        if k.share_gates:  # else no event was ever shared, and the link ignores frames of events
            k.in_isr = True
            k.arrive(EVENTS[a], (value & 1) + 1, robot, value // 16, bytes((value, 0)))
            k.in_isr = False

    def arm(self) -> int:
        if self.later_used:
            return SKIPPED
        self.later_used = True
        self.k.at_boundary = self.come_later
        return 0

    def come_later(self) -> None:
        records, time, boundaries = self.later
        if len(self.records) == records and self.k.now == time:
            if boundaries == 0:
                self.k.at_boundary = None
                self.later_came = True
                self.interrupt(2)
            self.later = records, time, boundaries - 1

    def fail(self, a: int, b: int) -> None:
        self.k.allocations_to_skip, self.k.allocations_to_fail = a, b

    def operations(self) -> dict[int, Callable[[Place, int, int, int], Any]]:
        """Return the function that performs each operation on the model."""
        k = self.k
        return {
            Code.START_KERNEL: lambda p, a, b, c: k.start_kernel(),
            Code.RUN_SYSTEM_THREAD: lambda p, a, b, c: k.run_system_thread(),
            Code.START_PROCESS: lambda p, a, b, c: self.start(k.start_process, self.thread(b)),
            Code.START_WITH: lambda p, a, b, c: self.start(k.start_with, self.configuration(b, c)),
            Code.START_JOINABLE: lambda p, a, b, c: self.start(k.start_joinable, self.configuration(b, c)),
            Code.KILL: lambda p, a, b, c: k.kill(self.pid(a)),
            Code.YIELD: lambda p, a, b, c: k.yield_(),
            Code.SLEEP: lambda p, a, b, c: k.sleep(a),
            Code.WAIT_FOR_PERIOD: lambda p, a, b, c: k.wait_for_period(),
            Code.START_SECTION: lambda p, a, b, c: k.start_section(),
            Code.END_SECTION: lambda p, a, b, c: k.end_section(),
            Code.PROCESS_STATE: lambda p, a, b, c: k.process_state(self.pid(a)),
            Code.UNUSED_STACK: lambda p, a, b, c: k.unused_stack(self.pid(a)),
            Code.UNUSED_KERNEL_STACK: lambda p, a, b, c: k.unused_kernel_stack(),
            Code.SET_SCHEDULER: lambda p, a, b, c: k.set_scheduler(SCHEDULERS[a]),
            Code.REGISTER: lambda p, a, b, c: k.register(EVENTS[a]),
            Code.UNREGISTER: lambda p, a, b, c: k.unregister(EVENTS[a]),
            Code.IS_REGISTERED: lambda p, a, b, c: k.is_registered(EVENTS[a]),
            Code.SUBSCRIBE: lambda p, a, b, c: k.subscribe(
                EVENTS[a], self.pid(b), self.handlers[c % 8], self.conditions[c // 8]
            ),
            Code.UNSUBSCRIBE: lambda p, a, b, c: k.unsubscribe(EVENTS[a], self.pid(b)),
            Code.UNSUBSCRIBE_HANDLER: lambda p, a, b, c: k.unsubscribe_handler(
                EVENTS[a], self.pid(b), self.handlers[c]
            ),
            Code.SEND: lambda p, a, b, c: self.send(a, b, c),
            Code.SEND_INT: lambda p, a, b, c: k.send_int(EVENTS[a], b),
            Code.WAIT_EVENT: lambda p, a, b, c: k.wait_for_event(EVENTS[a]),
            Code.WAIT_CONDITION: lambda p, a, b, c: k.wait_for_condition(EVENTS[a], self.conditions[b]),
            Code.WAIT_TIMEOUT: lambda p, a, b, c: k.wait_for_condition_timeout(EVENTS[a], self.conditions[b], c),
            Code.READ: lambda p, a, b, c: self.stored(p),
            Code.CLEAR: lambda p, a, b, c: self.clear(p),
            Code.LOST: lambda p, a, b, c: k.lost_events(EVENTS[a]),
            Code.STATISTICS: lambda p, a, b, c: self.statistic(a),
            Code.MOTOR_SPEEDS: lambda p, a, b, c: (k.left_speed(), k.right_speed()),
            Code.LOCK: lambda p, a, b, c: k.lock(self.mutexes[a]),
            Code.LOCK_TIMEOUT: lambda p, a, b, c: k.lock_timeout(self.mutexes[a], b),
            Code.UNLOCK: lambda p, a, b, c: k.unlock(self.mutexes[a]),
            Code.JOIN: lambda p, a, b, c: k.join(self.pid(a)),
            Code.JOIN_TIMEOUT: lambda p, a, b, c: k.join_timeout(self.pid(a), b),
            Code.NOTIFY: lambda p, a, b, c: k.notify(self.notifications[a], b),
            Code.NOTIFY_VALUE: lambda p, a, b, c: k.notify_value(self.notifications[a], b, c),
            Code.WAIT_NOTIFICATION: lambda p, a, b, c: k.wait_for_notification(self.notifications[a], b, c),
            Code.SIGNAL: lambda p, a, b, c: k.signal(self.semaphores[a]),
            Code.WAIT_SEMAPHORE: lambda p, a, b, c: k.wait_for_semaphore(self.semaphores[a]),
            Code.WAIT_SEMAPHORE_TIMEOUT: lambda p, a, b, c: k.wait_for_semaphore_timeout(self.semaphores[a], b),
            Code.START_TIMER: lambda p, a, b, c: k.start_timer(self.timers[a], EVENTS[b], c, c & 15, c >> 4),
            Code.STOP_TIMER: lambda p, a, b, c: k.stop_timer(self.timers[a]),
            Code.PUSH: lambda p, a, b, c: self.push(a, b),
            Code.POP: lambda p, a, b, c: k.pop_cleanup(bool(a)),
            Code.LIMIT: lambda p, a, b, c: k.limit_event(self.quotas[a], EVENTS[b], c),
            Code.KEEP: lambda p, a, b, c: k.keep_latest(self.quotas[a], EVENTS[b]),
            Code.START_SERVICE: lambda p, a, b, c: k.start_service(self.services[a]),
            Code.FEED: lambda p, a, b, c: k.feed_watchdog(),
            Code.TICK: lambda p, a, b, c: k.tick(),
            Code.SLICE: lambda p, a, b, c: self.end_slice(),
            Code.INTERRUPT: lambda p, a, b, c: self.interrupt(a),
            Code.SHARE: lambda p, a, b, c: k.share(EVENTS[a], b),
            Code.REMOTE_STATISTICS: lambda p, a, b, c: k.remote_statistics()[a],
            Code.ARRIVE: lambda p, a, b, c: self.arrive(a, b + 1, c),
            Code.LATER: lambda p, a, b, c: self.arm(),
            Code.SYSTEM_TIME: lambda p, a, b, c: k.system_time(),
            Code.FAIL: lambda p, a, b, c: self.fail(a, b),
        }

    # ---- Final state -----------------------------------------------------------------------------------------------

    def final_state(self) -> None:
        """Record the lists and counters of the kernel, as interpreter_final_state() does."""
        k, place = self.k, Place(Kind.MAIN, 0)
        place.kind = Kind.FINAL
        for thread in k.ready:
            self.put(place, 0, thread.pid, thread.priority)
        for thread in k.blocked:
            self.put(place, 1, thread.pid, int(thread.state))
        for number in EVENTS:
            self.put(place, 2, k.is_registered(number), k.lost_events(number))
        for mutex, service in zip(self.mutexes, self.services, strict=True):
            self.put(place, 3, mutex.owner.pid if mutex.owner else 0xFFFF, int(bool(mutex.waiters)))
            self.put(place, 4, service.pid, service.bitten * 256 + service.restarts & 0xFFFF)
        for i in range(4):
            self.put(place, 5, self.statistic(i), self.quotas[i].dropped if i < 2 else 0)
            self.put(place, 7, self.notifications[i].bits if i < 2 else self.semaphores[i - 2].count)
        self.put(place, 6, k.left_speed(), k.right_speed() & 0xFFFF)
