"""Cost of the kernel's options: cycles of their calls; bytes of their code, variables and objects.

The `options` application runs scenes. The emulator counts cycles between symbols, as in `latency`. The numbers are
exact, and every run gives the same ones.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Final

from emu.image.footprint import pieces
from emu.image.model import Image
from emu.kernel_metrics.meter import Meter, Window
from emu.kernel_metrics.owners import handles
from emu.kernel_metrics.target import MeasureError, Target

APPLICATION: Final = "options_wanted"
"""Symbol by which the application is recognised."""
SCENES: Final = (
    *("LOCK", "LOCK_SECOND", "LOCK_TAKEN", "UNLOCK", "UNLOCK_SECOND", "UNLOCK_ONE_WAITS", "UNLOCK_TWO_WAIT"),
    *("UNLOCK_SECOND_ONE_WAITS", "UNLOCK_PRIORITIES", "UNLOCK_TO_BETTER", "START", "START_JOINABLE"),
    *(
        "JOIN_ZOMBIE",
        "JOIN_LIVING",
        "END",
        "END_JOINED",
        "PUSH",
        "PUSH_BEHIND_TWO",
        "POP",
        "POP_AND_RUN",
        "POP_BEHIND_TWO",
    ),
    *("END_CLEANED", "LIMIT", "SEND", "SEND_LIMITED", "SEND_LIMITED_BEHIND_FOUR", "SEND_DROPPED"),
    *("SEND_REPLACED", "SEND_SECOND_QUOTA", "SEND_NEIGHBOUR", "SEND_ELSEWHERE", "START_SERVICE", "FEED"),
    *("FEED_BEHIND_TWO", "TICK", "TICK_SERVICE", "TAKE", "TAKE_NONE", "SIGNAL", "SIGNAL_ONE_WAITS", "TAKE_BITS"),
    *("TAKE_NO_BITS", "NOTIFY", "NOTIFY_ONE_WAITS", "START_TIMER", "START_TIMER_BESIDE_TWO", "STOP_TIMER"),
    *("STOP_TIMER_BEHIND_TWO", "TICK_TIMER", "RESET_CAUSE", "START_WATCHDOG"),
)
"""Scenes in the order of the enumeration in firmware/apps/options/options.h."""
OPTIONS: Final = (
    "mutex",
    "join",
    "cleanup",
    "quota",
    "service",
    "semaphore",
    "notification",
    "timer",
    "reset",
    "watchdog",
    "woken_first",
)
"""Options: the names of their files in firmware/openswarm/option, without `.c`."""
KERNEL_PARTS: Final = {
    "_os_call_in_section": "cleanup", "_event_bucket": "quota", "_process_awaits": "semaphore"
}  # fmt: skip
"""Option of each kernel function that is linked only for an option. `_process_awaits` is counted for semaphores,
although notifications need it, too."""
OBJECTS: Final = {"sys_mutex": "mutex", "sys_cleanup": "cleanup", "sys_quota": "quota", "sys_service": "service",
                  "sys_semaphore": "semaphore", "sys_notification": "notification", "sys_timer": "timer"}  # fmt: skip
"""NAME of the application's variable `options_NAME`, by the type of the variable."""
HEAP: Final = (("a quota", "LIMIT", "options_done"), ("a zombie", "JOIN_ZOMBIE", "options_done"))
"""(name, scene, symbol): each row is the change of heap use while the scene runs from `options_ready` to the symbol."""
_ENDS_LATER: Final = ("END", "END_JOINED", "END_CLEANED", "TICK", "TICK_SERVICE", "TICK_TIMER")
"""Scenes in which the measured window begins after a delay. In all others the millisecond count must not change."""

MeasureFunction = Callable[[Meter], Window]


def until_return(call: str) -> MeasureFunction:
    """Measure from the first instruction of function `call` to the instruction to which it returns."""

    def take(meter: Meter) -> Window:
        meter.target.run_to(call)
        return meter.measure_until(meter.returned())

    return take


def until_entry(call: str, place: str) -> MeasureFunction:
    """Measure from the entry of function `call` until the CPU runs in function `place` at priority 0.

    It enters `place` there, or resumes a thread that was preempted in it.
    """

    def take(meter: Meter) -> Window:
        meter.target.run_to(call)
        there = meter.inside(place)
        return meter.measure_until(lambda: there() and meter.machine.state.ipl == 0)

    return take


