"""`openswarm flash`: writes an image into a robot through its boot loader, or sends a program to a running robot."""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Final, Protocol

from emu.host.errors import report_error
from emu.host.exit_status import DONE, FAULT
from emu.image.loader import load_image
from emu.image.model import Image
from openswarm.commands import made_parser
from openswarm.flashing.authentication import authenticated, key_row, read_key
from openswarm.flashing.boot_session import BootSession, RobotError
from openswarm.flashing.loaders import BAUD, LOADERS
from openswarm.flashing.program import Program, is_program, program_of
from openswarm.flashing.rows import Row, checked, rows, unwritten_parts
from openswarm.flashing.serial import SerialPort
from openswarm.flashing.spreading import HostNeighbour

WAIT_SECONDS: Final = 30.0
_NAMES: Final = " or ".join(one.name for one in LOADERS.values())
DESCRIPTION: Final = f"""\
Write an image into a robot's flash through its boot loader ({_NAMES}), over Bluetooth or a cable at
{BAUD:,} baud, and start it. Press the robot's reset button when it says so.

The command never writes the loader's own rows, configuration words and data EEPROM. After an interrupted transfer the
robot waits in its boot loader: run the command again.

A program built by `openswarm program` needs no reset: the command sends it to a robot whose running firmware has
`DEVICES := update`. The robot checks and activates it and passes it on to its neighbours (docs/programs.md).

With --key FILE, firmware with `DEVICES := update update_auth` gets the key of the swarm, and a program gets the tag
without which such robots refuse it. FILE has 32 hexadecimal digits and mode 0600; the key is never printed.

Exit status: 0 written, every row acknowledged, 1 the robot does not answer or refuses it, 2 bad image or port."""


def parser() -> argparse.ArgumentParser:
    """Return the parser of the command's options."""
    made = made_parser("flash", DESCRIPTION, "openswarm flash build/firmware.hex --port /dev/rfcomm0")
    made.add_argument("image", metavar="IMAGE", help="ELF executable or Intel HEX file, or a program")
    made.add_argument("--port", required=True, metavar="DEVICE", help="serial port: /dev/rfcomm0, /dev/ttyUSB0, a pty")
    made.add_argument(
        "--wait", type=_seconds, default=WAIT_SECONDS, metavar="S",
        help=f"time to wait for an answer of the boot loader or of the running robot (default {WAIT_SECONDS:g})",
    )  # fmt: skip
    made.add_argument("--store", action="store_true", help="programs only: store without activation")
    made.add_argument("--key", type=Path, metavar="FILE", help="key of the swarm, for firmware with update_auth")
    made.add_argument("--json", action="store_true", help="print the result as JSON")
    return made


