"""An emulated robot in a test.

It runs only within the calls below and in simulated time, so that time-outs do not depend on the host. A firmware
fault fails the call in which it occurs, with the complete fault report.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import emu
from emu.debug.inlining import missing_function

if TYPE_CHECKING:
    from re import Match

    from emu.debug.threads import Thread
    from emu.peripherals.uart.expect import Pattern
    from emu.peripherals.uart.uart import Uart
    from emu.profile.cycle_shares import Profile, Profiler

MILLISECONDS: Final = 1000
OWN: Final = frozenset(("image", "machine", "board", "uart", "fault"))
"""Attributes that belong to a robot; all others are those of its machine."""


class FirmwareFault(AssertionError):
    """A firmware fault; the text is the report of `emu run`."""


class UartLine:
    """A UART of the robot, with all attributes of the emulator's `Uart`.

    `expect` also matches earlier output that no previous expectation has matched. A firmware fault fails it.
    """

    def __init__(self, robot: Robot, uart: Uart) -> None:
        self._robot: Final = robot
        self._uart: Final = uart
        self.said: Final = bytearray()
        """All bytes that the UART has sent so far."""
        uart.listen(lambda byte, _cycle: self.said.append(byte & 0xFF), lazy=True)
        uart.expect(b"", within=0)  # starts the capture of output

    def expect(self, pattern: Pattern, *, within: float | None = None, within_ms: float | None = None) -> Match[bytes]:
        """Run until the output matches `pattern`: text or bytes literally, or a compiled regular expression.

        `within` is in ms of simulated time; `within_ms` is an older name for it. Raises ExpectError when the time has
        passed, FirmwareFault, and TypeError without a time.
        """
        limit = within if within is not None else within_ms
        if limit is None:
            raise TypeError("expect() needs within=MILLISECONDS")
        found: Match[bytes] = self._robot.watched(partial(self._uart.expect, pattern, within=limit))
        return found

    def __getattr__(self, name: str) -> Any:
        return getattr(self._uart, name)

    def __repr__(self) -> str:
        return f"<UART of a robot: {len(self.said)} bytes sent, the last {bytes(self.said[-40:])!r}>"


class UartLines(Mapping[int, UartLine]):
    """The UARTs by number. `expect`, `feed` and `said` without a number are those of UART1."""

    def __init__(self, lines: dict[int, UartLine]) -> None:
        self._lines: Final = lines
        self.expect: Final = lines[1].expect
        self.feed: Final = lines[1].feed
        self.said: Final = lines[1].said

    def __getitem__(self, number: int) -> UartLine:
        return self._lines[number]

    def __iter__(self) -> Iterator[int]:
        return iter(self._lines)

    def __len__(self) -> int:
        return len(self._lines)

    def __repr__(self) -> str:
        return f"<UARTs {', '.join(map(str, self._lines))} of a robot>"


@dataclass(frozen=True, slots=True)
class Cycles:
    """Durations of a function's calls in Tcy, including callees, without interrupts, sleep and other threads."""

    calls: int
    total: int
    most: int
    least: int


class Measured:
    """Result of a `Robot.measured` block, available after the block."""

    def __init__(self, robot: Robot, profiler: Profiler, profile: Profile) -> None:
        self._robot: Final = robot
        self._profiler: Final = profiler
        self.profile: Final = profile

    def cycles(self, function: str) -> Cycles:
        """Return the times of a function or handler by its C name.

        Raises KeyError for an unknown name, ValueError if no call completed.
        """
        entry = self._robot.machine.program_address(function)
        edges = [edge for edge in self.profile.edges if edge.entry == entry and edge.most]
        if not edges:
            reason = missing_function(self._robot.machine.inspector.debug, function)
            raise ValueError(f"{function} was not called" + (f"; it is also {reason}" if reason else ""))
        return Cycles(
            sum(edge.calls for edge in edges), sum(edge.cycles for edge in edges),
            max(edge.most for edge in edges), min(edge.least for edge in edges),
        )  # fmt: skip

    def coverage(self, file: str) -> float:
        """Return the share of executed lines of a source file, given by the end of its name.

        Raises ValueError if the file has no code in the image.
        """
        image, ran, all_lines = self._robot.machine.inspector.image, set(), set()
        for row in image.lines.rows:
            if row.line and Path(row.file).match(file) and self._robot.machine.inspector.is_code(row.start):
                all_lines.add(row.line)
                if self.profile.addresses.get(self._profiler.row_of(row.start)):
                    ran.add(row.line)
        if not all_lines:
            raise ValueError(f"no code comes from {file}")
        return len(ran) / len(all_lines)


