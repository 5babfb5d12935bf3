"""`openswarm flash`: an image into a robot, by its boot loader and a serial port; or a program into one that runs."""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections.abc import Callable
from dataclasses import asdict
from typing import Final

from emu.loader import load_image
from emu.status import DONE, FAULT
from openswarm.commands import made_parser
from openswarm.flashing.loaders import BAUD, LOADERS
from openswarm.flashing.program import Program, is_program, program_of
from openswarm.flashing.rows import checked, left_out, rows
from openswarm.flashing.serial import SerialPort
from openswarm.flashing.spreading import Neighbour
from openswarm.flashing.talk import RobotError, Talk

WAIT_SECONDS: Final = 30.0
_NAMES: Final = " or ".join(one.name for one in LOADERS.values())
DESCRIPTION: Final = f"""\
Write an image into a robot's flash through its boot loader ({_NAMES}), over Bluetooth or a cable at
{BAUD:,} baud, and start it. Press the robot's reset button when it says so.

The loader's own rows are never written, and neither are configuration words and data EEPROM. What was cut off in the
middle leaves the robot waiting in its boot loader: run the command again.

A program that `openswarm program` has built goes to a robot that runs firmware with `DEVICES := update`, which checks
and activates it, and passes it on to its neighbours (docs/programs.md): no reset.

Exit status: 0 written, every row acknowledged, 1 the robot does not answer or refuses it, 2 bad image or port."""


def parser() -> argparse.ArgumentParser:
    """The options of the command."""
    made = made_parser("flash", DESCRIPTION, "openswarm flash build/firmware.hex --port /dev/rfcomm0")
    made.add_argument("image", metavar="IMAGE", help="ELF executable or Intel HEX file, or a program")
    made.add_argument("--port", required=True, metavar="DEVICE", help="serial port: /dev/rfcomm0, /dev/ttyUSB0, a pty")
    made.add_argument(
        "--wait", type=_seconds, default=WAIT_SECONDS, metavar="S",
        help=f"how long to wait for the boot loader to answer, or the robot that runs (default {WAIT_SECONDS:g})",
    )  # fmt: skip
    made.add_argument("--store", action="store_true", help="of a program: do not activate it")
    made.add_argument("--json", action="store_true", help="what was done as data, for scripts")
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
    """Exit status as DESCRIPTION says. Raises ValueError or OSError for a bad image or port."""
    image = load_image(options.image)
    if is_program(image):
        return _spread(options, program_of(image))
    if options.store:
        raise ValueError(f"{image.path}: --store is for programs that `openswarm program` has built")
    checked(image)
    for what in left_out(image):
        print(f"openswarm flash: note: {what} of the image are not written; a programmer does that", file=sys.stderr)
    with SerialPort(options.port, BAUD) as line:
        began = line.now()
        print(f"openswarm flash: looking for a boot loader at {options.port}: press reset", file=sys.stderr, flush=True)
        try:
            talk = Talk(line, options.wait)
            wanted = rows(image, talk.loader)
            talk.write(wanted, _progress())
            talk.start()
        except (RobotError, OSError, KeyboardInterrupt) as error:
            print(end="\n" * sys.stderr.isatty(), file=sys.stderr)  # behind the progress
            if not isinstance(error, RobotError):
                raise
            print(f"openswarm flash: {error}", file=sys.stderr)
            return FAULT
        seconds = line.now() - began
    loader = talk.loader
    if options.json:
        facts = {"image": image.path, "port": options.port, "loader": asdict(loader), "rows": len(wanted)}
        print(json.dumps(facts | asdict(talk.counts) | {"seconds": round(seconds, 3)}))
    else:
        again = talk.counts.blocks - len(wanted)
        print(f"{image.path} is in the robot: {len(wanted)} rows, {again} sent again, {seconds:.1f} s;"
              f" boot loader {loader.name}")  # fmt: skip
    return DONE


def _spread(options: argparse.Namespace, program: Program) -> int:
    """A program into a robot that runs."""
    with SerialPort(options.port, BAUD) as line:
        began = line.now()
        print(
            f"openswarm flash: looking for a robot that takes programs at {options.port}", file=sys.stderr, flush=True
        )
        neighbour = Neighbour(line, program, options.wait)
        try:
            is_active = neighbour.give(_progress())
            if not is_active and not options.store:
                neighbour.activate()
                is_active = True
        except (RobotError, OSError, KeyboardInterrupt) as error:
            print(end="\n" * sys.stderr.isatty(), file=sys.stderr)  # behind the progress
            if not isinstance(error, RobotError):
                raise
            print(f"openswarm flash: {error}", file=sys.stderr)
            return FAULT
        seconds = line.now() - began
    if options.json:
        facts = {"program": options.image, "port": options.port, "version": program.version, "rows": len(program.rows)}
        counts = asdict(neighbour.counts)
        print(json.dumps(facts | {"crc": program.crc, "active": is_active} | counts | {"seconds": round(seconds, 3)}))
    else:
        print(f"{options.image} is in the robot{' and activated' if is_active else ''}: version {program.version},"
              f" {len(program.rows)} rows, CRC {program.crc:08X} as the robot says, {seconds:.1f} s")  # fmt: skip
    return DONE


def _progress() -> Callable[[int, int], None]:
    """One line that is written over on a terminal, nothing elsewhere."""
    if not sys.stderr.isatty():
        return lambda done, total: None

    def show(done: int, total: int) -> None:
        end = "\n" if done == total else ""
        print(f"\r{done} of {total} rows", end=end, file=sys.stderr, flush=True)

    return show
