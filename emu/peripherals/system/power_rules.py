"""Rules of Idle and CLRWDT (§4, §17). They require a disabled watchdog and no device that stops in Idle."""

from __future__ import annotations

from dataclasses import dataclass

from emu.chips.chip import Chip
from emu.peripherals.base import IDLE
from emu.system.events import NEVER
from emu.system.record import Record
from emu.system.rules import Cell, Number, RuleBuilder, event_slot


@dataclass(frozen=True, slots=True)
class PowerOperands:
    """Operands of the rules: register cells and masks of bits in them."""

    rcon: Cell
    idle: int
    wdto: int
    enables: tuple[tuple[Cell, int], ...]
    """Bits of which any enables the watchdog."""
    stops: tuple[tuple[Cell, int], ...]
    """Bits of which any makes a device stop in Idle."""
    timeout: Cell
    """Due cycle of the watchdog's event."""
    mode: Cell
    """Power mode of the CPU: 0 while it runs, else IDLE or SLEEP."""


def power_operands(record: Record, chip: Chip, timeout: int, mode: Cell) -> PowerOperands:
    """Return the operands for a chip; `timeout` is the watchdog's event slot."""
    rcon, word = chip.sfrs["RCON"], chip.config["FWDT"]
    config = record.fields["program.config"].offset + word.address - chip.program["config"].start
    bits = {name: 1 << rcon.fields[name][0] for name in ("IDLE", "WDTO", "SWDTEN")}
    stops = {sfr.address: sum(1 << lsb for name, (lsb, _width) in sfr.fields.items() if name.endswith("SIDL"))
             for sfr in chip.sfrs.values()}  # fmt: skip
    return PowerOperands(
        rcon=Cell(rcon.address, 16),
        idle=bits["IDLE"],
        wdto=bits["WDTO"],
        enables=((Cell(config, 16), 1 << word.fields["FWDTEN"][0]), (Cell(rcon.address, 16), bits["SWDTEN"])),
        stops=tuple((Cell(address, 16), mask) for address, mask in sorted(stops.items()) if mask),
        timeout=event_slot(record, timeout).due,
        mode=mode,
    )


def any_bit(m: RuleBuilder, words: tuple[tuple[Cell, int], ...]) -> Number:
    """Return a number that is not 0 if any bit of `words`, pairs of register and mask, is set."""
    found: Number = 0
    for place, bits in words:
        found = found | (m.get(place) & bits)
    return found


def clear_watchdog(m: RuleBuilder, p: PowerOperands) -> None:
    """Execute CLRWDT without a pending time-out: clear WDTO (UNVERIFIED: the family manual says so, §4)."""
    m.require(any_bit(m, p.enables) == 0)
    m.put(p.rcon, m.get(p.rcon) & (0xFFFF & ~p.wdto))
    m.put(p.timeout, NEVER)


def idle(m: RuleBuilder, p: PowerOperands) -> None:
    """Execute PWRSAV #1: set IDLE in RCON. All devices continue."""
    m.require(any_bit(m, p.stops) == 0)
    m.require(any_bit(m, p.enables) == 0)
    m.put(p.rcon, (m.get(p.rcon) & (0xFFFF & ~p.wdto)) | p.idle)
    m.put(p.timeout, NEVER)
    m.put(p.mode, IDLE)
