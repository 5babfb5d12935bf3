"""What generated code must know of a machine: where things are in the record, and which registers are special."""

from __future__ import annotations

from dataclasses import dataclass

from emu.dspic30f.core import Core
from emu.dspic30f.interpreter import flow_rules
from emu.dspic30f.state.modes import REGISTERS


@dataclass(frozen=True, slots=True)
class Places:
    """Where things are in the record: indices into the views of 16, 32 and 64 bits, and the edges of RAM."""

    at: dict[str, int]
    now: int
    ram: tuple[int, int]
    y: tuple[int, int]
    read_effects: frozenset[int]
    """Word indices of SFRs whose read changes something."""
    refused: frozenset[int]
    """Word indices of SFRs whose read depends on what only the sequencer keeps current."""
    modes: frozenset[int]
    """Word indices of SFRs that change how instructions are translated."""
    flow: flow_rules.FlowPlaces


def places_of(core: Core) -> Places:
    """What generated code must know of a machine's wiring."""
    at = core.state.at
    effects = frozenset(word for word, hook in enumerate(core.bus.on_read) if hook is not None)
    ram, y = core.chip.data["ram"], core.chip.data["yram"]
    return Places(
        at,
        core.events.now_index,
        (ram.start, ram.end),
        (y.start, y.end),
        effects,
        frozenset((at["PCL"], at["PCH"])),
        frozenset(at[name] for name in REGISTERS),
        flow_rules.places_of(core.state),
    )
