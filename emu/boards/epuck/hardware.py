"""The parts of the e-puck, connected to a chip's pins (epuck.md §1, §2, §10)."""

from __future__ import annotations

from typing import Final

from emu.boards.epuck.analog import Accelerometer, Infrared, Microphones
from emu.boards.epuck.bluetooth import Bluetooth
from emu.boards.epuck.camera.camera import Camera
from emu.boards.epuck.config import CHIPS, CONFIG, CRYSTAL_HZ
from emu.boards.epuck.motors import Motors
from emu.boards.epuck.remote import Remote
from emu.boards.epuck.simple import Battery, Codec, Leds, Selector
from emu.boards.noise import Noise
from emu.peripherals import Peripherals


class EpuckHardware:
    """An e-puck of hardware version 1.1 or 1.2: analog accelerometer, no device at I2C address 0x3C.

    `chip` is `machine.peripherals`. `camera` names the sensor (PO3030K, PO6030K, PO8030D), None means no camera. `seed`
    determines noise and radio losses, which are off by default (`noise.strength`, `bluetooth.loss`). Raises ValueError
    for an unknown sensor or selector position, and for a chip other than the e-puck's.
    """

    def __init__(self, chip: Peripherals, *, camera: str | None = "PO6030K", selector: int = 0, seed: int = 0) -> None:
        if chip.context.chip.name not in CHIPS:
            raise ValueError(f"an e-puck has a {CHIPS[0]}, not a {chip.context.chip.name}")
        chip.configure(crystal=CRYSTAL_HZ, config=CONFIG)
        self.chip: Final = chip
        self.noise: Final = Noise(chip.context.bus.record, seed)
        self.leds: Final = Leds(chip)
        self.motors: Final = Motors(chip)
        self.selector: Final = Selector(chip, selector)
        self.battery: Final = Battery(chip)
        self.ir: Final = Infrared(chip, self.noise)
        self.accelerometer: Final = Accelerometer(chip)
        self.microphones: Final = Microphones(chip, self.noise)
        self.remote: Final = Remote(chip)
        self.bluetooth: Final = Bluetooth(chip, seed=seed)
        self.codec: Final = Codec(chip)
        self.camera: Final = Camera(chip, camera) if camera is not None else None
        if self.camera is not None:
            chip.on_restored.append(self.camera.restored)

    def __repr__(self) -> str:
        return f"<{type(self).__name__} with {self.selector!r}, {self.leds!r}>"
