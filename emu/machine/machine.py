"""One microcontroller: record, clock, bus, CPU and devices wired together, and THE loop that runs them.

What enters: an image, pin levels, bytes. What leaves: `Stop`s, registers and memory, callbacks of devices. Time is
`Machine.cycle`, in Tcy since power-on; it only grows.
"""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from typing import Any, Final, Protocol

from emu.chips.chip import Chip, Vector
from emu.chips.dspic30f6014a import DSPIC30F6014A
from emu.debug.symbolic import BySource
from emu.dspic30f.core import Core
from emu.dspic30f.engines import make_engine
from emu.dspic30f.exceptions.faults import RESTART, Breakpoint, DeviceReset, Violation
from emu.dspic30f.state.state import PC_MASK, RUN, W15_INITIALISED
from emu.image.model import Image
from emu.machine.state_access import Contents, Place
from emu.machine.stops import CHECKPOINT_CYCLES, RESET_LOOP, RESETS_KEPT, Evidence, LastReset, Stop, following
from emu.peripherals import Peripherals, Wires, build
from emu.system.bus import Bus
from emu.system.events import NEVER, Events
from emu.system.native_handle import Native, Run
from emu.system.program import ProgramMemory
from emu.system.record import Record

PcHook = Callable[[], bool | None]


class _WRegisters(Protocol):
    def __getitem__(self, number: int) -> int: ...
    def __setitem__(self, number: int, value: int) -> None: ...