class Robot:
    """A robot after power-on: an `emu.Machine` whose runs fail the test if the firmware has a fault.

    It has every attribute of `emu.Machine` by the same name, with the same units: `call`, `hook_pc`, `set_var`,
    `snapshot`, `restore`, `threads`, ... `run`, `step` and `uart[n].expect` raise FirmwareFault.

        >>> from pathlib import Path
        >>> from openswarm.testing.robot import Robot
        >>> robot = Robot(Path("firmware.elf"), selector=3)
        >>> robot.uart.expect("ready", within=50)[0]       # ms; `robot.uart` are UartLines, `robot.uart[1]` a UartLine
        b'ready'
        >>> robot.call("twice", 21), robot.var("speed.right")
        (42, -100)
        >>> with robot.measured() as measured:             # a Measured
        ...     stop = robot.run(ms=1)
        >>> cycles = measured.cycles("twice")              # Cycles
        >>> cycles.calls > 100, cycles.least <= cycles.most
        (True, True)
    """

    def __init__(self, image: Path, **around: Any) -> None:
        """Load an image.

        `around` has the arguments of `emu.load`, and also `selector`, `sensor` (a camera type or None), `camera` (a
        picture file) and `stimulus` (a file of input events). Raises the errors of `emu.load`, and ValueError for a
        bad file.
        """
        from emu.boards.epuck.board import Epuck
        from emu.boards.picture import read_picture

        picture, stimulus = around.pop("camera", None), around.pop("stimulus", None)
        if "board" not in around:
            fitted: dict[str, Any] = {"selector": around.pop("selector", 0)}
            if "sensor" in around:
                fitted["camera"] = around.pop("sensor")
            around["board"] = partial(Epuck, **fitted)
        self.image: Final = image
        self.machine: Final = emu.load(image, **around)
        self.board: Final[Any] = self.machine.board
        if picture is not None:
            self.board.camera.show(read_picture(str(picture)))
        if stimulus is not None:
            self.board.stimulus.load(Path(stimulus))
        self.uart: Final = UartLines({number: UartLine(self, uart) for number, uart in self.machine.uart.items()})
        self.fault: FirmwareFault | None = None

    @property
    def camera(self) -> Any:
        """The camera, or None; `show(picture)` takes a picture of shape (480, 640, 3)."""
        return self.board.camera

    def run(
        self,
        cycles: int | None = None,
        until: Callable[[], bool] | str | int | None = None,
        *,
        seconds: float | None = None,
        when: str | None = None,
        ms: float | None = None,
    ) -> emu.Stop:
        """Run as `emu.Machine.run`; `ms` is another unit for `seconds`. Raises FirmwareFault, and its ValueErrors."""
        if ms is not None:
            if seconds is not None:
                raise ValueError("give seconds or ms, not both")
            seconds = ms / MILLISECONDS
        stop: emu.Stop = self.watched(lambda: self.machine.run(cycles, until, seconds=seconds, when=when))
        return stop

    def step(self, limit: int | None = None) -> emu.Stop | None:
        """Run one instruction as `emu.Machine.step`. Raises FirmwareFault."""
        stop: emu.Stop | None = self.watched(lambda: self.machine.step(limit))
        return stop

    def run_to(self, place: str, *, within_ms: float) -> None:
        """Run until a function or label is next reached.

        Raises FirmwareFault, and AssertionError if it is not reached.
        """
        cycles = self.machine.cycles_in(within_ms / MILLISECONDS)
        stop = self.watched(lambda: self.machine.run(cycles, until=place))
        assert stop.reason == "until", f"{place} was not reached within {within_ms:g} ms: {stop.reason}"

    def watched(self, work: Any) -> Any:
        """Call `work`, which runs the machine, and return its result. Raises FirmwareFault if a fault ends it."""
        from emu.peripherals.uart.expect import ExpectError

        try:
            done = work()
        except ExpectError as error:
            if "firmware fault: " in str(error):
                raise self._failed(str(error)) from None
            raise
        if getattr(done, "fault", None) is not None:
            raise self._failed(done.fault.report())
        return done

    def _failed(self, report: str) -> FirmwareFault:
        self.fault = FirmwareFault(report)
        return self.fault

    def stack(self, thread: str) -> Thread:
        """Return an OpenSwarm thread by the name of its function; `.free` counts stack bytes that were never written.

        Raises KeyError for an unknown name.
        """
        threads = self.machine.threads()
        for one in threads:
            if one.name == thread:
                return one
        raise KeyError(f"no thread runs {thread}, only {', '.join(one.name for one in threads)}")

    @contextmanager
    def measured(self) -> Iterator[Measured]:
        """Count all cycles within the `with` block; the JIT then runs at more than half its speed."""
        from emu.profile.cycle_shares import Profiler

        assert self.machine.image is not None
        profiler = Profiler(self.machine, self.machine.image)
        with profiler.counting() as profile:
            yield Measured(self, profiler, profile)

    def __getattr__(self, name: str) -> Any:
        if name == "machine":  # not set yet
            raise AttributeError(name)
        return getattr(self.machine, name)

    def __setattr__(self, name: str, value: Any) -> None:
        machine = self.__dict__.get("machine")
        if machine is not None and name not in OWN and hasattr(machine, name):
            setattr(machine, name, value)
        else:
            object.__setattr__(self, name, value)

    def __dir__(self) -> list[str]:
        return sorted({*object.__dir__(self), *dir(self.machine)})

    def __repr__(self) -> str:
        state = "after a fault" if self.fault is not None else f"at cycle {self.machine.cycle:,}"
        return f"<robot with {self.image.name[:80]}, {state}>"
