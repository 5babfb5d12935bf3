"""Time travel: a machine that can be put back to any earlier instruction, to the bit.

What enters: a machine, and everything that is done to it between runs. What leaves: the same machine at another time.
States are kept at intervals; any other is had by running again from the one before it. Runs repeat exactly, so only
what comes from outside between two runs must be kept: it shows as a difference to where the last run ended, and the
state with it is kept for good. What a listener does to the machine in the middle of a run is not known here.

Time is the cycle: no two states between two steps have the same. A step is an instruction, or the entry of an
interrupt: whoever stands on the first instruction of a handler stands between two steps.
"""

from __future__ import annotations

import zlib
from bisect import bisect_right
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from emu.system.events import NEVER

if TYPE_CHECKING:
    from emu.debug.environment import Around
    from emu.machine.machine import Machine
    from emu.machine.stops import Stop

PERIOD: Final = 1 << 20
"""Cycles between kept states: 71 ms of an e-puck, so a step back takes what running that long takes."""
MOST: Final = 4096
"""Kept states; beyond, of the older half every other one goes."""
FIRST_WINDOW, WIDER, WIDEST = 64, 16, 1 << 26
"""Cycles that are stepped to find the step before, and how they grow while the CPU sleeps."""
STACK_POINTER: Final = 15


@dataclass(frozen=True, slots=True)
class Kept:
    """A state: packed without flash, and flash, which is shared as long as it does not change."""

    cycle: int
    packed: bytes
    flash: bytes
    is_input: bool
    """Something came from outside just before."""


@dataclass(frozen=True, slots=True)
class Write:
    """An instruction that wrote to a place: it stands at `pc` and begins in `cycle`."""

    cycle: int
    pc: int
    old: bytes
    new: bytes


def place(machine: Machine) -> tuple[int, int]:
    """PC and stack pointer: what changes when an interrupt is entered."""
    return machine.pc, machine.w[STACK_POINTER]


