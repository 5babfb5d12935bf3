"""Cycles of the kernel's operations: the list of measurements and their execution.

The `latency` application runs a scenario. The emulator counts cycles between symbols; the firmware has no
instrumentation. Each measurement uses the first undisturbed occurrence after the scenario has settled. The numbers are
exact, and every run gives the same ones.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import astuple, dataclass
from typing import Final

from emu.image.model import Image
from emu.kernel_metrics.meter import Meter, Window
from emu.kernel_metrics.observation import DISI_LEVEL
from emu.kernel_metrics.target import MeasureError, Target
from emu.system.events import NEVER

APPLICATION: Final = "latency_wanted"
"""Symbol by which the application is recognised."""
DEVICE_LEVEL: Final = 4
"""Priority of C device interrupts (kernel.md §4)."""
ATTEMPTS: Final = 50
"""Maximum number of windows examined to find one without another interrupt."""
SETTLING: Final = 5
"""Number of thread switches that are skipped before the measured one, so that every thread has yielded once."""
CALL_CYCLES: Final = 2
"""Cycles of CALL and RCALL (isa.md §13.1)."""
MASK_STEPS: Final = 150_000
"""Number of instructions examined for the longest window with masked interrupts."""
JITTER_CYCLES: Final = 4_423_680
"""Tcy examined for the clock's jitter: 300 ms."""
BYTE_CYCLES: Final = 1280
"""Tcy of a byte at 115,200 baud (epuck.md §2)."""


@dataclass(frozen=True, slots=True)
class Scenario:
    """Request to the application; the fields are in the order of its request words."""

    threads: int = 0
    yielders: int = 0
    subscribers: int = 0
    waiters: int = 0
    events: int = 0
    payload: int = 2
    sender: int = 0


MeasureFunction = Callable[[Meter], Window]


@dataclass(frozen=True, slots=True)
class Measure:
    """One row of the table: name, scenario and function that measures it."""

    name: str
    scenario: Scenario
    take: MeasureFunction


def measures() -> Iterator[Measure]:
    """Yield all measurements of a window between two points, in table order."""
    for ready in (2, 4, 8):
        yield Measure(f"preemptive switch, {ready} ready threads", Scenario(threads=ready), preemption(ready))
    yield Measure("Sys_Yield to a yielded thread", Scenario(yielders=2), yield_switch("latency_yield"))
    yield Measure("Sys_Yield to a preempted thread", Scenario(threads=1, yielders=1), yield_switch("latency_spin"))
    for subscribers in (0, 1, 4):
        for payload in (2, 24):
            what = f"send {payload} bytes, {subscribers} subscriber{'s' if subscribers != 1 else ''}"
            yield Measure(f"{what}, thread", Scenario(subscribers=subscribers, payload=payload, sender=1), send_call)
            scenario = Scenario(threads=1, subscribers=subscribers, payload=payload)
            yield Measure(f"{what}, ISR", scenario, send_call_from_isr)
    for events in (8, 16):
        scenario = Scenario(subscribers=1, events=events, sender=1)
        yield Measure(f"send 2 bytes, 1 subscriber, thread, {events} more events", scenario, send_call)
    yield Measure("send to handler entry", Scenario(subscribers=1, sender=1), send_until_entry("latency_handler"))
    yield Measure("send to waiting thread running", Scenario(waiters=1, sender=2), send_until_entry("latency_woken"))
    yield Measure("C interrupt: flag to first instruction", Scenario(threads=1), isr_entry)
    yield Measure("C interrupt: last instruction to interrupted thread", Scenario(threads=1), isr_exit)
    yield Measure(
        "1 ms clock with nothing to do, thread running", Scenario(threads=1), clock_interrupt("T1", "_T1Interrupt")
    )
    yield Measure("1 ms clock with nothing to do, idle", Scenario(), clock_interrupt("T1", "_T1Interrupt", "hal_idle"))
    yield Measure("slice end with one ready thread", Scenario(threads=1), clock_interrupt("T2", "_T2Interrupt"))


