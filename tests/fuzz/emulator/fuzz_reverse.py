"""Compare reverse steps with forward steps.

Usage: `python tests/fuzz/emulator/fuzz_reverse.py [--walks N] [--seed N] [--seconds S] [--json]`. A sample of this
campaign is tests/firmware/debugging/test_time_travel.py. A walk runs the clustering firmware or Listing 1 to a random
time, sometimes with input for UART1. It then makes some hundred steps forward and stores a hash of the whole state
before each. Then it makes as many reverse steps; each must restore the stored state. The summary counts the steps
that entered an interrupt, changed an I2C register, executed the camera driver, or began with input.
"""

from __future__ import annotations

import hashlib
import json
import random
import subprocess
import sys
import tempfile
from collections import Counter
from functools import cache, partial
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT))

import emu  # noqa: E402
from emu.boards.epuck.board import Epuck  # noqa: E402
from emu.debug.history import History  # noqa: E402
from emu.image.loader import load_image  # noqa: E402
from emu.image.model import Image  # noqa: E402
from tests.fuzz.seeds import Campaign, parser  # noqa: E402

APPS = {"clustering": 8, "listing1": 0}
"""Applications, with the selector position at which they start."""
LINE_HANDLER, FRAME = "_T4Interrupt", 4_000_000
"""Function that the firmware calls for every camera line, and approximate number of cycles from frame to frame."""
PERIOD = 2_000
"""Cycles between stored states; a reverse step runs again from the last stored state, so a short period is fast."""


def state_hash(machine: emu.Machine) -> bytes:
    """Return a hash of the whole state."""
    return hashlib.blake2b(machine.snapshot(), digest_size=16).digest()


def step_kinds(machine: emu.Machine, before: tuple[int, int, bytes], handlers: set[int]) -> set[str]:
    """Return the kinds of the last step; `before`: PC, stack pointer and I2C registers before it."""
    found = set()
    where = machine.inspector.image.lines
    entered = machine.inspector.function_start(machine.pc) in handlers and machine.w[15] >= before[1] + 4
    if entered and machine.inspector.function_start(before[0]) != machine.inspector.function_start(machine.pc):
        found.add("interrupts")
    if i2c(machine) != before[2]:
        found.add("i2c")
    line = where.find(machine.pc)
    if line is not None and "/camera/" in line.file:
        found.add("camera")
    return found


def i2c(machine: emu.Machine) -> bytes:
    """Return the contents of the I2C registers."""
    return machine.peek_bytes(machine.chip.sfrs["I2CRCV"].address, 12)


@cache
def image_at(path: Path) -> Image:
    """Load an image with its debug information, once per path."""
    return load_image(path)


def walk(image: Path, selector: int, seed: int, tally: Counter[str]) -> None:
    """Run one walk. Raises AssertionError."""
    rng = random.Random(seed)
    program = image_at(image)
    engine = rng.choice(["jit", "jit", "plain"])
    machine = emu.Machine(program.chip, engine=engine, board=partial(Epuck, selector=selector))
    machine.load(program)
    picture = np.random.default_rng(seed).integers(0, 256, (480, 640, 3), dtype=np.uint8)
    machine.board.camera.show(picture)
    machine.run_until(rng.randrange(rng.choice([120_000, 12_000_000])))  # start-up configures the camera by I2C
    app_has_camera = machine.image.symbols.find(LINE_HANDLER) is not None
    history = History(machine, period=PERIOD)
    handlers = {machine.image.word(vector.ivt) for vector in machine.chip.vectors}
    states: list[tuple[int, bytes]] = []
    for _ in range(rng.randrange(2, 6)):
        history.advance(machine.cycle + rng.randrange(20_000))
        if app_has_camera and rng.random() < 0.4:
            remove = machine.hook_pc(LINE_HANDLER, lambda: True)
            history.advance(machine.cycle + FRAME)
            remove()
        fed = rng.random() < 0.7
        if fed:
            machine.uart[1].feed(rng.randbytes(rng.randrange(1, 6)))
        elif machine.is_asleep:
            history.step()  # a step does not end during Sleep or Idle
        start = len(states)
        for number in range(rng.randrange(20, 400)):
            states.append((machine.cycle, state_hash(machine)))
            before = machine.pc, machine.w[15], i2c(machine)
            assert history.step() is None
            tally.update(step_kinds(machine, before, handlers))
            tally["input"] += fed and not number
        states.append((machine.cycle, state_hash(machine)))
        tally["steps"] += len(states) - start - 1
        for cycle, expected in reversed(states[start:-1]):
            assert history.step_back()
            assert (machine.cycle, state_hash(machine)) == (cycle, expected), f"cycle {cycle} of seed {seed}"
        cycle, expected = rng.choice(states)
        history.seek(cycle)
        assert state_hash(machine) == expected, f"going to cycle {cycle} of seed {seed}"
        history.seek(history.end)
        assert state_hash(machine) == states[-1][1]


def main() -> int:
    campaign = Campaign(parser(__doc__), "walks", 40, "walks")
    campaign.parser.add_argument("--json", action="store_true", help="print the tally as one JSON object")
    options = campaign.parse()
    tally: Counter[str] = Counter()
    with tempfile.TemporaryDirectory() as folder:
        for app in APPS:
            words = [f"APP={app}", f"OUT={folder}/{app}", f"PYTHON={sys.executable}"]
            subprocess.run(["make", "-s", "-C", str(ROOT / "firmware"), *words], check=True, stdout=subprocess.DEVNULL)
        for seed in campaign:
            app = list(APPS)[seed % 5 == 0]
            try:
                walk(Path(folder) / app / "firmware.elf", APPS[app], seed, tally)
            except AssertionError as error:
                return campaign.failed(error)
    if options.json:
        print(json.dumps(tally))
        return 0
    counts = ", ".join(f"{tally[kind]:,} {kind}" for kind in ("interrupts", "i2c", "camera", "input"))
    return campaign.ended(f"{tally['steps']:,} steps back, among them {counts}: every state as before")


if __name__ == "__main__":
    sys.exit(main())
