"""Device settings for random programs: register values in the order of the writes."""

from __future__ import annotations

import random

Scene = list[tuple[str, int]]
_STANDS = (0, 0x2000, 0x2000)
"""xSIDL bit of control registers, or 0: the device's clock stops in Idle."""


def _timer(draw: random.Random) -> Scene:
    n = draw.choice((1, 3, 5))
    gated_or_clocked = draw.choice((0, 0, 0, 0x02, 0x40))
    return [
        (f"PR{n}", draw.choice((2, 3, 7, 17, 40, 99, 500))),
        (f"T{n}CON", 0x8000 | draw.randrange(4) << 4 | gated_or_clocked | draw.choice((0, 0x2000))),
    ]


def _pair(draw: random.Random) -> Scene:
    low, high = draw.choice(((2, 3), (4, 5)))
    return [
        (f"PR{low}", draw.randrange(400)),
        (f"PR{high}", draw.choice((0, 0, 1))),
        (f"T{low}CON", 0x8008 | draw.randrange(2) << 4 | draw.choice(_STANDS)),
    ]


def _scan(draw: random.Random) -> Scene:
    return [
        ("ADPCFG", draw.choice((0, 0xFFFF, draw.randrange(0x10000)))),
        ("ADCSSL", draw.randrange(1, 0x10000)),
        ("ADCON2", 0x0400 | draw.randrange(16) << 2),
        ("ADCON3", draw.choice((1, 2, 31)) << 8 | draw.randrange(64)),
        ("ADCON1", 0x80E4),
    ]


def _converter(draw: random.Random) -> Scene:
    return [
        ("ADCHS", draw.randrange(0x10000)),
        ("ADCSSL", draw.randrange(0x10000)),
        ("ADCON2", draw.randrange(0x10000)),
        ("ADCON3", draw.randrange(0x10000) & 0x1F9F),
        ("ADCON1", 0x8000 | draw.randrange(0x400)),
    ]


def _compare(draw: random.Random) -> Scene:
    n, timer = draw.randrange(1, 9), draw.choice((2, 3))
    return [
        (f"PR{timer}", draw.choice((9, 40, 99, 300))),
        (f"OC{n}R", draw.randrange(120)),
        (f"OC{n}RS", draw.randrange(120)),
        (f"OC{n}CON", draw.randrange(8) | (timer == 3) << 3 | draw.choice(_STANDS)),
        (f"T{timer}CON", 0x8000 | draw.choice(_STANDS) | draw.choice((0, 0, 0x10))),
    ]


def _capture(draw: random.Random) -> Scene:
    n = draw.randrange(1, 9)
    return [
        (f"T{draw.choice((2, 3))}CON", 0x8000 | draw.choice(_STANDS)),
        (f"IC{n}CON", draw.randrange(8) | draw.randrange(4) << 5 | draw.choice((0, 0x80)) | draw.choice(_STANDS)),
    ]


def _uart(draw: random.Random) -> Scene:
    n = draw.choice((1, 2))
    return [
        (f"U{n}BRG", draw.choice((0, 1, 7))),
        (f"U{n}MODE", 0x8000 | draw.choice((0, 0x40, 0x40, 0x20, 0x06, 0x01, 0x80)) | draw.choice(_STANDS)),
        (f"U{n}STA", 0x0400 | draw.choice((0, 0x8000, 0x20, 0xC0, 0x0800))),
        *((f"U{n}TXREG", draw.randrange(256)) for _ in range(draw.choice((1, 1, 3, 6)))),
        *([(f"U{n}BRG", draw.randrange(9))] if draw.random() < 0.4 else []),
    ]


def _spi(draw: random.Random) -> Scene:
    n = draw.choice((1, 2))
    return [
        (f"SPI{n}CON", draw.randrange(0x800) | draw.choice((0x20, 0x20, 0))),
        (f"SPI{n}STAT", 0x8000 | draw.choice(_STANDS)),
        (f"SPI{n}BUF", draw.randrange(0x10000)),
        (f"SPI{n}BUF", draw.randrange(0x10000)),
    ]


def _bus(draw: random.Random) -> Scene:
    return [
        ("I2CBRG", draw.randrange(40)),
        ("I2CADD", draw.randrange(0x80)),
        ("I2CCON", draw.choice((0x8000, 0x9000, 0x9040, 0x9080, 0xB000)) | draw.choice((0, 1, 1, 8, 4))),
        ("I2CTRN", draw.choice((0xDC, 0xDD, 0))),
        *([("I2CTRN", draw.randrange(256))] if draw.random() < 0.3 else []),
    ]


