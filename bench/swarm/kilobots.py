"""Speed of emulated Kilobots: a swarm on a grid of 33 mm in which each robot receives from up to 20 others.

    python -m bench.swarm.kilobots [--image FILE.elf] [--robots 1 10 100] [--seconds 4] [--gap 33] [--reach 82]

Without an image it builds `gradient` of firmware/kilobot with avr-gcc. Robots get RUN first. Prints simulated seconds
per second of CPU time, and the robots that one core runs in real time.
"""

from __future__ import annotations

import argparse
import ctypes
import json
import math
import random
import shutil
import subprocess
import tempfile
import time
from pathlib import Path
from typing import Any

from emu.avr.core.state import Avr
from emu.avr.image import AvrImage, load_avr_image
from emu.boards.kilobot.overhead import broadcast
from emu.boards.kilobot.swarm import KilobotSetup, KilobotSwarm

ROOT = Path(__file__).resolve().parents[2]


def measure(image: AvrImage, count: int, seconds: float, gap: float, reach: float) -> dict[str, Any]:
    """Return a line of the table."""
    side, dice = math.ceil(math.sqrt(count)), random.Random(1)
    robots = [KilobotSetup(image, gap * (n % side), gap * (n // side), n, dice.random() * 0.03,
                           clock=1 + dice.uniform(-0.01, 0.01)) for n in range(count)]  # fmt: skip
    swarm = KilobotSwarm(robots, reach=reach)
    heard = max(sum(math.dist(a, b) <= reach for b in swarm.places) - 1 for a in swarm.places)
    swarm.run(0.25)
    broadcast(swarm, "run", 0.4)
    sent = sum(map(swarm.pulses_sent, range(count)))
    start = time.process_time()
    swarm.run(seconds)
    spent = time.process_time() - start
    sent = sum(map(swarm.pulses_sent, range(count))) - sent
    idle = sum(robot.state.skipped + robot.state.slept for robot in swarm.robots)
    share = idle / sum(robot.cycle for robot in swarm.robots)
    return {
        "robots": count,
        "hears up to": heard,
        "pulses/s each": round(sent / seconds / count),
        "waiting, %": round(100 * share, 1),
        "x real time": round(seconds / spent, 2),
        "robots in real time": round(count * seconds / spent),
    }


def built() -> AvrImage:
    """Return the image of `gradient`."""
    with tempfile.TemporaryDirectory() as out:
        command = ["make", "-s", "-C", str(ROOT / "firmware" / "kilobot"), "PROGRAM=gradient", f"OUT={out}"]
        subprocess.run(command, check=True)
        return load_avr_image(str(Path(out) / "gradient.elf"))


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--image", help="ELF file of avr-gcc (default: gradient of firmware/kilobot)")
    options.add_argument("--robots", type=int, nargs="+", default=[1, 10, 100])
    options.add_argument("--seconds", type=float, default=4.0)
    options.add_argument("--gap", type=float, default=33.0, help="mm between neighbours of the grid")
    options.add_argument("--reach", type=float, default=82.0, help="range of infrared in mm")
    options.add_argument("--json", action="store_true", help="print one JSON object")
    given = options.parse_args()
    if given.image is None and shutil.which("avr-gcc") is None:
        print("avr-gcc is not installed; Debian packages: gcc-avr, avr-libc")
        return
    image = built() if given.image is None else load_avr_image(given.image)
    rows = []
    for count in given.robots:
        rows.append(measure(image, count, given.seconds, given.gap, given.reach))
        if not given.json:
            if count == given.robots[0]:
                print(f"{ctypes.sizeof(Avr)} bytes per robot\n| {' | '.join(rows[0])} |\n|{'---:|' * len(rows[0])}")
            print(f"| {' | '.join(map(str, rows[-1].values()))} |", flush=True)
    if given.json:
        print(json.dumps({"bytes per robot": ctypes.sizeof(Avr), "rows": rows}))


if __name__ == "__main__":
    main()
