"""The e-puck as data: its chip, its crystal, and configuration words for firmware that has none."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

CHIPS: Final = ("dsPIC30F6014A", "dsPIC30F6014")
"""Chip of the e-puck, and its predecessor with the same pins, for which some of its firmware was built."""

CRYSTAL_HZ: Final = 7_372_800
"""Frequency in Hz of the crystal at OSC1 (dspic30f6014a.md §3)."""

CONFIG: Final[Mapping[str, int]] = MappingProxyType(
    {
        "FOSC": 0xFFE6,  # clock switching and clock monitor off; XT crystal with PLL x8
        "FWDT": 0x7FFF,  # watchdog off
        "FBORPOR": 0xFF7F,  # brown-out reset off, MCLR on, power-up timer 64 ms
        "FGS": 0xFFFF,  # no code protection
    }
)
"""Configuration words that the robot's library and boot loader program (dspic30f6014a.md §2).

Firmware images often omit these words, because a boot loader cannot write them. An erased FWDT would enable the
watchdog.
"""
