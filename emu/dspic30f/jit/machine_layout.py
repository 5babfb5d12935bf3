"""Facts about a machine, apart from the program, on which its translations depend: offsets, register access, rules."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from emu.dspic30f.core import Core
from emu.dspic30f.interpreter import flow_rules
from emu.dspic30f.isa.builder import Context
from emu.dspic30f.state.data_space import W_END
from emu.dspic30f.state.modes import REGISTERS, Key
from emu.system.arrivals import Recording
from emu.system.hook_filters import Filter
from emu.system.rules import Rule

SfrAccess = Literal["plain", "slow", "irq", "flags", "sr"]
"""How native code accesses an SFR.

- `plain`: as memory, under a mask.
- `slow`: only through Python.
- `irq`: as memory; an interrupt may become acceptable.
- `flags`: as interrupt flags.
- `sr`: as the status register.
"""


@dataclass(frozen=True)
class Latches:
    """Destinations of table writes: byte offsets of the latches in the record, and the address range of EEPROM."""

    flash: int
    flash_count: int
    eeprom: int
    eeprom_count: int
    eeprom_range: tuple[int, int]
    captured_in: tuple[int, int] | None
    """Data addresses of the registers that store the address of a table write; None if the chip has none."""


@dataclass(frozen=True)
class MachineLayout:
    """Facts about one set of processor modes that the translator may compile into code."""

    offset: Mapping[str, int]
    """Byte offsets in the record of registers and hidden state, by name."""
    reads: Mapping[int, SfrAccess]
    """Read access by even SFR address. For a missing address it is `slow`."""
    writes: Mapping[int, tuple[SfrAccess, int]]
    """Write access by even SFR address, with the bits that a write can change. For a missing address it is `slow`."""
    initialised: int
    """Bit n is set if Wn is known to be initialised, so that its use as a pointer needs no check (isa.md §2.2)."""
    limit_armed: bool
    """Whether SPLIM has been written since reset (isa.md §10.2)."""
    ram: tuple[int, int]
    """Data addresses of the end of the SFRs and of the end of RAM."""
    y_ram: int
    """First data address of Y RAM, the upper part of RAM."""
    flash_words: int
    flag_words: tuple[tuple[int, int], ...]
    """Addresses of the interrupt flag registers, each with the address of its enable register."""
    trap_flags: int
    """Flags in INTCON1 that request a trap."""
    idle_rule: Rule
    """Rule for the effect of PWRSAV #1 on devices."""
    clrwdt_rule: Rule
    """Rule for the effect of CLRWDT on devices."""
    latches: Latches
    flow: flow_rules.FlowOperands
    rules: Mapping[int, Rule] = field(default_factory=dict)
    """Rules of device registers, by even data address."""
    tapped: tuple[int, ...] = ()
    """Even addresses of SFRs whose reads and writes an observer receives. Only Python accesses them."""
    hooks: frozenset[int] = frozenset()
    """Hooked program addresses, before which native code returns to Python."""
    filters: Mapping[int, tuple[Filter, ...]] = field(default_factory=dict)
    """Filters of hooked addresses: native code passes the address if none of them holds."""
    recorded: Mapping[int, Recording] = field(default_factory=dict)
    """Hooked addresses at which native code records arrivals and does not return to Python."""
    do_start: int = -1
    """Address of the active DO loop's first instruction; -1 if no loop is active."""
    do_end: int = -1
    """Address of the active DO loop's last instruction; -1 if no loop is active."""

    def accumulator_at(self, address: int) -> tuple[int, int] | None:
        """Return the accumulator that contains the word at `address`, and the word's bit position in it;

        None if none does.
        """
        for i, low in enumerate((self.offset["ACCAL"], self.offset["ACCBL"])):
            if low <= address < low + 6:
                return i, 8 * (address - low)
        return None


def wiring_hash(layout: MachineLayout) -> bytes:
    """Return the hash of the large facts that are equal in all modes of a machine: offsets and device rules."""
    return hashlib.sha256(repr((sorted(layout.offset.items()), sorted(layout.rules.items()))).encode()).digest()


