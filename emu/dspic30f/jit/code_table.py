"""Native code of one set of processor modes, and counts of its use."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from emu.dspic30f.jit.hot_regions import HotRegions

if TYPE_CHECKING:
    from emu.dspic30f.isa.builder import Context
    from emu.dspic30f.jit.compiler import LoadedCode
    from emu.dspic30f.jit.machine_layout import MachineLayout
    from emu.dspic30f.jit.translate.region import Region


@dataclass(eq=False)
class CodeTable:
    """Native code for one set of processor modes: two tables of code addresses by program word.

    Machines of the same kind with the same program share it, so that a region is translated once for all of them.
    """

    context: Context
    layout: MachineLayout
    identity: bytes
    """Hash of all inputs of the code except program words."""
    indirect_sfr: LoadedCode
    """Native helper for indirect SFR access."""
    blocks: Any
    steps: Any
    loaded: list[LoadedCode] = field(default_factory=list)
    """Loaded code to which the tables point; it must stay alive."""
    regions: dict[int, Region] = field(default_factory=dict)
    """Requested regions by start address."""
    entries: set[int] = field(default_factory=set)
    """Leaders (entry addresses) of all requested regions."""
    heat: dict[int, int] = field(default_factory=dict)
    """How often each address without code was reached."""
    hot: HotRegions = field(init=False)

    def __post_init__(self) -> None:
        self.hot = HotRegions(self.regions)


@dataclass
class EngineStatistics:
    """Counts of native runs, interpreted instructions, cold runs, regions, and hot regions."""

    runs: int = 0
    interpreted: int = 0
    cold: int = 0
    regions: int = 0
    hot: int = 0
