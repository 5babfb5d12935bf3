"""Memory of one long trial: `python tests/fuzz/swarm/fuzz_soak.py [--hours N] [--robots N] [--brain NAME]`.

One trial of the scene `clustering` with two robots and two objects in a small arena runs for 24 simulated hours. After
each hour the campaign prints the resident memory of the process. It fails if the memory grows by more than
`MOST_GROWTH` after the first hour, or if the firmware of a robot stops. The record takes a sample each minute, so that
its own growth, which is intended, is some 50 KB in an hour. With `--seconds` each step is a few simulated seconds
instead of an hour.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path
from typing import Final

ROOT = Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT))

from arena.campaign.campaign import Plan, controllers_of  # noqa: E402
from arena.replay.live_feed import LiveFile, live_path  # noqa: E402
from arena.robots.images import image_for  # noqa: E402
from arena.scene.loader import Scene, load_scene, scripted  # noqa: E402
from arena.trial.trial import RunningTrial  # noqa: E402
from tests.fuzz.seeds import SKIPPED, STATM, Campaign, parser, resident_bytes  # noqa: E402

HOUR: Final = 3600
SPARSE: Final = 5
"""Simulated seconds of a step if the duration is limited by --seconds."""
MOST_GROWTH: Final = 8 << 20
"""Bytes by which the memory may grow after the first hour."""
SAMPLE_S: Final = 60.0


def small_scene(robots: int) -> Scene:
    """Return the scene of the soak: robots and two objects in an arena in which they meet often."""
    return load_scene("clustering").with_values(
        robots__count=robots, objects__count=2, arena__width_cm=80.0, arena__height_cm=80.0, clock__sample_s=SAMPLE_S
    )


def main() -> int:
    made = parser(__doc__)
    made.add_argument("--robots", type=int, default=2, metavar="N", help="number of robots (default 2)")
    made.add_argument("--brain", default="openswarm", metavar="NAME", help="as in `arena run` (default openswarm)")
    campaign = Campaign(made, "hours", 24, "simulated hours of one trial")
    options = campaign.parse()
    if not STATM.exists():
        print("the resident memory is known on Linux only")
        return SKIPPED
    step = HOUR if options.seconds is None else SPARSE
    scene, image = small_scene(options.robots), image_for(options.brain)
    plan = Plan(scene if image else scripted(scene), options.brain, "A", image, 1, 1e7, campaign.first)
    memory: list[int] = []
    with tempfile.TemporaryDirectory() as name, controllers_of(plan, plan.seed) as (controllers, channel):
        live = LiveFile(live_path(Path(name), 1), plan.key() | {"seed": plan.seed, "faults": []})
        trial = RunningTrial(plan.scene, plan.seed, controllers, plan.seconds, on_row=live.write, channel=channel,
                             experiment=plan.loaded_experiment)  # fmt: skip
        for _ in campaign:
            until = trial.world.ticks + step * trial.per_second
            while trial.world.ticks < until and not trial.is_over:
                trial.advance(until)
            memory.append(resident_bytes())
            if trial.result.faults:
                return campaign.failed(f"firmware stopped: {trial.result.faults}")
            if options.seconds is None:
                print(f"{trial.world.seconds / HOUR:.0f} h: {memory[-1] / 2**20:.1f} MiB", flush=True)
            if memory[-1] - memory[0] > MOST_GROWTH and options.seconds is None:
                return campaign.failed(f"memory grew from {memory[0]:,} to {memory[-1]:,} bytes")
        simulated = trial.world.seconds
        live.close()
    first, last, most = (value / 2**20 for value in (memory[0], memory[-1], max(memory)))
    seen = f"resident {first:.1f} MiB at first, {last:.1f} last, {most:.1f} most"
    return campaign.ended(f"{simulated:.0f} s simulated, {seen}")


if __name__ == "__main__":
    sys.exit(main())
