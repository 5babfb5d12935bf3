"""Execution control of the debugged machine: run and step in both directions, breakpoints.

Inputs: the user's commands. Outputs: `StopEvent`s with the reason of each stop. A `History` records every run, so that
every forward run can be reversed.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, cast

from emu.dap.breakpoints import Breakpoint
from emu.dap.logged_writes import can_log_writes, logged_writes, site_of
from emu.debug.dwarf.units import Scope
from emu.debug.expressions.condition_filters import filter_of
from emu.debug.frame import Frame
from emu.debug.history import History
from emu.debug.inlining import inlined_at
from emu.debug.inspector import Inspector
from emu.debug.processor import Processor
from emu.debug.threads import Thread, Threads
from emu.image.lines import SourceLine
from emu.machine.stops import CHANGED, SLEEP_CYCLES, STILL_ASLEEP
from emu.system.hook_filters import Filter

if TYPE_CHECKING:
    from emu.debug.avr.machine import DebuggedKilobot
    from emu.dspic30f.change_log import Change
    from emu.machine.machine import Machine
    from emu.machine.stops import Stop

SLICE_CYCLES: Final = 400_000
"""Cycles between two polls for requests of the client."""
POLL_STEPS: Final = 2_000
"""Single steps between two polls for requests of the client."""


@dataclass(frozen=True, slots=True)
class StopEvent:
    """Reason why the machine is paused, in the terms of the protocol."""

    reason: str
    description: str = ""
    breakpoints: tuple[int, ...] = ()
    stop: Stop | None = None


class Debuggee:
    """Execution control of `machine`.

    `is_stop_requested()` says whether the client has requested a pause. `write_output(text)` prints log messages.
    """

    def __init__(
        self,
        machine: Machine,
        is_stop_requested: Callable[[], bool],
        write_output: Callable[[str], None],
        history: History,
    ) -> None:
        self.machine: Final = machine
        self.inspector: Final = Inspector(machine)
        self.history: Final = history
        self.breakpoints: Final[dict[str, list[Breakpoint]]] = {}
        """Breakpoints by kind; source breakpoints by file."""
        self.stops_at_faults = True
        self._is_stop_requested: Final = is_stop_requested
        self._write_output: Final = write_output
        self._hooks: list[Callable[[], None]] = []
        self._hit: list[int] = []
        self._run_target: tuple[Collection[int], Callable[[], bool]] | None = None
        self._limit: int | None = None
        """Cycle at which the run ends."""

    @property
    def _processor(self) -> Processor:
        return self.inspector.processor

    @property
    def _kilobot(self) -> DebuggedKilobot:
        """The machine as a Kilobot. Only a Kilobot's processor has no native instruments."""
        return cast("DebuggedKilobot", self.machine)

    @property
    def stack(self) -> int:
        """Value of the stack pointer."""
        return self.machine.w[self._processor.stack_pointer]

    # Breakpoints

    def set_breakpoints(self, key: str, breakpoints: list[Breakpoint]) -> None:
        """Replace one list of breakpoints. A breakpoint that is in both lists keeps its hit count."""
        for one in breakpoints:
            one.hits = next((old.hits for old in self.breakpoints.get(key, []) if old.is_same(one)), 0)
        self.breakpoints[key] = breakpoints
        self._update_hooks()

    def all(self) -> list[Breakpoint]:
        """Return all breakpoints."""
        return [one for some in self.breakpoints.values() for one in some]

    def _breakpoint_addresses(self) -> set[int]:
        """Return the program addresses of all breakpoints."""
        return {place for one in self.all() if one.kind != "data" for place in one.addresses}

    def _update_hooks(self) -> None:
        for remove in self._hooks:
            remove()
        addresses = self._breakpoint_addresses()
        if self._run_target is not None:
            addresses |= set(self._run_target[0])
        self._hooks = [
            self.machine.hook_pc(place, self._is_breakpoint_hit, filter_)
            for place in sorted(addresses)
            for filter_ in self._filters_at(place)
        ]

    def _filters_at(self, place: int) -> list[Filter | None]:
        """Return the filter of the breakpoints at an address; None if every arrival matters or there are several."""
        conditions = [one.condition for one in self.all() if one.kind != "data" and place in one.addresses]
        is_target = self._run_target is not None and place in self._run_target[0]
        native = self._processor.has_native_instruments
        if is_target or len(conditions) != 1 or not conditions[0] or not native:
            return [None]
        return [filter_of(self.inspector, conditions[0], place)]

    def _is_breakpoint_hit(self) -> bool:
        """Mark the breakpoints at the current PC that are hit. Return whether the run stops here."""
        pc = self.machine.pc
        self._hit = [
            one.id
            for one in self.all()
            if one.kind != "data" and pc in one.addresses and one.should_stop(self.inspector, self._write_output)
        ]
        extra = self._run_target is not None and pc in self._run_target[0] and self._run_target[1]()
        return bool(self._hit) or extra

    # Forward execution

    def resume(self) -> StopEvent:
        """Run until a stop."""
        event = None if self.machine.is_asleep else self._step()
        if event is not None:
            return event
        return self._run() or StopEvent("pause")

    def _run(self) -> StopEvent | None:
        """Run until a stop. Return None for a requested pause and at the target of `run_to`."""
        data = [one for one in self.all() if one.kind == "data"]
        if data and not self._processor.has_native_instruments:
            with self._kilobot.watching(data[0].addresses[0], data[0].size):
                return self._run_slices(data, [])
        is_simple = self.history.environment is None and not self.history.is_past
        if data and is_simple and can_log_writes(self.machine, data):
            with logged_writes(self.machine, data) as writes:
                return self._run_slices(data, writes)
        return self._run_slices(data, None)

    def _run_slices(self, data: list[Breakpoint], writes: list[Change] | None) -> StopEvent | None:
        """Run until a stop. Native code logs what the data breakpoints observe to `writes`; None: single steps."""
        while not self._is_stop_requested() and not self._is_limit_reached():
            self._hit = []
            if data and writes is None:
                event = self._run_with_data_breakpoints(data)
                if event is not None or self._is_at_target():
                    return event
                continue
            self.machine.replay_condition = self._is_breakpoint_hit
            try:
                stop = self.history.advance(min(self.machine.cycle + SLICE_CYCLES, self._limit or sys.maxsize))
            finally:
                self.machine.replay_condition = None
            if stop is not None and stop.detail == CHANGED:
                event = self._event_of_change(data[0])
                if event is not None:
                    return event
                continue
            if writes:
                event = self._event_of_writes(data, writes)
                writes.clear()
                if event is not None:
                    return event
                stop = None if stop is None or stop.reason == "interrupted" else stop
            if stop is None:
                continue
            if stop.reason == "breakpoint" and not stop.detail:
                return StopEvent("breakpoint", breakpoints=tuple(self._hit)) if self._hit else None
            event = self._event_of_stop(stop)
            if event is not None:
                return event
        return None

    def _event_of_writes(self, data: list[Breakpoint], writes: list[Change]) -> StopEvent | None:
        """Return the event for logged writes; None if every data breakpoint that was hit continues."""
        hit = [data[number] for number in sorted({one.number for one in writes})]
        ids = tuple(one.id for one in hit if one.should_stop(self.inspector, self._write_output))
        place = self.inspector.where(site_of(writes[0]))
        return StopEvent("data breakpoint", f"write at {place}", ids) if ids else None

    def _event_of_change(self, one: Breakpoint) -> StopEvent | None:
        """Return the event for a change of watched bytes; None if the data breakpoint continues."""
        place = self.inspector.where(self._kilobot.last_address)
        ids = (one.id,) if one.should_stop(self.inspector, self._write_output) else ()
        return StopEvent("data breakpoint", f"write at {place}", ids) if ids else None

    def _is_limit_reached(self) -> bool:
        return self._limit is not None and self.machine.cycle >= self._limit

    def _is_at_target(self) -> bool:
        return self._run_target is not None and self.machine.pc in self._run_target[0] and self._run_target[1]()

    def _event_of_stop(self, stop: Stop) -> StopEvent | None:
        if stop.fault is not None:
            return StopEvent("exception", stop.fault.cause.rstrip(","), stop=stop) if self.stops_at_faults else None
        if stop.reason == "breakpoint":
            return StopEvent("breakpoint", stop.detail or "breakpoint in the program", stop=stop)
        if stop.reason == "halt":
            return StopEvent("pause", "the firmware sleeps and no event can wake it", stop=stop)
        return StopEvent("pause", stop.detail or stop.reason, stop=stop)

    def _step(self) -> StopEvent | None:
        """Execute one instruction and ignore breakpoints.

        A sleeping CPU sleeps until an interrupt wakes it, but at most for SLEEP_CYCLES or until the client requests a
        pause.
        """
        limit = self.machine.cycle + SLEEP_CYCLES
        while True:
            stop = self._step_slice(limit)
            if stop is None or stop.reason != "limit" or stop.detail != STILL_ASLEEP:
                return self._event_of_step(stop)
            if self.machine.cycle >= limit or self._is_stop_requested():
                return StopEvent("pause", f"{STILL_ASLEEP}; `continue` runs on until one does", stop=stop)

    def _step_slice(self, limit: int) -> Stop | None:
        """Execute one instruction. A sleeping CPU sleeps for at most SLICE_CYCLES and at most until cycle `limit`."""
        return self.history.step(min(self.machine.cycle + SLICE_CYCLES, limit))

    def _event_of_step(self, stop: Stop | None) -> StopEvent | None:
        """Return the event for the stop that ended a step, None if the step is complete."""
        is_complete = stop is None or (stop.reason == "breakpoint" and not stop.detail)
        return None if stop is None or is_complete else self._event_of_stop(stop)

    def _run_with_data_breakpoints(self, data: list[Breakpoint]) -> StopEvent | None:
        """Run by single steps and check the data breakpoints after each."""
        machine, space = self.machine, self.machine.core.data
        read, write = space.read, space.write
        touched: list[tuple[str, int, int]] = []

        def reads(ea: int, size: int) -> int:
            touched.append(("read", ea, size))
            return read(ea, size)

        def writes(ea: int, value: int, size: int) -> None:
            touched.append(("write", ea, size))
            write(ea, value, size)

        addresses = self._breakpoint_addresses()
        vars(space)["read"], vars(space)["write"] = reads, writes
        try:
            for _ in range(POLL_STEPS):
                touched.clear()
                pc = machine.pc
                stop = self._step_slice(sys.maxsize if self._limit is None else self._limit)
                if stop is not None and stop.detail == STILL_ASLEEP:
                    return None
                event = self._event_of_step(stop)
                if event is not None:
                    return event
                hit = [one for one in data if any(_is_hit(one, touch) for touch in touched)]
                ids = [one.id for one in hit if one.should_stop(self.inspector, self._write_output)]
                if ids:
                    verb = "/".join(sorted({touch[0] for touch in touched if any(_is_hit(one, touch) for one in hit)}))
                    return StopEvent("data breakpoint", f"{verb} at {self.inspector.where(pc)}", tuple(ids))
                if machine.pc in addresses and self._is_breakpoint_hit() and self._hit:
                    return StopEvent("breakpoint", breakpoints=tuple(self._hit))
                if self._is_at_target() or self._is_limit_reached():
                    return None
        finally:
            del vars(space)["read"], vars(space)["write"]
        return None

    def run_to(self, addresses: Collection[int], condition: Callable[[], bool]) -> StopEvent | None:
        """Run to one of the addresses at which `condition` holds, and return None.

        Return the event if the machine stops earlier.
        """
        self._run_target = (addresses, condition)
        self._update_hooks()
        try:
            event = self._run()
            return StopEvent("pause") if event is None and not self._is_at_target() else event
        finally:
            self._run_target = None
            self._update_hooks()

    def step_instruction(self) -> StopEvent:
        """Execute one instruction."""
        return self._step() or StopEvent("step")

    def step_over(self) -> StopEvent:
        """Execute one instruction. A call or an interrupt counts as part of it."""
        return self._step_instruction_or_call(into=False) or StopEvent("step")

    def step_line(self, into: bool) -> StopEvent:
        """Run to the next source line. With `into`, the first line of a called or inlined function also counts.

        Interrupt handlers run to their end.
        """
        frames = self.inspector.frames()
        inlined = self._inlined()
        entry = frames[0].raw.entry if frames else None
        line = self._line()
        has_entered = False
        for _ in range(POLL_STEPS * 100):
            if self._is_stop_requested():
                return StopEvent("pause")
            event = self._step_instruction_or_call(into)
            if event is not None:
                return event
            here = self._line()
            top = self.stack
            if here is None:
                continue
            start = self.inspector.function_start(self.machine.pc)
            if start is not None and self.machine.pc < self.inspector.prologue_end(start):
                has_entered = True
                continue
            if entry is not None and self._processor.has_left(top, entry):
                return StopEvent("step")
            is_visible = into or self._inlined() <= inlined
            is_other = (here.file, here.line) != (line and (line.file, line.line)) and here.start == self.machine.pc
            if is_other and is_visible:
                return StopEvent("step")
            if into and (has_entered or self.machine.pc == start):
                return StopEvent("step")
        return StopEvent("step")

    def _step_instruction_or_call(self, into: bool) -> StopEvent | None:
        """Execute one instruction and run interrupt handlers to their end.

        A call counts as one instruction, except with `into` and a function that has line information.
        """
        machine = self.machine
        pc, top = machine.pc, self.stack
        return_pc = self._processor.return_address(pc)
        event = self._step()
        if event is not None:
            return event
        if (
            self.inspector.is_handler(machine.pc)
            and self.stack == self._processor.stack_in_handler(top)
            and return_pc is None
        ):
            return self.run_to([pc], lambda: self.stack == top)
        if return_pc is not None and not (into and self._line() is not None):
            return self.run_to([return_pc], lambda: self.stack == top)
        return None

    def step_out(self) -> StopEvent:
        """Run to the return of the current function."""
        frames = [one for one in self.inspector.frames() if one.kind != "inlined"]
        if len(frames) < 2 or frames[0].raw.entry is None:
            return StopEvent("step", "there is no caller")
        top = self._processor.stack_after_return(frames[0].raw.entry)
        return self.run_to([frames[1].pc], lambda: self.stack == top) or StopEvent("step")

    def goto(self, cycle: int) -> StopEvent:
        """Go to a cycle. If it is after the recording, run to it unless the machine stops earlier."""
        history = self.history
        if cycle <= history.end:
            history.seek(max(cycle, history.start))
            return StopEvent("goto")
        self._limit = cycle
        try:
            hooked = not self.machine.is_asleep and self.machine.pc in self._breakpoint_addresses()
            event = (self._step() if hooked else None) or self._run()
        finally:
            self._limit = None
        return event or StopEvent("goto" if self.machine.cycle >= cycle else "pause")

    def run_to_cycle(self, cycle: int, offer_checkpoint: Callable[[], None] = lambda: None) -> bool:
        """Run to a cycle and ignore breakpoints. Return False if the client requested a pause before it.

        `offer_checkpoint` is called between slices of the run.
        """
        machine, before = self.machine, -1
        while machine.cycle < cycle and machine.cycle > before and not self._is_stop_requested():
            before = machine.cycle
            offer_checkpoint()
            self.history.advance(min(before + SLICE_CYCLES, cycle))
        return machine.cycle >= cycle

    def _line(self) -> SourceLine | None:
        return self.inspector.image.lines.find(self.machine.pc)

    def _inlined(self) -> set[Scope]:
        return inlined_at(self.inspector.debug, self.machine.pc)

    # Reverse execution

    def reverse_step_instruction(self) -> StopEvent:
        """Go back by one instruction."""
        return StopEvent("step") if self.history.step_back() else START_OF_RECORDING

    def reverse_step_line(self) -> StopEvent:
        """Go back to the start of the previous line of this function or its caller."""
        start, inlined = self.inspector.function_start(self.machine.pc), self._inlined()
        line = self._line()
        if line is not None and line.start != self.machine.pc:  # inside a line, first go back to its start
            line = SourceLine(-1, -1, line.file, -line.line)
        for positions in self.history.earlier_steps():
            for at, (cycle, pc) in reversed(list(enumerate(positions))):
                here = self.inspector.image.lines.find(pc)
                begins = here is not None and here.start == pc and self.inspector.function_start(pc) == start
                begins = begins and inlined_at(self.inspector.debug, pc) <= inlined
                if begins and (line is None or here is None or (here.file, here.line) != (line.file, line.line)):
                    self.history.seek(cycle)
                    return StopEvent("step")
                if pc == start and at:
                    self.history.seek(positions[at - 1][0])
                    return StopEvent("step")
        self.history.seek(self.history.start)
        return START_OF_RECORDING

    def reverse_step_into(self) -> StopEvent:
        """Go back to the start of the previous line in any function. Interrupt handlers are skipped."""
        now, line, depth = self.machine.pc, self._line(), len(self._interrupts())
        here = (
            (line.file, line.line, self.inspector.function_start(now))
            if line is not None and line.start == now
            else None
        )
        for positions in self.history.earlier_steps():
            at = len(positions)
            while at:
                at -= 1
                cycle, pc = positions[at]
                row = self.inspector.image.lines.find(pc)
                if row is None or row.start != pc or (row.file, row.line, self.inspector.function_start(pc)) == here:
                    continue
                self.history.seek(cycle)
                handlers = self._interrupts()
                if len(handlers) <= depth:
                    return StopEvent("step")
                while at and positions[at][1] != handlers[0]:
                    at -= 1
        self.history.seek(self.history.start)
        return START_OF_RECORDING

    def _interrupts(self) -> list[int | None]:
        """Return the entry addresses of the active interrupt handlers, innermost first."""
        return [self.inspector.function_start(one.raw.pc) for one in self.inspector.frames() if one.kind == "interrupt"]

    def reverse_finish(self) -> StopEvent:
        """Go back to the call of the current function, or to the instruction before the interrupt."""
        frame = next((one for one in self.inspector.frames() if one.kind != "inlined"), None)
        start = self.inspector.function_start(self.machine.pc)
        if frame is None or frame.raw.entry is None or start is None:
            return StopEvent("step", "there is no caller")
        machine, top = self.machine, self._processor.stack_at_entry(frame.raw.entry)
        if machine.pc != start or self.stack != top:
            self.history.run_back([start], lambda: self.stack == top)
        return self.reverse_step_instruction()

    def reverse_continue(self) -> StopEvent:
        """Go back to the previous breakpoint hit, or to the previous write that a data breakpoint observes."""
        addresses = self._breakpoint_addresses()
        now = self.machine.cycle
        found: list[tuple[int, StopEvent]] = []
        if self.history.run_back(addresses, self._is_breakpoint_hit) is not None:
            found.append((self.machine.cycle, StopEvent("breakpoint", breakpoints=tuple(self._hit))))
        for one in self.all():
            if one.kind == "data" and one.access != "read":
                self.history.seek(now)
                written = self.history.last_write(one.addresses[0], one.size)
                if written is not None:
                    text = f"write at {self.inspector.where(written.pc)}: {written.old.hex()} -> {written.new.hex()}"
                    found.append((written.cycle, StopEvent("data breakpoint", text, (one.id,))))
        if not found:
            self.history.seek(self.history.start)
            return START_OF_RECORDING
        cycle, event = max(found, key=lambda one: one[0])
        self.history.seek(cycle)
        return event

    def restart(self) -> StopEvent:
        """Go back to the start of the recording."""
        self.history.seek(self.history.start)
        return StopEvent("entry")

    def install_breakpoints(self, breakpoints: Mapping[str, list[Breakpoint]], stops_at_faults: bool) -> None:
        """Replace all breakpoints by those of another session, with their hit counts."""
        self.breakpoints.clear()
        self.breakpoints.update(breakpoints)
        self.stops_at_faults = stops_at_faults
        self._update_hooks()

    def release(self) -> None:
        """Detach the debugger: return to the present and remove all breakpoints."""
        self.breakpoints.clear()
        self._update_hooks()
        self.history.seek(self.history.end)

    # State

    def threads(self) -> list[Thread]:
        """Return the threads of OpenSwarm; empty for other firmware."""
        return Threads(self.inspector).all() if self._processor.has_native_instruments else []

    def frames(self) -> list[Frame]:
        """Return the current call stack."""
        return self.inspector.frames()


START_OF_RECORDING: Final = StopEvent("entry", "start of recording")


def _is_hit(one: Breakpoint, touch: tuple[str, int, int]) -> bool:
    kind, ea, size = touch
    matches = one.access == "readWrite" or one.access == kind
    return matches and ea < one.addresses[0] + one.size and one.addresses[0] < ea + size