def run_measures(image: Image, engine: str = "auto") -> dict[str, Window]:
    """Perform all measurements. Raises MeasureError if a scenario does not behave as expected."""
    target = Target(image, "latency_begin", engine)
    taken = {}
    for measure in measures():
        meter = _start(target, measure.scenario)
        try:
            taken[measure.name] = measure.take(meter)
        except MeasureError as error:
            raise MeasureError(f"{measure.name}: {error}") from None
    busy = Scenario(threads=1, yielders=1, subscribers=4, waiters=1, payload=24, sender=1)
    taken.update(masked(_start(target, busy)))
    busy = Scenario(yielders=1, subscribers=4, waiters=1, payload=24, sender=1)  # no thread spins
    taken["1 ms clock: worst jitter, busy kernel"] = jitter(_start(target, busy), b"")
    traffic = bytes(range(256)) * (JITTER_CYCLES // BYTE_CYCLES // 256 + 1)
    taken["1 ms clock: worst jitter, busy kernel and UART traffic"] = jitter(_start(target, busy), traffic)
    return taken


def _start(target: Target, scenario: Scenario) -> Meter:
    target.restart()
    target.set_words("latency_wanted", astuple(scenario))
    target.run_to("latency_ready")
    return Meter(target)


def _running(meter: Meter) -> int:
    return meter.target.words("os_running", 1)[0]


def _undisturbed(take: MeasureFunction) -> MeasureFunction:
    """Wrap a measuring function so that it returns the first window without an interrupt in it."""

    def taken(meter: Meter) -> Window:
        for _ in range(ATTEMPTS):
            window = take(meter)
            if not window.interrupted:
                return window
        raise MeasureError(f"disturbed {ATTEMPTS} times")

    return taken


def preemption(ready: int) -> MeasureFunction:
    """Measure from T2IF to the first instruction of the next thread, after every thread has been preempted once."""

    def take(meter: Meter) -> Window:
        target = meter.target
        for _ in range(ready + 2):
            target.run_to("_T2Interrupt")
            before = _running(meter)
            spinning = meter.inside("latency_spin")
            window = meter.measure_until(lambda: spinning() and meter.machine.state.ipl == 0, meter.rise("T2"))  # noqa: B023
        if before == _running(meter):
            raise MeasureError("the same thread continued")
        return window

    return take


def yield_switch(into: str) -> MeasureFunction:
    """Measure from the call of Sys_Yield to the first instruction of another thread, inside function `into`."""

    @_undisturbed
    def take(meter: Meter) -> Window:
        target = meter.target
        target.run_to("Sys_Yield")
        while _running(meter) == target.address("os_system"):
            meter.machine.step()
            target.run_to("Sys_Yield")
        before = _running(meter)
        arrived = meter.inside(into)
        return meter.measure_until(lambda: arrived() and _running(meter) != before, meter.machine.cycle - CALL_CYCLES)

    def settled(meter: Meter) -> Window:
        for _ in range(SETTLING):
            take(meter)
        return take(meter)

    return settled


def _to_send(meter: Meter) -> None:
    """Run to the first instruction of Sys_Send_Event when the application calls it."""
    meter.target.run_to("latency_send")
    meter.target.run_to("Sys_Send_Event")


@_undisturbed
def send_call(meter: Meter) -> Window:
    """Measure from the first instruction of Sys_Send_Event to the instruction after its call."""
    _to_send(meter)
    return meter.measure_until(meter.returned())


def _interrupt(meter: Meter) -> None:
    """Raise INT1 while a thread runs at priority 0."""
    meter.target.run_to("latency_spin")
    meter.measure_until(lambda: meter.machine.state.ipl == 0)
    meter.request("INT1", DEVICE_LEVEL)


@_undisturbed
def send_call_from_isr(meter: Meter) -> Window:
    """Measure a call of Sys_Send_Event from a C interrupt function."""
    _interrupt(meter)
    _to_send(meter)
    return meter.measure_until(meter.returned())


def isr_entry(meter: Meter) -> Window:
    """Measure from the rise of the interrupt flag to the first instruction of the C function."""
    _interrupt(meter)
    return meter.measure_until(meter.inside("latency_isr"), meter.rise("INT1"))


@_undisturbed
def isr_exit(meter: Meter) -> Window:
    """Measure from the return of the C function to the next instruction of the interrupted thread."""
    _interrupt(meter)
    meter.target.run_to("latency_isr")
    meter.release("INT1")
    meter.measure_until(meter.returned())
    spinning = meter.inside("latency_spin")
    return meter.measure_until(lambda: spinning() and meter.machine.state.ipl == 0)


def send_until_entry(name: str) -> MeasureFunction:
    """Measure from the first instruction of Sys_Send_Event to the first one of the function `name`."""

    @_undisturbed
    def take(meter: Meter) -> Window:
        _to_send(meter)
        return meter.measure_until(meter.inside(name))

    return take


def clock_interrupt(irq: str, vector: str, back: str = "latency_spin") -> MeasureFunction:
    """Measure from an interrupt's flag to the next instruction of the function that it interrupted or woke."""

    def take(meter: Meter) -> Window:
        for _ in range(2):
            level = meter.level(irq)
            meter.target.run_to(vector)
            there = meter.inside(back)
            window = meter.measure_until(lambda: there() and meter.machine.state.ipl < level, meter.rise(irq))  # noqa: B023
        return window

    return take


def jitter(meter: Meter, traffic: bytes) -> Window:
    """Measure how the time from the clock's flag to its interrupt varies while UART1 receives `traffic`."""
    machine = meter.machine
    late: list[int] = []

    def entered() -> bool:
        late.append(machine.cycle - meter.rise("T1"))
        return False

    machine.uart[1].feed(traffic)
    remove = machine.hook_pc(meter.target.address("_T1Interrupt"), entered)
    stop = machine.run(cycles=JITTER_CYCLES)
    remove()
    if stop.reason != "limit" or len(late) < JITTER_CYCLES // 14_746:
        raise MeasureError(f"only {len(late)} clock interrupts occurred: {stop.reason} {stop.detail}")
    return Window(max(late) - min(late), False)


def masked(meter: Meter) -> dict[str, Window]:
    """Measure the longest time for which interrupts of each priority 1..7 are masked, in the busiest scenario."""
    machine = meter.machine
    longest = {level: Window(0, False) for level in range(1, 8)}
    since: dict[int, tuple[int, int]] = {}
    for _ in range(MASK_STEPS):
        cycle, pc = machine.cycle, machine.pc
        if machine.service_boundary(NEVER) is not None:
            raise MeasureError("the scenario ended")
        entered = cycle if machine.pc != pc else machine.cycle
        now = max(machine.state.ipl, DISI_LEVEL if machine.state.disi_end > machine.cycle else 0)
        for level in range(1, 8):
            if now >= level:
                since.setdefault(level, (entered, machine.pc))
            elif level in since:
                begin, place = since.pop(level)
                if machine.cycle - begin > longest[level].cycles:
                    longest[level] = Window(machine.cycle - begin, False, Counter({place: machine.cycle - begin}))
        machine.step()
    return {f"longest time priority {level} is held back": window for level, window in longest.items()}
