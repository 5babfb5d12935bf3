"""A cycle-exact emulator of the dsPIC30F6014A. Names load when they are first used, so that tools which need only
the instruction table or the chip's data pay for nothing else.

>>> import emu
>>> machine = emu.load("firmware.elf")      # doctest: +SKIP
>>> stop = machine.run(cycles=14_745_600)   # doctest: +SKIP
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from emu.api import load as load
    from emu.api import watch as watch
    from emu.image import Image as Image
    from emu.image import LoadError as LoadError
    from emu.loader import load_image as load_image
    from emu.machine import Machine as Machine
    from emu.machine import Stop as Stop

_HOME: Final = {
    "Image": "emu.image",
    "LoadError": "emu.image",
    "Machine": "emu.machine",
    "Stop": "emu.machine",
    "load": "emu.api",
    "load_image": "emu.loader",
    "watch": "emu.api",
}

__all__ = ["Image", "LoadError", "Machine", "Stop", "load", "load_image", "watch"]


def __getattr__(name: str) -> Any:
    """Import a public name from the module it lives in. Raises AttributeError for any other name."""
    if name not in _HOME:
        raise AttributeError(f"module 'emu' has no attribute {name!r}")
    value = getattr(import_module(_HOME[name]), name)
    globals()[name] = value
    return value
