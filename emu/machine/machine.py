"""One microcontroller: record, clock, bus, CPU and peripherals wired together, and the run loop.

Inputs: an image, pin levels, UART bytes. Outputs: `Stop`s, registers, memory, and callbacks of peripherals. Time is
`Machine.cycle`, in Tcy since power-on; it never decreases. The machine knows no debugger: `emu.debug` attaches to it
through `Machine.diagnose` and the `observer` argument.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from fractions import Fraction
from numbers import Real
from pathlib import Path
from typing import Any, Final, Protocol

from emu.chips.chip import Chip, Vector
from emu.chips.dspic30f6014a import DSPIC30F6014A
from emu.dspic30f.core import Core
from emu.dspic30f.engines import make_engine
from emu.dspic30f.exceptions.faults import RESTART, DebuggerWord, DeviceReset, Violation
from emu.dspic30f.exceptions.power import DRAIN_CYCLES
from emu.dspic30f.isa.flow import PC_MASK
from emu.dspic30f.state.state import RUN, W15_INITIALISED
from emu.image.model import Image
from emu.machine import saved_state
from emu.machine.pc_hooks import PcHook, PcHooks
from emu.machine.state_access import MemoryObserver, NameOrAddress, StateAccess
from emu.machine.stops import (
    CHECKPOINT_CYCLES,
    RESET_LOOP,
    RESETS_KEPT,
    SLEEP_CYCLES,
    STILL_ASLEEP,
    LastReset,
    RunCheckpoints,
    Stop,
    next_reset,
)
from emu.peripherals import CpuSignals, Peripherals, build
from emu.system.bus import Bus
from emu.system.events import NEVER, Events
from emu.system.hook_filters import Filter
from emu.system.native_handle import Native, Run
from emu.system.program import ProgramMemory
from emu.system.record import Record


class _WRegisters(Protocol):
    def __getitem__(self, number: int) -> int: ...
    def __setitem__(self, number: int, value: int) -> None: ...


class Machine(StateAccess):
    """A chip with a program. `docs/reference/engines.md` describes the engines.

        >>> import emu
        >>> machine = emu.load("firmware.elf")
        >>> machine.run(cycles=1000).reason, machine.cycle >= 1000
        ('limit', True)
        >>> state = machine.snapshot()
        >>> machine.run(until="twice").reason
        'until'
        >>> machine.poke("count", 7)
        >>> machine.peek("count"), machine.w[0] == machine.peek("W0")
        (7, True)
        >>> machine.restore(state)
        >>> machine.peek("count") == 7
        False

    `ipl_slip` = 1 accepts an interrupt right after a write that raises IPL or clears IEC (isa.md §14.3).
    `board` is called with the peripherals and returns the board around the chip (`emu.boards`).
    `observer` is called with the machine and returns an observer of its memory; it may reserve room in the record.
    Both are called before the engine is created. Raises ValueError for an unknown engine.
    """

    def __init__(
        self,
        chip: Chip = DSPIC30F6014A,
        *,
        engine: str = "auto",
        ipl_slip: int = 0,
        board: Callable[[Peripherals], Any] | None = None,
        observer: Callable[[Machine], MemoryObserver] | None = None,
    ) -> None:
        record = Record(chip.data["ram"].end)
        self.events: Final = Events(record)
        bus = Bus(record, self.events, chip.data["sfr"].end)
        program = ProgramMemory(record, chip)
        wires = CpuSignals()
        self.peripherals: Final = build(chip, bus, program, wires)
        self.pins: Final = self.peripherals.pins
        self.uart: Final = self.peripherals.uart
        super().__init__(chip, Core(record, self.events, bus, program, chip))
        self.core.exceptions.ipl_slip = ipl_slip
        self._connect(wires)
        self.board: Final[Any] = board(self.peripherals) if board is not None else None
        """The board, for example an `emu.boards.epuck.board.Epuck`. Its state is part of the record."""
        self.state: Final = self.core.state
        self.w: Final[_WRegisters] = self.core.w
        self.stop_on_fault = True
        """Whether a reset for a fault (illegal opcode, uninitialised pointer, trap conflict) ends a run."""
        self.resets: Final[list[tuple[int, str]]] = []
        """(cycle, cause) of the last resets."""
        self._pc_hooks: Final = PcHooks()
        self._last_hook_stop: tuple[int, int] | None = None
        """PC and cycle at which a hook ended the last run."""
        self._last_reset = LastReset()
        self._interrupt = False
        self._last = 0
        self._cuts: list[int] = []
        self.replay_condition: Callable[[], bool] | None = None
        """Called instead of the hooks of a hooked address during replay (`Events.quiet`)."""
        self.diagnose: Callable[[Stop], Stop] | None = None
        """Called with every stop that may be a firmware fault; returns the stop to report."""
        self._restart_hook: Callable[[], None] | None = None
        self.checkpoints: Final = RunCheckpoints()
        """States of the last run that fault diagnosis replays from."""
        self.core.exceptions.on_trap = self._on_trap
        self._clock: Final = (
            self.record.u64,
            self.state.at["cpu.cycle"],
            self.events.deadline_index,
            self.state.at["cpu.mode"],
            self.record.fields["cpu.slept"].index,
        )
        """For the fast path of `run_until`: the 64-bit view of the record, and the indices of cycle, deadline, mode and
        the cycle in which the CPU stopped."""
        self.memory_observer = observer(self) if observer is not None else None
        self.runner = make_engine(engine, self.core, self._pc_hooks.by_address, self._pc_hooks.filters)
        self.reset("POR")

    def __repr__(self) -> str:
        name = f"{self.chip.name}: {Path(self.image.path).name[-60:]}" if self.image is not None else self.chip.name
        return f"<Machine {name}, at {self.pc:#08x}, cycle {self.cycle:,}, {self.seconds:.6f} s>"

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
        """Whether the CPU is in Idle or Sleep mode."""
        return self.state.mode != RUN

    @property
    def hz(self) -> Fraction:
        """Instruction cycles per second (Fcy) at the current clock setting: 14,745,600 on an e-puck."""
        return Fraction(self.peripherals.fcy)

    @property
    def seconds(self) -> float:
        """Simulated time since power-on in s, at `cycle`."""
        return self.peripherals.seconds(self.cycle)

    def cycles_in(self, seconds: float | Fraction) -> int:
        """Whole cycles in `seconds` at the current clock setting, at least 1. Raises ValueError for a negative time."""
        if not isinstance(seconds, Real) or not 0 <= seconds < math.inf:
            raise ValueError(f"seconds = {seconds!r}: expected a number of 0 or more")
        return max(1, int(Fraction(seconds) * self.hz))

    @property
    def pc(self) -> int:
        """Program address of the next instruction."""
        return self.state.pc

    @pc.setter
    def pc(self, address: int) -> None:
        self.state.pc = address & PC_MASK
        self.state.stall = 0
        self._set_last_hook_stop(self._last_hook_stop)

    def _connect(self, wires: CpuSignals) -> None:
        """Connect the signals between the CPU and the peripherals."""
        sequencer = self.core.sequencer
        power = sequencer.power
        wires.reset = self._device_reset
        wires.wake = power.wake
        wires.stall_until = sequencer.hold_until
        wires.trap = self.core.traps.request_flag
        wires.run = lambda cycles: self.run(cycles=cycles)
        wires.end_run = self.interrupt
        power.signals.clear_watchdog = lambda: self.peripherals.clear_watchdog(self.events.now)
        power.signals.power = self._on_power_change
        power.signals.idle_rule, power.signals.clrwdt_rule = (
            self.peripherals.watchdog.idling,
            self.peripherals.watchdog.clearing,
        )
        power.signals.restart = self.peripherals.oscillator.wake_tcy
        power.signals.can_wake = lambda: self.peripherals.watchdog.is_enabled
        power.signals.interrupted = lambda: self._interrupt

    def _on_power_change(self, mode: int, cycle: int) -> None:
        """Stop or resume the peripherals' clocks: the CPU sleeps after `cycle` - 1, or wakes at `cycle`."""
        if mode == RUN:
            self.peripherals.wake(cycle)
        else:
            self.peripherals.sleep(mode, cycle - 1)

    def _device_reset(self, cause: str) -> None:
        """Raise DeviceReset for a reset that a peripheral requests during an instruction or event."""
        raise DeviceReset(cause, f"reset by {cause}", fault=False)

    # Running

    def run_until(self, cycle: int) -> Stop | None:
        """Run to the first instruction boundary at or after `cycle`. Return the stop that ended the run earlier, or
        None."""
        u64, now, deadline, mode, slept = self._clock
        if (
            u64[now] < cycle < u64[deadline] < NEVER
            and self.record.u16[mode] != RUN
            and cycle <= u64[slept] + DRAIN_CYCLES
            and not self._interrupt
        ):
            u64[now] = u64[self.events.now_index] = cycle  # the CPU sleeps, and no event is due before `cycle`
            return None
        state, sequencer, engine, hooks = self.state, self.core.sequencer, self.runner, self._pc_hooks.by_address
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
                    stop = self._call_hooks()
                    if stop is None:
                        engine.run(cycle)
                else:
                    engine.run(cycle)
            except DebuggerWord as word:
                stop = self._diagnosed(Stop("breakpoint", state.pc - 2, state.cycle, str(word)))
            except DeviceReset as reset:
                stop = self._reset_by(reset)
            except Violation as what:
                stop = self._diagnosed(Stop("fault", what.pc, state.cycle, str(what)))
            if self._interrupt:
                break
        if self._interrupt:
            self._interrupt = False
            stop = stop or self.stopped("interrupted")
        return self._sync_devices() or stop

    def run_past(self, first: int, period: int, last: int, cuts: list[int]) -> Stop | None:
        """Run to cycle `last` as `run_until` does, and append the end of every period to `cuts`.

        The end of a period is the first instruction boundary at or after `first`, `first` + `period` and so on.
        `end_at_cut` ends the run earlier.
        """
        self._last, self._cuts, runner, began = last, cuts, self.runner, len(cuts)
        while True:
            limit = first + period * (len(cuts) - began)
            runner.pass_limits(period, self._last)
            try:
                stop = self.run_until(min(limit, self._last))
            finally:  # also if a callback raises: the limits belong to this run only
                runner.pass_limits(0, 0)
                cuts += runner.passed()
            now = self.state.cycle
            if stop is not None:
                return stop
            while first + period * (len(cuts) - began) <= now:
                cuts.append(now)
            if now >= self._last:
                return None

    def attach_runner(self, run: Run) -> Native | None:
        """Return the handle by which another native program runs this machine (emu/system/native_handle.py).

        From now on `run` executes the native code. It may extend a `run_past` by moving `Native.last`. Returns None for
        an engine without native code.
        """
        return self.runner.attach_runner(run)

    def end_at_cut(self) -> None:
        """Make the current `run_past` end at its next cut at the latest."""
        self._last = 0
        self.runner.pass_limits(0, 0)

    def cuts_so_far(self) -> list[int]:
        """Return the cuts that the current `run_past` has found so far."""
        self._cuts += self.runner.passed()
        return self._cuts

    def run(
        self,
        cycles: int | None = None,
        until: Callable[[], bool] | NameOrAddress | None = None,
        *,
        seconds: float | Fraction | None = None,
    ) -> Stop:
        """Run until a stop, for at most `cycles` Tcy or `seconds` of simulated time.

        `until` names a function or label, or is a program address: the run ends with reason "until" when the PC next
        reaches it. It may also be a function, which is called after every instruction and therefore slow. Raises
        KeyError for an unknown name, ValueError if both limits are given or a limit is not above 0.
        """
        limit = self._limit_of(cycles, seconds)
        if until is None:
            return self.advance(limit) or self.stopped("limit")
        if callable(until):
            return self.step_until(until, limit)
        return self.run_to(self.program_address(until), limit)

    def _limit_of(self, cycles: int | None, seconds: float | Fraction | None) -> int:
        """Return the cycle at which a run ends. Raises as `run`."""
        if seconds is not None:
            if cycles is not None:
                raise ValueError("give cycles or seconds, not both")
            if seconds == 0:
                raise ValueError(f"seconds = {seconds!r}: expected a number above 0")
            cycles = self.cycles_in(seconds)
        if cycles is not None and not (isinstance(cycles, Real) and 0 < cycles < math.inf and cycles == int(cycles)):
            raise ValueError(f"cycles = {cycles!r}: expected a whole number above 0")
        return NEVER if cycles is None else self.cycle + int(cycles)

    def step_until(self, condition: Callable[[], bool], limit: int) -> Stop:
        """Run to the first instruction after which `condition` holds, at most to cycle `limit`."""
        checkpoint = 0
        while self.cycle < limit:
            if self.cycle >= checkpoint:
                checkpoint = self.cycle + CHECKPOINT_CYCLES
                self.checkpoints.take(self.cycle, self.save_state())
            stop = self.step(limit)
            if stop is not None and stop.reason != "limit":
                return stop
            if condition():
                return self.stopped("until")
        return self.stopped("limit")

    def advance(self, cycle: int) -> Stop | None:
        """Run as `run_until` does, and take checkpoints from which a fault can be diagnosed."""
        state = self.save_state()
        while True:
            self.checkpoints.take(self.cycle, state)
            stop = self.run_until(min(cycle, self.cycle + CHECKPOINT_CYCLES))
            state = self.checkpoints.end = self.save_state()
            if stop is not None or self.cycle >= cycle:
                return stop

    def run_to(
        self, address: int, limit: int, condition: Callable[[], bool] = lambda: True, when: Filter | None = None
    ) -> Stop:
        """Run until the PC next reaches `address` while `condition` holds, at most to cycle `limit`.

        `when` is a filter of the condition.
        """
        start = self.cycle
        remove = self.hook_pc(address, lambda: self.cycle > start and condition(), when)
        try:
            stop = self.advance(limit)
        finally:
            remove()
        if stop is None:
            return self.stopped("limit")
        return self.stopped("until") if stop.reason == "breakpoint" and stop.pc == address else stop

    def step(self, limit: int | None = None) -> Stop | None:
        """Run one instruction, and first all that is due at the boundary before it. Return a stop, or None.

        A sleeping CPU sleeps until an event wakes it, at most to cycle `limit` (by default for SLEEP_CYCLES). If it
        still sleeps then, no instruction runs, and the reason of the stop is "limit", or "interrupted".
        """
        state = self.state
        stop = None
        limit = self.cycle + SLEEP_CYCLES if limit is None else limit
        try:
            if not self.core.sequencer.boundary(limit):
                stop = self.stopped("halt")
            elif self.is_asleep:
                stop = self._still_asleep()
            else:
                stop = self._call_hooks() if state.pc in self._pc_hooks.by_address else None
                if stop is None:
                    self.core.sequencer.execute()
        except DebuggerWord as word:
            stop = self._diagnosed(Stop("breakpoint", state.pc - 2, state.cycle, str(word)))
        except DeviceReset as reset:
            stop = self._reset_by(reset)
        except Violation as what:
            stop = self._diagnosed(Stop("fault", what.pc, state.cycle, str(what)))
        return self._sync_devices() or stop

    def _still_asleep(self) -> Stop:
        """Return the stop of a step in which no event has woken the CPU."""
        if self._interrupt:
            self._interrupt = False
            return self.stopped("interrupted")
        return Stop("limit", self.pc, self.cycle, STILL_ASLEEP)

    def service_boundary(self, limit: int) -> Stop | None:
        """Handle all that is due before the next instruction: events, exception entry, sleep up to cycle `limit`.

        Afterwards `pc` and `cycle` are those of the instruction that `step` runs. Return a stop, or None.
        """
        stop = None
        try:
            if not self.core.sequencer.boundary(limit):
                stop = self.stopped("halt")
        except DeviceReset as reset:
            stop = self._reset_by(reset)
        return self._sync_devices() or stop

    def _sync_devices(self) -> Stop | None:
        """Bring the devices to the present cycle and deliver their output. Return the stop of a reset, or None."""
        try:
            self._bring_devices_to_present()
        except DeviceReset as reset:
            return self._reset_by(reset)
        self.peripherals.deliver_uart_output()
        return None

    def _bring_devices_to_present(self) -> None:
        """Fire the events due by the present cycle, so that an observer sees every device in its present state.

        It runs before every call of an observer: hooks, conditions, and code of the caller between two runs. It does
        not change the run, because the events of the present cycle precede the accesses of the next instruction. If
        the CPU sleeps, the events due in the present cycle are left to the next run. Raises DeviceReset.
        """
        u64, now, _, mode, _ = self._clock
        cycle = u64[now]
        self.events.arrive(cycle if self.record.u16[mode] == RUN else cycle - 1)
        u64[self.events.now_index] = cycle

    def interrupt(self) -> None:
        """End the current run at its next boundary. May be called from a signal handler."""
        self._interrupt = True
        self.events.kick()

    def stopped(self, reason: str, detail: str = "") -> Stop:
        """Return a `Stop` for the current state, diagnosed if the CPU sleeps."""
        stop = Stop(reason, self.pc, self.cycle, detail)
        return self._diagnosed(stop) if reason in ("halt", "limit") and self.is_asleep else stop

    def _diagnosed(self, stop: Stop) -> Stop:
        """Return `stop` as `diagnose` classifies it. Replays, and machines without an image, are not diagnosed."""
        if self.diagnose is None or self.image is None or self.events.quiet:
            return stop
        return self.diagnose(stop)

    def _on_trap(self, vector: Vector) -> None:
        """Keep the state before a trap is entered: a handler that never returns destroys the evidence."""
        if not self.events.quiet:
            self.checkpoints.trap = (vector, self.save_state(), self.checkpoints.start)

    def _call_hooks(self) -> Stop | None:
        """Call the hooks of the current PC. Return a `Stop` if one requests it, at most once per arrival."""
        here = (self.state.pc, self.state.cycle)
        if self._last_hook_stop == here:
            self._set_last_hook_stop(None)
            return None
        self._bring_devices_to_present()
        if self.events.quiet:
            return self.stopped("breakpoint") if self.replay_condition is not None and self.replay_condition() else None
        hit = False
        for hook in list(self._pc_hooks.by_address[self.state.pc]):
            hit = bool(hook()) or hit
        if not hit:
            return None
        self._set_last_hook_stop(here)
        if self._has_restarted():
            return self._diagnosed(self.stopped("fault", RESTART))
        return self.stopped("breakpoint")

    def _set_last_hook_stop(self, place: tuple[int, int] | None) -> None:
        self._last_hook_stop = place
        self.runner.skip_hooks_at(self.cycle if place == (self.pc, self.cycle) else NEVER)

    def _has_restarted(self) -> bool:
        """Whether the PC has reached address 0 without a reset.

        Right after a reset, the cycle is that of the reset. If the clock had to start up, the cycle is later, but no W
        register has been written yet.
        """
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
            if self.memory_observer is not None:
                self.memory_observer.on_power_on()
        self.core.reset()
        self.peripherals.reset(cause)
        self.events.kick()
        self.resets.append((self.cycle, cause))
        del self.resets[:-RESETS_KEPT]

    def _reset_by(self, reset: DeviceReset) -> Stop | None:
        """Perform a reset that the core or a peripheral requested. A fault, or a loop of resets, ends the run."""
        origin = self.pc
        self.checkpoints.reset = self.save_state() if reset.fault and not self.events.quiet else None
        if reset.fault:
            self.state.cycle += 1
        self.reset(reset.cause)
        self._last_reset = last = next_reset(self._last_reset, reset.cause, origin, self.cycle)
        loop = not last.repeats and not self.events.quiet  # the count belongs to the present, not to a replay
        if not self.stop_on_fault or not (reset.fault or loop):
            return None
        detail = reset.detail if reset.fault else f"reset loop: {reset.detail}, {RESET_LOOP} times in a row"
        return self._diagnosed(Stop("fault", origin, self.cycle, detail))

    # Memory

    def load(self, image: Image) -> None:
        """Write an image into program memory and perform a power-on reset.

        The board supplies configuration words that the image omits (a bare chip: watchdog off). The image's symbols
        become names for `read`, `write`, `peek` and `poke`.
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
        if self._restart_hook is None:
            self._restart_hook = self.hook_pc(0, self._has_restarted)

    # State

    def snapshot(self) -> bytes:
        """Return a copy of the whole state. Equal machines give equal copies in every engine.

        Pending callbacks are delivered first. Derived data are normalised: the deadline, and the cycle at which a
        deferred interrupt request becomes acceptable. A run that continues from the copy computes them again.
        """
        self.pins.flush()
        self.peripherals.deliver_uart_output()
        self.peripherals.synchronize()
        self.core.exceptions.forget()
        self.events.kick()
        return self.save_state()

    def restore(self, state: bytes) -> None:
        """Continue from a snapshot of an equally wired machine with any engine. Raises ValueError for another size."""
        self.restore_state(state)
        self._set_last_hook_stop(None)
        self.checkpoints.trap = None

    def save_state(self) -> bytes:
        """Return a copy of the record and of the UART input that does not fit into it, and change nothing."""
        return saved_state.save(self.record, self.uart.values())

    def restore_state(self, state: bytes) -> None:
        """Restore the record and the waiting UART input, from a snapshot of an equally wired machine.

        The host-side state that `restore` clears is kept. Raises ValueError for another size.
        """
        flash = self.program.flash.tobytes()
        saved_state.restore(self.record, self.uart.values(), state)
        if self.program.flash.tobytes() != flash:
            self.program.announce_all()
        self.peripherals.restored()

    def save_host_state(self) -> Callable[[], None]:
        """Save the state that is not in a snapshot. Return a function that restores it."""
        hook_stop, last_reset, interrupt, resets = (
            self._last_hook_stop, self._last_reset, self._interrupt, list(self.resets),
        )  # fmt: skip

        def restore() -> None:
            self._set_last_hook_stop(hook_stop if hook_stop == (self.pc, self.cycle) else None)
            self._last_reset, self._interrupt = last_reset, interrupt
            self.resets[:] = resets

        return restore

    # Hooks

    def hook_pc(self, place: NameOrAddress, hook: PcHook, when: Filter | None = None) -> Callable[[], None]:
        """Call `hook` before the instruction at `place`: a function, a label or a program address.

        A true result stops the run. With `when`, the hook need not be called where a comparison does not hold. Returns
        a function that removes the hook. Raises KeyError for an unknown name, ValueError for an odd address.
        """
        return self._pc_hooks.add(self.program_address(place), hook, when, self.runner.forget)
