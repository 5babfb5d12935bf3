"""Fault injection on the emulated robot: interrupts at every instruction of kernel calls, and failing allocations.

Input is the firmware target/calls, whose scenes restore everything that they change. A deviation raises AssertionError
with scene, boundary and injection mode, which reproduce it.

tests/firmware/kernel/test_every_instruction.py runs a sample, tests/fuzz/kernel/fuzz_kernel.py runs the whole sweep.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from emu import Machine
from emu.system.events import NEVER
from tests.firmware.kernel.test_kernel_on_target import load, place, run_to, thread_list, words

T1IF, T2IF, T3IF, INT1IF, INT2IF = 1 << 3, 1 << 6, 1 << 7, 1 << 0, 1 << 7
CLOCK_PERIOD = 14746
"""Tcy between clock ticks; some periods are one shorter (kernel.md §3)."""
DEVICE_PERIOD = 1475
"""Tcy between interrupts of the simulated device: 100 us."""
TICK_MARGIN = 3000
"""Tcy before and after the timer's tick in which no tick is injected, because the two would coincide."""
MASKED = 40
"""Maximum Tcy for which the kernel masks levels 1-5 (kernel.md §6)."""
RECOGNISED = 6
"""Maximum Tcy from interrupt flag to exception entry: three instructions, one of up to four Tcy (isa.md §14.2)."""
DSP = 25
"""Additional masked Tcy while the frame of a SYS_DSP thread is saved or restored (port/dspic30f/README.md)."""
LEAF = 20
"""Tcy of the IPL 6 interrupt, which is served first: entry, five instructions, RETFIE."""
LEFT, CALLS = 64, 4
"""Stack bytes that interrupts and kernel leave free in a stack of 128 (kernel.md §4), and those of the checker's
call."""
PATIENCE = 200_000
MESSAGE, HEAP = 8, 3072
"""Heap bytes of a message of at most one word, and of the whole heap."""
HEARD, RECEIVED = 0x40, 0x09
"""Event that the device sends, and event SYS_UART1_RECEIVED."""
RETFIE = 0x064000
COMPARED = (*(f"W{n}" for n in range(15)), "RCOUNT", "TBLPAG", "PSVPAG", "CORCON", "SPLIM")
"""Registers compared across an interrupt, besides the low byte of SR; the hardware stacks only SR (isa.md §14.2)."""

ALL = 0xFFFF
"""Value of isr_wanted: the interrupt makes every permitted and every forbidden call."""

MODES = ("together", "nested")
"""Injection modes.

together: all interrupts at the boundary. nested: the slice ends at the boundary, the others follow up to 44
instructions later.
"""


@dataclass
class Seen:
    """Totals and worst values of a campaign."""

    boundaries: int = 0
    compared: int = 0
    interrupts: Counter[str] = field(default_factory=Counter)
    stepper_late: int = 0
    behind_dsp: int = 0
    """Maximum delay of the stepper in Tcy while DSP state was saved or restored."""
    stack_left: int = 128

    def __str__(self) -> str:
        counts = ", ".join(f"{count} {name}" for name, count in sorted(self.interrupts.items()))
        return (
            f"{self.boundaries} boundaries ({counts}); registers compared {self.compared} times; stepper at most"
            f" {self.stepper_late} Tcy late behind IPL 6, {self.behind_dsp} behind DSP state as well;"
            f" {self.stack_left} of 128 bytes of stack left"
        )


@dataclass(frozen=True)
class Base:
    """State at the start of a scene, and the values that the end of the scene must equal."""

    state: bytes
    used: int
    subscriptions: Counter[int]
    now_ms: int
    timer_at: int
    """Cycle of the timer's next tick."""


