"""Time travel: restore a machine to any earlier instruction, bit for bit.

Inputs: a machine, and every change made to it between runs. Output: the same machine at another time. The history
stores states at intervals and restores any other state by replaying from the one before it. Runs are deterministic, so
only input between runs must be stored. The history detects input as a difference from the end of the last run, and
never discards the state that contains it. Changes that a callback makes during a run are not recorded.

Time is measured in cycles: no two states between steps have the same cycle. A step is an instruction or the entry of an
interrupt. A machine at the first instruction of a handler is therefore between two steps.
"""

from __future__ import annotations

import zlib
from bisect import bisect_right
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from emu.dspic30f.state.state import STACK_POINTER
from emu.machine.stops import SLEEP_CYCLES
from emu.system.events import NEVER

if TYPE_CHECKING:
    from emu.debug.environment import Environment
    from emu.machine.machine import Machine
    from emu.machine.stops import Stop

PERIOD: Final = 1 << 20
"""Cycles between stored states: 71 ms of an e-puck. A step back takes as long as a run of this length."""
MAX_STATES: Final = 4096
"""Maximum number of stored states. Beyond it, every other state of the older half is discarded."""
FIRST_WINDOW, WIDER, WIDEST = 64, 16, 1 << 26
"""Cycles replayed in single steps to find the previous step.

The values are: initial number, growth factor while the CPU sleeps, maximum number.
"""


@dataclass(frozen=True, slots=True)
class StoredState:
    """A compressed state of the machine without flash. Consecutive states share the flash until it changes."""

    cycle: int
    packed: bytes
    flash: bytes
    is_input: bool
    """Whether the machine received input immediately before this state."""


@dataclass(frozen=True, slots=True)
class Write:
    """A write to the observed bytes by the instruction at `pc` whose first cycle is `cycle`."""

    cycle: int
    pc: int
    old: bytes
    new: bytes


def position(machine: Machine) -> tuple[int, int]:
    """Return PC and stack pointer. The entry of an interrupt changes them."""
    return machine.pc, machine.w[STACK_POINTER]