class Machine(Contents, BySource):
    """A chip with a program. See engine documentation in README.md for the choice of `engine`.

    `ipl_slip` = 1 lets an interrupt slip through right after a write that raises IPL or clears IEC (isa.md §14.3).
    `board` puts the chip on a board: it is called with the peripherals before the engine is made (`emu.boards`).
    `strict` makes null pointers, uninitialised reads and stores into other threads' stacks faults
    (emu/debug/strict.py); it takes the plain engine.
    Raises ValueError for an engine that does not exist, or is not plain though strict.
    """

    def __init__(
        self,
        chip: Chip = DSPIC30F6014A,
        *,
        engine: str = "auto",
        ipl_slip: int = 0,
        board: Callable[[Peripherals], Any] | None = None,
        strict: bool = False,
    ) -> None:
        record = Record(chip.data["ram"].end)
        self.events: Final = Events(record)
        bus = Bus(record, self.events, chip.data["sfr"].end)
        program = ProgramMemory(record, chip)
        wires = Wires()
        self.peripherals: Final = build(chip, bus, program, wires)
        self.pins: Final = self.peripherals.pins
        self.uart: Final = self.peripherals.uart
        super().__init__(chip, Core(record, self.events, bus, program, chip))
        self.core.exceptions.ipl_slip = ipl_slip
        self._connect(wires)
        self.board: Final[Any] = board(self.peripherals) if board is not None else None
        """What `board` made, for example an `emu.boards.epuck.board.Epuck`; its state is part of the record."""
        self.state: Final = self.core.state
        self.w: Final[_WRegisters] = self.core.w
        self.stop_on_fault = True
        """Whether a reset for a fault (illegal opcode, uninitialised pointer, trap conflict) ends a run."""
        self.resets: Final[list[tuple[int, str]]] = []
        """(cycle, cause) of the last resets."""
        self._pc_hooks: Final[dict[int, list[PcHook]]] = {}
        self._stopped_at: tuple[int, int] | None = None
        self._last_reset = LastReset()
        self._interrupt = False
        self._last = 0
        self._cuts: list[int] = []
        self.scout: Callable[[], bool] | None = None
        """Called instead of the hooks of a hooked address while what was told before is run again."""
        self._no_restart: Callable[[], None] | None = None
        self.evidence: Final = Evidence()
        """What the last run left for whoever explains a fault."""
        self.core.exceptions.on_trap = self._trapped
        self._clock: Final = (
            self.record.u64,
            self.state.at["cpu.cycle"],
            self.events.deadline_index,
            self.state.at["cpu.mode"],
        )
        """What `run_until` looks at first: the view of the record, indices of the cycle, the deadline and the mode."""
        if strict:
            if engine not in ("auto", "plain"):
                raise ValueError(f"a strict run needs the plain engine, not {engine!r}")
            from emu.debug import strict as watching

            engine = "plain"
            self.strict = watching.Strict(self, watching.reserve(self.record, chip.data["ram"].end))
        self.runner = make_engine(engine, self.core, self._pc_hooks)
        self.reset("POR")

    @property
    def engine(self) -> str:
        """Name of the engine in use."""
        return self.runner.name

    @property
    def cycle(self) -> int:
        """Cycle in which the next instruction starts, in Tcy since power-on."""
        return self.state.cycle

    @property
    def is_asleep(self) -> bool:
        """Whether the CPU stands in Idle or Sleep."""
        return self.state.mode != RUN

    @property
    def hz(self) -> Fraction:
        """Instruction cycles per second (Fcy) at the present clock setting: 14,745,600 on an e-puck."""
        return Fraction(self.peripherals.fcy)

    @property
    def seconds(self) -> float:
        """Simulated time since power-on in s, at `cycle`."""
        return self.peripherals.seconds(self.cycle)

    def cycles_in(self, seconds: float | Fraction) -> int:
        """Whole cycles in so many seconds at the present clock setting, at least 1."""
        return max(1, int(Fraction(seconds) * self.hz))

    @property
    def pc(self) -> int:
        """Program address of the next instruction."""
        return self.state.pc

    @pc.setter
    def pc(self, address: int) -> None:
        self.state.pc = address & PC_MASK
        self.state.stall = 0

    def _connect(self, wires: Wires) -> None:
        """The few lines between the CPU and the devices."""
        sequencer = self.core.sequencer
        power = sequencer.power
        wires.reset = self._device_reset
        wires.wake = power.wake
        wires.stall_until = sequencer.hold_until
        wires.trap = self.core.traps.request_flag
        wires.run = lambda cycles: self.run(cycles=cycles)
        wires.end_run = self.interrupt
        power.wires.clear_watchdog = lambda: self.peripherals.clear_watchdog(self.events.now)
        power.wires.power = self._power
        power.wires.idling, power.wires.clearing = self.peripherals.watchdog.idling, self.peripherals.watchdog.clearing
        power.wires.restart = self.peripherals.oscillator.wake_tcy
        power.wires.can_wake = lambda: self.peripherals.watchdog.is_enabled
        power.wires.interrupted = lambda: self._interrupt

    def _power(self, mode: int, cycle: int) -> None:
        """The CPU stops after `cycle` - 1, or runs again from `cycle`."""
        if mode == RUN:
            self.peripherals.wake(cycle)
        else:
            self.peripherals.sleep(mode, cycle - 1)

    def _device_reset(self, cause: str) -> None:
        """A peripheral resets the chip in the middle of whatever goes on."""
        raise DeviceReset(cause, f"reset by {cause}", fault=False)

    # Running

    def run_until(self, cycle: int) -> Stop | None:
        """Run to the first instruction boundary at or after `cycle`; None if nothing stopped the run before."""
        u64, now, deadline, mode = self._clock
        if u64[now] < cycle < u64[deadline] < NEVER and self.record.u16[mode] != RUN and not self._interrupt:
            u64[now] = u64[self.events.now_index] = cycle  # asleep, and nothing is due before `cycle`
            return None
        state, sequencer, engine, hooks = self.state, self.core.sequencer, self.runner, self._pc_hooks
        stop = None
        while stop is None and u64[now] < cycle:
            try:
                if engine.natively(cycle):
                    pass
                elif not sequencer.boundary(cycle):
                    stop = self.stopped("halt")
                elif state.cycle >= cycle or self._interrupt:
                    break
                elif state.pc in hooks:
                    stop = self._hit()
                    if stop is None:
                        engine.run(cycle)
                else:
                    engine.run(cycle)
            except Breakpoint as word:
                stop = self._explained(Stop("breakpoint", state.pc - 2, state.cycle, str(word)))
            except DeviceReset as reset:
                stop = self._reset_by(reset)
            except Violation as what:
                stop = self._explained(Stop("fault", what.pc, state.cycle, str(what)))
            if self._interrupt:
                break
        if self._interrupt:
            self._interrupt = False
            stop = stop or self.stopped("interrupted")
        return self._arrive() or stop

    def run_past(self, first: int, period: int, last: int, cuts: list[int]) -> Stop | None:
        """As `run_until(last)`, and `cuts` gets the cycle of the first boundary at or after `first`, `first` + `period`
        and so on: where runs to each of them would have ended. `end_at_cut` ends it earlier."""
        self._last, self._cuts, runner, began = last, cuts, self.runner, len(cuts)
        while True:
            limit = first + period * (len(cuts) - began)
            runner.pass_limits(period, self._last)
            try:
                stop = self.run_until(min(limit, self._last))
            finally:  # a callback may raise: later runs have limits of their own
                runner.pass_limits(0, 0)
                cuts += runner.passed()
            now = self.state.cycle
            if stop is not None:
                return stop
            while first + period * (len(cuts) - began) <= now:
                cuts.append(now)
            if now >= self._last:
                return None

    def lend(self, run: Run) -> Native | None:
        """Let `run` run native code from now on, for who runs many machines at once (emu/system/native_handle.py).
        None for an engine
        that has none. It may end a `run_past` later than was asked by moving `Native.last`."""
        return self.runner.lend(run)

    def end_at_cut(self) -> None:
        """Let the `run_past` in which this is called end at its next cut, or before."""
        self._last = 0
        self.runner.pass_limits(0, 0)

    def cuts_so_far(self) -> list[int]:
        """What a `run_past` in which this is called has found up to here."""
        self._cuts += self.runner.passed()
        return self._cuts

    def run(
        self,
        cycles: int | None = None,
        until: Callable[[], bool] | Place | None = None,
        *,
        seconds: float | Fraction | None = None,
    ) -> Stop:
        """Run until something stops the machine: at most `cycles` Tcy or `seconds` of simulated time.

        `until` is the name of a function or label, a program address (the run ends with reason "until" at the next
        arrival there), or a condition tested between instructions (slow). Raises KeyError for an unknown name,
        ValueError for both limits.
        """
        if seconds is not None:
            if cycles is not None:
                raise ValueError("give cycles or seconds, not both")
            cycles = self.cycles_in(seconds)
        limit = NEVER if cycles is None else self.cycle + cycles
        if until is None:
            return self.advance(limit) or self.stopped("limit")
        if not callable(until):
            return self._run_to(self.program_address(until), limit)
        checkpoint = 0
        while self.cycle < limit:
            if self.cycle >= checkpoint:
                checkpoint = self.cycle + CHECKPOINT_CYCLES
                self.evidence.look(self.cycle, self.record.snapshot())
            stop = self.step()
            if stop is not None:
                return stop
            if until():
                return self.stopped("until")
        return self.stopped("limit")

    def advance(self, cycle: int) -> Stop | None:
        """As `run_until`, and able to tell what led to a fault: it remembers where it was now and then."""
        while True:
            self.evidence.look(self.cycle, self.record.snapshot())
            stop = self.run_until(min(cycle, self.cycle + CHECKPOINT_CYCLES))
            self.evidence.ended = self.record.snapshot()
            if stop is not None or self.cycle >= cycle:
                return stop

    def _run_to(self, address: int, limit: int) -> Stop:
        """Run to the next arrival at a program address."""
        start = self.cycle
        remove = self.hook_pc(address, lambda: self.cycle > start)
        try:
            stop = self.advance(limit)
        finally:
            remove()
        if stop is None:
            return self.stopped("limit")
        return self.stopped("until") if stop.reason == "breakpoint" and stop.pc == address else stop

    def step(self) -> Stop | None:
        """One instruction, after whatever is to be done at the boundary before it; None if nothing stopped it.

        A sleeping CPU sleeps until something wakes it.
        """
        state = self.state
        stop = None
        try:
            if not self.core.sequencer.boundary(NEVER):
                stop = self.stopped("halt")
            else:
                stop = self._hit() if state.pc in self._pc_hooks else None
                if stop is None:
                    self.core.sequencer.execute()
        except Breakpoint as word:
            stop = self._explained(Stop("breakpoint", state.pc - 2, state.cycle, str(word)))
        except DeviceReset as reset:
            stop = self._reset_by(reset)
        except Violation as what:
            stop = self._explained(Stop("fault", what.pc, state.cycle, str(what)))
        return self._arrive() or stop

    def approach(self, limit: int) -> Stop | None:
        """Do what is due before the next instruction, as `step` does first: events, exception entry, sleep up to
        cycle `limit`. Afterwards `pc` and `cycle` are those of the instruction `step` will run."""
        try:
            return None if self.core.sequencer.boundary(limit) else self.stopped("halt")
        except DeviceReset as reset:
            return self._reset_by(reset)

    def _arrive(self) -> Stop | None:
        """Bring the devices to the present cycle, for whoever looks at the machine between runs.

        What is due in the very cycle a sleeping CPU has got to is left for the next run: cutting a run in two must
        not show, not even in the cycle in which nothing is left to happen.
        """
        u64, now, _, mode = self._clock
        cycle = u64[now]
        try:
            self.events.arrive(cycle if self.record.u16[mode] == RUN else cycle - 1)
        except DeviceReset as reset:
            return self._reset_by(reset)
        u64[self.events.now_index] = cycle
        self.peripherals.tell()
        return None

    def interrupt(self) -> None:
        """Make the current run end at its next boundary (signal handlers)."""
        self._interrupt = True
        self.events.kick()

    def stopped(self, reason: str, detail: str = "") -> Stop:
        """A `Stop` for the present state; a firmware that sleeps where it must not is a fault."""
        stop = Stop(reason, self.pc, self.cycle, detail)
        return self._explained(stop) if reason in ("halt", "limit") and self.is_asleep else stop

    def _explained(self, stop: Stop) -> Stop:
        """`stop` with its fault, if it is one and there is an image to tell by."""
        if self.image is None or self.events.quiet:
            return stop
        from emu.machine.fault_report import explained  # most runs end well

        return explained(self, stop)

    def _trapped(self, vector: Vector) -> None:
        """A trap is about to be entered: handlers that never come back say little, so keep what there was."""
        if not self.events.quiet:
            self.evidence.trap = (vector, self.record.snapshot(), self.evidence.began)

    def _hit(self) -> Stop | None:
        """Call the hooks of the present PC; a `Stop` if one of them wants it, at most once per arrival."""
        here = (self.state.pc, self.state.cycle)
        if self._stopped_at == here:
            self._stopped_at = None
            return None
        if self.events.quiet:
            return self.stopped("breakpoint") if self.scout is not None and self.scout() else None
        hit = False
        for hook in list(self._pc_hooks[self.state.pc]):
            hit = bool(hook()) or hit
        if not hit:
            return None
        self._stopped_at = here
        if self._restarted():
            return self._explained(self.stopped("fault", RESTART))
        return self.stopped("breakpoint")

    def _restarted(self) -> bool:
        """Whether the program is at address 0 without a reset. Behind one it is still the same cycle, or the clock has
        started up meanwhile and no W register has been written."""
        if not self.stop_on_fault or self.state.pc or self.state.initialised == W15_INITIALISED:
            return False
        return self.resets[-1][0] != self.cycle

    # Resets

    def reset(self, cause: str = "EXTR") -> None:
        """Reset for `cause`: the RCON bit POR, BOR, EXTR (MCLR pin), SWR, WDTO, TRAPR or IOPUWR (isa.md §14.6)."""
        self.events.now = self.cycle
        u16 = self.record.u16
        for word in range(self.chip.sfrs["INTCON1"].address >> 1):
            u16[word] = self.bus.reset_value[word]
        if cause == "POR":
            ram = self.chip.data["ram"]
            self.record.bytes[ram.start : ram.end] = bytes(ram.size)
            if self.strict is not None:
                self.strict.power_on()
        self.core.reset()
        self.peripherals.reset(cause)
        self.events.kick()
        self.resets.append((self.cycle, cause))
        del self.resets[:-RESETS_KEPT]

    def _reset_by(self, reset: DeviceReset) -> Stop | None:
        """Carry out a reset the core or a device asked for; a fault, or a loop of resets, ends the run."""
        culprit = self.pc
        self.evidence.reset = self.record.snapshot() if reset.fault and not self.events.quiet else None
        if reset.fault:
            self.state.cycle += 1
        self.reset(reset.cause)
        self._last_reset = last = following(self._last_reset, reset.cause, culprit, self.cycle)
        loop = not last.repeats
        if not self.stop_on_fault or not (reset.fault or loop):
            return None
        detail = reset.detail if reset.fault else f"reset loop: {reset.detail}, {RESET_LOOP} times in a row"
        return self._explained(Stop("fault", culprit, self.cycle, detail))

    # Memory

    def load(self, image: Image) -> None:
        """Put an image into program memory and reset as after power-on.

        Configuration words the image leaves out are those of the board (a bare chip: watchdog off). Its symbols become
        names for `read`, `write`, `peek` and `poke`.
        """
        self.image = image
        self.program.erase()
        for address, word in self.peripherals.config.items():
            self.program.put(address, word)
        for block in image.blocks:
            if block.end <= self.chip.program["flash"].end:
                self.program.put_flash(block.base, list(block.words))
            else:
                for index, word in enumerate(block.words):
                    self.program.put(block.base + 2 * index, word)
        self.reset("POR")
        if self._no_restart is None:
            self._no_restart = self.hook_pc(0, self._restarted)

    # State

    def snapshot(self) -> bytes:
        """A copy of the whole state. Whoever continues from it looks for work first: the deadline is derived data, and
        so is when a request that is held back becomes acceptable, which is known to who has looked since.

        Equal machines give equal copies whatever their engines: what waits to be told is told first.
        """
        self.pins.flush()
        self.peripherals.tell()
        self.peripherals.settle()
        self.core.exceptions.forget()
        self.events.kick()
        return self.record.snapshot()

    def restore(self, state: bytes) -> None:
        """Continue from a snapshot of an equally wired machine, whatever engine made it. Raises ValueError."""
        self.put_back(state)
        self._stopped_at = None
        self.evidence.trap = None

    def put_back(self, state: bytes) -> None:
        """The record alone, of this very machine and run; what else `restore` forgets is kept. Raises ValueError."""
        flash = self.program.flash.tobytes()
        self.record.restore(state)
        if self.program.flash.tobytes() != flash:
            self.program.announce_all()
        self.peripherals.restored()

    def hold(self) -> Callable[[], None]:
        """Note what is not in the record; returns how to put it back as it was."""
        stopped_at, last_reset, interrupt, resets = (
            self._stopped_at, self._last_reset, self._interrupt, list(self.resets),
        )  # fmt: skip
        waiting = [(uart.line.backlog, list(uart.line.backlog)) for uart in self.uart.values()]

        def put_back() -> None:
            self._stopped_at, self._last_reset, self._interrupt = stopped_at, last_reset, interrupt
            self.resets[:] = resets
            for backlog, frames in waiting:
                backlog.clear()
                backlog.extend(frames)

        return put_back

    # Hooks

    def hook_pc(self, place: Place, hook: PcHook) -> Callable[[], None]:
        """Call `hook` before the instruction at `place`, the name of a function or label or a program address; a true
        result stops the run. Returns how to remove it. Raises KeyError for an unknown name, ValueError for an odd
        address."""
        address = self.program_address(place)
        self._pc_hooks.setdefault(address, []).append(hook)
        self.runner.forget()
        removed = False

        def remove() -> None:
            nonlocal removed
            if removed:
                return
            removed = True
            self._pc_hooks[address].remove(hook)
            if not self._pc_hooks[address]:
                del self._pc_hooks[address]
            self.runner.forget()

        return remove