class Stage:
    """A machine that can be restored to the start of a scene any number of times."""

    def __init__(self, path: Path, ipl_slip: int = 0, patch: dict[int, int] | None = None) -> None:
        self.machine = load(path, ipl_slip)
        assert self.machine.image is not None
        for address, word in (patch or {}).items():
            self.machine.program.put_flash(address, [word])
        self.lines = self.machine.image.lines
        self.begin, self.end, self.leaf = (
            place(self.machine, n) for n in ("scene_begin", "scene_end", "_INT2Interrupt")
        )
        self.seen = Seen()
        self.stepper_at = 0
        self.switches_dsp = False
        """Whether DSP state has been saved or restored since the start of the current injection."""
        run_to(self.machine, "scene_begin")
        self.bases = [self._base(scene) for scene in range(self._count())]

    def _next(self) -> int:
        """Run to the start of the next scene and return its number."""
        self.machine.step()
        run_to(self.machine, "scene_begin")
        return self.machine.peek("scene")

    def _count(self) -> int:
        """Return the number of scenes in a round, counted until the first one repeats."""
        first = self.machine.peek("scene")
        return 1 + sum(1 for _ in iter(self._next, first))

    def _base(self, scene: int) -> Base:
        machine = self.machine
        while self._next() != scene:
            pass
        for counter in (
            "heard",
            "sent",
            "isr_sent",
            "isr_extra",
            "isr_wrong",
            "isr_wanted",
            "bytes",
            "leaf",
            "failures",
            "broken",
        ):
            machine.poke(counter, 0)
        timer_at = machine.cycle + machine.peek("PR1") - machine.peek("TMR1")
        now_ms = machine.peek("now_ms") + bool(machine.peek("IFS0") & T1IF)
        return Base(machine.snapshot(), machine.peek("os_statistics"), _subscriptions(machine), now_ms, timer_at)

    def watch(self) -> None:
        """Set the breakpoints of the sweep. They are set once, because each new one discards translated code."""
        machine = self.machine

        def stepper() -> bool:
            self.stepper_at = self.stepper_at or machine.cycle
            return False

        def dsp() -> bool:
            self.switches_dsp |= not self.stepper_at
            return False

        machine.hook_pc(self.end, lambda: True)
        machine.hook_pc(place(machine, "_T3Interrupt"), stepper)
        for name in ("save_dsp", "resume_dsp"):
            machine.hook_pc(place(machine, name), dsp)
        for name in ("os_isr_exit", "resume_preempted", "_INT2Interrupt", "_T3Interrupt"):
            machine.hook_pc(self._retfie(name), lambda: True)

    def _retfie(self, name: str) -> int:
        """Return the address of the RETFIE that follows a label of switch.S."""
        assert self.machine.image is not None
        address = place(self.machine, name)
        while self.machine.image.word(address) != RETFIE:
            address += 2
        return address

    def calls_of(self, number: int) -> int:
        """Return the value of isr_wanted at a boundary: all calls, or one group alone.

        Groups are run separately in turn so that one group's effects do not hide those of another.
        """
        return ALL if number % 2 else 1 + number // 2 % self.machine.peek("isr_acts")

    def in_stepper(self) -> bool:
        """Whether the stepper's interrupt runs. It clears its flag last, so that a second request would be lost."""
        inside = self.machine.image.symbols.code(self.machine.pc) if self.machine.image else None
        return inside is not None and inside[0].name == "__T3Interrupt"

    def in_kernel(self) -> bool:
        """Whether the next instruction belongs to the kernel, a device driver or the library."""
        line = self.lines.find(self.machine.pc)
        return line is None or "target/calls" not in line.file


def sweep(
    path: Path,
    ipl_slip: int,
    mode: str,
    stride: int = 1,
    phase: int = 0,
    first: int = 0,
    patch: dict[int, int] | None = None,
) -> Iterator[tuple[int, Seen]]:
    """Inject at every stride-th kernel boundary of each scene from `first` on; yield (number of scenes done, totals).

    `patch` maps addresses to faulty program words, with which the sweep must fail.
    """
    stage = Stage(path, ipl_slip, patch)
    stage.watch()
    machine = stage.machine
    number = phase
    for scene, base in enumerate(stage.bases[first:], first):
        machine.restore(base.state)
        machine.step()
        while machine.pc != stage.end:
            if stage.in_kernel():
                if number % stride == 0:
                    here = machine.snapshot()
                    where = f"scene {scene}, boundary {number} at {machine.pc:#x}, {mode}, slip {ipl_slip}"
                    try:
                        _inject(stage, base, number * 7 % 45 if mode == "nested" else 0, stage.calls_of(number))
                    except AssertionError as error:
                        raise AssertionError(f"{where}: {error}") from error
                    machine.restore(here)
                number += 1
            if machine.step() is not None:  # one of the sweep's breakpoints
                machine.step()
        _check_end(stage, base)
        yield scene + 1, stage.seen


