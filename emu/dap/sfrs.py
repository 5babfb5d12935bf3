"""Response to the custom request `sfrs`: special function registers by peripheral, read without side effects."""

from __future__ import annotations

from bisect import bisect_right
from typing import Any, Final

from emu.chips.chip import Sfr
from emu.machine.machine import Machine

PERIPHERALS: Final = {
    0x0000: "CPU core", 0x0080: "Interrupts", 0x00C0: "Change notification", 0x0100: "Timer 1",
    0x0106: "Timers 2 and 3", 0x0114: "Timers 4 and 5", 0x0140: "Input capture", 0x0180: "Output compare",
    0x0200: "I2C", 0x020C: "UART 1", 0x0216: "UART 2", 0x0220: "SPI 1", 0x0226: "SPI 2", 0x0240: "DCI",
    0x0280: "A/D converter", 0x02C0: "I/O ports", 0x0300: "CAN 1", 0x03C0: "CAN 2", 0x0740: "System",
    0x0760: "Flash and EEPROM", 0x0770: "Peripheral module disable",
}  # fmt: skip
"""First register address of each peripheral, equal in all dsPIC30F (chip reference, register map)."""


def sfr_groups(machine: Machine) -> list[dict[str, Any]]:
    """Return the peripherals, each with its registers, and the registers with their fields, most significant first.

    Each row has a name, and a path that `evaluate` accepts. Registers and fields also have a value.
    """
    starts = list(PERIPHERALS)
    found: dict[str, list[dict[str, Any]]] = {}
    for sfr in sorted(machine.chip.sfrs.values(), key=lambda one: (one.address, -one.size)):
        place = PERIPHERALS[starts[bisect_right(starts, sfr.address) - 1]]
        found.setdefault(place, []).append(_register(machine, sfr))
    return [{"name": name, "path": f"peripheral {name}", "parts": parts} for name, parts in found.items()]


def _register(machine: Machine, sfr: Sfr) -> dict[str, Any]:
    value = machine.peek(sfr.name)
    row: dict[str, Any] = {"name": sfr.name, "path": sfr.name, "value": f"0x{value:0{2 * sfr.size}x}",
                           "address": f"{sfr.address:#06x}"}  # fmt: skip
    fields = sorted(sfr.fields.items(), key=lambda one: -one[1][0])
    if fields:
        row["parts"] = [
            {"name": name, "path": f"{sfr.name}.{name}", "value": str(value >> lsb & (1 << width) - 1)}
            for name, (lsb, width) in fields
        ]
    return row
