"""Observation of stacks and handlers of a running image, and interrupts requested at the deepest moments of each stack.

A plain run meets few coincidences: an interrupt in the deepest call of a thread, and another one within its handler.
`nest` repeats each deepest moment and requests every enabled interrupt there, then again in the deepest moments of the
handlers. A request at any time is what the bounds assume, so no measurement may exceed them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from random import Random

import emu
from bench.kernel.structures import Structures
from emu.boards.epuck.config import CHIPS
from emu.system.events import NEVER
from toolchain.bounds.interference import SECOND_STACK
from toolchain.bounds.program import Program

RETURN_ADDRESS = 4
SWITCH_LEVEL = 1
"""Level of the interrupts that lead to another thread."""
CHECKPOINT = 5_000
"""Cycles between two checkpoints, from which deepest moments are repeated."""
RECEIVED = 20
"""Maximum number of bytes that each UART receives at line rate after every sixth checkpoint; a pause follows."""
DELAYS, DELAY = 12, 7_000
"""Number and length in cycles of the times in which no interrupt is enabled: five bytes at 115,200 baud."""
ENABLES = ("IEC0", "IEC1", "IEC2")
RARE = ("refuse_message", "save_dsp", "swap_reserve")
"""Functions of memory shortage, of SYS_DSP threads, and of holes larger than the heap's reserve. A run without them
does not count their paths (`--without`)."""
LEADS = (2, 4, 6)
"""Cycles from a request to the deepest moment; an interrupt is accepted some cycles after its request."""
ACCEPTANCE, FRAME, HANDLER = 8, 80, 2_000
"""Maximum number of instructions: from a request to its handler, in the slice interrupt, in any other handler."""
PRIORITY = 5
"""Position of the CPU priority in SR."""


@dataclass
class Seen:
    """Maxima of one run.

    stacks, alone  bytes by stack, with and without interrupts
    handlers       cycles by handler
    sizes          lengths of the kernel's lists at the start and the end of each handler (bench/kernel/structures.py)
    called         functions of RARE that were called
    """

    stacks: dict[str, int] = field(default_factory=dict)
    alone: dict[str, int] = field(default_factory=dict)
    handlers: dict[str, int] = field(default_factory=dict)
    sizes: dict[str, int] = field(default_factory=dict)
    called: set[str] = field(default_factory=set)


@dataclass
class _Stack:
    name: str
    start: int
    end: int
    interrupted: int | None = None
    """W15 at the interrupt that is in progress on the stack, None without one."""
    has_limit: bool = False
    """Whether SPLIM is the end of the stack while it is used; a new thread may use the memory of an ended one."""


@dataclass
class _State:
    """The machine and the observed stacks at one boundary."""

    machine: bytes
    stacks: list[_Stack]


@dataclass
class _Moment:
    """The deepest moment of a stack at one CPU priority: bytes, cycle, and a state from which it is repeated."""

    used: int
    cycle: int
    since: _State


def _worst(moments: Mapping[tuple[str, int], _Moment]) -> list[_Moment]:
    """Return the moments whose stack is deeper than at any lower priority.

    At a lower priority more interrupts can nest, so the other moments cannot lead to a greater total.
    """
    found = []
    for (name, priority), moment in moments.items():
        others = [other for (stack, at), other in moments.items() if stack == name and at < priority]
        if all(other.used < moment.used for other in others):
            found.append(moment)
    return found


class Observer:
    """Runs an image by single instructions and observes W15."""

    def __init__(self, image: Path, program: Program) -> None:
        self.program = program
        self.machine = emu.load(image, engine="plain", board="epuck" if program.chip.name in CHIPS else "none")
        self.start = self._run_to_start()
        self.threads = {entry: program.calls.name(entry).removeprefix("_") for entry in program.threads()}
        self.handlers = {entry: (name, level) for entry, name, level in program.interrupts()}
        self.requests = self._requests()
        self.stacks: list[_Stack] = []
        self.seen = Seen()
        self._open: list[tuple[str, int, int, bool]] = []
        """Handlers in progress: name, W15 at the interrupted instruction, cycle of the start, whether undisturbed."""
        self._deepest: dict[tuple[str, int], _Moment] = {}
        """By stack and CPU priority."""
        self._rare = {entry: name for name in RARE if (entry := program.address(name)) in program.calls.entries}
        self._structures = Structures(self.machine) if program.address("_os_ring") is not None else None
        self._begin(self.start)
        for annotation in program.annotations.of("stack"):
            name, _, text = annotation.text.partition(" ")
            start, size = program.address(name, annotation), program.annotations.number(text, annotation)
            assert start is not None
            assert size is not None
            self.stacks.append(_Stack(SECOND_STACK, start, start + size))
        self._since = self._state()

    def _run_to_start(self) -> str:
        """Run the start-up code; return the name of main, or without it, of the first C function from reset."""
        main = self.program.address("main")
        first = set(self.program.signatures.functions) if main is None else {main}
        assert self.machine.run(until=lambda: self.machine.pc in first, seconds=1).reason == "until"
        return self.program.calls.name(self.machine.pc).removeprefix("_")

    def _requests(self) -> dict[int, tuple[int, tuple[str, int], tuple[str, int]]]:
        """Return level, flag and enable bit of one vector of each handler of an interrupt, by handler."""
        chip, found = self.program.chip, {}
        for vector in chip.vectors:
            handler = next((e for e, names in self.program.calls.vectors.items() if vector.name in names), None)
            if vector.irq is not None and vector.irq in chip.interrupts and handler in self.handlers:
                source = chip.interrupts[vector.irq]
                found[handler] = self.handlers[handler][1], source.flag, source.enable
        return found

    # -- a plain run -------------------------------------------------------------------------------------------------

    def run(self, cycles: int, seed: int = 1) -> Seen:
        """Run for a number of cycles, or until the machine stops, and return the maxima.

        `seed` determines the bytes that the UARTs receive.
        """
        random = Random(seed)
        for number in range(cycles // CHECKPOINT):
            if number % 6 == 0:
                self._receive(random, RECEIVED)
            self._since = self._state()
            if not self._run_for(CHECKPOINT):
                return self.seen
        for _ in range(DELAYS):
            self._receive(random, RECEIVED)
            self._since = self._state()
            if not (self._run_for(random.randint(0, 6 * CHECKPOINT)) and self._delay()):
                break
        return self.seen

    def _receive(self, random: Random, most: int) -> None:
        for uart in self.machine.uart.values():
            uart.feed(random.randbytes(random.randint(1, most)))

    def _delay(self) -> bool:
        """Disable all interrupts for a time, then let them occur. Return False if the machine has stopped."""
        machine = self.machine
        enabled = {name: machine.peek(name) for name in ENABLES}
        for name in ENABLES:
            machine.poke(name, 0)
        goes = self._run_for(DELAY)
        for name, bits in enabled.items():
            machine.poke(name, machine.peek(name) | bits)
        self._since = self._state()
        return goes and self._run_for(2 * CHECKPOINT)

    def _run_for(self, cycles: int) -> bool:
        """Run for a number of cycles. Return False if the machine has stopped."""
        end = self.machine.cycle + cycles
        while self.machine.cycle < end:
            if not self._step():
                return False
        return True

    def _step(self) -> bool:
        """Run one instruction, and what is due before it. Return False if the machine has stopped."""
        machine = self.machine
        before = machine.pc, machine.w[15]
        if machine.service_boundary(NEVER) is not None:
            return False
        for handler, top in self._accepted(before[1]):
            self._enter(handler, top)
        self._record()
        if machine.step() is not None:
            return False
        self._record()
        if machine.pc in self._rare:
            self.seen.called.add(self._rare[machine.pc])
        if machine.pc in self.threads and machine.pc != before[0]:
            self._begin(self.threads[machine.pc])
        self._leave()
        return True

    def _accepted(self, top: int) -> Iterator[tuple[int, int]]:
        """Yield handler and interrupted W15 of each exception of a boundary; a second one interrupts the first's entry.

        `top` is W15 before the boundary.
        """
        machine = self.machine
        for at in range(top, machine.w[15], RETURN_ADDRESS):
            inner = at + RETURN_ADDRESS
            pc = machine.pc if inner == machine.w[15] else machine.peek(inner) | (machine.peek(inner + 2) & 0x7F) << 16
            if pc in self.handlers:
                yield pc, at

    def _begin(self, name: str) -> None:
        """Begin the stack of a thread at its first instruction; it replaces those that used the memory before."""
        start, end = self.machine.w[15] - RETURN_ADDRESS, self.machine.peek("SPLIM") + 2
        self.stacks = [one for one in self.stacks if one.end <= start or one.start >= end]
        self.stacks.append(_Stack(name, start, end, has_limit=name != self.start))

    def _record(self) -> None:
        top = self.machine.w[15]
        stack = self._stack_of(top)
        if stack is None:
            return
        used = top - stack.start
        if used > self.seen.stacks.get(stack.name, -1):
            self.seen.stacks[stack.name] = used
        if stack.interrupted is not None and top <= stack.interrupted:
            stack.interrupted = None
        if stack.interrupted is None and used > self.seen.alone.get(stack.name, -1):
            self.seen.alone[stack.name] = used
        moment = stack.name, self._priority()
        if moment not in self._deepest or used > self._deepest[moment].used:
            self._deepest[moment] = _Moment(used, self.machine.cycle, self._since)

    def _priority(self) -> int:
        return self.machine.peek("SR") >> PRIORITY & 7

    def _stack_of(self, top: int) -> _Stack | None:
        stack = next((stack for stack in self.stacks if stack.start <= top <= stack.end), None)
        if stack is not None and stack.has_limit and stack.end != self.machine.peek("SPLIM") + 2:
            return None
        return stack

    def _enter(self, handler: int, top: int) -> None:
        self._open = [(name, at, start, False) for name, at, start, _ in self._open]
        stack = self._stack_of(top)
        if stack is not None and stack.interrupted is None:
            stack.interrupted = top
        name, level = self.handlers[handler]
        if level > SWITCH_LEVEL:
            self._measure_lists()
            self._open.append((name, top, self.machine.cycle, True))

    def _leave(self) -> None:
        while self._open and self.machine.w[15] == self._open[-1][1]:
            name, _, start, counts = self._open.pop()
            self._measure_lists()
            if counts:
                self.seen.handlers[name] = max(self.seen.handlers.get(name, 0), self.machine.cycle - start)

    def _measure_lists(self) -> None:
        if self._structures is not None:
            for name, size in self._structures.sizes().items():
                self.seen.sizes[name] = max(self.seen.sizes.get(name, 0), size)

    # -- requested interrupts ----------------------------------------------------------------------------------------

    def nest(self) -> Seen:
        """Request interrupts in the deepest moment of every stack at every CPU priority, and return the maxima."""
        self._structures = None
        for moment in _worst(self._deepest):
            self._nest(moment, frozenset())
        return self.seen

    def _nest(self, moment: _Moment, nested: frozenset[int]) -> None:
        """Request, at a moment, each handler that is not nested yet.

        Continue in the same way at the deepest moments of the handler that uses the most stack at each level.
        """
        best: dict[int, tuple[int, list[_Moment], int]] = {}
        """By level, for the handler that uses the most stack: its bytes, its deepest moments, its address."""
        for lead in LEADS:
            self._restore(moment.since)
            while self.machine.cycle < moment.cycle - lead and self._step():
                pass
            state, priority = self._state(), self._priority()
            for handler, (level, flag, enable) in self.requests.items():
                self._restore(state)
                if handler in nested or level <= priority or not self.machine.peek(enable[0]) >> enable[1] & 1:
                    continue
                self.machine.poke(flag[0], self.machine.peek(flag[0]) | 1 << flag[1])
                found = self._follow(self._state(), handler, FRAME if level == SWITCH_LEVEL else HANDLER)
                used = max((one.used for one in found), default=0)
                if used > best.get(level, (0, [], 0))[0]:
                    best[level] = used, found, handler
        for _, found, handler in best.values():
            for deeper in found:
                self._nest(deeper, nested | {handler})

    def _follow(self, since: _State, handler: int, most: int) -> list[_Moment]:
        """Run a requested handler to its end, and return its moments of greatest stack use (`_worst`)."""
        self._since, kept, self._deepest = since, self._deepest, {}
        entered = None
        for number in range(most):
            top = self.machine.w[15]
            if not self._step() or (entered is None and number == ACCEPTANCE):
                break
            if entered is None:
                self._deepest = {}
                entered = top if self._is_in(handler) else None
            elif self.machine.w[15] <= entered and self._stack_of(entered) is self._stack_of(self.machine.w[15]):
                break
        found, self._deepest = _worst(self._deepest), kept
        return found if entered is not None else []

    def _is_in(self, handler: int) -> bool:
        """Whether the first instruction of a handler has just run."""
        return 0 < self.machine.pc - handler <= 4

    def _state(self) -> _State:
        return _State(self.machine.snapshot(), [replace(one) for one in self.stacks])

    def _restore(self, state: _State) -> None:
        self.machine.restore(state.machine)
        self.stacks = [replace(one) for one in state.stacks]
        self._open = []