def measures() -> Iterator[tuple[str, str, MeasureFunction]]:
    """Yield (name, scene, measuring function) of every row, in table order."""
    lock, unlock, send = "Sys_Lock_Mutex", "Sys_Unlock_Mutex", "Sys_Send_Event"
    yield f"{lock}", "LOCK", until_return(lock)
    yield f"{lock}, another thread owns another", "LOCK_SECOND", until_return(lock)
    yield f"{lock} of another thread's, to the next thread", "LOCK_TAKEN", until_entry(lock, "options_spin")
    yield f"{unlock}", "UNLOCK", until_return(unlock)
    yield f"{unlock}, another thread owns another", "UNLOCK_SECOND", until_return(unlock)
    yield f"{unlock}, one thread waits", "UNLOCK_ONE_WAITS", until_return(unlock)
    yield f"{unlock}, two threads wait", "UNLOCK_TWO_WAIT", until_return(unlock)
    yield f"{unlock}, one waits, another owns another", "UNLOCK_SECOND_ONE_WAITS", until_return(unlock)
    yield f"{unlock}, fixed priorities", "UNLOCK_PRIORITIES", until_return(unlock)
    yield f"{unlock}, a better thread waits, to that", "UNLOCK_TO_BETTER", until_entry(unlock, "options_woken")
    yield f"{unlock}, a better thread locks, unlocks, sleeps", "UNLOCK_TO_BETTER", until_return(unlock)
    yield "Sys_Start_ProcessWith, for comparison", "START", until_return("Sys_Start_ProcessWith")
    yield "Sys_Start_Joinable", "START_JOINABLE", until_return("Sys_Start_Joinable")
    yield "Sys_Join of a zombie", "JOIN_ZOMBIE", until_return("Sys_Join")
    yield "Sys_Join of a living thread, to the next thread", "JOIN_LIVING", until_entry("Sys_Join", "options_spin")
    yield "end of a thread, to the next, for comparison", "END", until_entry("os_thread_returned", "options_spin")
    yield "end of a thread, to the one that joins it", "END_JOINED", until_entry("os_thread_returned", "options_woken")
    yield "Sys_Push_Cleanup", "PUSH", until_return("Sys_Push_Cleanup")
    yield "Sys_Push_Cleanup, two of others are there", "PUSH_BEHIND_TWO", until_return("Sys_Push_Cleanup")
    yield "Sys_Pop_Cleanup", "POP", until_return("Sys_Pop_Cleanup")
    yield "Sys_Pop_Cleanup, an empty function is run", "POP_AND_RUN", until_return("Sys_Pop_Cleanup")
    yield "Sys_Pop_Cleanup, two of others are newer", "POP_BEHIND_TWO", until_return("Sys_Pop_Cleanup")
    yield "end of a thread, to its cleanup", "END_CLEANED", until_entry_on_kernel_stack("options_woken")
    yield "Sys_Limit_Event", "LIMIT", until_return("Sys_Limit_Event")
    yield "send 2 bytes, for comparison", "SEND", until_return(send)
    yield "send 2 bytes, limited", "SEND_LIMITED", until_return(send)
    yield "send 2 bytes, limited, four wait", "SEND_LIMITED_BEHIND_FOUR", until_return(send)
    yield "send 2 bytes, limited, a newer quota", "SEND_SECOND_QUOTA", until_return(send)
    yield "send 2 bytes, limited, dropped", "SEND_DROPPED", until_return(send)
    yield "send 2 bytes, the latest is replaced", "SEND_REPLACED", until_return(send)
    yield "send 2 bytes, another event of the bucket is limited", "SEND_NEIGHBOUR", until_return(send)
    yield "send 2 bytes, an event elsewhere is limited", "SEND_ELSEWHERE", until_return(send)
    yield "Sys_Start_Service", "START_SERVICE", until_return("Sys_Start_Service")
    yield "Sys_Feed_Watchdog", "FEED", until_return("Sys_Feed_Watchdog")
    yield "Sys_Feed_Watchdog, two services are newer", "FEED_BEHIND_TWO", until_return("Sys_Feed_Watchdog")
    yield "1 ms clock, idle, for comparison", "TICK", clock_until_idle
    yield "1 ms clock, idle, one service", "TICK_SERVICE", clock_until_idle
    take, signal, bits = "Sys_Wait_for_Semaphore", "Sys_Signal_Semaphore", "Sys_Wait_for_Notification"
    yield "Sys_Wait_for_Semaphore", "TAKE", until_return(take)
    yield "Sys_Wait_for_Semaphore without unit, to the next thread", "TAKE_NONE", until_entry(take, "options_spin")
    yield signal, "SIGNAL", until_return(signal)
    yield f"{signal}, a better thread waits, to that", "SIGNAL_ONE_WAITS", until_entry(signal, "options_woken")
    yield bits, "TAKE_BITS", until_return(bits)
    yield f"{bits} without bit, to the next thread", "TAKE_NO_BITS", until_entry(bits, "options_spin")
    yield "Sys_Notify", "NOTIFY", until_return("Sys_Notify")
    yield "Sys_Notify, a better thread waits, to that", "NOTIFY_ONE_WAITS", until_entry("Sys_Notify", "options_woken")
    yield "Sys_Start_Timer", "START_TIMER", until_return("Sys_Start_Timer")
    yield "Sys_Start_Timer, two others run", "START_TIMER_BESIDE_TWO", until_return("Sys_Start_Timer")
    yield "Sys_Stop_Timer", "STOP_TIMER", until_return("Sys_Stop_Timer")
    yield "Sys_Stop_Timer, two others are newer", "STOP_TIMER_BEHIND_TWO", until_return("Sys_Stop_Timer")
    yield "1 ms clock, idle, a timer sends without listeners", "TICK_TIMER", clock_until_idle
    yield "Sys_Get_ResetCause", "RESET_CAUSE", until_return("Sys_Get_ResetCause")
    yield "Sys_Start_HardwareWatchdog", "START_WATCHDOG", until_return("Sys_Start_HardwareWatchdog")