def fail_every_allocation(path: Path) -> Iterator[tuple[int, int]]:
    """Make the k-th allocation of each scene fail, for every k; yield (number of scenes done, number of failures).

    A device requests its interrupt once, so that the failing allocation may also be that of the interrupt.
    """
    stage = Stage(path)
    machine = stage.machine
    calls = wanted = failed = 0

    def take() -> bool:
        nonlocal calls
        calls += 1
        return calls == wanted

    machine.hook_pc(stage.end, lambda: True)
    for allocator in ("heap_alloc", "heap_alloc_lasting"):
        machine.hook_pc(place(machine, allocator), take)
    for scene, base in enumerate(stage.bases):
        wanted = 0
        while calls >= wanted:  # the previous round reached its k-th allocation
            calls, wanted = 0, wanted + 1
            machine.restore(base.state)
            machine.step()
            machine.write("IFS1", machine.peek("IFS1") | INT1IF)
            while machine.pc != stage.end:
                assert machine.run(cycles=PATIENCE).reason == "breakpoint", (
                    f"scene {scene} hangs without its {wanted}th"
                )
                if machine.pc != stage.end:
                    _return_null(machine)
                    failed += 1
            try:
                _check_end(stage, base, raised=1, failing=True)
            except AssertionError as error:
                raise AssertionError(f"scene {scene}, allocation {wanted} fails: {error}") from error
        yield scene + 1, failed


def _return_null(machine: Machine) -> None:
    """Make the function that was just called return 0."""
    machine.w[15] -= 4
    machine.w[0] = 0
    machine.pc = machine.peek(machine.w[15]) & 0xFFFE | (machine.peek(machine.w[15] + 2) & 0x7F) << 16


def _registers(machine: Machine) -> tuple[int, ...]:
    return machine.pc, machine.w[15], machine.peek("SR") & 0xFF, *(machine.peek(name) for name in COMPARED)


def _inject(stage: Stage, base: Base, later: int, calls: int) -> None:
    """Inject the end of the slice, and all other interrupts together `later` instructions after it.

    The device repeats its interrupt every 100 us. `calls` selects the calls that its first interrupt makes besides
    sending its event (target/calls/isr_calls.h).
    """
    machine, seen = stage.machine, stage.seen
    seen.boundaries += 1
    stage.stepper_at, stage.switches_dsp = 0, False
    machine.write("IFS0", machine.peek("IFS0") | T2IF)
    for _ in range(later):
        if machine.pc != stage.end:
            machine.step()
    at, leaf = machine.cycle, machine.peek("leaf")
    stage.stepper_at = 0
    tick = not -TICK_MARGIN < at - base.timer_at < TICK_MARGIN
    step = not stage.in_stepper() and not machine.peek("IFS0") & T3IF
    machine.poke("isr_wanted", calls)
    uart = machine.uart[1]
    uart._incoming.value = ord("x")
    uart._rx_due(machine.cycle)  # a byte is complete in this cycle
    machine.write("IFS0", machine.peek("IFS0") | T2IF | T3IF * step | T1IF * tick)
    machine.write("IFS1", machine.peek("IFS1") | INT1IF | INT2IF)
    saved = _registers(machine)
    machine.service_boundary(NEVER)
    while machine.pc != stage.leaf:
        assert machine.cycle - at <= RECOGNISED, "the interrupt of IPL 6 was held back"
        machine.step()
        saved = _registers(machine)
        machine.service_boundary(NEVER)
    raised, is_first, periods = 1, True, 1
    while (stop := machine.run_until(at + DEVICE_PERIOD * periods)) is None or machine.pc != stage.end:
        if stop is None:
            periods += 1
            raised += not machine.peek("IFS1") & INT1IF
            machine.write("IFS1", machine.peek("IFS1") | INT1IF)
            assert periods < 50, "the scene does not end"
            continue
        assert stop.reason == "breakpoint", stop
        machine.step()
        if is_first and (machine.pc, machine.w[15]) == saved[:2]:
            now = _registers(machine)
            assert now == saved, f"registers {saved} became {now}"
            seen.compared += 1
            machine.service_boundary(NEVER)
            is_first = machine.pc != saved[0]  # unequal: another interrupt; equal: the code continues
    assert machine.peek("leaf") == leaf + 1
    if step:
        late, dsp = stage.stepper_at - at, stage.switches_dsp
        assert 0 < late <= MASKED + LEAF + DSP * dsp, f"the stepper came {late} Tcy late"
        if dsp:
            seen.behind_dsp = max(seen.behind_dsp, late)
        else:
            seen.stepper_late = max(seen.stepper_late, late)
    seen.interrupts.update(
        {"ticks": int(tick), "slices": 1, "device": raised, "bytes": 1, "steps": int(step), "IPL 6": 1}
    )
    _check_end(stage, base, raised, tick, byte=True)


