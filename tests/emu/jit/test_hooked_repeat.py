"""Hooks on a REPEAT and on its target."""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from engine_pair import engine_pair
from random_firmware import Firmware, difference, literal, load, to_sfr, words_of


def test_a_hooked_repeat_that_never_fits_before_the_next_event_goes_on() -> None:
    """engines.md §4.3: a hooked REPEAT that does not fit before the next event makes progress. The block checks the
    whole loop after the hook; exact code then runs it."""
    firmware = Firmware(0)
    firmware.put(0, words_of("GOTO Expr", n=0x100))
    firmware.put(0x1A, [0x1000])
    firmware.put(0x1000, words_of("BCLR{.B} f, #bit4", f=0x84, b=3) + words_of("RETFIE"))
    at = 0x100
    for register, value in ((1, 200), (2, 0), (15, 0x900)):
        at = firmware.put(at, literal(value, register))
    for sfr, value in (("PR1", 99), ("IEC0", 8), ("T1CON", 0x8000)):
        at = firmware.put(at, to_sfr(sfr, value))
    repeat = at
    at = firmware.put(at, words_of("REPEAT Wn", s=1) + words_of("INC{.B} Ws, Wd", B=0, s=2, p=0, d=2, q=0))
    firmware.put(at, words_of("BRA Expr", n=-3))
    plain, native = engine_pair(firmware, 0, 2)
    arrivals: list[list[int]] = []
    for machine in (plain, native):
        seen: list[int] = []
        load(machine, firmware)
        machine.hook_pc(repeat, lambda m=machine, s=seen: s.append(m.cycle))  # type: ignore[misc]
        machine.run(3_000)
        arrivals.append(seen)
    assert arrivals[0] == arrivals[1]
    assert len(arrivals[0]) > 10
    assert not difference(plain, native)


def test_each_iteration_of_a_hooked_target_is_an_arrival() -> None:
    """A hook on a REPEAT target is called in every iteration, because each is a boundary (isa.md §7.5)."""
    firmware = Firmware(0)
    firmware.put(0, words_of("GOTO Expr", n=0x100))
    at = firmware.put(0x100, literal(0, 2) + words_of("REPEAT #lit14", k=5))
    firmware.put(at, words_of("INC{.B} Ws, Wd", B=0, s=2, p=0, d=2, q=0) + words_of("BRA Expr", n=-1))
    arrivals: list[list[int]] = []
    for machine in engine_pair(firmware, 0, 2):
        seen: list[int] = []
        load(machine, firmware)
        machine.hook_pc(at, lambda m=machine, s=seen: s.append(m.cycle))  # type: ignore[misc]
        machine.run(100)
        arrivals.append(seen)
    assert arrivals == [arrivals[0]] * 2
    assert len(arrivals[0]) == 6
