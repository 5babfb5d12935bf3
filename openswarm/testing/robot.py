"""An emulated robot in a test.

It runs only within the calls below and in simulated time, so that time-outs do not depend on the host. A firmware
fault fails the call in which it occurs, with the complete fault report.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import emu

if TYPE_CHECKING:
    from re import Match

    from emu.debug.threads import Thread
    from emu.peripherals.uart.uart import Uart
    from emu.peripherals.wait import Pattern
    from emu.profile.cycle_shares import Profile, Profiler

MILLISECONDS: Final = 1000


class FirmwareFault(AssertionError):
    """A firmware fault; the text is the report of `emu run`."""


class Line:
    """A UART of the robot. `expect` also matches earlier output that no previous expectation has matched."""

    def __init__(self, robot: Robot, uart: Uart) -> None:
        self._robot: Final = robot
        self._uart: Final = uart
        self.said: Final = bytearray()
        """All bytes that the UART has sent so far."""
        uart.listen(lambda byte, _cycle: self.said.append(byte & 0xFF), lazy=True)
        uart.expect(b"", within=0)  # starts the capture of output

    def expect(self, pattern: Pattern, *, within_ms: float) -> Match[bytes]:
        """Run until the output matches `pattern`: text or bytes literally, or a compiled regular expression.

        Raises ExpectError after `within_ms` of simulated time, and FirmwareFault.
        """
        found: Match[bytes] = self._robot.watched(partial(self._uart.expect, pattern, within=within_ms))
        return found

    def feed(self, data: bytes) -> None:
        """Send bytes to the robot, at the baud rate of its receiver."""
        self._uart.feed(data)


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
            raise ValueError(f"{function} was not called, or is inlined")
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
    """A robot after power-on. `machine` gives access to its whole state (`help(emu.Machine)`)."""

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
        self.uarts: Final = {number: Line(self, uart) for number, uart in self.machine.uart.items()}
        self.uart: Final = self.uarts[1]
        self.fault: FirmwareFault | None = None

    @property
    def camera(self) -> Any:
        """The camera, or None; `show(picture)` takes a picture of shape (480, 640, 3)."""
        return self.board.camera

    @property
    def cycle(self) -> int:
        """Tcy since power-on."""
        return self.machine.cycle

    def run(self, *, ms: float) -> emu.Stop:
        """Run for `ms` of simulated time. Raises FirmwareFault."""
        stop: emu.Stop = self.watched(lambda: self.machine.run(seconds=ms / MILLISECONDS))
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
        from emu.peripherals.wait import ExpectError

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

    def var(self, expression: str) -> Any:
        """Return the value of a C expression in the firmware."""
        return self.machine.var(expression)

    def stack(self, thread: str) -> Thread:
        """Return an OpenSwarm thread by the name of its function; `.free` is its number of never written stack bytes.

        Raises KeyError for an unknown name.
        """
        for one in self.machine.threads():
            if one.name == thread:
                return one
        raise KeyError(f"no thread runs {thread}, only {', '.join(one.name for one in self.machine.threads())}")

    @contextmanager
    def measured(self) -> Iterator[Measured]:
        """Count all cycles within the `with` block; the JIT then runs at more than half its speed."""
        from emu.profile.cycle_shares import Profiler

        assert self.machine.image is not None
        profiler = Profiler(self.machine, self.machine.image)
        with profiler.counting() as profile:
            yield Measured(self, profiler, profile)
