"""Model of the options: mutexes, joining, cleanups, quotas, services."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from tests.firmware.model.calls import SATURATED, call
from tests.firmware.model.events import Events
from tests.firmware.model.state import (
    Cleanup,
    Code,
    Configuration,
    Error,
    Event,
    Mutex,
    Quota,
    Service,
    Sizes,
    State,
    Thread,
)  # fmt: skip
from tests.firmware.model.threads import ALWAYS, Ended, Step

LATEST_PAYLOAD = 16
"""Longest payload that the newest message of a queue of one may replace."""


class Options(Events):
    """Model of all options of the kernel, which are linked only into images that use them."""

    def __init__(self, sizes: Sizes, code: Code) -> None:
        super().__init__(sizes, code)
        self.held: list[Mutex] = []
        """Mutexes with an owner, the last locked first."""
        self.joins: list[tuple[Thread, int]] = []
        """Waiting threads and the PIDs they join, the last first."""
        self.dying: list[Thread] = []
        """Threads whose cleanups are to run, in order of their end."""
        self.cleaning = False
        self.host: Thread | None = None
        """Thread whose call runs the cleanups of other threads; None at other times."""
        self.host_ends = False
        self.interrupted: Thread | None = None
        """Thread that was running when cleanups began to run in kernel context; None at other times."""
        self.gates: set[int] = set()
        """Numbers of events that have or had a quota. The kernel keeps one gate for each, of the size of an event."""
        self.services: list[Service] = []
        """Supervised services, the last started first."""

    # ---- Mutexes: immediate priority ceiling -----------------------------------------------------------------------

    def base_priority(self, thread: Thread) -> int:
        return next((mutex.base for mutex in self.held if mutex.owner is thread), thread.priority)

    def acquire(self, mutex: Mutex, thread: Thread) -> None:
        mutex.base, mutex.owner = self.base_priority(thread), thread
        self.held.insert(0, mutex)
        thread.priority = max(thread.priority, mutex.ceiling)

    def release(self, mutex: Mutex) -> None:
        """Take a mutex from its owner and pass it to the waiter of the highest priority, the first of equals."""
        owner = mutex.owner
        assert owner is not None
        self.held.remove(mutex)
        mutex.owner = None
        owner.priority = max(mutex.base, *(m.ceiling for m in self.held if m.owner is owner), 0)
        if mutex.waiters:
            best = max(mutex.waiters, key=lambda thread: thread.priority)
            mutex.waiters.remove(best)
            self.acquire(mutex, best)
            if best.state is State.BLOCKED:
                self.wake(best)

    @call("Sys_Lock_Mutex", "T", blocks=True)
    def lock(self, mutex: Mutex) -> Step:
        return self.lock_within(mutex, 0)

    @call("Sys_Lock_MutexTimeout", "T", blocks=True)
    def lock_timeout(self, mutex: Mutex, ms: int) -> Step:
        return self.lock_within(mutex, ms)

    def lock_within(self, mutex: Mutex, ms: int) -> Step:
        thread = self.running
        if mutex.owner is thread:
            return self.fail(Error.PROCESS)
        if self.base_priority(thread) > mutex.ceiling:
            return self.fail(Error.ARGUMENT)
        if mutex.owner is None:
            self.acquire(mutex, thread)
            return True
        mutex.waiters.append(thread)
        yield from self.block(ms)
        if mutex.owner is thread:
            return True
        mutex.waiters.remove(thread)
        return False

    @call("Sys_Unlock_Mutex", "MT")
    def unlock(self, mutex: Mutex) -> bool:
        thread = self.running
        if mutex.owner is not thread:
            return self.fail(Error.PROCESS)
        raised = thread.priority
        self.release(mutex)
        if thread.priority < raised:
            self.preempt()
        return True

    def leave_mutexes(self, thread: Thread) -> None:
        for mutex in self.held:
            if thread in mutex.waiters:
                mutex.waiters.remove(thread)
        while owned := [mutex for mutex in self.held if mutex.owner is thread]:
            self.release(owned[0])

    # ---- Joining ---------------------------------------------------------------------------------------------------

    @call("Sys_Start_Joinable", "MTH", 0)
    def start_joinable(self, configuration: Configuration) -> int:
        return self.start(configuration, joinable=True)

    @call("Sys_Join", "T", blocks=True)
    def join(self, pid: int) -> Step | bool:
        return self.join_within(pid, 0)

    @call("Sys_JoinTimeout", "T", blocks=True)
    def join_timeout(self, pid: int, ms: int) -> Step | bool:
        return self.join_within(pid, ms)

    def join_within(self, pid: int, ms: int) -> Step | bool:
        """Wait for the end of a thread, or remove a zombie."""
        thread = self.find(pid)
        if thread is None or thread is self.system or self.would_wait_for_itself(thread):
            return self.fail(Error.PROCESS)
        if thread.state is State.ZOMBIE:
            self.leave_lists(thread)
            self.drop_subscriptions(pid)
            self.free(self.sizes.thread)
            return True
        self.joins.insert(0, (self.running, pid))
        return self.wait_for_end(self.joins[0], ms)

    def would_wait_for_itself(self, thread: Thread | None) -> bool:
        while thread is not None:
            if thread is self.running:
                return True
            pid = next((pid for waiting, pid in self.joins if waiting is thread), None)
            thread = None if pid is None else self.find(pid)
        return False

    def wait_for_end(self, join: tuple[Thread, int], ms: int) -> Step:
        yield from self.block(ms)
        if join not in self.joins:
            return True
        self.joins.remove(join)
        return False

    def leave_joins(self, thread: Thread) -> None:
        """Remove the thread's own join and wake threads that join it: a joined thread does not become a zombie."""
        for waiting, pid in list(self.joins):
            if waiting is thread:
                self.joins.remove((waiting, pid))
            elif pid == thread.pid:
                self.joins.remove((waiting, pid))
                thread.joinable = False
                if waiting.state is State.BLOCKED:  # else its time-out has expired and it has not run since
                    self.wake(waiting)

    # ---- Cleanups --------------------------------------------------------------------------------------------------

    @call("Sys_Push_Cleanup", "MT")
    def push_cleanup(self, cleanup: Cleanup | None, run: Callable[[], Any] | None) -> bool:
        if cleanup is None or run is None or cleanup.run is not None:
            return self.fail(Error.ARGUMENT)
        cleanup.run = run
        self.running.cleanups.append(cleanup)
        return True

    @call("Sys_Pop_Cleanup", "MT")
    def pop_cleanup(self, run: bool) -> bool:
        thread = self.running
        if not thread.cleanups:
            return self.fail(Error.PROCESS)
        function = self.take_cleanup(thread)
        if run:
            self.run_in_section(function)
        return True

    def take_cleanup(self, thread: Thread) -> Callable[[], Any]:
        cleanup = thread.cleanups.pop()
        function, cleanup.run = cleanup.run, None
        assert function is not None
        return function

    def run_in_section(self, function: Callable[[], Any]) -> None:
        """Run a cleanup in a critical section that it cannot end."""
        before, self.depth = self.depth, 1 << 14
        self.boundary()
        function()
        self.boundary()
        self.depth = before

    def run_cleanups(self, thread: Thread) -> None:
        """Run the cleanups of a thread that has left all lists, the newest first, and free it.

        If a cleanup ends another thread, the same loop runs the cleanups of that thread after those of this one.
        """
        if thread is self.interrupted:
            self.interrupted = self.system
        if not thread.cleanups:
            self.free_thread(thread)
            return
        self.dying.append(thread)
        if not self.cleaning:
            self.run_all_cleanups()

    def run_all_cleanups(self) -> None:
        in_kernel = self.in_kernel
        self.cleaning = True
        if in_kernel:
            self.interrupted = self.running
        else:
            self.host = self.running
        self.in_kernel = True
        while self.dying:
            thread = self.dying[0]
            if thread.cleanups:
                self.running = thread
                self.run_in_section(self.take_cleanup(thread))
            else:
                del self.dying[0]
                before = self.interrupted if in_kernel else self.host
                assert before is not None
                self.running = before
                self.free_thread(thread)
        self.in_kernel, self.cleaning = in_kernel, False
        self.host = self.interrupted = None
        if self.host_ends:
            self.host_ends = False
            raise Ended
        self.preempt()

    def free_thread(self, thread: Thread) -> None:
        """Free the memory of a thread (kernel.py)."""
        raise NotImplementedError

    # ---- Quotas ----------------------------------------------------------------------------------------------------

    @call("Sys_Limit_Event", "MTH")
    def limit_event(self, quota: Quota, number: int, most: int) -> bool:
        return self.set_quota(quota, number, most) if most else self.fail(Error.ARGUMENT)

    @call("Sys_Keep_Latest", "MTH")
    def keep_latest(self, quota: Quota, number: int) -> bool:
        return self.set_quota(quota, number, 0)

    def set_quota(self, quota: Quota, number: int, most: int) -> bool:
        event = self.events.get(number)
        if event is None:
            return self.fail(Error.EVENT)
        for other in (event.quota, quota):
            if other is not None and other.event is not None:
                other.event.quota = other.event = None
        if number in self.gates:
            self.gates.remove(number)
            self.free(self.sizes.event)
        if not self.allocate(self.sizes.event):
            return self.fail(Error.MEMORY)
        self.gates.add(number)
        event.quota = quota
        quota.event, quota.most, quota.latest, quota.dropped = event, most or 1, not most, 0
        return True

    def apply_quota(self, event: Event, payload: bytes) -> bool:
        """Apply an event's quota to a message. Return whether it drops the message or replaces the newest one."""
        quota = event.quota
        if quota is None:
            return False
        waiting = [message for message in (*self.batch, *self.queue) if message.event is event]
        if len(waiting) < quota.most:
            return False
        if quota.latest and len(payload) == len(waiting[-1].payload) <= LATEST_PAYLOAD:
            waiting[-1].payload = payload
        else:
            quota.dropped = min(quota.dropped + 1, SATURATED)
        return True

    # ---- Services --------------------------------------------------------------------------------------------------

    @call("Sys_Start_Service", "MTH")
    def start_service(self, service: Service) -> bool:
        if service in self.services and service.pid:
            return self.fail(Error.PROCESS)
        self.supervises = True
        self.begin_service(service)
        if not service.pid:
            return False
        if service not in self.services:
            self.services.insert(0, service)
        return True

    def begin_service(self, service: Service) -> None:
        service.pid = self.start(service.configuration)
        service.fed = self.now

    @call("Sys_Feed_Watchdog", "MTH")
    def feed_watchdog(self) -> bool:
        fed = [
            service
            for service in self.services
            if service.pid and service.pid == self.running.pid and not self.in_kernel
        ]
        for service in fed:
            service.fed = self.now
        return bool(fed) or self.fail(Error.PROCESS)

    def supervise(self) -> None:
        """Kill the services that were not fed in time and restart those that have ended, after each tick."""
        for service in list(self.services):
            if service.pid and service.limit_ms and self.now > service.fed + service.limit_ms:
                self.kill(service.pid)
                service.bitten = min(service.bitten + 1, SATURATED)
            if not service.pid and service.restarts:
                before = self.last_error()
                self.begin_service(service)
                self.fail(before)  # a restart that fails is no error of a handler
                if service.pid and service.restarts != ALWAYS:
                    service.restarts -= 1

    def leave_services(self, thread: Thread) -> None:
        for service in self.services:
            if service.pid == thread.pid:
                service.pid = 0
