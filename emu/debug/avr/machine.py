"""One Kilobot for the debugger: runs, steps, breakpoints, a watched range, snapshots.

It has the interface of `emu.machine.machine.Machine` that the debugger uses. The robot runs instruction by instruction
(emu/avr/core/observed.c) in its surroundings: an overhead controller, or the crowd of a trial.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from ctypes import sizeof
from dataclasses import dataclass
from fractions import Fraction
from types import SimpleNamespace
from typing import Any, Final, Protocol, cast

from emu.avr.core.addresses import ADDRESSES
from emu.avr.core.state import DATA_BYTES, FLASH_BYTES, NEVER, RAM_START, Avr
from emu.avr.image import AvrImage
from emu.avr.machine import HZ, SPL, UDR0, Atmega328p, Change
from emu.avr.observation import STOP_LIMIT, STOP_NONE, STOP_PLACE, STOP_WRITE, Observation
from emu.boards.kilobot.swarm import KilobotFaultError
from emu.chips.chip import Region, Sfr
from emu.debug.avr.fault import fault_stop
from emu.debug.avr.processor import Atmega328pProcessor
from emu.debug.avr.unwind import STACK_POINTER
from emu.debug.processor import Processor
from emu.image.lines import LineTable
from emu.image.symbols import Symbols
from emu.machine.stops import CHANGED, SLEEP_CYCLES, STILL_ASLEEP, Stop

ASLEEP: Final = "the CPU sleeps or has ended, and no event can wake it"
FLASH_AT: Final = cast("Any", Avr).flash.offset
"""Offset of the flash in the state record."""
Hook = Callable[[], Any]


class Surroundings(Protocol):
    """What a debugged robot runs in (`SingleKilobot`); it determines all inputs of the robot."""

    @property
    def machine(self) -> Atmega328p:
        """The robot's microcontroller."""

    @property
    def has_ended(self) -> bool:
        """Whether nothing can wake the CPU any more."""

    def observe(self, observation: Observation) -> None:
        """Run the robot instruction by instruction from now on."""

    def run_until(self, cycle: int) -> None:
        """Run to a cycle of the robot, or until it stops. Raises KilobotFaultError."""

    def take_changes(self) -> list[Change]:
        """Return the changes of watched registers by the last run."""

    def snapshot(self) -> bytes:
        """Return the state of the robot, whose last part is that of its microcontroller, and of its inputs."""

    def restore(self, snapshot: bytes) -> None:
        """Return to the state of a snapshot. Raises ValueError for other bytes."""


@dataclass(frozen=True, eq=False)
class DebugImage:
    """An AVR image with its chip's tables, in the form of `emu.image.model.Image`."""

    path: str
    symbols: Symbols
    lines: LineTable
    chip: SimpleNamespace


def debug_image(image: AvrImage) -> DebugImage:
    """Return an image for the debugger."""
    sfrs = {name: Sfr(name, address, 1, 0, 0xFF, {}, 0, 0) for name, address in ADDRESSES.items()}
    flash, ram = Region("flash", 0, FLASH_BYTES), Region("ram", RAM_START, DATA_BYTES)
    chip = SimpleNamespace(sfrs=sfrs, program={"flash": flash}, data={"ram": ram})
    return DebugImage(image.path, image.symbols, image.lines, chip)


class _Registers:
    """Registers by DWARF number: R0 to R31, then the stack pointer."""

    def __init__(self, state: Avr) -> None:
        self._data: Final = state.data

    def __getitem__(self, number: int) -> int:
        return self._data[number] if number < STACK_POINTER else self._data[SPL] | self._data[SPL + 1] << 8

    def __setitem__(self, number: int, value: int) -> None:
        if number < STACK_POINTER:
            self._data[number] = value
        else:
            self._data[SPL], self._data[SPL + 1] = value & 0xFF, value >> 8


class _Flash:
    """Program memory, and its place in a snapshot."""

    def __init__(self, robot: Surroundings) -> None:
        self._flash: Final = robot.machine.state.flash
        self.flash: Final = SimpleNamespace(nbytes=FLASH_BYTES)
        self.flash_offset: Final = len(robot.snapshot()) - sizeof(Avr) + FLASH_AT

    def word(self, pc: int) -> int:
        """Return the word at a byte address, 0 outside."""
        return self._flash[pc] | self._flash[pc + 1] << 8 if 0 <= pc < FLASH_BYTES - 1 else 0


class _Uart:
    """The debug UART's output."""

    def __init__(self) -> None:
        self.listeners: Final[list[Callable[[int, int], None]]] = []

    def listen(self, listener: Callable[[int, int], None]) -> None:
        """Call `listener(byte, cycle)` for every byte that the robot sends."""
        self.listeners.append(listener)


