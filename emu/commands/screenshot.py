"""`emu screenshot`: run a firmware image, then write the picture that its driver captured or its sensor would send."""

from __future__ import annotations

import argparse
import json
import sys
from fractions import Fraction
from typing import TYPE_CHECKING, Any, Final

from emu.commands.board_options import add_board_options, board_of, set_up
from emu.commands.image_option import add_chip_option, image_of
from emu.host.command import CommandError, Parser, seconds
from emu.host.exit_status import DONE, FAULT
from emu.host.files import is_standard

if TYPE_CHECKING:
    from emu.api import Machine

FORMATS: Final = {"rgb565": 2, "yuv": 2, "grey": 1}
"""Bytes per pixel of each format."""

DESCRIPTION: Final = """\
Run a firmware image for a while and write a picture as PNG.

With --buffer: the frame stored there by the camera driver, --size pixels wide and high, lines from top to bottom.
Without: the sensor's view through the window programmed by the firmware.

Exit status: 0 done, 1 firmware fault (the picture is still written), 2 bad input."""


def parser() -> Parser:
    example = "emu screenshot firmware.elf --camera room.png --seconds 2 --buffer frame --size 20x20 -o frame.png"
    made = Parser("screenshot", DESCRIPTION, example)
    made.add_argument("image", metavar="IMAGE", help="ELF executable or Intel HEX file")
    add_chip_option(made)
    made.add_argument("-o", "--output", metavar="FILE.png", default="frame.png", help="default frame.png")
    made.add_argument("--seconds", metavar="S", type=seconds, default=Fraction(2), help="simulated time (default 2)")
    made.add_argument("--buffer", metavar="SYM|ADDR", help="variable or data address of the frame")
    made.add_argument("--size", metavar="WxH", type=_size, help="pixels of the frame, for example 20x20")
    made.add_argument("--format", choices=FORMATS, default="rgb565", help="of the frame (default rgb565)")
    made.add_argument("--enlarge", metavar="N", type=_enlargement, default=1, help="make every pixel N x N large")
    made.add_argument("--engine", metavar="NAME", default="auto", help="auto, jit or plain (default auto)")
    made.add_argument("--json", action="store_true", help="print one JSON object")
    add_board_options(made)
    return made


def _size(text: str) -> tuple[int, int]:
    width, _, height = text.lower().partition("x")
    if not (width.isdecimal() and height.isdecimal() and int(width) and int(height)):
        raise argparse.ArgumentTypeError(f"expected WIDTHxHEIGHT like 20x20, not {text!r}")
    return int(width), int(height)


def _enlargement(text: str) -> int:
    if not text.isdecimal() or not 1 <= int(text) <= 100:
        raise argparse.ArgumentTypeError(f"expected 1 to 100, not {text!r}")
    return int(text)


def run(options: argparse.Namespace) -> int:
    """Run the command. Return the exit status as listed in DESCRIPTION."""
    from emu.api import Machine
    from emu.boards.picture import write_picture

    if (options.buffer is None) != (options.size is None):
        raise CommandError("--buffer and --size must be given together")
    if options.board == "none" and options.buffer is None:
        raise CommandError("a bare chip has no sensor; omit --board none or give --buffer")
    if options.json and is_standard(options.output):
        raise CommandError("only one of --output and --json can use standard output")
    image = image_of(options)
    try:
        machine = Machine(image.chip, engine=options.engine, board=board_of(options))
    except ValueError as error:
        raise CommandError(str(error)) from None
    machine.load(image)
    set_up(machine, options)
    limit = max(1, int(options.seconds * Fraction(machine.peripherals.fcy)))
    place = _buffer_address(machine, options) if options.buffer else None
    stop = machine.advance(limit) or machine.stopped("limit")
    pixels = _sensor(machine) if place is None else _captured(machine, place, options)
    write_picture(options.output, pixels, options.enlarge)
    height, width, _ = pixels.shape
    if options.json:
        facts = {"output": options.output, "width": width, "height": height, "cycles": machine.cycle}
        facts |= {"reason": stop.reason} | ({"fault": stop.fault.facts()} if stop.fault is not None else {})
        print(json.dumps(facts))
    else:
        print(f"{options.output}: {width} x {height} pixels after {machine.cycle:,} cycles", file=sys.stderr)
    if stop.fault is not None:
        print(f"emu screenshot: {stop.fault.report()}", file=sys.stderr)
        return FAULT
    return DONE


def _buffer_address(machine: Machine, options: argparse.Namespace) -> int:
    """Return the data address of the picture buffer, all of which must be in RAM."""
    try:
        address = int(options.buffer, 0)
    except ValueError:
        try:
            address = machine.address_of(options.buffer)
        except KeyError as error:
            raise CommandError(str(error.args[0])) from None
    width, height = options.size
    end = address + width * height * FORMATS[options.format]
    ram = machine.chip.data["ram"]
    if not ram.start <= address < end <= ram.end:
        raise CommandError(f"{address:#x}..{end - 1:#x} is outside RAM, {ram.start:#x}..{ram.end - 1:#x}")
    return address


def _captured(machine: Machine, address: int, options: argparse.Namespace) -> Any:
    from emu.boards.epuck.camera.pixels import decode

    width, height = options.size
    data = bytes(machine.record.bytes[address : address + width * height * FORMATS[options.format]])
    try:
        return decode(data, options.format).reshape(height, width, 3)
    except ValueError as error:
        raise CommandError(str(error)) from None


def _sensor(machine: Machine) -> Any:
    camera = machine.board.camera
    if camera is None:
        raise CommandError("this robot has no camera; omit --sensor none or give --buffer")
    pixels = camera.frame()
    if not pixels.size:
        raise CommandError("the window programmed by the firmware contains no pixels")
    return pixels
