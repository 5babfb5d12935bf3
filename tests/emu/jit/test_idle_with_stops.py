"""Idle in native code with a device that stops during Idle."""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from engine_pair import engine_pair
from random_firmware import Firmware, difference, literal, load, to_sfr, words_of


def test_a_timer_that_stops_in_idle_goes_on_behind_it() -> None:
    """dspic30f6014a.md §4: TSIDL stops timer 2 only during Idle; it counts again when native code continues after the
    wake-up."""
    firmware = Firmware(2)
    firmware.put(0, words_of("GOTO Expr", n=0x100))
    firmware.put(0x1A, [0x1000])
    firmware.put(0x1000, words_of("BCLR{.B} f, #bit4", f=0x84, b=3) + words_of("RETFIE"))
    at = firmware.put(0x100, literal(0x900, 15))
    for sfr, value in (
        ("PR1", 99), ("IPC0", 0x4444), ("IEC0", 8), ("PR2", 0xFFFF), ("T2CON", 0xA000), ("T1CON", 0x8000),
    ):  # fmt: skip
        at = firmware.put(at, to_sfr(sfr, value))
    idle = words_of("PWRSAV #lit1", k=1)
    firmware.put(at, words_of("NOP") + idle + words_of("NOP") * 9 + words_of("BRA Expr", n=-12))
    plain, native = engine_pair(firmware, 0, 2)
    counts = []
    for machine in (plain, native):
        load(machine, firmware)
        machine.run(10_000)
        counts.append(machine.read("TMR2"))
    assert counts[0] == counts[1]
    assert 500 < counts[0] < 8_000
    assert not difference(plain, native)
