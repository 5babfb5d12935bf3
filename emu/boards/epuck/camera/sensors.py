"""Image sensors of e-pucks: decoding of their registers (epuck.md §7; openswarm-original.md §5.5).

Positions are sensor columns and rows. A column lasts `column_tcy` Tcy, a row `columns` columns, a frame `rows` rows.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

WIDTH, HEIGHT = 640, 480
"""Active pixels of the sensors: columns and rows, equal for all three types."""
RGB565, YUV, GREY = "rgb565", "yuv", "grey"

ReadRegister = Callable[[int, int], int]
"""read(bank, register): returns the register's value, 0..255."""


@dataclass(frozen=True, slots=True)
class SensorTiming:
    """Timing settings, in columns and rows."""

    columns: int
    rows: int
    column_tcy: int
    scale_x: int
    scale_y: int
    bytes_per_pixel: int
    first_column: int
    """Column in which HREF rises."""
    end_column: int
    """Column in which HREF falls."""
    first_row: int
    end_row: int
    vsync_row: int
    vsync_column: int
    vsync_end_row: int
    """Row in which VSYNC falls."""


@dataclass(frozen=True, slots=True)
class ImageSettings:
    """Image settings: pixel format, orientation, gains and exposure."""

    form: str
    origin_x: int
    origin_y: int
    flip_x: bool
    flip_y: bool
    gains: tuple[float, float, float]
    """Gain factors of red, green and blue."""
    exposure: float | None
    """Exposure factor of the exposure registers, 1 = nominal; None with automatic exposure."""


@dataclass(frozen=True, slots=True)
class Sensor:
    """Sensor type: defaults and decoding of its registers."""

    name: str
    identity: tuple[int, int]
    banks: int
    bank_register: int | None
    defaults: Mapping[tuple[int, int], int]
    timing: Callable[[ReadRegister], SensorTiming]
    picture: Callable[[ReadRegister], ImageSettings]


def _word(read: ReadRegister, bank: int, high: int) -> int:
    return read(bank, high) << 8 | read(bank, high + 1)


def _defaults(text: str) -> dict[tuple[int, int], int]:
    """Parse groups `bank:register=value value ...`, all hexadecimal. The values belong to consecutive registers."""
    table = {}
    for group in text.split(";"):
        place, values = group.split("=")
        bank, register = (int(part, 16) for part in place.split(":"))
        for offset, value in enumerate(values.split()):
            table[bank, register + offset] = int(value, 16)
    return table


# -- PO3030K ----------------------------------------------------------------------------------------------------------

_PO3030K_DIVIDER: Final = (2, 3, 4, 8, 16, 32, 64, 128)  # UNVERIFIED: code 1 is a step between 2 and 4 (§7.3)
_PO3030K_SCALE: Final = {0x44: 1, 0x11: 2, 0x33: 4}
_PO3030K_FORM: Final = {0x08: RGB565, 0x02: YUV, 0x0C: GREY}
_PO3030K_DEFAULTS: Final = _defaults(  # §7.2
    "0:04=03 53 03 53 00 D1 00 07 03 51 01 E7;0:12=02 02;0:15=10 40 40 40 40 03 E6 00 70 0A 1B 44;0:46=80;0:48=60 96 00"
    " 7D 00;0:4E=08 0A 70;0:5C=AC 02;0:76=00 1A 2A 37 42 56 68 87 A3 BC D4 EA;0:8E=38 A5 0D 93 2D 06 83 AA 4D 25 25"
    ";0:9C=96;0:9F=80 80 B6 9D AB 80 00 07 01 E7 00 01;0:AD=9F 22 8C 07 CC 00 70;0:B9=03 E6 07 CC 00 0C"
    ";0:C1=10 E0 10 E0 80 80 01 A5 02 7A 00 A7 01 47;0:D4=3C 01;0:D8=80"
)