def until_entry_on_kernel_stack(place: str) -> MeasureFunction:
    """Measure from the end of a thread to the entry of a function that runs on the kernel's stack."""

    def take(meter: Meter) -> Window:
        meter.target.run_to("os_thread_returned")
        return meter.measure_until(meter.inside(place))

    return take


def clock_until_idle(meter: Meter) -> Window:
    """Measure from the clock's flag until the kernel is idle again."""
    for _ in range(2):
        meter.target.run_to("_T1Interrupt")
        idle = meter.target.address("hal_idle")
        window = meter.measure_until(lambda: meter.machine.pc == idle, meter.rise("T1"))  # noqa: B023
    return window


def _play(target: Target, scene: str, stop: str = "options_ready") -> Meter:
    target.restart()
    target.set_words(APPLICATION, (SCENES.index(scene),))
    target.run_to(stop)
    return Meter(target)


def run_measures(image: Image, engine: str = "auto") -> dict[str, Window]:
    """Perform all measurements. Raises MeasureError if a scene does not behave as expected."""
    target = Target(image, "options_begin", engine)
    taken: dict[str, Window] = {}
    for name, scene, take in measures():
        try:
            meter = _play(target, scene)
            before = target.words("now_ms", 1)
            taken[name] = take(meter)
        except MeasureError as error:
            raise MeasureError(f"{name}: {error}") from None
        if scene not in _ENDS_LATER and target.words("now_ms", 1) != before:
            raise MeasureError(f"{name}: disturbed by the clock interrupt")
    return taken


def sizes(image: Image, engine: str = "auto") -> dict[str, int]:
    """Return bytes by name: ROM and RAM of each option, of its objects, and its heap use."""
    target = Target(image, "options_begin", engine)
    found: dict[str, int] = {}
    parts = pieces(image)
    slots = handles(image)
    for option in OPTIONS:
        file = f"option/{option}.c"
        code = (part.rom for part in parts if part.module.endswith(file) or KERNEL_PARTS.get(part.name) == option)
        found[f"{option}: ROM"] = sum(code) + sum(size for module, size in slots if module.endswith(file))
        found[f"{option}: RAM"] = sum(part.ram for part in parts if part.module.endswith(file))
    found |= {f"{kind}: RAM of one": target.size(f"options_{name}") for kind, name in OBJECTS.items()}
    for what, scene, stop in HEAP:
        before = _play(target, scene).target.words("os_statistics", 1)[0]
        target.run_to(stop)
        found[f"{what}: heap"] = abs(target.words("os_statistics", 1)[0] - before)
    return found
