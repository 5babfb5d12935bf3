"""Measure the speed of one robot with its camera on and its wheels turning: `clustering` and `clustering-bare`.

    python -m bench.emulator.clustering [--seconds S] [--json]

Prints simulated seconds per CPU second of this process under the JIT. A warm-up of one simulated second compiles the
native code. The camera sees a red object, so every line of every frame is rendered and captured.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import time
from functools import partial
from pathlib import Path

import numpy as np

from emu.api import Machine
from emu.boards.epuck.board import Epuck
from emu.dspic30f.jit.engine import JitEngine
from emu.image.loader import load_image

FIRMWARE = Path(__file__).resolve().parents[2] / "firmware"
START = 8
"""Selector position at which the program starts without the remote control (firmware/apps/clustering)."""
RED = (80, 0, 0)
WARM_UP = 200.0
"""Simulated seconds until the hot regions of native code are compiled again (emu/dspic30f/jit/hot_regions.py)."""


def measure(app: str, seconds: float) -> float:
    """Return simulated seconds per CPU second."""
    command = ["make", "-s", "-C", str(FIRMWARE), f"APP={app}", f"PYTHON={sys.executable}"]
    subprocess.run(command, check=True)
    image = load_image(FIRMWARE / "build" / app / "firmware.elf")
    machine = Machine(image.chip, engine="jit", board=partial(Epuck, selector=START))
    machine.load(image)
    machine.board.camera.show(np.full((480, 640, 3), RED, np.uint8))
    assert isinstance(machine.runner, JitEngine)
    machine.runner.wait = True  # wait for native code, so that compilation is not measured
    fcy = machine.board.chip.fcy
    machine.run(cycles=int(WARM_UP * fcy))
    began = time.process_time()
    machine.run(cycles=int(seconds * fcy))
    return seconds / (time.process_time() - began)


def main() -> int:
    parser = argparse.ArgumentParser(description="Speed of a robot with its camera running.")
    parser.add_argument("--seconds", type=float, default=30.0, help="simulated seconds per program (default 30)")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    options = parser.parse_args()
    found = {app: round(measure(app, options.seconds), 1) for app in ("clustering", "clustering-bare")}
    if options.json:
        print(json.dumps(found))
    else:
        for app, speed in found.items():
            print(f"{app:16} {speed:5.1f} x real time")
    return 0


if __name__ == "__main__":
    sys.exit(main())
