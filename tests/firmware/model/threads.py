"""Model of threads: beginning, scheduling, time."""

from __future__ import annotations

from collections.abc import Callable, Generator
from typing import Any

from tests.firmware.model.calls import SATURATED, Calls, call
from tests.firmware.model.schedulers import ROUND_ROBIN, Scheduler
from tests.firmware.model.state import Code, Configuration, Error, Message, Period, Sizes, State, Thread

ALWAYS = 0xFF
TERMINATION, CLOCK, DEADLINE_MISSED = 0x01, 0x07, 0x0E

Step = Generator[str, None, Any]
"""A call that may give the CPU up before it returns."""


class Ended(Exception):
    """The running thread has ended inside a call."""


class Threads(Calls):
    """Threads, time and memory.

    `ready` lists the ready threads in round-robin order. The first one runs, unless the kernel does. `blocked` lists
    all others in order of blocking, with the zombies.
    """

    def __init__(self, sizes: Sizes, code: Code) -> None:
        super().__init__(sizes, code)
        self.ready = [self.system]
        self.blocked: list[Thread] = []
        self.newest_pid = 0
        self.scheduler: Scheduler = ROUND_ROBIN
        self.forced = False
        """Whether an eager scheduler chooses again as soon as no critical section is open."""
        self.slice_over = False
        self.now = 0
        self.alarm: int | None = None
        """Earliest time-out set since the last expiry. It stays if the waiting thread ends."""
        self.alarm_expired = self.supervision_due = self.supervises = False
        self.scan: int | None = None
        """Position in `blocked` while conditions are evaluated."""
        self.events_lost = self.deadlines_missed = 0

    # ---- Start and end ---------------------------------------------------------------------------------------------

    def find(self, pid: int) -> Thread | None:
        """Return the thread or zombie with this PID. A thread whose cleanups run has left all lists."""
        return next((t for t in (*self.ready, *self.blocked) if t.pid == pid), None)

    def start(self, c: Configuration, joinable: bool = False) -> int:
        """Start a thread, which becomes the last ready one, and return its PID, or 0."""
        stack = c.stack or self.sizes.default_stack
        period = self.sizes.period if c.periodic else 0
        if (
            c.code is None
            or c.unknown_flags
            or stack < self.sizes.minimum_stack
            or (c.periodic and not 1 <= c.deadline_ms <= c.period_ms <= 0x7FFF)
        ):
            self.fail(Error.ARGUMENT)
            return 0
        if not self.allocate(period + stack + self.sizes.thread):
            self.fail(Error.MEMORY)
            return 0
        self.newest_pid += 1
        thread = Thread(self.newest_pid, c.code(), c.priority, stack, joinable=joinable)
        if c.periodic:
            thread.period = Period(c.period_ms, c.deadline_ms, self.now, self.now + c.deadline_ms)
        self.append_ready(thread)
        return thread.pid

    @call("Sys_Start_Process", "MTH", 0)
    def start_process(self, code: Callable[[], Code]) -> int:
        return self.start(Configuration(code))

    @call("Sys_Start_ProcessWith", "MTH", 0)
    def start_with(self, configuration: Configuration) -> int:
        return self.start(configuration)

    @call("Sys_Kill_Process", "MTH")
    def kill(self, pid: int) -> bool:
        thread = self.find(pid) if pid else None
        if thread is None:
            return self.fail(Error.PROCESS)
        if thread is self.running and not self.in_kernel:
            raise Ended
        self.end(thread)
        return True

    def end(self, thread: Thread) -> None:
        """Tear a thread down (kernel.py)."""
        raise NotImplementedError

    def leave_lists(self, thread: Thread) -> None:
        """Take a thread off the ready or blocked list."""
        if thread in self.ready:
            self.ready.remove(thread)
        else:
            self.remove_blocked(thread)

    # ---- Ready and blocked threads ---------------------------------------------------------------------------------

    def append_ready(self, thread: Thread) -> None:
        self.ready.append(thread)
        self.preempt()

    def remove_blocked(self, thread: Thread) -> None:
        at = self.blocked.index(thread)
        del self.blocked[at]
        if self.scan is not None and at < self.scan:
            self.scan -= 1

    def block(self, ms: int, event: Any = None) -> Step:
        """Block the running thread, for at most ms milliseconds unless ms is 0. Other time-outs expire first."""
        thread = self.running
        self.ready.remove(thread)
        thread.state, thread.awaited, thread.wake, thread.woken = State.BLOCKED, event, None, False
        self.blocked.append(thread)
        self.depth = 0
        self.boundary()
        if ms:
            self.expire()
            thread.wake = self.now + ms
            self.set_alarm(thread.wake)
        yield "block"

    def wake(self, thread: Thread, message: Message | None = None) -> None:
        """End a wait: the thread becomes the last ready one. Its last error is OK."""
        self.remove_blocked(thread)
        if thread.awaited is not None:
            thread.result, thread.awaited, thread.condition = message, None, None
        thread.state, thread.woken, thread.wake, thread.error = State.READY, True, None, Error.OK
        self.append_ready(thread)

    # ---- Scheduling ------------------------------------------------------------------------------------------------

    def preempt(self) -> None:
        """Let an eager scheduler choose as soon as possible; wake-ups and messages of handlers do not request it."""
        scheduler = self.scheduler
        if scheduler.eager and scheduler.pick is not None and (not self.in_kernel or self.in_isr):
            self.forced = True

    @property
    def has_work(self) -> bool:
        """Whether messages, a time-out or the supervision of services wait for the kernel."""
        return self.alarm_expired or self.supervision_due or self.has_messages

    has_messages = False

    def work(self) -> None:
        """Deliver messages, expire time-outs, supervise services; a section left open by a handler ends."""
        self.deliver_queued()
        if self.alarm_expired:
            self.alarm_expired = False
            self.boundary()
            self.expire()
            self.expire_timers()
        self.depth = 0
        if self.supervision_due:
            self.supervision_due = False
            self.boundary()
            self.supervise()
        self.boundary()
        self.serve_posts()

    def deliver_queued(self) -> None:
        """Deliver the queued messages (events.py)."""
        raise NotImplementedError

    def supervise(self) -> None:
        """Supervise services (options.py)."""
        raise NotImplementedError

    def expire_timers(self) -> None:
        """Send the events of timers that are due (waits.py)."""
        raise NotImplementedError

    def serve_posts(self) -> None:
        """Wake the threads that were notified or get a unit of a semaphore (waits.py)."""
        raise NotImplementedError

    def idle(self) -> None:
        """Wait for an interrupt: the clock's, unless there is work."""
        if not self.has_work:
            self.tick()

    def schedule(self) -> None:
        """Do the kernel's work until a thread is ready, and let the scheduler pick one."""
        self.in_kernel = True
        while True:
            self.boundary()
            self.forced = False
            self.boundary()
            if self.has_work:
                self.work()
            self.boundary()
            if self.ready:
                break
            self.running = self.system
            self.idle()
        if self.scheduler.pick is not None:
            at = self.ready.index(self.scheduler.pick(self))
            self.ready = self.ready[at:] + self.ready[:at]
        self.in_kernel = False
        self.dispatch()

    def dispatch(self) -> None:
        self.running = self.ready[0]
        self.slice_over = False
        if self.running.state is State.NEW:
            self.running.state = State.READY

    def rotate(self) -> None:
        """End the slice of the running thread: it becomes the last ready one."""
        self.ready.append(self.ready.pop(0))
        if self.has_work or self.scheduler.pick is not None:
            self.schedule()
        else:
            self.dispatch()

    def resume(self) -> None:
        """Run the threads for ever. A thread returns here when it yields, blocks, is preempted, retires or ends."""
        while True:
            self.boundary()
            if (self.forced or self.slice_over) and not self.depth and self.started:
                if self.slice_over:
                    self.rotate()
                else:  # the running thread keeps its turn
                    self.schedule()
                continue
            try:
                reason = next(self.running.code)
            except (StopIteration, Ended):
                self.depth = 0
                self.in_kernel = True
                self.end(self.running)
                self.schedule()
                continue
            if reason == "block":
                self.schedule()
            elif reason == "yield":
                self.rotate()

    def settle(self) -> Step:
        """Yield the CPU if an interrupt requests it and no critical section is open."""
        if (self.forced or self.slice_over) and not self.depth and self.started:
            yield "preempted"

    @call("Sys_Yield", "T", None, blocks=True)
    def yield_(self) -> Step:
        yield "yield"

    @call("Sys_Sleep", "T", None, blocks=True)
    def sleep(self, ms: int) -> Step:
        if ms:
            yield from self.block(ms)
        else:
            yield "yield"

    @call("Sys_Run_SystemThread", "T", None, blocks=True)
    def run_system_thread(self) -> Step | None:
        if self.running is not self.system:
            self.refused = min(self.refused + 1, SATURATED)
            self.fail(Error.CONTEXT)
            return None
        return self.block(0)

    @call("Sys_Set_Scheduler", "MTHI")
    def set_scheduler(self, scheduler: Scheduler | None) -> bool:
        if scheduler is None:
            return self.fail(Error.ARGUMENT)
        self.scheduler = scheduler
        if scheduler.pick is None:
            self.forced = False
        return True

    @call("Sys_Wait_for_Period", "T", blocks=True)
    def wait_for_period(self) -> Step | bool:
        """Wait for the next release; True: the deadline was met."""
        if self.running.period is None:
            return self.fail(Error.PROCESS)
        return self.end_job(self.running.period)

    def end_job(self, period: Period) -> Step:
        met = self.now <= period.due
        if not met and not period.missed:
            self.report_miss(self.running)
        period.missed = False
        period.release += period.length
        period.due = period.release + period.deadline
        if period.release > self.now:
            yield from self.block(period.release - self.now)
        else:  # the next job is released already
            yield from self.settle()
            yield "yield"
        return met

    def report_miss(self, thread: Thread) -> None:
        assert thread.period is not None
        thread.period.missed = True
        self.deadlines_missed = min(self.deadlines_missed + 1, SATURATED)
        self.boundary()
        self.announce(DEADLINE_MISSED, thread.pid)

    def announce(self, number: int, value: int) -> None:
        """Send an event of the kernel's own (events.py)."""
        raise NotImplementedError

    # ---- Time ------------------------------------------------------------------------------------------------------

    def tick(self) -> None:
        """Clock interrupt, every 1 ms."""
        before, self.in_isr = self.in_isr, True
        self.now += 1
        if self.now == self.alarm:
            self.alarm_expired = True
        self.supervision_due |= self.supervises
        if self.has_work:
            self.preempt()
        self.announce(CLOCK, self.now)
        self.in_isr = before

    def set_alarm(self, moment: int) -> None:
        if self.alarm is None or moment < self.alarm:
            self.alarm = moment
        self.boundary()

    def expire(self) -> None:
        """Wake the threads whose time-out has expired, in order of blocking."""
        if self.alarm is not None and self.alarm <= self.now:
            self.alarm = None
        for thread in list(self.blocked):
            if thread.wake is None:
                continue
            if thread.wake <= self.now:
                self.wake(thread)
            else:
                self.set_alarm(thread.wake)

    @call("Sys_Get_SystemTime", "MTHI")
    def system_time(self) -> int:
        return self.now

    # ---- Questions -------------------------------------------------------------------------------------------------

    @call("Sys_Get_ProcessID", "MTHI")
    def process_id(self) -> int:
        return self.running.pid

    @call("Sys_Get_ProcessState", "MTH", State.UNKNOWN)
    def process_state(self, pid: int) -> State:
        thread = self.find(pid)
        if thread is None:
            return State.UNKNOWN
        return State.RUNNING if thread is self.running and not self.in_kernel else thread.state

    @call("Sys_Get_UnusedStack", "MTH", 0)
    def unused_stack(self, pid: int) -> int:
        """Return the stack's size: the POSIX port uses none of it."""
        thread = self.find(pid)
        return 0 if thread is None or thread.state is State.ZOMBIE else thread.stack

    @call("Sys_Get_UnusedKernelStack", "MTHI")
    def unused_kernel_stack(self) -> int:
        return self.sizes.kernel_stack

    @call("Sys_Get_Statistics", "MTHI")
    def statistics(self) -> tuple[int, int, int, int]:
        """Return heap peak, lost messages, refused calls and missed deadlines."""
        return self.peak, self.events_lost, self.refused, self.deadlines_missed

    @call("Sys_Start_Kernel", "M", None)
    def start_kernel(self) -> None:
        self.started = True