def _seconds(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not (0 < value <= 86_400 and math.isfinite(value)):
        raise argparse.ArgumentTypeError(f"expected seconds above 0 and at most a day, not {text!r}")
    return value


def run(options: argparse.Namespace) -> int:
    """Flash the image; return the exit status. Raises ValueError or OSError for a bad image or port."""
    image = load_image(options.image)
    key = None if options.key is None else read_key(options.key)
    if is_program(image):
        program = program_of(image)
        return _with_robot(options, _ProgramTransfer(options, program, key))
    if options.store:
        raise ValueError(f"{image.path}: --store is for programs that `openswarm program` has built")
    checked(image)
    keys = [] if key is None else [key_row(image, key)]
    for what in unwritten_parts(image):
        print(f"openswarm flash: note: {what} of the image are not written; a programmer does that", file=sys.stderr)
    return _with_robot(options, _FirmwareTransfer(options, image, keys))


class _Job(Protocol):
    """One transfer of an image into a robot."""

    wanted: str
    """Name of the peer at the serial port, for messages."""
    hint: str
    """Action of the user that makes the peer answer, for messages."""
    keeps: str
    """State of the robot after an interrupted transfer, for messages."""

    def converse(self, line: SerialPort, progress: Callable[[int, int], None]) -> None:
        """Transfer the image. Raises RobotError, or OSError of the port."""

    def facts(self) -> dict[str, object]:
        """Return the result of the transfer as data, for JSON output."""

    def summary(self, seconds: float) -> str:
        """Return the result of the transfer as text."""


class _FirmwareTransfer:
    """Transfer of firmware through a boot loader."""

    wanted = "a boot loader"
    hint = ": press reset"
    keeps = "the robot waits in its boot loader"

    def __init__(self, options: argparse.Namespace, image: Image, keys: list[Row]) -> None:
        self._options: Final = options
        self._image: Final = image
        self._keys: Final = keys

    def converse(self, line: SerialPort, progress: Callable[[int, int], None]) -> None:
        self._session = BootSession(line, self._options.wait)
        self._rows = rows(self._image, self._session.loader, self._keys)
        self._session.write(self._rows, progress)
        self._session.start()

    def facts(self) -> dict[str, object]:
        loader = asdict(self._session.loader)
        return {"image": self._image.path, "loader": loader, "rows": len(self._rows), **asdict(self._session.counts)}

    def summary(self, seconds: float) -> str:
        again = self._session.counts.blocks - len(self._rows)
        return (f"{self._image.path} is in the robot: {len(self._rows)} rows, {again} sent again, {seconds:.1f} s;"
                f" boot loader {self._session.loader.name}")  # fmt: skip


class _ProgramTransfer:
    """Transfer of a program to running firmware."""

    wanted = "a robot that takes programs"
    hint = ""
    keeps = "the robot keeps them until a reset"

    def __init__(self, options: argparse.Namespace, program: Program, key: bytes | None) -> None:
        self._options: Final = options
        self._program: Final = program if key is None else authenticated(program, key)
        self._key: Final = key
        self._is_active = False

    def converse(self, line: SerialPort, progress: Callable[[int, int], None]) -> None:
        self._neighbour = HostNeighbour(line, self._program, self._options.wait, self._key)
        self._is_active = self._neighbour.send(progress)
        if not self._is_active and not self._options.store:
            self._neighbour.activate()
            self._is_active = True

    def facts(self) -> dict[str, object]:
        made = self._program
        facts = {"program": self._options.image, "version": made.version, "rows": len(made.rows), "crc": made.crc}
        return {**facts, "active": self._is_active, **asdict(self._neighbour.counts)}

    def summary(self, seconds: float) -> str:
        made = self._program
        what = "in the robot and activated" if self._is_active else "in the robot"
        return (f"{self._options.image} is {what}: version {made.version}, {len(made.rows)} rows, CRC {made.crc:08X} as"
                f" the robot says, {seconds:.1f} s")  # fmt: skip


def _with_robot(options: argparse.Namespace, job: _Job) -> int:
    progress = _Progress()
    with SerialPort(options.port, BAUD) as line:
        began = line.now()
        print(f"openswarm flash: looking for {job.wanted} at {options.port}{job.hint}", file=sys.stderr, flush=True)
        try:
            job.converse(line, progress)
        except RobotError as error:
            progress.end()
            return report_error(f"openswarm flash: {error}", FAULT, options.json)
        except OSError as error:
            progress.end()
            raise OSError(f"{error}; {progress.state(job.keeps)}") from None
        except KeyboardInterrupt:
            progress.end()
            print(f"openswarm flash: interrupted; {progress.state(job.keeps)}", file=sys.stderr)
            raise
        seconds = line.now() - began
    if options.json:
        print(json.dumps({**job.facts(), "port": options.port, "seconds": round(seconds, 3)}))
    else:
        print(job.summary(seconds))
    return DONE


class _Progress:
    """Progress display: one line, overwritten on a terminal; no output otherwise."""

    def __init__(self) -> None:
        self._done = self._total = 0
        self._shows: Final = sys.stderr.isatty()

    def __call__(self, done: int, total: int) -> None:
        self._done, self._total = done, total
        if self._shows:
            print(f"\r{done} of {total} rows", end="\n" if done == total else "", file=sys.stderr, flush=True)

    def end(self) -> None:
        """End the progress line."""
        if self._shows and self._done != self._total:
            print(file=sys.stderr)

    def state(self, keeps: str) -> str:
        """Return the state of the robot after an interrupted transfer. `keeps`: what becomes of the written rows."""
        if not self._done:
            return "no row is written"
        if self._done == self._total:
            return f"all {self._total} rows are written"
        return f"{self._done} of {self._total} rows are written, {keeps}: run the command again"
