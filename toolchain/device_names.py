"""Device names on command lines, such as `30F6014A` or `dsPIC30F4013`, in upper or lower case."""

from __future__ import annotations

from typing import Final

from emu.chips import NAMES, chip_named
from emu.chips.chip import Chip
from toolchain.errors import ToolError

DEVICES: Final = tuple(name.removeprefix("dsPIC") for name in NAMES)
DEFAULT: Final = DEVICES[0]


def device(name: str) -> Chip:
    """The chip with a name. Raise `ToolError` if the name is unknown."""
    try:
        return chip_named(name)
    except ValueError:
        raise ToolError(f"device '{name}' is not supported (expected {', '.join(DEVICES)})") from None
