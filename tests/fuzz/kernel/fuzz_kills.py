"""Threads killed inside driver calls: `python tests/fuzz/kernel/fuzz_kills.py [--rounds N] [--stride N]`.

A sample of this campaign is tests/firmware/faults/test_kills_on_target.py. A round executes a scene of driver calls,
without or with IPL slip (kernel.md §4), alternating by seed. It kills the thread at every instruction boundary of the
scene, and then uses the devices again at once and after a while. With --stride a round tests every N-th boundary,
from a first one that depends on its seed.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT))

from tests.firmware.kills import SCENES, Seen, Stage, sweep  # noqa: E402
from tests.fuzz.kernel.fuzz_kernel import build  # noqa: E402
from tests.fuzz.seeds import Campaign, parser  # noqa: E402

SPARSE = 97
"""Default stride if the duration is limited by --seconds."""


def main() -> int:
    campaign = Campaign(parser(__doc__), "rounds", 2 * len(SCENES), "scenes")
    campaign.parser.add_argument(
        "--stride", type=int, help=f"every N-th boundary (default 1: an hour; {SPARSE} with --seconds)"
    )
    options = campaign.parse()
    stride = options.stride or (1 if options.seconds is None else SPARSE)
    boundaries = 0
    with tempfile.TemporaryDirectory() as folder:
        path = build("kills", Path(folder))
        for seed in campaign:
            seen = Seen()
            scene, slip = seed // 2 % len(SCENES), seed % 2
            try:
                for last in sweep(Stage(path, slip), scene, stride, seed // (2 * len(SCENES)) % stride):
                    seen = last
                    if campaign.over and options.seconds is not None:
                        break
            except AssertionError as error:
                return campaign.failed(error)
            boundaries += seen.boundaries
            print(f"--seed {seed} ({SCENES[scene]}, slip {slip}): {seen}", flush=True)
    return campaign.ended(f"{boundaries} kills tried, every device went on")


if __name__ == "__main__":
    sys.exit(main())
