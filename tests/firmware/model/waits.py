"""Model of race-free waiting: notifications, semaphores, and timers that send events."""

from __future__ import annotations

from tests.firmware.model.calls import call
from tests.firmware.model.options import Options
from tests.firmware.model.state import Code, Error, Notification, Semaphore, Sizes, Thread, Timer
from tests.firmware.model.threads import Step

LONGEST = 0x7FFF
"""Maximum delay and period of a timer, in ms."""


class Waits(Options):
    """A notification or signal only changes its object; the next thread switch wakes the waiting thread."""

    def __init__(self, sizes: Sizes, code: Code) -> None:
        super().__init__(sizes, code)
        self.posted = False
        """A notification or a semaphore has changed."""
        self.granted: set[Thread] = set()
        """Threads that have got a unit of a semaphore and have not run since."""
        self.timers: list[Timer] = []
        """Running timers, the last started first."""
        self.uses_timers = False

    @property
    def has_work(self) -> bool:
        return self.posted or super().has_work

    def post(self) -> None:
        self.posted = True
        self.preempt()

    def serve_posts(self) -> None:
        """Pass units of semaphores to threads in order of waiting, then wake notified threads."""
        if not self.posted:
            return
        self.posted = False
        for thread in list(self.blocked):
            semaphore = thread.awaited
            if isinstance(semaphore, Semaphore) and semaphore.count:
                semaphore.count -= 1
                self.wake(thread)
                self.granted.add(thread)
        for thread in list(self.blocked):
            if isinstance(thread.awaited, Notification) and thread.awaited.bits & thread.awaited.awaited:
                self.wake(thread)

    def is_awaited(self, waited: Notification | Semaphore) -> bool:
        return any(thread.awaited is waited for thread in self.blocked)

    # ---- Notifications --------------------------------------------------------------------------------------------

    @call("Sys_Notify", "MTHI", None)
    def notify(self, notification: Notification, bits: int) -> None:
        notification.bits |= bits
        self.post()

    @call("Sys_Notify_Value", "MTHI", None)
    def notify_value(self, notification: Notification, bits: int, value: int) -> None:
        notification.value = value
        notification.bits |= bits
        self.post()

    @call("Sys_Wait_for_Notification", "T", 0, blocks=True)
    def wait_for_notification(self, notification: Notification, bits: int, ms: int) -> Step:
        """Take all set bits among `bits`; if none is set, wait until one is."""
        if not bits or self.is_awaited(notification):
            self.fail(Error.BUSY if bits else Error.ARGUMENT)
            return 0
        if notification.bits & bits:
            return self.take(notification, bits)
        self.release_result(self.running)
        notification.awaited = bits
        yield from self.block(ms, notification)
        return self.take(notification, bits)

    def take(self, notification: Notification, bits: int) -> int:
        taken = notification.bits & bits
        notification.bits ^= taken
        return taken

    # ---- Semaphores -----------------------------------------------------------------------------------------------

    @call("Sys_Signal_Semaphore", "MTHI")
    def signal(self, semaphore: Semaphore) -> bool:
        if semaphore.count == 0xFFFF:
            return self.fail(Error.BUSY)
        semaphore.count += 1
        self.post()
        return True

    @call("Sys_Wait_for_Semaphore", "T", blocks=True)
    def wait_for_semaphore(self, semaphore: Semaphore) -> Step:
        return self.take_unit(semaphore, 0)

    @call("Sys_Wait_for_SemaphoreTimeout", "T", blocks=True)
    def wait_for_semaphore_timeout(self, semaphore: Semaphore, ms: int) -> Step:
        return self.take_unit(semaphore, ms)

    def take_unit(self, semaphore: Semaphore, ms: int) -> Step:
        """Take a unit. If there is none or a thread already waits, wait after the threads that wait."""
        if semaphore.count and not self.is_awaited(semaphore):
            semaphore.count -= 1
            return True
        thread = self.running
        self.release_result(thread)
        yield from self.block(ms, semaphore)
        if thread not in self.granted:
            return False
        self.granted.remove(thread)
        return True

    # ---- Timers ---------------------------------------------------------------------------------------------------

    @call("Sys_Start_Timer", "MTH")
    def start_timer(self, timer: Timer, event: int, value: int, first_ms: int, period_ms: int) -> bool:
        if not 0 < first_ms <= LONGEST or period_ms > LONGEST:
            return self.fail(Error.ARGUMENT)
        if timer in self.timers:
            self.timers.remove(timer)
        self.uses_timers = True
        self.expire()
        timer.event, timer.value, timer.due, timer.period = event, value, self.now + first_ms, period_ms
        self.set_alarm(timer.due)
        self.timers.insert(0, timer)
        return True

    @call("Sys_Stop_Timer", "MTH")
    def stop_timer(self, timer: Timer) -> bool:
        if timer not in self.timers:
            return self.fail(Error.PROCESS)
        self.timers.remove(timer)
        return True

    def expire_timers(self) -> None:
        """Send the events of the timers that are due, and deliver them. Missed periods are skipped."""
        if not self.uses_timers:
            return
        for timer in list(self.timers):
            if timer.due <= self.now:
                self.announce(timer.event, timer.value)
                if not timer.period:
                    self.timers.remove(timer)
                    continue
                while timer.due <= self.now:
                    timer.due += timer.period
            self.set_alarm(timer.due)
        self.deliver_queued()
