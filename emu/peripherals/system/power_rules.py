"""Idle and CLRWDT while no watchdog runs and nothing stops in Idle (§4, §17): text for every engine."""

from __future__ import annotations

from dataclasses import dataclass

from emu.chips.chip import Chip
from emu.peripherals.base import IDLE
from emu.system.events import NEVER
from emu.system.record import Record
from emu.system.rules import Number, Place, Reader, slot_of


@dataclass(frozen=True, slots=True)
class PowerOperands:
    """Words, and the bits that count in them."""

    rcon: Place
    idle: int
    wdto: int
    enables: tuple[tuple[Place, int], ...]
    """The watchdog runs while one of these bits is set."""
    stops: tuple[tuple[Place, int], ...]
    """Some device stops in Idle if one of these is."""
    timeout: Place
    """When the watchdog expires."""
    mode: Place
    """0 while the CPU runs, IDLE or SLEEP."""


def places_of(record: Record, chip: Chip, timeout: int, mode: Place) -> PowerOperands:
    """From a chip's data; `timeout` is the watchdog's event slot."""
    rcon, word = chip.sfrs["RCON"], chip.config["FWDT"]
    config = record.fields["program.config"].offset + word.address - chip.program["config"].start
    bits = {name: 1 << rcon.fields[name][0] for name in ("IDLE", "WDTO", "SWDTEN")}
    stops = {sfr.address: sum(1 << lsb for name, (lsb, _width) in sfr.fields.items() if name.endswith("SIDL"))
             for sfr in chip.sfrs.values()}  # fmt: skip
    return PowerOperands(
        rcon=Place(rcon.address, 16),
        idle=bits["IDLE"],
        wdto=bits["WDTO"],
        enables=((Place(config, 16), 1 << word.fields["FWDTEN"][0]), (Place(rcon.address, 16), bits["SWDTEN"])),
        stops=tuple((Place(address, 16), mask) for address, mask in sorted(stops.items()) if mask),
        timeout=slot_of(record, timeout).due,
        mode=mode,
    )


def any_bit(m: Reader, words: tuple[tuple[Place, int], ...]) -> Number:
    """Not 0 if one of the bits is set."""
    found: Number = 0
    for place, bits in words:
        found = found | (m.get(place) & bits)
    return found


def clear_watchdog(m: Reader, p: PowerOperands) -> None:
    """CLRWDT: WDTO falls (UNVERIFIED: the family manual says so, §4), and nothing will expire."""
    m.need(any_bit(m, p.enables) == 0)
    m.put(p.rcon, m.get(p.rcon) & (0xFFFF & ~p.wdto))
    m.put(p.timeout, NEVER)


def idle(m: Reader, p: PowerOperands) -> None:
    """PWRSAV #1: RCON tells, and all devices go on."""
    m.need(any_bit(m, p.stops) == 0)
    m.need(any_bit(m, p.enables) == 0)
    m.put(p.rcon, (m.get(p.rcon) & (0xFFFF & ~p.wdto)) | p.idle)
    m.put(p.timeout, NEVER)
    m.put(p.mode, IDLE)