class History:
    """Recorder of `machine`.

        >>> import emu
        >>> from emu.debug.history import History
        >>> machine = emu.load("firmware.elf")
        >>> history = History(machine)
        >>> history.advance(200_000)               # no stop before the limit, in Tcy
        >>> write = history.last_write(machine.address_of("count"), 2)     # a Write; states are kept as StoredState
        >>> machine.cycle == write.cycle, int.from_bytes(write.new, "little") - int.from_bytes(write.old, "little")
        (True, 1)
        >>> history.step_back(), history.is_past
        (True, True)
        >>> history.seek(history.end)

    From its creation on, `advance` and `step` of this class must run the machine.
    """

    def __init__(self, machine: Machine, *, period: int = PERIOD, max_states: int = MAX_STATES) -> None:
        self.machine: Final = machine
        self.environment: Environment | None = None
        """The machine's environment. It remains in the present while only the machine goes back."""
        self.period: Final = period
        self.max_states: Final = max_states
        self._flash: Final = slice(
            machine.program.flash_offset, machine.program.flash_offset + machine.program.flash.nbytes
        )
        self._states: list[StoredState] = []
        self._cycles: list[int] = []
        self._last_state = b""
        self._fault_stops: dict[int, Stop] = {}
        """Stops at faults by the cycle at which the machine stopped."""
        self._previous_steps: tuple[int, list[int]] = (-1, [])
        """A cycle and the (cycle, PC) list of steps before it, oldest first, as found by the last step back."""
        self.end = machine.cycle
        """The present: the latest cycle that the machine has reached."""
        self._store(machine.snapshot(), is_input=True)

    @property
    def start(self) -> int:
        """The earliest cycle of the recording."""
        return self._cycles[0]

    @property
    def is_past(self) -> bool:
        """Whether the machine is at a cycle before `end`."""
        return self.machine.cycle < self.end

    @property
    def read_only_reason(self) -> str:
        """Why the machine must not be changed now; empty if changes are permitted."""
        return ""

    @property
    def size(self) -> int:
        """Bytes used by the stored states."""
        flash = {id(one.flash): len(one.flash) for one in self._states}
        return sum(len(one.packed) for one in self._states) + sum(flash.values())

    # Forward execution

    def advance(self, cycle: int) -> Stop | None:
        """Run as `Machine.advance` does. In the past, replay the recording with its input and without observers.

        If the machine was changed in the past, the recording after that point is discarded.
        """
        machine = self.machine
        self._detect_change()
        stop = None
        while stop is None and machine.cycle < cycle:
            place = bisect_right(self._cycles, machine.cycle)
            following = self._cycles[place] if place < len(self._cycles) else self._cycles[-1] + self.period
            target = min(cycle, max(following, machine.cycle + 1))
            if self.is_past:
                with self._replaying():
                    stop = machine.run_until(min(target, self.end))
                self._replay_input()
                stop = self._recorded_stop(stop)
            else:
                stop = self._record_stop(self._advance_present(target))
                self._record_progress(following)
        self._last_state = machine.snapshot()
        return stop

    def step(self, limit: int | None = None) -> Stop | None:
        """Step as `Machine.step` does, but treat the entry of an interrupt as a step of its own.

        A sleep in the past continues into the present if nothing in the recording ends it.
        """
        self._detect_change()
        machine = self.machine
        limit = machine.cycle + SLEEP_CYCLES if limit is None else limit
        following = self._cycles[-1] + self.period
        while True:
            was_past = self.is_past
            if was_past:
                with self._replaying():
                    stop = self._step_once(min(limit, self.end, self._next_input()))
                self._replay_input()
                stop = self._recorded_stop(stop)
            else:
                stop = self._record_stop(self._step_present(limit))
                self._record_progress(following)
            if not (was_past and stop is not None and stop.reason == "limit" and machine.cycle < limit):
                break
        self._last_state = machine.snapshot()
        return stop

    def _record_stop(self, stop: Stop | None) -> Stop | None:
        """Keep the diagnosis of a fault at which the present run has stopped, and return `stop`."""
        if stop is not None and stop.fault is not None:
            self._fault_stops[self.machine.cycle] = stop
        return stop

    def _recorded_stop(self, stop: Stop | None) -> Stop | None:
        """Return a stop of the replay as the original run reported it: replayed faults are not diagnosed.

        A loop of resets ends the recording, but no replay.
        """
        return None if stop is None and self.is_past else self._fault_stops.get(self.machine.cycle, stop)

    def _next_input(self) -> int:
        """Return the next recorded cycle at which the machine received input; NEVER if there is none."""
        place = bisect_right(self._cycles, self.machine.cycle)
        return next((stored.cycle for stored in self._states[place:] if stored.is_input), NEVER)

    def _advance_present(self, cycle: int) -> Stop | None:
        """Run from the present to `cycle`."""
        return self.machine.advance(cycle)

    def _step_present(self, limit: int) -> Stop | None:
        """Step from the present; a sleeping CPU sleeps at most to cycle `limit`."""
        return self._step_once(limit)

    def _step_once(self, limit: int) -> Stop | None:
        """Make one step. A sleeping CPU sleeps until an event wakes it, at most to cycle `limit`."""
        machine = self.machine
        start = position(machine)
        stop = machine.service_boundary(limit)
        if stop is not None:
            return stop
        return machine.run_until(machine.cycle) if position(machine) != start else machine.step(limit)

    def _replay_input(self) -> None:
        """Restore the state with the input that the machine received at this cycle."""
        stored = self._states[bisect_right(self._cycles, self.machine.cycle) - 1]
        if stored.is_input and stored.cycle == self.machine.cycle:
            with self._replaying():
                self.machine.restore_state(self._unpacked(stored))

    def _record_progress(self, following: int) -> None:
        cycle = self.machine.cycle
        if cycle > self.end:
            self.end = cycle
            if cycle >= following:
                self._store(self.machine.snapshot(), is_input=False)

    def _detect_change(self) -> None:
        """If the machine was changed since the last run, store a new state and make this cycle the present."""
        state = self.machine.snapshot()
        if state == self._last_state:
            return
        cycle = self.machine.cycle
        self._previous_steps = (-1, [])
        place = bisect_right(self._cycles, cycle)
        if self._last_state or cycle != self.start:
            del self._states[place:], self._cycles[place:]
            self._fault_stops = {at: stop for at, stop in self._fault_stops.items() if at <= cycle}
            self.end = cycle
            self._store(state, is_input=True)
        self._last_state = state

    def _store(self, state: bytes, is_input: bool) -> None:
        flash = state[self._flash]
        if self._states and self._states[-1].flash == flash:
            flash = self._states[-1].flash
        packed = zlib.compress(state[: self._flash.start] + state[self._flash.stop :], 1)
        self._states.append(StoredState(self.machine.cycle, packed, flash, is_input))
        self._cycles.append(self.machine.cycle)
        if len(self._states) > self.max_states:
            self._discard_states()

    def _discard_states(self) -> None:
        half = len(self._states) // 2
        old = [one for number, one in enumerate(self._states[:half]) if one.is_input or number % 2 == 0]
        self._states[:half] = old
        self._cycles = [one.cycle for one in self._states]

    def _unpacked(self, stored: StoredState) -> bytes:
        rest = zlib.decompress(stored.packed)
        return rest[: self._flash.start] + stored.flash + rest[self._flash.start :]

    # Reverse execution

    def seek(self, cycle: int) -> None:
        """Restore the machine to `cycle`, or to the first instruction boundary after it.

        Raises ValueError for a cycle that is not in the recording.
        """
        if not self.start <= cycle <= self.end:
            raise ValueError(f"cycle {cycle:,} is not in the recording, {self.start:,} to {self.end:,}")
        self._detect_change()
        self._goto(cycle)

    def _goto(self, cycle: int) -> None:
        with self._replaying():
            self._restore(cycle)
            if self.machine.cycle < cycle:
                self.machine.run_until(cycle)
        self._last_state = self.machine.snapshot()

    def step_back(self) -> bool:
        """Go back by one step. Return False at the start of the recording."""
        self._detect_change()
        now = self.machine.cycle
        if now <= self.start:
            return False
        behind = self._previous_steps[1] if self._previous_steps[0] == now else []
        window = FIRST_WINDOW
        while not behind and window <= WIDEST:
            begin = max(self.start, now - window)
            behind = [cycle for cycle, _ in self._steps(begin, now)]
            if begin == self.start:
                break
            del behind[:1]  # at `begin` the CPU may wake and enter an interrupt, which is inside a step
            window *= WIDER
        self._goto(behind.pop() if behind else self.start)
        self._previous_steps = (self.machine.cycle, behind)
        return True

    def _steps(self, begin: int, now: int) -> Iterator[tuple[int, int]]:
        """Replay from `begin` to `now`. Yield (cycle, PC) of every step.

        A sleep that began before `begin` does not count as a step.
        """
        machine = self.machine
        inputs = [stored for stored in self._states if stored.is_input and begin < stored.cycle < now]
        with self._replaying():
            base = self._restore(begin)
            if machine.cycle < begin:
                machine.run_until(begin)
            began_asleep = machine.is_asleep and machine.cycle != base
            while machine.cycle < now:
                if not began_asleep:
                    yield machine.cycle, machine.pc
                began_asleep = False
                self._step_once(inputs[0].cycle if inputs else now)
                if inputs and inputs[0].cycle <= machine.cycle:  # between two steps, or while the CPU sleeps
                    machine.restore_state(self._unpacked(inputs.pop(0)))

    def earlier_steps(self) -> Iterator[list[tuple[int, int]]]:
        """Yield ever longer lists of the steps before now, as (cycle, PC), oldest first.

        The last list begins at the start of the recording. Call `seek` afterwards to restore the machine.
        """
        now = self.machine.cycle
        self._detect_change()
        window = FIRST_WINDOW
        while True:
            begin = max(self.start, now - window)
            positions = list(self._steps(begin, now))
            self._last_state = self.machine.snapshot()
            yield positions
            if begin <= self.start or window > WIDEST:
                return
            window *= WIDER

    def run_back(self, places: Collection[int], condition: Callable[[], bool] | None = None) -> int | None:
        """Go back to the previous hit of one of the program addresses `places` at which `condition` holds.

        Return that address. If there is no hit, return None and leave the machine at the start of the recording.
        """
        with self._searching() as now:
            last: int | None = None
            for begin, end in self._intervals_before(now):
                last = self._last_arrival(begin, end, places, condition)
                if last is not None:
                    break
        self._goto(self.start if last is None else last)
        return None if last is None else self.machine.pc

    def last_write(self, address: int, size: int, *, changes: bool = True) -> Write | None:
        """Go back to just before the last instruction that wrote one of the bytes.

        With `changes`, only writes that changed a byte count.

        If there is none, return None and leave the machine unchanged. The replay executes every instruction as a
        single step.
        """
        with self._searching() as now:
            for begin, end in self._intervals_before(now):
                found = self._last_write(begin, end, address, size, changes)
                if found is not None:
                    self._goto(found.cycle)
                    return found
            self._goto(now)
        return None

    @contextmanager
    def _searching(self) -> Iterator[int]:
        """Search the recording before the current cycle, which is yielded. The machine returns there on an error."""
        self._detect_change()
        now = self.machine.cycle
        try:
            yield now
        except Exception:
            self._goto(now)
            raise

    def _intervals_before(self, now: int) -> Iterator[tuple[StoredState, int]]:
        """Yield stored states backwards, from the latest one before `now`. Each comes with the end of its interval."""
        end = now
        for stored in reversed(self._states[: bisect_right(self._cycles, max(now - 1, self.start))]):
            yield stored, end
            end = stored.cycle

    def _last_arrival(
        self, begin: StoredState, end: int, places: Collection[int], condition: Callable[[], bool] | None
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
            with self._replaying():
                machine.restore_state(self._unpacked(begin))
                machine.replay_condition = arrived
                machine.run_until(end)
        finally:
            machine.replay_condition = None
            for remove in removals:
                remove()
        return last

    def _last_write(self, begin: StoredState, end: int, address: int, size: int, changes: bool) -> Write | None:
        machine, data = self.machine, self.machine.core.data
        found: Write | None = None
        hit = False
        write = data.write

        def noted(ea: int, value: int, width: int) -> None:
            nonlocal hit
            hit = hit or (ea < address + size and address < ea + width)
            write(ea, value, width)

        with self._replaying():
            machine.restore_state(self._unpacked(begin))
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
        """Restore the latest stored state at or before `cycle`, and return its cycle."""
        stored = self._states[max(bisect_right(self._cycles, cycle) - 1, 0)]
        self.machine.restore_state(self._unpacked(stored))
        return stored.cycle

    @contextmanager
    def _replaying(self) -> Iterator[None]:
        """Replay without observers inside the block. Report pending pin edges before it."""
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
