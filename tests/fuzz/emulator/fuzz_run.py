"""Damaged and random firmware: a run always ends with a stop reason, never with an exception of the emulator.

`python tests/fuzz/emulator/fuzz_run.py [--images N] [--seed S] [--seconds T]`; exits with 1 at the first image with
another outcome.
"""

from __future__ import annotations

import json
import random
import sys
import traceback
from collections import Counter
from collections.abc import Iterable
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT))

from emu.api import Machine  # noqa: E402
from emu.image.loader import parse_image  # noqa: E402
from emu.machine.stops import REASONS  # noqa: E402
from tests.emu.cli.programs import ECHO, HELLO, SPIN, assembled  # noqa: E402
from tests.emu.loader.elf_samples import ElfSample, SampleSection, words  # noqa: E402
from tests.fuzz.seeds import Campaign, parser  # noqa: E402

CYCLES = 3_000
CODE_WORDS = 300


def random_code(rng: random.Random) -> list[int]:
    """Return code of a valid program with words replaced or bits flipped, or random words."""
    if rng.random() < 0.5:
        return [rng.getrandbits(24) for _ in range(CODE_WORDS)]
    code = assembled(rng.choice((ECHO, HELLO, SPIN)))[0] * 8
    for _ in range(rng.randint(1, 20)):
        place = rng.randrange(len(code))
        code[place] = rng.getrandbits(24) if rng.random() < 0.5 else code[place] ^ 1 << rng.randrange(24)
    return code


def attempt(rng: random.Random, engine: str) -> str:
    """Run an image whose registers often point into RAM, so that it does not fault at once. Return why it ends."""
    code = random_code(rng)
    vectors = [0x100 + 2 * rng.randrange(len(code)) for _ in range(62)]
    reset = SampleSection(".reset", 0, words(0x040100, 0, *vectors))
    sample = ElfSample([reset, SampleSection(".text", 0x100, words(*code))])
    image = parse_image(sample.build(), "fuzz")
    machine = Machine(image.chip, engine=engine, ipl_slip=rng.randrange(2))
    machine.load(image)
    for number in range(15):
        machine.w[number] = rng.choice((rng.getrandbits(16), 0x800 + 2 * rng.randrange(0x1000)))
    machine.uart[1].feed(bytes(rng.getrandbits(8) for _ in range(4)))
    stop = machine.run(cycles=CYCLES)
    assert stop.reason in REASONS
    assert (stop.reason == "fault") == (stop.fault is not None)
    if stop.fault is not None:
        assert json.dumps(stop.fault.facts())
        assert stop.fault.report().startswith("firmware fault: ")
    return stop.reason


def campaign(seeds: Iterable[int], engines: tuple[str, ...]) -> Counter[str]:
    """Run one image per seed, with alternating engines, and count the reasons for the ends of the runs. Re-raises
    other exceptions."""
    outcomes: Counter[str] = Counter()
    for seed in seeds:
        engine = engines[seed % len(engines)]
        try:
            outcomes[attempt(random.Random(seed), engine)] += 1
        except Exception as error:
            error.add_note(f"engine {engine}")
            raise
    return outcomes


def main() -> int:
    plan = Campaign(parser(__doc__), "images", 5_000, "images to run")
    plan.parse()
    try:
        outcomes = campaign(plan, ("plain", "jit"))
    except Exception:
        return plan.failed(traceback.format_exc())
    return plan.ended(str(dict(outcomes)))


if __name__ == "__main__":
    sys.exit(main())
