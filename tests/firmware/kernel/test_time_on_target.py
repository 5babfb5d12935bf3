"""Slices, masked windows, idle and motor steps of the kernel on the emulated robot."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import pytest

import emu
from emu import Machine
from emu.system.device import flag_since
from tests.firmware.conftest import TARGET_APPS, Build
from tests.firmware.kernel.test_kernel_on_target import FCY, INT1IF, T2IF, T3IF, load, place, run_to

SLICE = 147_456


@pytest.mark.slow
def test_a_thread_gets_its_whole_slice_under_a_storm(image: Build) -> None:
    """A thread gets its whole slice of 147,456 Tcy during an event storm and full UART traffic (kernel.md §3).

    The slice is measured from dispatch to the next T2 interrupt. Interrupt time counts, handler time does not. A
    handler that resends for ever starves no thread.
    """
    machine = load(image("slices", TARGET_APPS))
    machine.uart[1].feed(b"0123456789abcdef" * 150)
    ends: list[int] = []
    restarts: list[int] = []
    machine.hook_pc(place(machine, "_T2Interrupt"), lambda *_: ends.append(machine.cycle))
    machine.hook_sfr("TMR2", lambda write, _: restarts.append(machine.cycle) if write else None)
    machine.run(cycles=12 * SLICE)
    assert len(ends) >= 8, "the rest of the time is handlers'"
    slices = [end - max(at for at in restarts if at < end) for end in ends]
    late = [length - SLICE for length in slices]
    assert all(-8 <= extra <= 600 for extra in late), "one timer count, or ISRs of the storm, and nothing else"
    assert any(b - a > SLICE + 2_000 for a, b in pairwise(ends)), "handlers took their time between slices"
    assert all(machine.peek(machine.address_of("spins") + 2 * i) for i in range(3))
    assert machine.peek("stormed") - machine.peek("handled") <= 125
    assert machine.peek("resent") >= len(ends), "once in each drain"
    assert machine.peek("echoed") >= 40, "of 16 bytes each"


def count_clock(path: Path, ticks: int) -> str:
    """Run `ticks` clock events under the storm of target/slices; assert that each takes exactly 14,745.6 Tcy.

    Return a summary with the worst jitter of the clock interrupt in the first second.
    """
    machine = emu.load(path, engine="jit")
    flag_rose = flag_since(machine.record, machine.chip.sfrs["IFS0"].address, 3)
    late: list[int] = []

    def entered() -> bool:
        late.append(machine.cycle - machine.record.u64[flag_rose])
        return False

    def counts() -> tuple[int, int, int]:
        """Return (cycle of the last tick, number of ticks, number of clock events received)."""
        at = machine.address_of("clock_events")
        heard = machine.peek(at) + (machine.peek(at + 2) << 16)
        return machine.record.u64[flag_rose], machine.peek("now_ms") + (machine.peek("wraps") << 16), heard

    remove = machine.hook_pc(place(machine, "_T1Interrupt"), entered)
    machine.run(cycles=FCY)
    remove()
    while machine.peek("now_ms") % 5 or machine.peek("SR") & 0xE0:  # after the first tick of five periods
        machine.step()
    begin, ticks_before, heard_before = counts()
    machine.run(cycles=ticks * 73_728 // 5 + 3_000)
    end, ticks_after, heard_after = counts()
    assert ticks_after - ticks_before == ticks
    assert end - begin == ticks * 73_728 // 5
    assert abs(heard_after - heard_before - ticks) <= 11, "those of the running slice are not yet heard"
    return (
        f"{ticks:,} clock events in {end - begin:,} Tcy, {heard_after - heard_before:,} heard so far;"
        f" worst jitter {max(late) - min(late)} Tcy"
    )


@pytest.mark.slow
def test_ten_seconds_of_clock_events_are_exact(image: Build) -> None:
    """10,000 clock events take exactly 147,456,000 Tcy (kernel.md §3). tests/fuzz/kernel/fuzz_clock.py counts an
    hour."""
    assert "10,000 clock events in 147,456,000 Tcy" in count_clock(image("slices", TARGET_APPS), 10_000)


def masked_windows(machine: Machine, cycles: int) -> dict[int, int]:
    """Return the longest run of cycles with IPL >= level outside ISRs of that level, for levels 5 and 6."""
    longest = {5: 0, 6: 0}
    since: dict[int, int | None] = {5: None, 6: None}
    stepper = place(machine, "_T3Interrupt")
    end = machine.cycle + cycles
    inside_stepper = False
    while machine.cycle < end:
        inside_stepper = machine.pc == stepper or (inside_stepper and machine.peek("SR") >> 5 & 7 >= 5)
        machine.step()
        ipl = machine.peek("SR") >> 5 & 7
        for level in (5, 6):
            if ipl >= level and not inside_stepper:
                since[level] = machine.cycle if since[level] is None else since[level]
                longest[level] = max(longest[level], machine.cycle - (since[level] or 0))
            else:
                since[level] = None
    return longest


@pytest.mark.slow
def test_nothing_masks_the_stepper_for_long_or_the_camera_at_all(image: Build) -> None:
    """The kernel masks IPL 1-5 for at most 40 Tcy, and IPL 6 only around PWRSAV in the idle loop (kernel.md §6)."""
    machine = load(image("points", TARGET_APPS))
    run_to(machine, "scenario_begin")
    machine.step()
    run_to(machine, "scenario_begin")
    machine.poke("IFS0", machine.peek("IFS0") | T2IF | T3IF)
    windows = masked_windows(machine, 12_000)
    assert 10 <= windows[5] <= 40
    assert windows[6] == 0


@pytest.mark.slow
def test_an_interrupt_never_falls_between_the_test_and_the_sleep(image: Build) -> None:
    """A device interrupt at any instruction of the idle loop is handled at once, not 1 ms later (kernel.md §4)."""
    machine = load(image("latency"))
    run_to(machine, "latency_begin")
    wanted = machine.address_of("latency_wanted")
    machine.poke(wanted + 4, 1)  # one subscriber
    machine.poke(wanted + 10, 2)  # two bytes per message
    run_to(machine, "latency_ready")
    machine.write("IPC4", 4)
    machine.write("IEC1", INT1IF)
    clock = place(machine, "_T1Interrupt")
    run_to(machine, "_T1Interrupt")
    begin = machine.snapshot()
    handler = place(machine, "latency_handler")
    worst = boundary = 0
    asleep = 0
    while asleep < 3:  # from a clock interrupt until the core has slept for some time
        at = machine.snapshot()
        machine.write("IFS1", INT1IF)
        came = machine.cycle
        stop = machine.run(cycles=FCY // 1000, until=lambda: machine.pc in (handler, clock))
        assert stop.reason == "until"
        if machine.pc == clock:  # the interrupt was served before this one; its handler follows
            machine.run(cycles=2_000, until=handler)
        assert machine.pc == handler
        worst = max(worst, machine.cycle - came)
        machine.restore(at)
        before = machine.cycle
        machine.step()
        asleep += machine.cycle - before > 100
        boundary += 1
    machine.restore(begin)
    assert boundary > 50
    assert worst < 1_500, "far less than the 14,746 Tcy to the next clock interrupt"


@pytest.mark.parametrize("speed", [129, 100, 68, 1, -64, -129])
def test_the_average_motor_speed_is_exact(image: Build, speed: int) -> None:
    """The average motor speed is exact: v mm/s are v * 1000 / 129 steps/s (epuck.md §3).

    Driving forward decrements the left phase index and increments the right one.
    """
    machine = load(image("latency"))
    run_to(machine, "latency_ready")
    motors = machine.address_of("stepper_left")
    assert machine.peek("T3CON") == 0
    machine.poke(motors, -5 * speed & 0xFFFF)
    machine.poke(motors + 6, 0x0F)
    machine.poke(motors + 8, 5 * speed & 0xFFFF)
    machine.poke(motors + 14, 0x0F)
    machine.write("T3CON", 0x8000)
    machine.write("IEC0", machine.peek("IEC0") | T3IF)
    sequence = {0xA: 0, 0x6: 1, 0x5: 2, 0x9: 3}
    ticks = 0
    steps = [0, 0]
    last = [sequence[0xA], sequence[0xA]]
    rti = place(machine, "_T3Interrupt")

    def tick(*_: object) -> None:
        nonlocal ticks
        coils = machine.peek("LATD")
        ticks += 1
        if ticks == 1:
            return
        for motor, nibble in enumerate((coils & 15, coils >> 4 & 15)):
            index = sequence[nibble]
            steps[motor] += (index - last[motor] + 1) % 4 - 1
            last[motor] = index

    machine.hook_pc(rti, tick)
    machine.run(cycles=1536 * 700)
    exact = (ticks - 1) * 5 * speed / 6192
    assert abs(steps[1] - exact) <= 1
    assert abs(-steps[0] - exact) <= 1
