"""Command-line arguments that select the firmware image and its chip."""

from __future__ import annotations

import argparse

from emu.chips import NAMES, chip_named
from emu.host.command import CommandError
from emu.image.loader import load_image
from emu.image.model import Image


def add_chip_option(parser: argparse.ArgumentParser) -> None:
    """Add the option --chip."""
    parser.add_argument(
        "--chip",
        metavar="NAME",
        help=f"the chip: {', '.join(NAMES)} (default: the one in an ELF file's flags, else {NAMES[0]})",
    )


def image_of(options: argparse.Namespace) -> Image:
    """Load the image that the options name, for their chip. Raises CommandError and LoadError."""
    try:
        return load_image(options.image, None if options.chip is None else chip_named(options.chip))
    except ValueError as error:
        raise CommandError(str(error)) from None
