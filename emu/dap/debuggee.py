"""The machine being debugged: goes on and back, by instruction, line and function and to breakpoints.

What enters: what a person wants. What leaves: `Halt`s that say why it stopped. Everything is recorded (`History`), so
each way forward has one back.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from emu.dap.breakpoints import Breakpoint
from emu.debug.history import History
from emu.debug.inspector import Frame, Inspector
from emu.debug.threads import Thread, Threads
from emu.dspic30f.isa.codec import decode_for_execution
from emu.dspic30f.isa.facts import facts_of
from emu.dspic30f.isa.flow import Call
from emu.image.lines import Line

if TYPE_CHECKING:
    from emu.machine.machine import Machine
    from emu.machine.stops import Stop

SLICE: Final = 400_000
"""Cycles between looks at what the client wants."""
LOOK_STEPS: Final = 2_000
"""The same in single steps."""
STACK_POINTER: Final = 15
PUSHED: Final = 4
"""Bytes that entering an interrupt puts on the stack."""


@dataclass(frozen=True, slots=True)
class Halt:
    """Why the machine stands, in the protocol's words."""

    reason: str
    description: str = ""
    breakpoints: tuple[int, ...] = ()
    stop: Stop | None = None


class Debuggee:
    """Drives `machine`. `wanted()` tells whether somebody wants it to stand; `say(text)` gets log messages."""

    def __init__(
        self, machine: Machine, wanted: Callable[[], bool], say: Callable[[str], None], history: History
    ) -> None:
        self.machine: Final = machine
        self.inspector: Final = Inspector(machine)
        self.history: Final = history
        self.breakpoints: Final[dict[str, list[Breakpoint]]] = {}
        """By kind and, for those in sources, file."""
        self.stops_at_faults = True
        self._wanted: Final = wanted
        self._say: Final = say
        self._hooks: list[Callable[[], None]] = []
        self._hit: list[int] = []
        self._extra: tuple[Collection[int], Callable[[], bool]] | None = None
        self._limit: int | None = None
        """The cycle a run ends at."""

    # Breakpoints

    def set_breakpoints(self, key: str, wanted: list[Breakpoint]) -> None:
        """Replace one list. A breakpoint that was in it goes on counting its hits."""
        for one in wanted:
            one.hits = next((old.hits for old in self.breakpoints.get(key, []) if old.is_as(one)), 0)
        self.breakpoints[key] = wanted
        self._rehook()

    def all(self) -> list[Breakpoint]:
        """Every breakpoint."""
        return [one for some in self.breakpoints.values() for one in some]

    def _places(self) -> set[int]:
        """Instructions that have a breakpoint."""
        return {place for one in self.all() if one.kind != "data" for place in one.places}

    def _rehook(self) -> None:
        for remove in self._hooks:
            remove()
        places = self._places()
        if self._extra is not None:
            places |= set(self._extra[0])
        self._hooks = [self.machine.hook_pc(place, self._arrived) for place in sorted(places)]

    def _arrived(self) -> bool:
        """The machine is about to run a hooked instruction."""
        pc = self.machine.pc
        self._hit = [
            one.id
            for one in self.all()
            if one.kind != "data" and pc in one.places and one.stops(self.inspector, self._say)
        ]
        extra = self._extra is not None and pc in self._extra[0] and self._extra[1]()
        return bool(self._hit) or extra

    # Forward

    def go_on(self) -> Halt:
        """Run until something stops it."""
        halt = self._stepped()
        if halt is not None:
            return halt
        return self._run() or Halt("pause")

    def _run(self) -> Halt | None:
        """Run; None if somebody wants it to stand, or it has arrived where `_extra` says."""
        while not self._wanted() and not self._is_there():
            self._hit = []
            data = [one for one in self.all() if one.kind == "data"]
            if data:
                halt = self._watched(data)
                if halt is not None or self._arrived_extra():
                    return halt
                continue
            self.machine.replay_condition = self._arrived
            try:
                stop = self.history.advance(min(self.machine.cycle + SLICE, self._limit or sys.maxsize))
            finally:
                self.machine.replay_condition = None
            if stop is None:
                continue
            if stop.reason == "breakpoint" and not stop.detail:
                return Halt("breakpoint", breakpoints=tuple(self._hit)) if self._hit else None
            halt = self._ended(stop)
            if halt is not None:
                return halt
        return None

    def _is_there(self) -> bool:
        return self._limit is not None and self.machine.cycle >= self._limit

    def _arrived_extra(self) -> bool:
        return self._extra is not None and self.machine.pc in self._extra[0] and self._extra[1]()

    def _ended(self, stop: Stop) -> Halt | None:
        if stop.fault is not None:
            return Halt("exception", stop.fault.cause.rstrip(","), stop=stop) if self.stops_at_faults else None
        if stop.reason == "breakpoint":
            return Halt("breakpoint", stop.detail or "breakpoint in the program", stop=stop)
        if stop.reason == "halt":
            return Halt("pause", "the firmware sleeps and nothing will wake it", stop=stop)
        return Halt("pause", stop.detail or stop.reason, stop=stop)

    def _stepped(self) -> Halt | None:
        """One instruction, breakpoints not asked."""
        stop = self.history.step()
        return self._ended(stop) if stop is not None and not (stop.reason == "breakpoint" and not stop.detail) else None

    def _watched(self, data: list[Breakpoint]) -> Halt | None:
        """Single steps with an eye on data."""
        machine, space = self.machine, self.machine.core.data
        read, write = space.read, space.write
        touched: list[tuple[str, int, int]] = []

        def reads(ea: int, size: int) -> int:
            touched.append(("read", ea, size))
            return read(ea, size)

        def writes(ea: int, value: int, size: int) -> None:
            touched.append(("write", ea, size))
            write(ea, value, size)

        places = self._places()
        vars(space)["read"], vars(space)["write"] = reads, writes
        try:
            for _ in range(LOOK_STEPS):
                touched.clear()
                pc = machine.pc
                halt = self._stepped()
                if halt is not None:
                    return halt
                hit = [one for one in data if any(_meets(one, touch) for touch in touched)]
                ids = [one.id for one in hit if one.stops(self.inspector, self._say)]
                if ids:
                    verb = "/".join(sorted({touch[0] for touch in touched if any(_meets(one, touch) for one in hit)}))
                    return Halt("data breakpoint", f"{verb} at {self.inspector.where(pc)}", tuple(ids))
                if machine.pc in places and self._arrived() and self._hit:
                    return Halt("breakpoint", breakpoints=tuple(self._hit))
                if self._arrived_extra() or self._is_there():
                    return None
        finally:
            del vars(space)["read"], vars(space)["write"]
        return None

    def run_to(self, places: Collection[int], condition: Callable[[], bool]) -> Halt | None:
        """Run until one of the addresses is reached and `condition` holds (None), or something else stops it."""
        self._extra = (places, condition)
        self._rehook()
        try:
            halt = self._run()
            return Halt("pause") if halt is None and not self._arrived_extra() else halt
        finally:
            self._extra = None
            self._rehook()

    def step_instruction(self) -> Halt:
        """One instruction."""
        return self._stepped() or Halt("step")

    def step_over(self) -> Halt:
        """One instruction; a call, and an interrupt, as a whole."""
        return self._one(into=False) or Halt("step")

    def step_line(self, into: bool) -> Halt:
        """To the next line; into functions that have lines, or over them. Interrupts are run through."""
        frames = self.inspector.frames()
        entry = frames[0].raw.entry if frames else None
        line = self._line()
        has_entered = False
        for _ in range(LOOK_STEPS * 100):
            if self._wanted():
                return Halt("pause")
            halt = self._one(into)
            if halt is not None:
                return halt
            here = self._line()
            top = self.machine.w[STACK_POINTER]
            if here is None:
                continue
            start = self.inspector.function_start(self.machine.pc)
            if start is not None and self.machine.pc < self.inspector.prologue_end(start):
                has_entered = True
                continue
            if entry is not None and top < entry:
                return Halt("step")
            if (here.file, here.line) != (line and (line.file, line.line)) and here.start == self.machine.pc:
                return Halt("step")
            if into and (has_entered or self.machine.pc == start):
                return Halt("step")
        return Halt("step")

    def _one(self, into: bool) -> Halt | None:
        """One instruction; a call to what has no lines, or any without `into`, as one; an interrupt not at all."""
        machine = self.machine
        pc, top = machine.pc, machine.w[STACK_POINTER]
        insn = decode_for_execution(machine.program.word(pc), machine.program.word(pc + 2))
        calls = insn is not None and facts_of(insn).flow is Call
        halt = self._stepped()
        if halt is not None:
            return halt
        if self.inspector.is_handler(machine.pc) and machine.w[STACK_POINTER] == top + PUSHED and not calls:
            return self.run_to([pc], lambda: machine.w[STACK_POINTER] == top)
        if calls and insn is not None and not (into and self._line() is not None):
            back = pc + 2 * insn.words
            return self.run_to([back], lambda: machine.w[STACK_POINTER] == top)
        return None

    def step_out(self) -> Halt:
        """To where the function goes back to."""
        frames = [one for one in self.inspector.frames() if one.kind != "inlined"]
        if len(frames) < 2 or frames[0].raw.entry is None:
            return Halt("step", "there is no caller")
        top = frames[0].raw.entry - 4
        return self.run_to([frames[1].pc], lambda: self.machine.w[STACK_POINTER] == top) or Halt("step")

    def go_to(self, cycle: int) -> Halt:
        """To a cycle of the recording, or on to one behind it, unless something stops it before."""
        history = self.history
        if cycle <= history.end:
            history.seek(max(cycle, history.start))
            return Halt("goto")
        self._limit = cycle
        try:
            hooked = not self.machine.is_asleep and self.machine.pc in self._places()
            halt = (self._stepped() if hooked else None) or self._run()
        finally:
            self._limit = None
        return halt or Halt("goto" if self.machine.cycle >= cycle else "pause")

    def arrive(self, cycle: int, pass_by: Callable[[], None] = lambda: None) -> bool:
        """Run on to a cycle, whatever is on the way, unless somebody wants it to stand; whether it is there. `pass_by`
        is called now and then."""
        machine, before = self.machine, -1
        while machine.cycle < cycle and machine.cycle > before and not self._wanted():
            before = machine.cycle
            pass_by()
            self.history.advance(min(before + SLICE, cycle))
        return machine.cycle >= cycle

    def _line(self) -> Line | None:
        return self.inspector.image.lines.find(self.machine.pc)

    # Back

    def back_instruction(self) -> Halt:
        """One instruction back."""
        return Halt("step") if self.history.step_back() else START

    def back_line(self) -> Halt:
        """To the start of the line before, in this function or its caller."""
        start = self.inspector.function_start(self.machine.pc)
        line = self._line()
        if line is not None and line.start != self.machine.pc:  # inside a line its own start comes first
            line = Line(-1, -1, line.file, -line.line)
        for positions in self.history.before():
            for at, (cycle, pc) in reversed(list(enumerate(positions))):
                here = self.inspector.image.lines.find(pc)
                begins = here is not None and here.start == pc and self.inspector.function_start(pc) == start
                if begins and (line is None or here is None or (here.file, here.line) != (line.file, line.line)):
                    self.history.seek(cycle)
                    return Halt("step")
                if pc == start and at:
                    self.history.seek(positions[at - 1][0])
                    return Halt("step")
        self.history.seek(self.history.start)
        return START

    def back_into(self) -> Halt:
        """To the start of the line before, in whatever function that was; interrupts are passed by."""
        now, line, depth = self.machine.pc, self._line(), len(self._interrupts())
        here = (
            (line.file, line.line, self.inspector.function_start(now))
            if line is not None and line.start == now
            else None
        )
        for positions in self.history.before():
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
                    return Halt("step")
                while at and positions[at][1] != handlers[0]:
                    at -= 1
        self.history.seek(self.history.start)
        return START

    def _interrupts(self) -> list[int | None]:
        """Where the handlers begin in which the machine stands, innermost first."""
        return [self.inspector.function_start(one.raw.pc) for one in self.inspector.frames() if one.kind == "interrupt"]

    def back_out(self) -> Halt:
        """To the call of this function, or to before the interrupt."""
        frame = next((one for one in self.inspector.frames() if one.kind != "inlined"), None)
        start = self.inspector.function_start(self.machine.pc)
        if frame is None or frame.raw.entry is None or start is None:
            return Halt("step", "there is no caller")
        machine, entry = self.machine, frame.raw.entry
        if machine.pc != start or machine.w[STACK_POINTER] != entry:
            self.history.run_back([start], lambda: machine.w[STACK_POINTER] == entry)
        return self.back_instruction()

    def back(self) -> Halt:
        """Back to the last breakpoint; data breakpoints to the last write."""
        places = self._places()
        now = self.machine.cycle
        found: list[tuple[int, Halt]] = []
        if self.history.run_back(places, self._arrived) is not None:
            found.append((self.machine.cycle, Halt("breakpoint", breakpoints=tuple(self._hit))))
        for one in self.all():
            if one.kind == "data" and one.access != "read":
                self.history.seek(now)
                written = self.history.last_write(one.places[0], one.size)
                if written is not None:
                    text = f"write at {self.inspector.where(written.pc)}: {written.old.hex()} -> {written.new.hex()}"
                    found.append((written.cycle, Halt("data breakpoint", text, (one.id,))))
        if not found:
            self.history.seek(self.history.start)
            return START
        cycle, halt = max(found, key=lambda one: one[0])
        self.history.seek(cycle)
        return halt

    def restart(self) -> Halt:
        """Back to where the recording began."""
        self.history.seek(self.history.start)
        return Halt("entry")

    def stop_at(self, breakpoints: Mapping[str, list[Breakpoint]], stops_at_faults: bool) -> None:
        """Let what stopped another machine stop this one, and nothing else, hits counted."""
        self.breakpoints.clear()
        self.breakpoints.update(breakpoints)
        self.stops_at_faults = stops_at_faults
        self._rehook()

    def leave(self) -> None:
        """Give the machine back as it would be without a debugger: in the present, with no breakpoint."""
        self.breakpoints.clear()
        self._rehook()
        self.history.seek(self.history.end)

    # What there is to see

    def threads(self) -> list[Thread]:
        """OpenSwarm's threads; empty for other firmware."""
        return Threads(self.inspector).all()

    def frames(self) -> list[Frame]:
        """The call stack where the machine stands."""
        return self.inspector.frames()


START: Final = Halt("entry", "start of recording")


def _meets(one: Breakpoint, touch: tuple[str, int, int]) -> bool:
    kind, ea, size = touch
    wanted = one.access == "readWrite" or one.access == kind
    return wanted and ea < one.places[0] + one.size and one.places[0] < ea + size
