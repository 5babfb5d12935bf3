"""Command-line options of the board, for all commands that run a robot.

Input: parsed options. Output: a board constructor for `Machine(board=...)`, a configured board, observer output.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from emu.boards import BOARDS, board_named
from emu.host.command import CommandError
from emu.host.paths import use_cache

if TYPE_CHECKING:
    from emu.boards.epuck.board import Epuck
    from emu.machine.machine import Machine
    from emu.peripherals import Peripherals

SENSORS: Final = ("PO6030K", "PO3030K", "PO8030D", "none")
SELECTOR_POSITIONS: Final = 16
MOST_HZ: Final = 40_000_000
"""Frequency in Hz of the family's fastest external clock (dspic30f6014a.md §3)."""


def add_board_options(parser: argparse.ArgumentParser, boards: tuple[str, ...] = BOARDS) -> None:
    """Add --cache, --board, --crystal, --selector, --camera, --sensor and --stimulus."""
    parser.add_argument("--cache", type=use_cache, metavar="DIR", help="keep native code in DIR instead of the cache")
    board = parser.add_argument_group("robot")
    board.add_argument(
        "--board", choices=boards, default=BOARDS[0], help="board around the chip (default epuck; none: bare pins)"
    )
    board.add_argument("--crystal", metavar="HZ", type=_crystal, help="crystal of bare pins (default 7372800)")
    board.add_argument("--selector", metavar="N", type=_selector, default=0, help="position of the selector, 0 to 15")
    board.add_argument("--camera", metavar="FILE.png", help="picture in front of the camera (default: darkness)")
    board.add_argument(
        "--sensor", choices=SENSORS, default=SENSORS[0], help=f"camera type (default {SENSORS[0]}; none: unplugged)"
    )
    board.add_argument(
        "--stimulus",
        metavar="FILE",
        help="events for the robot: a script (lines of TIME WHAT ARGUMENTS), or pins from a .vcd or .csv file",
    )


def add_watch_option(parser: argparse.ArgumentParser) -> None:
    """Add the option --watch."""
    parser.add_argument(
        "--watch", metavar="LIST", type=_topics, default=[], help="report changes of: leds,motors,uart1,uart2,sound"
    )


def _selector(text: str) -> int:
    if not text.isdecimal() or int(text) >= SELECTOR_POSITIONS:
        raise argparse.ArgumentTypeError(f"the selector has positions 0 to 15, not {text!r}")
    return int(text)


def _crystal(text: str) -> int:
    if not text.isdecimal() or not 0 < int(text) <= MOST_HZ:
        raise argparse.ArgumentTypeError(f"expected a frequency in Hz up to {MOST_HZ}, not {text!r}")
    return int(text)


def _topics(text: str) -> list[str]:
    return [topic.strip() for topic in text.split(",") if topic.strip()]


def board_of(options: argparse.Namespace) -> Callable[[Peripherals], Any] | None:
    """Return the board constructor for `Machine(board=...)`."""
    if options.crystal and options.board != "none":
        raise CommandError("--crystal needs --board none; a robot has its own crystal")
    if options.board != BOARDS[0]:
        wanted = [name for name in ("selector", "camera", "stimulus", "watch") if getattr(options, name, None)]
        if wanted:
            raise CommandError(f"--{wanted[0]} needs a robot; omit --board {options.board}")
        return partial(_bare, options.crystal) if options.crystal else board_named(options.board)
    from emu.boards.epuck.board import Epuck

    sensor = None if options.sensor == "none" else options.sensor
    return partial(Epuck, camera=sensor, selector=options.selector)


def _bare(crystal: int, chip: Peripherals) -> None:
    """Configure bare pins with a crystal."""
    chip.configure(crystal=crystal)


def set_up(machine: Machine, options: argparse.Namespace) -> None:
    """Show the picture to the camera and start the stimulus file. The image must already be loaded."""
    board: Epuck | None = machine.board
    if board is None:
        return
    if options.camera:
        if board.camera is None:
            raise CommandError("--camera needs a sensor; omit --sensor none")
        from emu.boards.picture import read_picture

        try:
            board.camera.show(read_picture(options.camera))
        except ValueError as error:
            raise CommandError(str(error)) from None
    if options.stimulus:
        from emu.boards.epuck.stimulus import StimulusError

        try:
            board.stimulus.load(Path(options.stimulus))
        except StimulusError as error:
            raise CommandError(str(error)) from None


def links_of(machine: Machine) -> dict[int, Any]:
    """Return the devices that connect UARTs with the host, by UART number: Bluetooth on UART1 of a robot."""
    bluetooth = getattr(machine.board, "bluetooth", None)
    return {} if bluetooth is None else {1: bluetooth}


def start_watch(machine: Machine, options: argparse.Namespace) -> Callable[[], None]:
    """Report the watched outputs on standard error. Return a function to call at the end of the run."""
    if not options.watch:
        return lambda: None
    from emu.boards.epuck.observer import RobotObserver

    try:
        return RobotObserver(machine.board, options.watch, partial(print, file=sys.stderr)).finish
    except ValueError as error:
        raise CommandError(str(error)) from None