def _queued(machine: Machine) -> Counter[int]:
    """Return the identifiers of the queued messages; assert that the queue's tail points to the last one."""
    found: Counter[int] = Counter()
    link = machine.address_of("event_queue")
    while machine.peek(link):
        link = machine.peek(link)
        found[machine.peek(machine.peek(link + 2))] += 1
        assert found.total() < 20, "the message queue is endless"
    assert machine.peek("queue_end") == link, "the queue's end is wrong"
    return found


def _free_bytes(machine: Machine) -> int:
    """Return the number of free heap bytes, computed from the allocator's data structures (kernel/memory.c)."""
    assert machine.image is not None
    free = machine.peek("reserve_end") - machine.peek("reserve_begin")
    free += machine.peek("free_run_end") - machine.peek("free_run")
    holes = [machine.peek("holes")]
    while holes:
        hole = holes.pop()
        if hole != machine.address_of("no_hole"):
            free += machine.peek(hole + 4)
            assert free <= HEAP, "the tree of holes is endless"
            holes += [machine.peek(hole), machine.peek(hole + 2)]
    return free


def _along(machine: Machine, at: int, link: int = 0) -> list[int]:
    found: list[int] = []
    while at:
        found.append(at)
        assert len(found) < 400, "a list is endless"
        at = machine.peek(at + link)
    assert len(set(found)) == len(found)
    return found


def _subscriptions(machine: Machine) -> Counter[int]:
    """Count the subscriptions of each event; assert that every list is well-formed."""
    found: Counter[int] = Counter()
    for head in words(machine, "events", 8):
        for event in _along(machine, head, 2):
            found[machine.peek(event)] += len(_along(machine, machine.peek(event + 4)))
    return found


def _unused_stack(machine: Machine) -> int:
    """Return the bytes of the checker's stack that still carry the fill pattern, without the guard."""
    pid = machine.peek("checker_pid")
    pcb = next(p for p in thread_list(machine) if machine.peek(p + 16) == pid)
    unused = 0
    for address in range(pcb - 14, machine.peek(pcb + 10), -2):
        if machine.peek(address) != 0xA5A5:
            break
        unused += 2
    return unused


def _check_end(
    stage: Stage, base: Base, raised: int = 0, tick: bool = False, byte: bool = False, failing: bool = False
) -> None:
    """Assert at the end of a scene that no message is lost or duplicated, no memory leaks and all lists are
    well-formed."""
    machine = stage.machine
    assert machine.peek("broken") == 0, "the checker found another value in a register"
    assert failing or machine.peek("failures") == 0, "a call gave another result"
    assert len(thread_list(machine)) == 3, "system, checker and driver"
    queued = _queued(machine)
    assert machine.peek("isr_wrong") == 0, "a call from an interrupt gave another result"
    sends = machine.peek("isr_sent")
    assert failing or sends + bool(machine.peek("IFS1") & INT1IF) == raised, f"{sends} of {raised} device interrupts"
    extra = machine.peek("isr_extra")
    assert machine.peek("heard") == machine.peek("sent") + sends + extra - queued[HEARD], (
        "an event was lost or came twice"
    )
    assert machine.peek("bytes") == byte - queued[RECEIVED], "a received byte was lost or came twice"
    came = (machine.peek("now_ms") - base.now_ms & 0xFFFF) + bool(machine.peek("IFS0") & T1IF)
    due = tick + (machine.cycle - base.timer_at + CLOCK_PERIOD) // CLOCK_PERIOD
    assert came == due, f"{came} of {due} ticks came"
    used, free = machine.peek("os_statistics"), _free_bytes(machine)
    assert used + free == HEAP, f"{used} bytes used and {free} free are not {HEAP}"
    assert used == base.used + MESSAGE * queued.total(), f"{base.used} bytes became {used}: memory leaked"
    assert _subscriptions(machine) == base.subscriptions, "subscriptions changed"
    left = _unused_stack(machine) + CALLS
    assert left >= LEFT, f"{left} bytes of stack left"
    stage.seen.stack_left = min(stage.seen.stack_left, left)
