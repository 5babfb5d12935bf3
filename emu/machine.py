"""One microcontroller: record, clock, bus, CPU and devices wired together, and THE loop that runs them.

What enters: an image, pin levels, bytes. What leaves: `Stop`s, registers and memory, callbacks of devices. Time is
`Machine.cycle`, in Tcy since power-on; it only grows.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final, Protocol

from emu.boards import epuck
from emu.bus import SFR_END, Bus
from emu.chips.chip import Chip
from emu.chips.dspic30f6014a import DSPIC30F6014A
from emu.dspic30f.core import Core
from emu.dspic30f.engines import Engine, make_engine
from emu.dspic30f.faults import Breakpoint, DeviceReset
from emu.dspic30f.state import RUN
from emu.events import NEVER, Events
from emu.image import Image
from emu.peripherals import Peripherals, Wires, build
from emu.program import ProgramMemory
from emu.record import Record

REASONS: Final = ("limit", "breakpoint", "halt", "fault", "until", "interrupted")

RESETS_KEPT: Final = 16
"""Length of `Machine.resets`."""
RESET_LOOP: Final = 8
"""Equal resets in a row, each within RESET_LOOP_CYCLES of the last, that count as a fault."""
RESET_LOOP_CYCLES: Final = 1_000_000

PcHook = Callable[[], bool | None]
SfrHook = Callable[[bool, int], None]


@dataclass(frozen=True, slots=True)
class Stop:
    """Why and where a run ended. `pc` is the next instruction, of a fault the culprit, of a debugger word that word."""

    reason: str
    pc: int
    cycle: int
    detail: str = ""


class _WRegisters(Protocol):
    def __getitem__(self, number: int) -> int: ...
    def __setitem__(self, number: int, value: int) -> None: ...


class Machine:
    """A chip with a program. See engine documentation in README.md for the choice of `engine`.

    `ipl_slip` = 1 lets an interrupt slip through right after a write that raises IPL or clears IEC (isa.md §14.3).
    `board` puts the chip on a board: it is called with the peripherals before the engine is made (`emu.boards`).
    """

    def __init__(
        self,
        chip: Chip = DSPIC30F6014A,
        *,
        engine: str = "auto",
        ipl_slip: int = 0,
        board: Callable[[Peripherals], Any] | None = None,
    ) -> None:
        self.chip: Final = chip
        self.record: Final = Record()
        self.events: Final = Events(self.record)
        self.bus: Final = Bus(self.record, self.events)
        self.program: Final = ProgramMemory(self.record, chip)
        wires = Wires()
        self.peripherals: Final = build(chip, self.bus, self.program, wires)
        self.pins: Final = self.peripherals.pins
        self.uart: Final = self.peripherals.uart
        self.core: Final = Core(self.record, self.events, self.bus, self.program, chip)
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
        self._last_reset = ("", 0, 0, 0)
        self._interrupt = False
        self._clock: Final = (
            self.record.u64,
            self.state.at["cpu.cycle"],
            self.events.deadline_index,
            self.state.at["cpu.mode"],
        )
        """What `run_until` looks at first: the view of the record, indices of the cycle, the deadline and the mode."""
        self.runner: Final[Engine] = make_engine(engine, self.core, self._pc_hooks)
        self.image: Image | None = None
        """What `load` was given last."""
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
    def pc(self) -> int:
        """Program address of the next instruction."""
        return self.state.pc

    @pc.setter
    def pc(self, address: int) -> None:
        self.state.pc = address & 0x7FFFFE
        self.state.stall = 0

    def _connect(self, wires: Wires) -> None:
        """The few lines between the CPU and the devices."""
        sequencer = self.core.sequencer
        power = sequencer.power
        wires.reset = self._device_reset
        wires.wake = power.wake
        wires.stall_until = sequencer.hold_until
        wires.trap = self.core.traps.request_flag
        power.wires.clear_watchdog = lambda: self.peripherals.clear_watchdog(self.events.now)
        power.wires.power = self._power
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
                elif state.pc in hooks and self._hit():
                    stop = self.stopped("breakpoint")
                else:
                    engine.run(cycle)
            except Breakpoint as word:
                stop = Stop("breakpoint", state.pc - 2, state.cycle, str(word))
            except DeviceReset as reset:
                stop = self._reset_by(reset)
            if self._interrupt:
                break
        if self._interrupt:
            self._interrupt = False
            stop = stop or self.stopped("interrupted")
        return self._arrive() or stop

    def run(self, cycles: int | None = None, until: Callable[[], bool] | int | None = None) -> Stop:
        """Run until something stops the machine: at most `cycles` Tcy. `until` is a program address, or a condition
        tested between instructions (slow)."""
        limit = NEVER if cycles is None else self.cycle + cycles
        if until is None:
            return self.run_until(limit) or self.stopped("limit")
        if isinstance(until, int):
            return self._run_to(until, limit)
        while self.cycle < limit:
            stop = self.step()
            if stop is not None:
                return stop
            if until():
                return self.stopped("until")
        return self.stopped("limit")

    def _run_to(self, address: int, limit: int) -> Stop:
        """Run to the next arrival at a program address."""
        start = self.cycle
        remove = self.hook_pc(address, lambda: self.cycle > start)
        try:
            stop = self.run_until(limit)
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
            elif state.pc in self._pc_hooks and self._hit():
                stop = self.stopped("breakpoint")
            else:
                self.core.sequencer.execute()
        except Breakpoint as word:
            stop = Stop("breakpoint", state.pc - 2, state.cycle, str(word))
        except DeviceReset as reset:
            stop = self._reset_by(reset)
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
        return None

    def interrupt(self) -> None:
        """Make the current run end at its next boundary (signal handlers)."""
        self._interrupt = True
        self.events.kick()

    def stopped(self, reason: str, detail: str = "") -> Stop:
        """A `Stop` for the present state."""
        return Stop(reason, self.pc, self.cycle, detail)

    def _hit(self) -> bool:
        """Call the hooks of the present PC; true if one of them wants to stop, at most once per arrival."""
        here = (self.state.pc, self.state.cycle)
        if self._stopped_at == here:
            self._stopped_at = None
            return False
        hit = False
        for hook in list(self._pc_hooks[self.state.pc]):
            hit = bool(hook()) or hit
        self._stopped_at = here if hit else None
        return hit

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
        self.core.reset()
        self.peripherals.reset(cause)
        self.events.kick()
        self.resets.append((self.cycle, cause))
        del self.resets[:-RESETS_KEPT]

    def _reset_by(self, reset: DeviceReset) -> Stop | None:
        """Carry out a reset the core or a device asked for; a fault, or a loop of resets, ends the run."""
        culprit = self.pc
        if reset.fault:
            self.state.cycle += 1
        self.reset(reset.cause)
        loop = self._loops(reset.cause, culprit)
        if not self.stop_on_fault or not (reset.fault or loop):
            return None
        detail = reset.detail if reset.fault else f"reset loop: {reset.detail}, {RESET_LOOP} times in a row"
        return Stop("fault", culprit, self.cycle, detail)

    def _loops(self, cause: str, culprit: int) -> bool:
        """Whether the device was reset RESET_LOOP times for the same reason, each soon after the one before."""
        soon = self._last_reset[:2] == (cause, culprit) and self.cycle - self._last_reset[2] < RESET_LOOP_CYCLES
        count = self._last_reset[3] + 1 if soon else 1
        self._last_reset = (cause, culprit, self.cycle, count % RESET_LOOP)
        return count == RESET_LOOP

    # Memory

    def load(self, image: Image) -> None:
        """Put an image into program memory and reset as after power-on.

        Configuration words the image leaves out are those of the robot (`emu.boards.epuck`). Its symbols become names
        for `read`, `write`, `peek` and `poke`.
        """
        self.image = image
        self.program.erase()
        for name, word in epuck.CONFIG.items():
            self.program.put(self.chip.config[name].address, word)
        for block in image.blocks:
            if block.end <= self.chip.program["flash"].end:
                self.program.put_flash(block.base, list(block.words))
            else:
                for index, word in enumerate(block.words):
                    self.program.put(block.base + 2 * index, word)
        self.reset("POR")

    def address_of(self, place: str | int) -> int:
        """Data address of a register (`U1STA`, `W3`) or of a variable of the loaded image by name, or the address
        itself. Raises KeyError for an unknown name."""
        if not isinstance(place, str):
            return place
        sfr = self.chip.sfrs.get(place) or self.chip.sfrs.get(re.sub(r"^[Ww](?=\d+$)", "WREG", place))
        if sfr is not None:
            return sfr.address
        symbol = self.image.symbols.find(place) if self.image is not None else None
        if symbol is None or symbol.space not in ("data", "absolute"):
            raise KeyError(f"there is no register or variable {place!r}")
        return symbol.address

    def read(self, place: str | int, size: int = 2) -> int:
        """Data space as an instruction reads it, side effects included."""
        return self.core.data.read(self.address_of(place), size)

    def write(self, place: str | int, value: int, size: int = 2) -> None:
        """Data space as an instruction writes it, side effects included."""
        self.core.data.write(self.address_of(place), value, size)

    def peek(self, place: str | int, size: int = 2) -> int:
        """Data space without side effects. An odd address with size 2 reads the word that holds it."""
        address = self.address_of(place)
        word = self.bus.peek(address & ~1) if address < SFR_END else self.record.u16[address >> 1]
        if size == 2:
            return word
        return word >> 8 if address & 1 else word & 0xFF

    def poke(self, place: str | int, value: int, size: int = 2) -> None:
        """Set what is stored in data space, telling nobody."""
        address = self.address_of(place)
        if size == 2:
            self.record.u16[address >> 1] = value & 0xFFFF
        else:
            self.record.u8[address] = value & 0xFF

    # State

    def snapshot(self) -> bytes:
        """A copy of the whole state. Whoever continues from it looks for work first: the deadline is derived data.

        Equal machines give equal copies whatever their engines: pin changes that wait to be told are told first.
        """
        self.pins.flush()
        self.events.kick()
        return self.record.snapshot()

    def restore(self, state: bytes) -> None:
        """Continue from a snapshot of an equally wired machine, whatever engine made it. Raises ValueError."""
        flash = self.program.flash.tobytes()
        self.record.restore(state)
        if self.program.flash.tobytes() != flash:
            self.program.announce_all()
        self.peripherals.restored()
        self._stopped_at = None

    # Hooks

    def hook_pc(self, address: int, hook: PcHook) -> Callable[[], None]:
        """Call `hook` before the instruction at `address`; a true result stops the run. Returns how to remove it."""
        self._pc_hooks.setdefault(address, []).append(hook)
        self.runner.forget()

        def remove() -> None:
            self._pc_hooks[address].remove(hook)
            if not self._pc_hooks[address]:
                del self._pc_hooks[address]
            self.runner.forget()

        return remove

    def hook_sfr(self, place: str | int, hook: SfrHook) -> None:
        """Call hook(is_write, word) after every access of an instruction to a register."""
        word = self.address_of(place) >> 1
        bus = self.bus
        read, written = bus.on_read[word] or bus.compute[word], bus.on_write[word]

        def on_read() -> int:
            value = read() if read is not None else self.record.u16[word]
            hook(False, value)
            return value

        def on_write(old: int, new: int, lanes: int) -> None:
            if written is not None:
                written(old, new, lanes)
            hook(True, self.record.u16[word])

        bus.on_read[word], bus.on_write[word] = on_read, on_write
        bus.watched.add(word)
        self.runner.forget()
