"""The image a command is about, and the part it is for."""

from __future__ import annotations

import argparse

from emu.chips import NAMES, chip_named
from emu.host.command import CommandError
from emu.image.loader import load_image
from emu.image.model import Image


def add_chip_option(parser: argparse.ArgumentParser) -> None:
    """Add --chip."""
    parser.add_argument(
        "--chip",
        metavar="NAME",
        help=f"the part: {' or '.join(NAMES)} (default: what an ELF file says, else {NAMES[0]})",
    )


def image_of(options: argparse.Namespace) -> Image:
    """The image the options name, for the chip they name. Raises CommandError and LoadError."""
    try:
        return load_image(options.image, None if options.chip is None else chip_named(options.chip))
    except ValueError as error:
        raise CommandError(str(error)) from None
