"""Regions that have run so long that compiling them again, with all of LLVM's passes, pays.

Native code is not instrumented for this. Where a native run ends is a sample: its length counts for the region of that
address. Runs that end asleep count too: the region with the Idle instruction often has the code that runs after each
interrupt. The first code of a region comes from a short list of passes (`worker.py`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

from emu.dspic30f.jit.translate.region import Region

HOT_CYCLES: Final = 500_000_000
"""Tcy in a region, by the samples, until it is hot: about 0.2 s of host time, as long as compiling a large region."""

SAMPLE_CYCLES: Final = 1_000_000
"""Tcy of native runs per sample: 68 ms of simulated time."""


@dataclass
class HotRegions:
    """Samples of native execution by region. Machines that share native code share them."""

    regions: Mapping[int, Region]
    """Translated regions by start address."""
    cycles: dict[int, int] = field(default_factory=dict)
    """Sampled Tcy by start address of a region."""
    _start: dict[int, int] = field(default_factory=dict)
    """Start address of the region of each sampled PC that lies in one."""

    def sample(self, pc: int, cycles: int) -> Region | None:
        """Count `cycles` Tcy for the region that contains `pc`. Return the region if it has just become hot."""
        start = self._start.get(pc)
        if start is None:
            known = list(self.regions.items())  # a copy: a thread of another machine may add regions meanwhile
            start = next((start for start, region in known if pc in region.steps), None)
            if start is None:
                return None
            self._start[pc] = start
        before = self.cycles.get(start, 0)
        self.cycles[start] = before + cycles
        return self.regions[start] if before < HOT_CYCLES <= before + cycles else None
