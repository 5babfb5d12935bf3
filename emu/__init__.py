"""A cycle-exact emulator of the dsPIC30F6014A, by default on an e-puck.

    >>> import emu
    >>> image = emu.build("main.c", output="firmware.elf")
    >>> machine = emu.load(image)
    >>> stop_listening = machine.uart[1].listen(lambda byte, cycle: print(chr(byte), end=""))
    >>> stop = machine.run(seconds=0.002)
    ready
    >>> stop.reason, stop.fault
    ('limit', None)

The examples of this reference use docs/examples/api.c as `main.c`; a test runs them.

`load` returns a `Machine` for a firmware file. Its methods run it, read and change its state, install hooks and take
snapshots. A run ends with a `Stop`. If the firmware failed, `Stop.fault` has the cause, the place, the thread, the call
stack and the last branches. Time is an integer number of Tcy (instruction cycles) since power-on; it never decreases.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from emu.api import BuildError as BuildError
    from emu.api import Change as Change
    from emu.api import Machine as Machine
    from emu.api import build as build
    from emu.api import load as load
    from emu.api import watch as watch
    from emu.image.loader import load_image as load_image
    from emu.image.model import Image as Image
    from emu.image.model import LoadError as LoadError
    from emu.instruments.arrivals import Arrival as Arrival
    from emu.instruments.arrivals import Arrivals as Arrivals
    from emu.machine.stops import Stop as Stop

FCY_HZ: Final = 14_745_600
"""Instruction cycles per second (Hz) of an e-puck with the vendor's clock setting, XT_PLL8 (dspic30f6014a.md §3)."""
TCY_SECONDS: Final = 1 / FCY_HZ
"""Length of one instruction cycle in s at `FCY_HZ`."""

# A module is imported when one of its names is first used. Tools that need only the instruction table or the chip's
# data therefore start faster.
_MODULES: Final = {
    "Arrival": "emu.instruments.arrivals",
    "Arrivals": "emu.instruments.arrivals",
    "BuildError": "emu.api",
    "Change": "emu.api",
    "Image": "emu.image.model",
    "LoadError": "emu.image.model",
    "Machine": "emu.api",
    "Stop": "emu.machine.stops",
    "build": "emu.api",
    "load": "emu.api",
    "load_image": "emu.image.loader",
    "watch": "emu.api",
}

__all__ = [
    "FCY_HZ",
    "TCY_SECONDS",
    "Arrival",
    "Arrivals",
    "BuildError",
    "Change",
    "Image",
    "LoadError",
    "Machine",
    "Stop",
    "build",
    "load",
    "load_image",
    "watch",
]


def __getattr__(name: str) -> Any:
    """Import a public name from its module. Raises AttributeError for any other name."""
    if name not in _MODULES:
        raise AttributeError(f"module 'emu' has no attribute {name!r}")
    value = getattr(import_module(_MODULES[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