def _po3030k_timing(read: ReadRegister) -> SensorTiming:
    scale = _PO3030K_SCALE.get(read(0, 0x20), 1)
    form = _PO3030K_FORM.get(read(0, 0x4E), YUV)
    # UNVERIFIED: a frame is at least as long as the exposure plus two rows (§7.4)
    rows = max(_word(read, 0, 0x06) + 1, _word(read, 0, 0x1A) + 2)
    return SensorTiming(
        columns=_word(read, 0, 0x04) + 1,
        rows=rows,
        column_tcy=_PO3030K_DIVIDER[read(0, 0x1D) >> 4 & 7],
        scale_x=scale,
        scale_y=scale,
        bytes_per_pixel=1 if form == GREY else 2,
        first_column=_word(read, 0, 0x08),
        end_column=_word(read, 0, 0x0C) + 1,
        first_row=_word(read, 0, 0x0A),
        end_row=_word(read, 0, 0x0E) + 1,
        vsync_row=_word(read, 0, 0xA5),
        vsync_column=_word(read, 0, 0xA9),
        vsync_end_row=_word(read, 0, 0xA7) + 1,
    )


def _po3030k_picture(read: ReadRegister) -> ImageSettings:
    control = read(0, 0xD4)
    exposure = None if control & 0x10 else _word(read, 0, 0xB0) / 0x07CC * read(0, 0x15) / 0x10
    gains = (read(0, 0x16), (read(0, 0x17) + read(0, 0x19)) / 2, read(0, 0x18))
    return ImageSettings(
        form=_PO3030K_FORM.get(read(0, 0x4E), YUV),
        origin_x=210,
        origin_y=7,
        flip_x=bool(read(0, 0x1E) & 0x80),
        flip_y=bool(read(0, 0x1E) & 0x40),
        gains=_gains(gains, balanced=bool(control & 0x20)),
        exposure=exposure,
    )


def _gains(registers: tuple[float, float, float], balanced: bool) -> tuple[float, float, float]:
    """Return the colour gains. Register value 0x40 is gain 1.0; automatic white balance counts as converged."""
    red, green, blue = (1.0 if balanced else value / 0x40 for value in registers)
    return red, green, blue


# -- PO6030K and PO8030D: banks A, B, C; window and scale in output pixels ---------------------------------------------


@dataclass(frozen=True, slots=True)
class _Banked:
    """Register locations in which the two banked sensors differ. Pairs are (bank, register)."""

    columns: int
    rows: int
    origin_x: int
    origin_y: int
    window_x: int
    """Sensor column of horizontal window position 0."""
    clock: tuple[int, int]
    dividers: Mapping[int, int]
    scale_x: tuple[int, int]
    scale_y: tuple[int, int]
    form: tuple[int, int]
    forms: Mapping[int, str]
    start_x: tuple[int, int]
    vsync: tuple[int, int]
    mirror: tuple[int, int]
    upright: int
    """Mirror bits (0x40 horizontal, 0x80 vertical) for which the sensor sends an unmirrored picture."""
    control: tuple[int, int]
    exposure: tuple[int, int]
    gains: tuple[int, int]


_NOMINAL_EXPOSURE: Final = 0x0008_0000
"""Value of the exposure registers for an exposure factor of 1. UNVERIFIED: "8.0 units" in a public driver (§7.6)."""


def _banked_timing(chip: _Banked, read: ReadRegister) -> SensorTiming:
    scale_x = max(read(*chip.scale_x) >> 5, 1)
    scale_y = max(read(*chip.scale_y) >> 5, 1)
    form = chip.forms.get(read(*chip.form), YUV)
    # UNVERIFIED: the first pixel is the one after the register's value, so that drivers get the column they request
    first = chip.window_x + (_word(read, *chip.start_x) + 1) * scale_x
    return SensorTiming(
        columns=chip.columns,
        rows=chip.rows,
        column_tcy=2 * chip.dividers.get(read(*chip.clock), 1),
        scale_x=scale_x,
        scale_y=scale_y,
        bytes_per_pixel=1 if form == GREY else 2,
        first_column=min(first, chip.origin_x + WIDTH - 1),
        end_column=chip.origin_x + WIDTH,
        first_row=chip.origin_y,
        end_row=chip.origin_y + HEIGHT,
        vsync_row=_word(read, *chip.vsync),
        vsync_column=min(first, chip.origin_x + WIDTH - 1) + 2,
        vsync_end_row=_word(read, chip.vsync[0], chip.vsync[1] + 2) + 1,
    )


