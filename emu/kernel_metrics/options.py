"""What the kernel's options cost: cycles of their calls, bytes of code, variables and objects.

The `options` application plays a scene; each window is counted from outside, between symbols, as in `latency`. Every
number is exact and repeats exactly.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Final

from emu.image.footprint import pieces
from emu.image.model import Image
from emu.kernel_metrics.meter import Meter, Window
from emu.kernel_metrics.shares import handles
from emu.kernel_metrics.target import MeasureError, Target

APPLICATION: Final = "options_wanted"
"""Symbol by which the application is told."""
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
    *("FEED_BEHIND_TWO", "TICK", "TICK_SERVICE"),
)
"""As the enumeration of firmware/apps/options/options.h."""
OPTIONS: Final = ("mutex", "join", "cleanup", "quota", "service", "woken_first")
"""Files of firmware/openswarm/option."""
KERNEL_PARTS: Final = {"_os_call_in_section": "cleanup", "_event_bucket": "quota"}
"""Functions of the kernel that are linked for an option alone."""
OBJECTS: Final = {"sys_mutex": "mutex", "sys_cleanup": "cleanup", "sys_quota": "quota", "sys_service": "service"}
"""Type, and the option one of which the application calls `options_` and that name."""
HEAP: Final = (("a quota", "LIMIT", "options_done"), ("a zombie", "JOIN_ZOMBIE", "options_done"))
"""What is taken from, or given back to, the heap between `options_ready` and another stop of a scene."""
_ENDS_LATER: Final = ("END", "END_JOINED", "END_CLEANED", "TICK", "TICK_SERVICE")
"""Scenes whose window begins when time has passed."""

Taken = Callable[[Meter], Window]


def returning(call: str) -> Taken:
    """From the first instruction of a call to the one behind it."""

    def take(meter: Meter) -> Window:
        meter.target.run_to(call)
        return meter.follow(meter.returned())

    return take


def reaching(call: str, place: str) -> Taken:
    """From the first instruction of a call to that of a function, or to where a thread goes on in it."""

    def take(meter: Meter) -> Window:
        meter.target.run_to(call)
        there = meter.inside(place)
        return meter.follow(lambda: there() and meter.machine.state.ipl == 0)

    return take


def measures() -> Iterator[tuple[str, str, Taken]]:
    """(name, scene, how it is taken) of every row, in the order they are printed."""
    lock, unlock, send = "Sys_Lock_Mutex", "Sys_Unlock_Mutex", "Sys_Send_Event"
    yield f"{lock}", "LOCK", returning(lock)
    yield f"{lock}, another thread owns another", "LOCK_SECOND", returning(lock)
    yield f"{lock} of another thread's, to the next thread", "LOCK_TAKEN", reaching(lock, "options_spin")
    yield f"{unlock}", "UNLOCK", returning(unlock)
    yield f"{unlock}, another thread owns another", "UNLOCK_SECOND", returning(unlock)
    yield f"{unlock}, one thread waits", "UNLOCK_ONE_WAITS", returning(unlock)
    yield f"{unlock}, two threads wait", "UNLOCK_TWO_WAIT", returning(unlock)
    yield f"{unlock}, one waits, another owns another", "UNLOCK_SECOND_ONE_WAITS", returning(unlock)
    yield f"{unlock}, fixed priorities", "UNLOCK_PRIORITIES", returning(unlock)
    yield f"{unlock}, a better thread waits, to that", "UNLOCK_TO_BETTER", reaching(unlock, "options_woken")
    yield f"{unlock}, a better thread locks, unlocks, sleeps", "UNLOCK_TO_BETTER", returning(unlock)
    yield "Sys_Start_ProcessWith, for comparison", "START", returning("Sys_Start_ProcessWith")
    yield "Sys_Start_Joinable", "START_JOINABLE", returning("Sys_Start_Joinable")
    yield "Sys_Join of a zombie", "JOIN_ZOMBIE", returning("Sys_Join")
    yield "Sys_Join of a living thread, to the next thread", "JOIN_LIVING", reaching("Sys_Join", "options_spin")
    yield "end of a thread, to the next, for comparison", "END", reaching("os_thread_returned", "options_spin")
    yield "end of a thread, to the one that joins it", "END_JOINED", reaching("os_thread_returned", "options_woken")
    yield "Sys_Push_Cleanup", "PUSH", returning("Sys_Push_Cleanup")
    yield "Sys_Push_Cleanup, two of others are there", "PUSH_BEHIND_TWO", returning("Sys_Push_Cleanup")
    yield "Sys_Pop_Cleanup", "POP", returning("Sys_Pop_Cleanup")
    yield "Sys_Pop_Cleanup, an empty function is run", "POP_AND_RUN", returning("Sys_Pop_Cleanup")
    yield "Sys_Pop_Cleanup, two of others are newer", "POP_BEHIND_TWO", returning("Sys_Pop_Cleanup")
    yield "end of a thread, to its cleanup", "END_CLEANED", reaching_on_kernel_stack("options_woken")
    yield "Sys_Limit_Event", "LIMIT", returning("Sys_Limit_Event")
    yield "send 2 bytes, for comparison", "SEND", returning(send)
    yield "send 2 bytes, limited", "SEND_LIMITED", returning(send)
    yield "send 2 bytes, limited, four wait", "SEND_LIMITED_BEHIND_FOUR", returning(send)
    yield "send 2 bytes, limited, a newer quota", "SEND_SECOND_QUOTA", returning(send)
    yield "send 2 bytes, limited, dropped", "SEND_DROPPED", returning(send)
    yield "send 2 bytes, the latest is replaced", "SEND_REPLACED", returning(send)
    yield "send 2 bytes, another event of the bucket is limited", "SEND_NEIGHBOUR", returning(send)
    yield "send 2 bytes, an event elsewhere is limited", "SEND_ELSEWHERE", returning(send)
    yield "Sys_Start_Service", "START_SERVICE", returning("Sys_Start_Service")
    yield "Sys_Feed_Watchdog", "FEED", returning("Sys_Feed_Watchdog")
    yield "Sys_Feed_Watchdog, two services are newer", "FEED_BEHIND_TWO", returning("Sys_Feed_Watchdog")
    yield "1 ms clock, idle, for comparison", "TICK", idle_again
    yield "1 ms clock, idle, one service", "TICK_SERVICE", idle_again


def reaching_on_kernel_stack(place: str) -> Taken:
    """From the end of a thread to the first instruction of a function that runs on the kernel stack."""

    def take(meter: Meter) -> Window:
        meter.target.run_to("os_thread_returned")
        return meter.follow(meter.inside(place))

    return take


def idle_again(meter: Meter) -> Window:
    """From the clock's flag until everything is worked off and the kernel idles again."""
    for _ in range(2):
        meter.target.run_to("_T1Interrupt")
        idle = meter.target.address("hal_idle")
        window = meter.follow(lambda: meter.machine.pc == idle, meter.rise("T1"))  # noqa: B023
    return window


def _play(target: Target, scene: str, stop: str = "options_ready") -> Meter:
    target.restart()
    target.set_words(APPLICATION, (SCENES.index(scene),))
    target.run_to(stop)
    return Meter(target)


def run_measures(image: Image, engine: str = "auto") -> dict[str, Window]:
    """Take all of them. Raises MeasureError when a scene does not show what it should."""
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
            raise MeasureError(f"{name}: the clock came in between")
    return taken


def sizes(image: Image, engine: str = "auto") -> dict[str, int]:
    """Bytes by name: ROM and RAM of each option, of its objects, and what it takes from the heap."""
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
