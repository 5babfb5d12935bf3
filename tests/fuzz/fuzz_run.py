"""Damaged and random firmware, executed: a run always ends with a reason, never with an exception of the emulator.

Run `python tests/fuzz/fuzz_run.py [COUNT [SEED]]`; exits 1 with the first image that made something else happen.
"""

from __future__ import annotations

import random
import sys
import time
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "tests" / "emu" / "loader"), str(ROOT / "tests" / "emu" / "cli")]

from elf_samples import ElfSample, Part, words  # noqa: E402
from programs import ECHO, HELLO, SPIN, assembled  # noqa: E402

from emu.faults import fault_of  # noqa: E402
from emu.loader import parse_image  # noqa: E402
from emu.machine import REASONS, Machine  # noqa: E402

CYCLES = 3_000
CODE_WORDS = 300


def random_code(rng: random.Random) -> list[int]:
    """Real code with words replaced or bits flipped, or words from nowhere."""
    if rng.random() < 0.5:
        return [rng.getrandbits(24) for _ in range(CODE_WORDS)]
    code = assembled(rng.choice((ECHO, HELLO, SPIN)))[0] * 8
    for _ in range(rng.randint(1, 20)):
        place = rng.randrange(len(code))
        code[place] = rng.getrandbits(24) if rng.random() < 0.5 else code[place] ^ 1 << rng.randrange(24)
    return code


def attempt(rng: random.Random, engine: str) -> str:
    """Run one image with registers that let it get somewhere; the reason it ended for."""
    code = random_code(rng)
    vectors = [0x100 + 2 * rng.randrange(len(code)) for _ in range(62)]
    sample = ElfSample([Part(".reset", 0, words(0x040100, 0, *vectors)), Part(".text", 0x100, words(*code))])
    image = parse_image(sample.build(), "fuzz")
    machine = Machine(image.chip, engine=engine, ipl_slip=rng.randrange(2))
    machine.load(image)
    for number in range(15):
        machine.w[number] = rng.choice((rng.getrandbits(16), 0x800 + 2 * rng.randrange(0x1000)))
    machine.uart[1].feed(bytes(rng.getrandbits(8) for _ in range(4)))
    stop = machine.run(cycles=CYCLES)
    assert stop.reason in REASONS
    fault_of(machine, image, stop)
    return stop.reason


def campaign(count: int, seed: int, engines: tuple[str, ...] = ("plain", "interp")) -> Counter[str]:
    """Reasons of `count` runs. Raises whatever escapes, with the number of the run in a note."""
    outcomes: Counter[str] = Counter()
    for number in range(count):
        try:
            outcomes[attempt(random.Random(f"{seed}.{number}"), engines[number % len(engines)])] += 1
        except Exception as error:
            error.add_note(f"seed {seed}, run {number}, engine {engines[number % len(engines)]}")
            raise
    return outcomes


def main(arguments: list[str]) -> int:
    count = int(arguments[0]) if arguments else 5_000
    seed = int(arguments[1]) if len(arguments) > 1 else 1
    start = time.monotonic()
    outcomes = campaign(count, seed, ("plain", "interp", "jit"))
    print(f"run: {count} images, seed {seed}, {time.monotonic() - start:.1f} s: {dict(outcomes)}")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
