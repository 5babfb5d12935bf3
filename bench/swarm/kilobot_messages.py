"""Compare messages of 25 emulated and 25 real Kilobots: numbers sent, and shares received by distance (kilobot.md §5).

    python -m bench.swarm.kilobot_messages [--image FILE.elf] [--seeds 1] [--seconds 161] [--json]

Robots on a grid of 50 mm send at the maximum rate for 4,800 ticks (firmware/kilobot/programs/counts.c). `--image`
selects the same program linked with another library. Two parameters are fitted: the share of lost pulses by distance,
and the spread of the clocks. The firmware determines what the robots send and when frames collide.
"""

from __future__ import annotations

import argparse
import json
import shutil
import subprocess
import tempfile
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from emu.avr.image import AvrImage, load_avr_image
from emu.boards.kilobot.overhead import broadcast
from emu.boards.kilobot.swarm import KilobotSetup, KilobotSwarm

ROOT = Path(__file__).resolve().parents[2]
SIDE, GAP_MM, TICKS, TICKS_PER_MESSAGE = 5, 50, 4800, 16
PUBLISHED_SENT: Final = 298.3 / 301
"""Messages sent by a real robot as a share of the greatest number possible."""
PUBLISHED: Final = {50: 0.971, 71: 0.965, 100: 0.960, 141: 0.954, 158: 0.946, 180: 0.932, 200: 0.51, 224: 0.14,
                    283: 0.03}  # fmt: skip
"""Share of the messages of a real robot that another one receives, by distance in mm."""
LOST: Final = ((50, 0.00067), (71, 0.00085), (100, 0.00099), (141, 0.0012), (158, 0.0014), (180, 0.00179),
               (200, 0.01777), (224, 0.053), (283, 0.0949))  # fmt: skip
"""Fitted share of lost pulses by distance in mm."""
CLOCK_SD: Final = 0.0025
"""Fitted standard deviation of the frequencies of the oscillators."""
Counts = tuple[float, dict[int, float]]


def measure(image: AvrImage, seed: int, seconds: float) -> Counts:
    """Return two shares: sent, of the maximum of one message every 16 ticks; and received, by distance in mm."""
    dice = np.random.default_rng(seed)
    robots = [KilobotSetup(image, GAP_MM * (n % SIDE), GAP_MM * (n // SIDE), n, float(2 * dice.random()),
                           clock=float(1 + CLOCK_SD * np.clip(dice.normal(), -3, 3)))
              for n in range(SIDE * SIDE)]  # fmt: skip
    with KilobotSwarm(robots, seed=seed, loss=LOST, reach=300.0) as swarm:
        swarm.run(2.1)
        broadcast(swarm, "run", 0.5)
        swarm.run(seconds)
        sent = np.array([robot.peek("sent", 2) for robot in swarm.robots])
        taken: NDArray[np.uint16] = np.array([np.frombuffer(robot.peek_bytes("received", 2 * len(robots)), "<u2")
                                              for robot in swarm.robots])  # fmt: skip
        apart = np.hypot(*(swarm.places[:, None] - swarm.places[None]).transpose(2, 0, 1)).round()
        ticks = np.minimum([robot.peek("kilo_ticks", 4) - robot.peek("first_tick", 4) for robot in swarm.robots], TICKS)
    share = float((sent / (ticks // TICKS_PER_MESSAGE + 1)).mean())
    return share, {far: float((taken / sent)[apart == far].mean()) for far in PUBLISHED}


def built(out: Path) -> AvrImage:
    """Return the image of `counts`, built into a folder."""
    command = ["make", "-s", "-C", str(ROOT / "firmware" / "kilobot"), "PROGRAM=counts", f"OUT={out}"]
    subprocess.run(command, check=True)
    return load_avr_image(str(out / "counts.elf"))


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--image", help="ELF file of the program (default: built with firmware/kilobot)")
    options.add_argument("--seeds", type=int, default=1, help="number of seeds (default 1)")
    options.add_argument("--seconds", type=float, default=161.0, help="simulated time after RUN; 4,800 ticks: 158")
    options.add_argument("--json", action="store_true", help="print one JSON object")
    given = options.parse_args()
    if given.image is None and shutil.which("avr-gcc") is None:
        print("avr-gcc is not installed; Debian packages: gcc-avr, avr-libc")
        return
    with tempfile.TemporaryDirectory() as out:
        image = built(Path(out)) if given.image is None else load_avr_image(given.image)
    runs = [measure(image, seed, given.seconds) for seed in range(1, given.seeds + 1)]
    if given.json:
        print(json.dumps([{"sent": sent, "received": received} for sent, received in runs]))
        return
    print(f"sent, of 301: {301 * np.mean([sent for sent, _ in runs]):.1f}; real robots: {301 * PUBLISHED_SENT:.1f}")
    print("| distance, mm | real | emulated | sd of the seeds |\n|---:|---:|---:|---:|")
    for far, real in PUBLISHED.items():
        shares = [received[far] for _, received in runs]
        print(f"| {far} | {real:.3f} | {np.mean(shares):.3f} | {np.std(shares):.4f} |")


if __name__ == "__main__":
    main()