def _codec(draw: random.Random) -> Scene:
    """Return the settings of the codec interface, in random order in half of the scenes, so that the port starts after
    different writes."""
    settings = [
        ("DCICON3", draw.randrange(16)), ("TSCON", draw.randrange(0x10000)), ("RSCON", draw.randrange(0x10000)),
        ("DCICON2", draw.randrange(0x1000)), ("DCICON1", 0x8000 | draw.choice((0, 0x800, draw.randrange(0x800)))),
        ("TXBUF0", draw.randrange(0x10000)),
    ]  # fmt: skip
    if draw.random() < 0.5:
        draw.shuffle(settings)
    return settings


def _can(draw: random.Random) -> Scene:
    n = draw.choice((1, 2))
    return [
        (f"C{n}CFG1", draw.randrange(8)), (f"C{n}CFG2", draw.randrange(0x800)), (f"C{n}INTE", 0xFF),
        (f"C{n}RXM0SID", 0), (f"C{n}RX0CON", 0), (f"C{n}CTRL", draw.choice((0x0200, 0x0000, 0x0400, 0x0700))),
        (f"C{n}TX0SID", draw.randrange(0x10000)), (f"C{n}TX0DLC", draw.randrange(0x80)),
        (f"C{n}TX0CON", 0x08 | draw.randrange(4)),
    ]  # fmt: skip


def _ports(draw: random.Random) -> Scene:
    letter = draw.choice("ABCDFG")
    return [
        (f"TRIS{letter}", draw.choice((0, 0xFF00, draw.randrange(0x10000)))), ("CNEN1", draw.randrange(0x10000)),
        ("CNPU1", draw.randrange(0x10000)), ("CNEN2", draw.randrange(0x100)), ("CNPU2", draw.randrange(0x100)),
        (f"LAT{letter}", draw.randrange(0x10000)),
    ]  # fmt: skip


def _edges(draw: random.Random) -> Scene:
    return [("INTCON2", draw.randrange(32)), ("ADPCFG", 0xFFFF)]


def _camera(draw: random.Random) -> Scene:
    return [
        ("TRISC", 0xFFFF & ~draw.choice((0, 0x2000))), ("LATC", 0x2000),
        ("TRISD", draw.choice((0xFF00, 0xFFFF, 0))), ("PR4", draw.choice((1, 3))), ("T4CON", 0x8002), ("PR5", 1),
        ("T5CON", 0x8002), ("PR1", 9), ("T1CON", draw.choice((0x8002, 0))),
    ]  # fmt: skip


def _programming(draw: random.Random) -> Scene:
    """Return settings that write an EEPROM row with the key sequence, or without it, which has no effect."""
    key = [("NVMKEY", 0x55), ("NVMKEY", 0xAA)] if draw.random() < 0.7 else []
    return [
        ("NVMADR", 0xF000 | draw.randrange(0x1000)),
        ("NVMADRU", 0x7F),
        ("NVMCON", 0x4000 | draw.choice((0x45, 0x05, 0x44, 0x04))),
        *key,
        ("NVMCON", 0xC000 | draw.choice((0x45, 0x05))),
    ]


def _off_and_on(draw: random.Random) -> Scene:
    """Return settings that switch active modules off and on again (§17)."""
    name = draw.choice(("PMD1", "PMD2"))
    return [
        *SCENES[draw.choice(("timer", "pair", "compare", "capture", "uart", "spi", "bus", "codec", "can"))](draw),
        (name, draw.choice((0xFFFF, draw.randrange(0x10000), 1 << draw.randrange(16)))),
        (name, 0),
    ]


def _supply(draw: random.Random) -> Scene:
    return [("RCON", draw.choice((0x1000, 0x0020, 0, draw.randrange(0x10000)))), ("OSCTUN", draw.randrange(16))]


SCENES = {
    "timer": _timer, "pair": _pair, "scan": _scan, "converter": _converter, "compare": _compare,
    "capture": _capture, "uart": _uart, "spi": _spi, "bus": _bus, "codec": _codec, "can": _can, "ports": _ports,
    "edges": _edges, "camera": _camera, "programming": _programming, "supply": _supply, "off and on": _off_and_on,
}  # fmt: skip