def _banked_picture(chip: _Banked, read: ReadRegister) -> ImageSettings:
    control = read(*chip.control)
    bank, first = chip.exposure
    manual = _word(read, bank, first) << 16 | _word(read, bank, first + 2)
    bank, first = chip.gains
    gains = (float(read(bank, first)), float(read(bank, first + 1)), float(read(bank, first + 2)))
    turned = read(*chip.mirror) ^ chip.upright
    return ImageSettings(
        form=chip.forms.get(read(*chip.form), YUV),
        origin_x=chip.origin_x,
        origin_y=chip.origin_y,
        flip_x=bool(turned & 0x40),
        flip_y=bool(turned & 0x80),
        gains=_gains(gains, balanced=not control & 4),
        exposure=manual / _NOMINAL_EXPOSURE if control & 1 else None,
    )


_PO6030K: Final = _Banked(
    columns=800,
    rows=500,
    origin_x=80,
    origin_y=8,
    window_x=64,
    clock=(0, 0x91),
    dividers=MappingProxyType({0x10: 1, 0x50: 2, 0x90: 4, 0xB0: 8}),
    scale_x=(1, 0x80),
    scale_y=(1, 0x81),
    form=(1, 0x38),
    forms=MappingProxyType({0x08: RGB565, 0x02: YUV, 0x0D: GREY}),
    start_x=(1, 0x50),
    vsync=(1, 0x60),
    mirror=(0, 0x90),
    upright=0xC0,  # UNVERIFIED: the library sets both mirrors for this sensor and none for the other (§7.1)
    control=(2, 0x04),
    exposure=(2, 0x2C),
    gains=(2, 0xA4),
)

_PO8030D: Final = _Banked(
    columns=776,  # UNVERIFIED: the public driver allows columns up to 775 and rows up to 515
    rows=516,
    origin_x=68,
    origin_y=4,
    window_x=64,
    clock=(0, 0x6A),
    dividers=MappingProxyType({0x00: 1, 0x02: 2, 0x04: 4, 0x05: 8}),
    scale_x=(1, 0x93),
    scale_y=(1, 0x94),
    form=(1, 0x4E),
    forms=MappingProxyType({0x30: RGB565, 0x02: YUV, 0x43: GREY}),
    start_x=(0, 0x08),
    vsync=(0, 0x10),
    mirror=(0, 0x6C),
    upright=0,
    control=(2, 0x04),
    exposure=(2, 0x12),
    gains=(0, 0x23),
)

SENSORS: Final[Mapping[str, Sensor]] = MappingProxyType(
    {
        sensor.name: sensor
        for sensor in (
            Sensor("PO3030K", (0x30, 0x30), 1, None, _PO3030K_DEFAULTS, _po3030k_timing, _po3030k_picture),
            Sensor(
                "PO6030K",
                (0x60, 0x30),
                4,
                0x03,
                _defaults(
                    "0:90=00 10;1:38=02;1:50=00 0F;1:60=00 08 01 E7;1:68=00;1:80=20 20 01;2:04=98;2:2C=00 08 00 00"
                    ";2:A4=40 40 40"
                ),
                lambda read: _banked_timing(_PO6030K, read),
                lambda read: _banked_picture(_PO6030K, read),
            ),
            Sensor(
                "PO8030D",
                (0x80, 0x30),
                4,
                0x03,
                _defaults(
                    "0:08=00 03;0:10=00 04 01 E3;0:23=40 40 40;0:5B=C8;0:6A=00;0:6C=00;1:4E=02;1:93=20 20;1:B7=00"
                    ";2:04=98;2:12=00 08 00 00"
                ),
                lambda read: _banked_timing(_PO8030D, read),
                lambda read: _banked_picture(_PO8030D, read),
            ),
        )
    }
)
"""Sensors by name. Defaults that are not in the library's tables are UNVERIFIED; drivers overwrite all of them."""