def translation_hash(context: Context, layout: MachineLayout, wiring: bytes) -> bytes:
    """Return the hash of processor modes and layout. `wiring` is the layout's `wiring_hash`.

    Hooks, filters and recordings are excluded, because a region's key contains those inside the region.
    """
    facts = vars(layout) | {"hooks": None, "filters": None, "recorded": None, "offset": None, "rules": wiring}
    parts = [sorted(part.items()) if isinstance(part, Mapping) else part for part in facts.values()]
    return hashlib.sha256(repr((context, parts)).encode()).digest()


def record_offsets(core: Core) -> dict[str, int]:
    """Return the byte offset in the record of every register and reserved field by name."""
    offset = {name: sfr.address for name, sfr in core.chip.sfrs.items()}
    offset |= {name: reserved.offset for name, reserved in core.record.fields.items()}
    offset |= {name: 2 * core.state.at[name] for name in ("W0S", "W1S", "W2S", "W3S", "SRS")}
    offset["flash"] = core.program.flash_offset
    return offset


def machine_layout(
    core: Core,
    key: Key,
    hooks: frozenset[int],
    offset: Mapping[str, int],
    filters: Mapping[int, tuple[Filter, ...]] | None = None,
    recorded: Mapping[int, Recording] | None = None,
) -> MachineLayout:
    """Return the facts that translations in the modes `key` may rely on."""
    chip, bus, signals = core.chip, core.bus, core.sequencer.power.signals
    words = {chip.sfrs[s.flag[0]].address: chip.sfrs[s.enable[0]].address for s in chip.interrupts.values()}
    reads, writes = sfr_access_kinds(core)
    ram = chip.data["ram"]
    start, end = key.loop if key.loop is not None else (-1, -1)
    return MachineLayout(
        offset=offset,
        reads=reads,
        writes=writes,
        initialised=key.initialised,
        limit_armed=bool(key.limit_armed),
        ram=(ram.start, ram.end),
        y_ram=chip.data["yram"].start,
        flash_words=chip.program["flash"].end // 2,
        flag_words=tuple(sorted(words.items())),
        trap_flags=core.traps.flags,
        idle_rule=signals.idle_rule,
        clrwdt_rule=signals.clrwdt_rule,
        latches=latch_layout(core),
        flow=flow_rules.operands_of(core.state),
        rules={2 * word: rule for word, rule in enumerate(bus.rules) if rule is not None},
        tapped=tuple(2 * word for word in sorted(bus.watched)),
        hooks=hooks,
        filters=filters or {},
        recorded=recorded or {},
        do_start=start,
        do_end=end,
    )


def latch_layout(core: Core) -> Latches:
    """Return the destinations of table writes."""
    flash, eeprom = (core.record.fields[f"program.{kind}_latch"] for kind in ("flash", "eeprom"))
    program = core.program
    return Latches(flash.offset, flash.count, eeprom.offset, eeprom.count, program.eeprom_range, program.captured_in)


def sfr_access_kinds(core: Core) -> tuple[dict[int, SfrAccess], dict[int, tuple[SfrAccess, int]]]:
    """Return how native code may read and write each SFR, derived from the hooks on the bus."""
    bus, sfrs = core.bus, core.chip.sfrs
    sources = core.chip.interrupts.values()
    special: dict[int, SfrAccess] = {}
    if not core.exceptions.ipl_slip:
        special |= {sfrs[name].address: "irq" for s in sources for name in (s.enable[0], s.priority[0])}
        special |= {sfrs[source.flag[0]].address: "flags" for source in sources}
        special[sfrs["SR"].address] = "sr"
    if core.state.limit_armed:
        special[sfrs["SPLIM"].address] = "plain"
    modes = {sfrs[name].address for name in REGISTERS} - special.keys()
    reads: dict[int, SfrAccess] = {}
    writes: dict[int, tuple[SfrAccess, int]] = {}
    for address in range(W_END, bus.end, 2):
        word = address >> 1
        if bus.modelled[word] and bus.on_read[word] is None and bus.compute[word] is None:
            reads[address] = "plain"
        if word in bus.watched or address in modes:
            continue
        if address in special:
            writes[address] = (special[address], bus.writable[word])
        elif bus.modelled[word] and bus.on_write[word] is None and not bus.clear_only[word]:
            writes[address] = ("plain", bus.writable[word])
    return reads, writes
