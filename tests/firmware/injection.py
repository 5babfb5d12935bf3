"""Interrupts at every instruction of every kernel call, and every allocation failing, on the emulated robot.

What enters: the firmware of target/calls, whose scenes leave everything as they found it. What leaves: nothing, or an
AssertionError with scene, boundary and way of injection, which reproduce it.
tests/firmware/kernel/test_every_instruction.py takes a sample, tests/fuzz/kernel/fuzz_kernel.py all.
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
"""Tcy, or one less (kernel.md §3)."""
DEVICE_PERIOD = 1475
"""100 us in Tcy."""
TICK_MARGIN = 3000
"""Tcy around the timer's own tick in which none is added: two would fall together."""
MASKED = 40
"""Tcy for which levels 1-5 may be masked (kernel.md §6)."""
RECOGNISED = 6
"""Tcy from a flag to the exception entry: three instructions, one of which may take four (isa.md §14.2)."""
DSP = 25
"""Tcy more in which the frame of a SYS_DSP thread is saved or restored (port/dspic30f/README.md)."""
LEAF = 20
"""Tcy of the IPL 6 interrupt, which goes first: entry, five instructions, RETFIE."""
LEFT, CALLS = 64, 4
"""Bytes that interrupts and kernel leave to a thread with a stack of 128 (kernel.md §4); those of them the checker
uses for its call."""
PATIENCE = 200_000
MESSAGE, HEAP = 8, 3072
"""Bytes: a message of one word or less, the whole heap."""
HEARD, RECEIVED = 0x40, 0x09
"""Events: the one the device sends, SYS_UART1_RECEIVED."""
RETFIE = 0x064000
COMPARED = (*(f"W{n}" for n in range(15)), "RCOUNT", "TBLPAG", "PSVPAG", "CORCON", "SPLIM")
"""And the low byte of SR: the hardware itself stacks no more (isa.md §14.2)."""

ALL = 0xFFFF
"""Of isr_wanted: every call an interrupt may make, and every one it may not."""

WAYS = ("together", "nested")
"""Everything at the boundary; or the end of the slice first, the rest up to 44 instructions later."""


@dataclass
class Seen:
    """What a campaign went through, and the worst it saw."""

    boundaries: int = 0
    compared: int = 0
    interrupts: Counter[str] = field(default_factory=Counter)
    stepper_late: int = 0
    behind_dsp: int = 0
    """The same while DSP state was saved or restored."""
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
    """The begin of a scene, and what its end is compared with."""

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
        """DSP state was saved or restored since the last look."""
        run_to(self.machine, "scene_begin")
        self.bases = [self._base(scene) for scene in range(self._count())]

    def _next(self) -> int:
        """To the begin of the next scene; its number."""
        self.machine.step()
        run_to(self.machine, "scene_begin")
        return self.machine.peek("scene")

    def _count(self) -> int:
        """Scenes until the first comes again."""
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
        """Stop wherever the sweep wants to look; hooks are set once, because each makes the engine forget its code."""
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
        """The RETFIE behind a label of switch.S."""
        assert self.machine.image is not None
        address = place(self.machine, name)
        while self.machine.image.word(address) != RETFIE:
            address += 2
        return address

    def calls_of(self, number: int) -> int:
        """What the device's interrupt calls at a boundary: every call of the public headers, or one group of them
        alone, in turn, so that none hides what another did."""
        return ALL if number % 2 else 1 + number // 2 % self.machine.peek("isr_acts")

    def in_stepper(self) -> bool:
        """Whether the stepper's interrupt runs; it clears its flag last: a second one would fall together with it."""
        inside = self.machine.image.symbols.code(self.machine.pc) if self.machine.image else None
        return inside is not None and inside[0].name == "__T3Interrupt"

    def in_kernel(self) -> bool:
        """Whether the next instruction is the kernel's, a device's or the library's."""
        line = self.lines.find(self.machine.pc)
        return line is None or "target/calls" not in line.file


def sweep(
    path: Path,
    ipl_slip: int,
    way: str,
    stride: int = 1,
    phase: int = 0,
    first: int = 0,
    patch: dict[int, int] | None = None,
) -> Iterator[tuple[int, Seen]]:
    """Inject at every stride-th boundary of the kernel in every scene from `first` on; yields (scenes done, what was
    seen). `patch`: program words to be wrong by address."""
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
                    where = f"scene {scene}, boundary {number} at {machine.pc:#x}, {way}, slip {ipl_slip}"
                    try:
                        _inject(stage, base, number * 7 % 45 if way == "nested" else 0, stage.calls_of(number))
                    except AssertionError as error:
                        raise AssertionError(f"{where}: {error}") from error
                    machine.restore(here)
                number += 1
            if machine.step() is not None:  # a place the sweep stops at
                machine.step()
        _check_end(stage, base)
        yield scene + 1, stage.seen


def fail_every_allocation(path: Path) -> Iterator[tuple[int, int]]:
    """In every scene the k-th call of the allocator finds no memory, for every k; yields (scenes done, failures).

    A device that sends interrupts once; what it sends may be what fails.
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
        while calls >= wanted:  # the last round had a k-th call
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
    """End the function that was just called with 0."""
    machine.w[15] -= 4
    machine.w[0] = 0
    machine.pc = machine.peek(machine.w[15]) & 0xFFFE | (machine.peek(machine.w[15] + 2) & 0x7F) << 16


def _registers(machine: Machine) -> tuple[int, ...]:
    return machine.pc, machine.w[15], machine.peek("SR") & 0xFF, *(machine.peek(name) for name in COMPARED)


def _inject(stage: Stage, base: Base, later: int, calls: int) -> None:
    """The end of the slice, and `later` instructions later everything else at once, the device again every 100 us.

    `calls`: what the device's interrupt calls beside its event, the first time (target/calls/isr_calls.h).
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
    uart._rx_due(machine.cycle)  # a byte is complete in this very cycle
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
            is_first = machine.pc != saved[0]  # another interrupt is next; otherwise the code continues
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
    """Identifiers of the messages in the queue, whose last element its end must point to."""
    found: Counter[int] = Counter()
    link = machine.address_of("event_queue")
    while machine.peek(link):
        link = machine.peek(link)
        found[machine.peek(machine.peek(link + 2))] += 1
        assert found.total() < 20, "the message queue is endless"
    assert machine.peek("queue_end") == link, "the queue's end is wrong"
    return found


def _free_bytes(machine: Machine) -> int:
    """Heap that is not handed out, seen from outside (kernel/memory.c)."""
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
    """Subscriptions by event, every list well-formed."""
    found: Counter[int] = Counter()
    for head in words(machine, "events", 8):
        for event in _along(machine, head, 2):
            found[machine.peek(event)] += len(_along(machine, machine.peek(event + 4)))
    return found


def _unused_stack(machine: Machine) -> int:
    """Return the painted bytes of the checker's stack without the guard."""
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
    """At the end of a scene: nothing lost, nothing doubled, nothing leaked, every list well-formed."""
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
