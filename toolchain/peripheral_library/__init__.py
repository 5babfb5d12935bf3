"""Headers of XC16's peripheral library for the dsPIC30F (`timer.h`, `uart.h` ...), generated for each chip.

Names, arguments and results follow Microchip's "16-Bit Language Tools Libraries" (DS51456). Values of the macros come
from the chip's register table, so a header declares only the modules that the chip has. The functions are inline.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

from emu.chips.chip import Chip
from toolchain.peripheral_library import adc, audio, can, motor, ports, serial, timers
from toolchain.peripheral_library.lines import page

BODIES: dict[str, tuple[str, Callable[[Chip], Iterator[str]]]] = {
    "timer.h": ("Timers", timers.timer),
    "incap.h": ("Input capture", timers.input_capture),
    "outcompare.h": ("Output compare", timers.output_compare),
    "uart.h": ("UARTs", serial.uart),
    "spi.h": ("SPI", serial.spi),
    "i2c.h": ("I2C", serial.i2c),
    "can.h": ("CAN", can.can),
    "dci.h": ("Data converter interface", audio.dci),
    "adc10.h": ("10-bit analogue-to-digital converter", adc.adc10),
    "adc12.h": ("12-bit analogue-to-digital converter", adc.adc12),
    "pwm.h": ("Motor control PWM", motor.pwm),
    "qei.h": ("Quadrature encoder interface", motor.qei),
    "ports.h": ("External interrupts and change notification", ports.ports),
    "reset.h": ("Causes of a reset", ports.reset),
    "wdt.h": ("Watchdog timer", ports.watchdog),
}
"""Title and contents of each header, by file name."""


def headers(chip: Chip) -> dict[str, str]:
    """Return the text of each header for a chip, by file name."""
    return {name: page(chip, name, title, body(chip)) for name, (title, body) in BODIES.items()}