class History:
    """Records `machine` from now on, if it is run with `advance` or `step` of this."""

    def __init__(self, machine: Machine, *, period: int = PERIOD, most: int = MOST) -> None:
        self.machine: Final = machine
        self.around: Around | None = None
        """What lives around the machine. It stands in the present while the machine alone goes back."""
        self.period: Final = period
        self.most: Final = most
        self._flash: Final = slice(
            machine.program.flash_offset, machine.program.flash_offset + machine.program.flash.nbytes
        )
        self._kept: list[Kept] = []
        self._cycles: list[int] = []
        self._ended = b""
        self._behind: tuple[int, list[int]] = (-1, [])
        """A cycle, and the cycles of the steps before it, oldest first: found by the last step back."""
        self.end = machine.cycle
        """The present: the latest cycle that was run to."""
        self._keep(machine.snapshot(), is_input=True)

    @property
    def start(self) -> int:
        """The earliest cycle one can go back to."""
        return self._cycles[0]

    @property
    def is_past(self) -> bool:
        """Whether the machine stands before `end`."""
        return self.machine.cycle < self.end

    @property
    def frozen(self) -> str:
        """Why the machine may not be changed now; empty if it may."""
        return ""

    @property
    def size(self) -> int:
        """Bytes kept."""
        flash = {id(one.flash): len(one.flash) for one in self._kept}
        return sum(len(one.packed) for one in self._kept) + sum(flash.values())

    # Going on

    def advance(self, cycle: int) -> Stop | None:
        """As `Machine.advance`. In the past it is the same again, input included, and nobody is told; but if the
        machine was changed, what came later is forgotten."""
        machine = self.machine
        self._notice()
        stop = None
        while stop is None and machine.cycle < cycle:
            place = bisect_right(self._cycles, machine.cycle)
            following = self._cycles[place] if place < len(self._cycles) else self._cycles[-1] + self.period
            target = min(cycle, max(following, machine.cycle + 1))
            if self.is_past:
                with self._silence():
                    stop = machine.run_until(min(target, self.end))
                self._take_input()
            else:
                stop = self._run_on(target)
                self._reached(following)
        self._ended = machine.snapshot()
        return stop

    def step(self) -> Stop | None:
        """As `Machine.step`, but that an interrupt is entered is a step of its own."""
        self._notice()
        following = self._cycles[-1] + self.period
        if self.is_past:
            with self._silence():
                stop = self._single()
            self._take_input()
        else:
            stop = self._step_on()
            self._reached(following)
        self._ended = self.machine.snapshot()
        return stop

    def _run_on(self, cycle: int) -> Stop | None:
        """Run beyond the present."""
        return self.machine.advance(cycle)

    def _step_on(self) -> Stop | None:
        """Step beyond the present."""
        return self._single()

    def _single(self) -> Stop | None:
        """One step. A sleeping CPU sleeps until something wakes it."""
        machine = self.machine
        before = place(machine)
        stop = machine.service_boundary(NEVER)
        if stop is not None:
            return stop
        return machine.run_until(machine.cycle) if place(machine) != before else machine.step()

    def _take_input(self) -> None:
        """What came from outside at this cycle comes again."""
        kept = self._kept[bisect_right(self._cycles, self.machine.cycle) - 1]
        if kept.is_input and kept.cycle == self.machine.cycle:
            with self._silence():
                self.machine.restore_record(self._state(kept))

    def _reached(self, following: int) -> None:
        cycle = self.machine.cycle
        if cycle > self.end:
            self.end = cycle
            if cycle >= following:
                self._keep(self.machine.snapshot(), is_input=False)

    def _notice(self) -> None:
        """Whether the machine is as the last run left it; if not, this is a new present."""
        state = self.machine.snapshot()
        if state == self._ended:
            return
        cycle = self.machine.cycle
        self._behind = (-1, [])
        place = bisect_right(self._cycles, cycle)
        if self._ended or cycle != self.start:
            del self._kept[place:], self._cycles[place:]
            self.end = cycle
            self._keep(state, is_input=True)
        self._ended = state

    def _keep(self, state: bytes, is_input: bool) -> None:
        flash = state[self._flash]
        if self._kept and self._kept[-1].flash == flash:
            flash = self._kept[-1].flash
        packed = zlib.compress(state[: self._flash.start] + state[self._flash.stop :], 1)
        self._kept.append(Kept(self.machine.cycle, packed, flash, is_input))
        self._cycles.append(self.machine.cycle)
        if len(self._kept) > self.most:
            self._thin()

    def _thin(self) -> None:
        half = len(self._kept) // 2
        old = [one for number, one in enumerate(self._kept[:half]) if one.is_input or number % 2 == 0]
        self._kept[:half] = old
        self._cycles = [one.cycle for one in self._kept]

    def _state(self, kept: Kept) -> bytes:
        rest = zlib.decompress(kept.packed)
        return rest[: self._flash.start] + kept.flash + rest[self._flash.start :]

    # Going back

    def seek(self, cycle: int) -> None:
        """Put the machine to `cycle`, which must be one it has stood in between two instructions, or to the first such
        behind it. Raises ValueError for a time that was not recorded."""
        if not self.start <= cycle <= self.end:
            raise ValueError(f"cycle {cycle:,} is not in the recording, {self.start:,} to {self.end:,}")
        self._notice()
        self._go(cycle)

    def _go(self, cycle: int) -> None:
        with self._silence():
            self._restore(cycle)
            if self.machine.cycle < cycle:
                self.machine.run_until(cycle)
        self._ended = self.machine.snapshot()

    def step_back(self) -> bool:
        """Go back by one step; false at the beginning of the recording."""
        self._notice()
        now = self.machine.cycle
        if now <= self.start:
            return False
        behind = self._behind[1] if self._behind[0] == now else []
        window = FIRST_WINDOW
        while not behind and window <= WIDEST:
            begin = max(self.start, now - window)
            behind = [cycle for cycle, _ in self._steps(begin, now)]
            if begin == self.start:
                break
            del behind[:1]  # `begin` may be where the CPU wakes to enter an interrupt: inside of a step
            window *= WIDER
        self._go(behind.pop() if behind else self.start)
        self._behind = (self.machine.cycle, behind)
        return True

    def _steps(self, begin: int, now: int) -> Iterator[tuple[int, int]]:
        """(cycle, PC) of the steps from `begin` to `now`, run again with their input. A sleep that began before `begin`
        is no step of its own."""
        machine = self.machine
        inputs = [kept for kept in self._kept if kept.is_input and begin < kept.cycle < now]
        with self._silence():
            base = self._restore(begin)
            if machine.cycle < begin:
                machine.run_until(begin)
            began_asleep = machine.is_asleep and machine.cycle != base
            while machine.cycle < now:
                if not began_asleep:
                    yield machine.cycle, machine.pc
                began_asleep = False
                self._single()
                if inputs and inputs[0].cycle <= machine.cycle:  # between two steps, or while the CPU sleeps
                    machine.restore_record(self._state(inputs.pop(0)))

    def before(self) -> Iterator[list[tuple[int, int]]]:
        """(cycle, PC) of the steps before now, oldest first, in longer and longer lists; the last begins where the
        recording does. The machine stands where it stood only after `seek`."""
        now = self.machine.cycle
        self._notice()
        window = FIRST_WINDOW
        while True:
            begin = max(self.start, now - window)
            positions = list(self._steps(begin, now))
            self._ended = self.machine.snapshot()
            yield positions
            if begin <= self.start or window > WIDEST:
                return
            window *= WIDER

    def run_back(self, places: Collection[int], condition: Callable[[], bool] | None = None) -> int | None:
        """Go back to the last arrival before now at one of the program addresses where `condition` holds; its address.
        None: there is none, and the machine stands at the beginning of the recording."""
        now = self.machine.cycle
        self._notice()
        last: int | None = None
        for begin, end in self._intervals(now):
            last = self._last_arrival(begin, end, places, condition)
            if last is not None:
                break
        self._go(self.start if last is None else last)
        return None if last is None else self.machine.pc

    def last_write(self, address: int, size: int, *, changes: bool = True) -> Write | None:
        """Go back to the instruction before now that wrote to one of the bytes last (with `changes`: other values), and
        stand before it. None: there is none, and the machine stands where it stood.

        Every instruction on the way back is looked at, one by one.
        """
        now = self.machine.cycle
        self._notice()
        for begin, end in self._intervals(now):
            found = self._last_write(begin, end, address, size, changes)
            if found is not None:
                self._go(found.cycle)
                return found
        self._go(now)
        return None

    def _intervals(self, now: int) -> Iterator[tuple[Kept, int]]:
        """Kept states from the latest before `now` back, each with the cycle up to which it is looked at."""
        end = now
        for kept in reversed(self._kept[: bisect_right(self._cycles, max(now - 1, self.start))]):
            yield kept, end
            end = kept.cycle

    def _last_arrival(
        self, begin: Kept, end: int, places: Collection[int], condition: Callable[[], bool] | None
    ) -> int | None:
        machine = self.machine
        last: int | None = None

        def arrived() -> bool:
            nonlocal last
            if machine.pc in places and machine.cycle < end and (condition is None or condition()):
                last = machine.cycle
            return False

        removals = [machine.hook_pc(place, lambda: False) for place in places]
        try:
            with self._silence():
                machine.restore_record(self._state(begin))
                machine.replay_condition = arrived
                machine.run_until(end)
        finally:
            machine.replay_condition = None
            for remove in removals:
                remove()
        return last

    def _last_write(self, begin: Kept, end: int, address: int, size: int, changes: bool) -> Write | None:
        machine, data = self.machine, self.machine.core.data
        found: Write | None = None
        hit = False
        write = data.write

        def noted(ea: int, value: int, width: int) -> None:
            nonlocal hit
            hit = hit or (ea < address + size and address < ea + width)
            write(ea, value, width)

        with self._silence():
            machine.restore_record(self._state(begin))
            vars(data)["write"] = noted
            try:
                while machine.cycle < end:
                    if machine.service_boundary(end) is not None or machine.cycle >= end:
                        break
                    cycle, pc = machine.cycle, machine.pc
                    old, hit = machine.peek_bytes(address, size), False
                    stop = machine.step()
                    new = machine.peek_bytes(address, size)
                    if new != old or (hit and not changes):
                        found = Write(cycle, pc, old, new)
                    if stop is not None:
                        break
            finally:
                del vars(data)["write"]
        return found

    def _restore(self, cycle: int) -> int:
        """Put the latest kept state at or before `cycle` back; returns its cycle."""
        kept = self._kept[max(bisect_right(self._cycles, cycle) - 1, 0)]
        self.machine.restore_record(self._state(kept))
        return kept.cycle

    @contextmanager
    def _silence(self) -> Iterator[None]:
        """Nobody hears what has been told already, nor are edges of pins that wait to be told taken for later ones."""
        self.machine.pins.flush()
        self.machine.peripherals.deliver_uart_output()
        events, held = self.machine.events, self.machine.save_host_state()
        quiet, events.quiet = events.quiet, True
        try:
            yield
        finally:
            self.machine.pins.flush()
            self.machine.peripherals.deliver_uart_output()
            events.quiet = quiet
            held()
