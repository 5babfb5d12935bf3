"""Measure the time in which a swarm reprograms itself by infrared, with the real firmware in the arena, for
docs/swarm.md.

    python docs/tools/infrared/update.py [--robots 10] [--rows 1] [--lost 0] [--most 120] [--noise 2]

Robots with apps/spreading are on the grid of swarm.py, and the first one has a program of `--rows` flash rows.
The output is the time at which each robot has received the whole program, and the time at which it has restarted and
calls it. The exit status is 1 if a robot does not call it within `--most` seconds.
"""

from __future__ import annotations

import argparse
import itertools
import math
import shutil
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

from swarm import grid, word

from arena.infrared.channel import OpticalChannel
from arena.robots.firmware_controller import FirmwareController
from arena.scene.loader import FCY, load_scene
from emu.host import paths
from emu.image.loader import load_image
from emu.image.model import ERASED
from emu.machine.machine import Machine
from openswarm.flashing.loaders import ROW_WORDS
from openswarm.flashing.program import ROWS, SLOT, program_of

APP = "spreading"
VERSION = 2
"""Selector of the first robot, which is the version of its program."""
LOOK_TICKS = 100
FILLING = """\
    .section .filling, code, keep       ; words of which none is like another
    .set n, 0
    .rept {words}
    mov     #n, w0
    .set n, n + 1
    .endr
"""


def build_image(folder: Path, rows: int) -> Path:
    """Build the application with a program of `rows` flash rows and return its image."""
    app, out = folder / APP, folder / "build"
    shutil.copytree(paths.firmware() / "apps" / APP, app)
    if rows > 1:
        (app / "lamp" / "filling.S").write_text(FILLING.format(words=(rows - 1) * ROW_WORDS))
    command = [
        "make",
        "-C",
        paths.firmware(),
        f"APPS={folder}",
        f"APP={APP}",
        f"OUT={out}",
        f"PYTHON={sys.executable}",
    ]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    made = program_of(load_image(str(out / "lamp.elf")))
    if len(made.rows) != rows:
        raise ValueError(f"the program has {len(made.rows)} rows, not {rows}")
    return out / "firmware.elf"


def is_program_installed(machine: Machine) -> bool:
    """Whether the program is in the flash slot from which the kernel calls it."""
    return machine.program.word(SLOT.start) != ERASED


def measure(image: Path, robots: int, lost: float, most: float, noise: float) -> tuple[list[float], list[float]]:
    """Return two unordered lists: seconds until a robot has received the program, and until its kernel calls it.

    Robots that have not reached that state in `most` seconds are missing in the list.
    """
    poses = grid(robots)
    values = {"robots__count": robots, "objects__count": 0, "infrared__noise_counts": noise,
              "infrared__lost_share": lost}  # fmt: skip
    scene = load_scene("clustering").with_values(**values)
    channel = OpticalChannel.of(scene)
    controllers = [FirmwareController(scene, 1, one, image, 0 if one else VERSION, channel) for one in range(robots)]
    has, calls = dict[int, float](), dict[int, float]()
    for tick in itertools.count(1):
        for controller in controllers:
            controller.control_step(tick - 1, poses)
        if tick % LOOK_TICKS:
            continue
        seconds = tick * scene.clock.quantum_tcy / FCY
        for one, controller in enumerate(controllers):
            if word(controller.machine, "have") == VERSION:
                has.setdefault(one, seconds)
            if one in has and is_program_installed(controller.machine):
                calls.setdefault(one, seconds)
        if len(calls) == robots or seconds >= most:
            break
    return list(has.values()), list(calls.values())


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robots", type=int, default=10)
    parser.add_argument("--rows", type=int, default=1, choices=range(1, ROWS + 1), metavar="N")
    parser.add_argument("--lost", type=float, default=0.0, metavar="SHARE", help="of messages, beside the light's own")
    parser.add_argument("--most", type=float, default=120.0, metavar="SECONDS")
    parser.add_argument("--noise", type=float, default=2.0, metavar="COUNTS")
    chosen = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        image = build_image(Path(folder), chosen.rows)
        has, calls = measure(image, chosen.robots, chosen.lost, chosen.most, chosen.noise)
    for what, seconds in (("have it whole", has), ("restarted and call it", calls)):
        known = seconds or [math.nan]
        times = f"median {statistics.median(known):.1f} s, last {max(known):.1f} s"
        print(f"{len(seconds)} of {chosen.robots} {what}: {times}")
    return 0 if len(calls) == chosen.robots else 1


if __name__ == "__main__":
    sys.exit(main())
