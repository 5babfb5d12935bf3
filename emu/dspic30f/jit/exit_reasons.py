"""What translations rely on apart from the program; and why native code comes back, by number."""

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
from emu.system.rules import Rule

NEXT, INTERPRET, DEADLINE, SERVICE, MISS, RETFIE, HOOK, MODES, ARRIVE, ENTERS = range(10)
"""Why native code came back: go on at PC; interpret the instruction at PC; the block at PC reaches the deadline;
look at events and interrupts before PC; no native code at PC; a RETFIE has run for two cycles;
PC is hooked; the processor modes are others at PC; events are due before the access of the instruction at PC; the
boundary before PC has begun and goes on, whatever limit has been reached."""

Access = Literal["plain", "slow", "irq", "flags", "sr"]
"""How native code treats an SFR: memory under a mask; Python only; memory that may make an interrupt acceptable;
interrupt flags, which native code only clears; SR."""


@dataclass(frozen=True)
class Latches:
    """Where table writes go: byte offsets in the record, and the addresses of EEPROM (`ProgramMemory.table_write`)."""

    flash: int
    flash_count: int
    eeprom: int
    eeprom_count: int
    eeprom_range: tuple[int, int]
    captured_in: tuple[int, int] | None


@dataclass(frozen=True)
class Surroundings:
    """What the translator knows of the machine around an instruction."""

    offset: Mapping[str, int]
    """Byte offsets in the record of registers and hidden state by name."""
    reads: Mapping[int, Access]
    """By even SFR address; absent: slow."""
    writes: Mapping[int, tuple[Access, int]]
    """By even SFR address: how, and the bits a write can change; absent: slow."""
    initialised: int
    """W registers known to have been written since reset: they need no check as pointers (isa.md §2.2)."""
    limit_armed: bool
    """SPLIM has been written since reset (isa.md §10.2)."""
    ram: tuple[int, int]
    """First data address behind the SFRs, first one behind RAM."""
    y_ram: int
    """First data address of Y RAM, which is the upper part of RAM."""
    flash_words: int
    flag_words: tuple[tuple[int, int], ...]
    """Addresses of interrupt flag registers, each with that of its enables."""
    trap_flags: int
    """Bits of INTCON1 that request a trap."""
    idling: Rule
    clearing: Rule
    """What PWRSAV #1 and CLRWDT do."""
    latches: Latches
    flow: flow_rules.FlowPlaces
    rules: Mapping[int, Rule] = field(default_factory=dict)
    """Of device registers, by even address."""
    hooks: frozenset[int] = frozenset()
    """Program addresses that Python wants to see."""
    do_start: int = -1
    do_end: int = -1
    """The DO loop that is active: its first and last instruction; -1: none."""

    def accumulator_at(self, address: int) -> tuple[int, int] | None:
        """Accumulator of which the word at `address` is a part, and from which bit on; None elsewhere."""
        for i, low in enumerate((self.offset["ACCAL"], self.offset["ACCBL"])):
            if low <= address < low + 6:
                return i, 8 * (address - low)
        return None


def wiring_of(around: Surroundings) -> bytes:
    """Hash of what is the same in all modes of a machine, and long: where things are, and the rules of devices."""
    return hashlib.sha256(repr((sorted(around.offset.items()), sorted(around.rules.items()))).encode()).digest()


def identity_of(context: Context, around: Surroundings, wiring: bytes) -> bytes:
    """Hash of processor modes and surroundings, whose `wiring_of` is given, without the hooks: those in a region belong
    to the region."""
    facts = vars(around) | {"hooks": None, "offset": None, "rules": wiring}
    parts = [sorted(part.items()) if isinstance(part, Mapping) else part for part in facts.values()]
    return hashlib.sha256(repr((context, parts)).encode()).digest()


def offsets(core: Core) -> dict[str, int]:
    """Byte offsets in the record of every register and reserved field, by name."""
    offset = {name: sfr.address for name, sfr in core.chip.sfrs.items()}
    offset |= {name: reserved.offset for name, reserved in core.record.fields.items()}
    offset |= {name: 2 * core.state.at[name] for name in ("W0S", "W1S", "W2S", "W3S", "SRS")}
    offset["flash"] = core.program.flash_offset
    return offset


def surroundings_of(core: Core, key: Key, hooks: frozenset[int], offset: Mapping[str, int]) -> Surroundings:
    """What translations in the modes `key` may rely on, apart from the program."""
    chip, bus = core.chip, core.bus
    words = {chip.sfrs[s.flag[0]].address: chip.sfrs[s.enable[0]].address for s in chip.interrupts.values()}
    reads, writes = access_kinds(core)
    ram = chip.data["ram"]
    start, end = key.loop if key.loop is not None else (-1, -1)
    return Surroundings(
        offset, reads, writes, key.initialised, bool(key.limit_armed), (ram.start, ram.end), chip.data["yram"].start,
        chip.program["flash"].end // 2, tuple(sorted(words.items())), core.traps.flags,
        core.sequencer.power.signals.idling, core.sequencer.power.signals.clearing, latches_of(core),
        flow_rules.places_of(core.state),
        {2 * word: rule for word, rule in enumerate(bus.rules) if rule is not None}, hooks, start, end)  # fmt: skip


def latches_of(core: Core) -> Latches:
    """Where table writes go."""
    flash, eeprom = (core.record.fields[f"program.{kind}_latch"] for kind in ("flash", "eeprom"))
    program = core.program
    return Latches(flash.offset, flash.count, eeprom.offset, eeprom.count, program.eeprom_range, program.captured_in)


def access_kinds(core: Core) -> tuple[dict[int, Access], dict[int, tuple[Access, int]]]:
    """How native code may touch each SFR, from what stands behind it on the bus."""
    bus, sfrs = core.bus, core.chip.sfrs
    sources = core.chip.interrupts.values()
    special: dict[int, Access] = {}
    if not core.exceptions.ipl_slip:
        special |= {sfrs[name].address: "irq" for s in sources for name in (s.enable[0], s.priority[0])}
        special |= {sfrs[source.flag[0]].address: "flags" for source in sources}
        special[sfrs["SR"].address] = "sr"
    if core.state.limit_armed:
        special[sfrs["SPLIM"].address] = "plain"
    modes = {sfrs[name].address for name in REGISTERS} - special.keys()
    reads: dict[int, Access] = {}
    writes: dict[int, tuple[Access, int]] = {}
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
