"""Random register accesses, pin changes, resets and idle periods of the peripherals without a CPU.

Restored snapshots must continue identically, the converter must equal its reference model, and no two devices may
contradict each other (owner of a pin, time of a timer match).

`python tests/fuzz/emulator/fuzz_peripherals.py [--rounds N] [--seed S] [--seconds T]`; exits with 1 at the first
failure.
"""

from __future__ import annotations

import random
import sys
import traceback
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT))

from tests.emu.peripherals.conftest import Rig  # noqa: E402
from tests.emu.peripherals.reference_adc import difference  # noqa: E402
from tests.emu.peripherals.test_fuzz import WORDS, act, contradictions  # noqa: E402
from tests.fuzz.seeds import Campaign, parser  # noqa: E402

ACTIONS = 8000
"""Number of accesses per round."""
CONVERTERS = 20
"""Number of comparisons with the converter's reference model per round."""
REPLAYED = 1000
"""Number of accesses that are repeated from one snapshot."""


def check(seed: int) -> None:
    """Run one round. Raises AssertionError, or the exception of a device."""
    draw = random.Random(seed)
    rig = Rig(fosc=draw.choice((0x7FE6, 0xFFE6)), fwdt=draw.choice((0x7FFF, 0x8000, 0x803F)))
    for _ in range(ACTIONS):
        act(rig, draw)
        assert not (found := contradictions(rig)), found
    for sfr in WORDS:
        assert not rig.peek(sfr.name) & ~sfr.mask, f"{sfr.name} holds bits it does not have"
    state, ends = rig.record.snapshot(), []
    for _ in range(2):
        rig.record.restore(state)
        rig.dev.restored()
        again = random.Random(seed + 1)
        for _ in range(REPLAYED):
            act(rig, again)
        ends.append(rig.record.snapshot())
    places = {rig.record.field_at(i) for i, (a, b) in enumerate(zip(*ends, strict=True)) if a != b}
    for converter in range(CONVERTERS * seed, CONVERTERS * (seed + 1)):
        assert (found := difference(converter)) is None, f"the converter of seed {converter}: {found}"
    assert not places, f"a restored snapshot went another way in {', '.join(sorted(places))}"


def main() -> int:
    campaign = Campaign(parser(__doc__), "rounds", 200, f"rounds of {ACTIONS} accesses")
    campaign.parse()
    for seed in campaign:
        try:
            check(seed)
        except Exception:
            return campaign.failed(traceback.format_exc())
    return campaign.ended("no failure")


if __name__ == "__main__":
    sys.exit(main())
