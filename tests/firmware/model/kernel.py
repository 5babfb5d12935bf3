"""The kernel model: the order in which a thread is torn down, and the state after initialisation."""

from __future__ import annotations

from tests.firmware.model.calls import call
from tests.firmware.model.events import DRIVERS
from tests.firmware.model.remote import Remote
from tests.firmware.model.state import Code, Error, Message, Sizes, State, Thread
from tests.firmware.model.threads import CLOCK, TERMINATION

LEFT, RIGHT = 0x02, 0x03


class Kernel(Remote):
    """The kernel with the motor drivers, after Sys_Init_Kernel. `code` is what main executes from there on."""

    def __init__(self, sizes: Sizes, code: Code) -> None:
        super().__init__(sizes, code)
        self.speeds = [0, 0]
        """Speeds of the left and the right wheel in mm/s."""
        for number in (TERMINATION, CLOCK, LEFT, RIGHT):
            self.register(number)
        for number in (LEFT, RIGHT):
            self.add_subscription(self.events[number], DRIVERS, self.set_speed)

    # ---- End of a thread -------------------------------------------------------------------------------------------

    @call("Sys_Kill_Process", "MTH")
    def kill(self, pid: int) -> bool:
        """End a thread. If cleanups of other threads run on its stack, it ends after these cleanups."""
        if self.host is not None and self.host.pid == pid and pid:
            self.host_ends = True
            return True
        return super().kill(pid)

    def end(self, thread: Thread) -> None:
        """Tear a thread down in a fixed order: it leaves every list, its cleanups run, its memory is freed."""
        self.leave_lists(thread)
        thread.state, thread.awaited, thread.condition, thread.wake = State.ZOMBIE, None, None, None
        self.drop_subscriptions(thread.pid)
        self.release_result(thread)
        if self.running is thread:
            self.running = self.system
        self.leave_mutexes(thread)
        self.leave_joins(thread)
        self.leave_services(thread)
        self.run_cleanups(thread)

    def free_thread(self, thread: Thread) -> None:
        """Free a thread's memory, except the control block of a joinable one, which becomes a zombie; report its
        end."""
        period = self.sizes.period if thread.period is not None else 0
        if thread.stack == 0:  # a zombie that is killed
            self.free(self.sizes.thread)
        elif thread.joinable:
            self.free(period + thread.stack)
            thread.stack = 0
            self.blocked.append(thread)
        else:
            self.free(period + thread.stack + self.sizes.thread)
        self.announce(TERMINATION, thread.pid)

    # ---- Motors ----------------------------------------------------------------------------------------------------

    def set_speed(self, _pid: int, number: int, message: Message) -> bool:
        """Handler of the motor drivers: clamp the speed and drive the wheel."""
        speed = (message.value + 0x8000) % 0x10000 - 0x8000
        most = self.sizes.maximum_speed
        if abs(speed) > most:
            self.fail(Error.ARGUMENT)
        self.speeds[number - LEFT] = max(-most, min(most, speed))
        return True

    @call("Sys_Get_MotorSpeed_Left", "MTHI")
    def left_speed(self) -> int:
        return self.speeds[0]

    @call("Sys_Get_MotorSpeed_Right", "MTHI")
    def right_speed(self) -> int:
        return self.speeds[1]