class DebuggedKilobot:
    """A robot in its surroundings."""

    engine: Final = "avr"

    def __init__(self, robot: Surroundings) -> None:
        self._robot: Final = robot
        self._machine: Final = robot.machine
        self._image: Final = robot.machine.image
        self._observation: Final = Observation()
        self._hooks: Final[dict[int, list[Hook]]] = {}
        self.image: Final = debug_image(self._image)
        self.chip: Final = self.image.chip
        self.w: Final = _Registers(self._machine.state)
        self.program: Final = _Flash(self._robot)
        self.uart: Final = {1: _Uart()}
        self.hz: Final = Fraction(HZ)
        self.replay_condition: Callable[[], bool] | None = None
        """Condition of a stop at a breakpoint while the history replays."""
        self.is_quiet = False
        """Whether the history replays: output is discarded, and hooks are not called."""
        robot.observe(self._observation)
        self._machine.watch([UDR0])

    def processor(self) -> Processor:
        """Return the processor as the debugger knows it."""
        return Atmega328pProcessor(self._image, self._machine)

    @property
    def pc(self) -> int:
        """Byte address of the next instruction."""
        return self._machine.pc

    @property
    def cycle(self) -> int:
        """CPU cycles since power-on."""
        return self._machine.cycle

    @property
    def seconds(self) -> float:
        """Simulated time in seconds."""
        return self.cycle / HZ

    @property
    def is_asleep(self) -> bool:
        """Whether the CPU sleeps."""
        return bool(self._machine.state.asleep)

    @property
    def last_address(self) -> int:
        """Byte address of the instruction, or of the interrupt's vector, that ran last."""
        return 2 * self._observation.site

    @property
    def last_cycle(self) -> int:
        """First cycle of that instruction or interrupt entry."""
        return self._observation.last_cycle

    def cycles_in(self, seconds: float | Fraction) -> int:
        """Return a time in cycles."""
        return int(Fraction(seconds) * HZ)

    # Running

    def run_until(self, cycle: int) -> Stop | None:
        """Run to the first instruction boundary at or after `cycle`. Return the stop that ended the run earlier."""
        seen = self._observation
        seen.steps = 0
        while self.cycle < cycle:
            stop = self._run(cycle)
            if stop is not None:
                return stop
            if seen.reason == STOP_WRITE:
                return self._stopped("breakpoint", CHANGED)
            if seen.reason == STOP_PLACE and self._is_stop():
                return self._stopped("breakpoint")
            if seen.reason in (STOP_NONE, STOP_LIMIT):
                break
        return None

    advance = run_until

    def step(self, limit: int | None = None) -> Stop | None:
        """Execute one instruction or enter an interrupt. A sleeping CPU sleeps at most to cycle `limit`."""
        self._observation.steps = 1
        stop = self._run(self.cycle + SLEEP_CYCLES if limit is None else max(limit, self.cycle + 1))
        if stop is None and self._observation.reason in (STOP_NONE, STOP_LIMIT):
            return self._stopped("limit", STILL_ASLEEP)
        return stop

    def _run(self, cycle: int) -> Stop | None:
        """Run to a cycle or the end of the observed run. Return the stop at a fault or at a program that has ended."""
        if self._machine.fault is not None:
            return fault_stop(self._machine)
        if self._robot.has_ended:
            return self._stopped("halt", ASLEEP)
        self._observation.reason = STOP_NONE
        try:
            self._robot.run_until(cycle)
        except KilobotFaultError:
            return fault_stop(self._machine)
        finally:
            self._deliver()
        return None

    def _deliver(self) -> None:
        """Give the UART's output to its listeners."""
        for change in self._robot.take_changes():
            if change.register == UDR0 and not self.is_quiet:
                for listener in self.uart[1].listeners:
                    listener(change.value, change.cycle)

    def _stopped(self, reason: str, detail: str = "") -> Stop:
        return Stop(reason, self.pc, self.cycle, detail)

    def _is_stop(self) -> bool:
        """Call the hooks of the PC. Return whether one stops the run."""
        if self.is_quiet:
            return self.replay_condition is not None and self.replay_condition()
        hits = [bool(hook()) for hook in list(self._hooks.get(self.pc, ()))]
        return any(hits)

    def hook_pc(self, place: int, hook: Hook, _when: object = None) -> Callable[[], None]:
        """Call `hook` before the instruction at a byte address; true stops the run. Return a function to remove it."""
        self._hooks.setdefault(place, []).append(hook)
        self._observation.places[place >> 1] = 1

        def remove() -> None:
            self._hooks[place].remove(hook)
            self._observation.places[place >> 1] = bool(self._hooks[place])

        return remove

    @contextmanager
    def watching(self, address: int, size: int) -> Iterator[None]:
        """Stop inside the block after an instruction that changes one of `size` bytes of data memory."""
        self._observation.watch(address, size)
        try:
            yield
        finally:
            self._observation.watch(0, 0)

    # State

    def snapshot(self) -> bytes:
        """Return the whole state of the robot and of the light on its way to it."""
        return self._robot.snapshot()

    def restore_state(self, state: bytes) -> None:
        """Return to the state of a snapshot of this robot."""
        self._robot.restore(state)
        self._observation.passed = NEVER

    def program_address(self, name: str) -> int:
        """Return the byte address of a function. Raises KeyError."""
        symbol = self._image.symbols.find(name)
        if symbol is None or symbol.space != "code":
            raise KeyError(f"there is no function {name}")
        return symbol.address

    def peek(self, name: str) -> int:
        """Return an I/O register by its name, without the effects of a read. Raises KeyError."""
        return self._machine.peek(ADDRESSES[name])

    def peek_bytes(self, address: int, count: int) -> bytes:
        """Return bytes of data memory, without the effects of a read. Raises ValueError."""
        if not 0 <= address <= address + count <= DATA_BYTES:
            raise ValueError(f"{count} bytes at {address:#06x} are not all in data memory, which ends at 0x08ff")
        return self._machine.peek_bytes(address, count)

    def poke(self, address: int, value: int, size: int) -> None:
        """Write bytes of RAM. Raises ValueError for other memory."""
        self.processor().write(address, value.to_bytes(size, "little"))
