"""Native code against the plain interpreter: random firmware with interrupts, the whole record at random stops.

Run `python tests/fuzz/fuzz_jit.py [--programs N] [--seed S] [--stops N]`; exits 1 at the first difference, naming its
seed. Prints how many instructions, distinct words in distinct modes, rows and interrupts were compared.
"""

from __future__ import annotations

import argparse
import random
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "tests" / "emu" / "jit")]

from random_firmware import difference, load, random_firmware  # noqa: E402

from emu.dspic30f.jit.cache import ObjectCache  # noqa: E402
from emu.dspic30f.jit.compiler import Compiler  # noqa: E402
from emu.dspic30f.jit.engine import JitEngine  # noqa: E402
from emu.machine import Machine  # noqa: E402

MODES = ("CORCON", "MODCON", "XBREV")


class Tally:
    """What the plain machines executed."""

    def __init__(self) -> None:
        self.instructions = 0
        self.interrupts = 0
        self.pairs: set[tuple[int, ...]] = set()
        self.rows: Counter[str] = Counter()

    def watch(self, machine: Machine) -> None:
        """Count every instruction of a plain machine."""
        sequencer = machine.core.sequencer
        execute = sequencer.execute
        enter = machine.core.exceptions.enter

        def counted() -> None:
            pc = machine.pc
            self.instructions += 1
            word = machine.program.word(pc)
            self.pairs.add((word, *(machine.peek(name) for name in MODES)))
            if machine.program.executable(pc):
                try:
                    self.rows[sequencer.fetch(pc).insn.row.syntax] += 1
                except Exception:  # an illegal word: the machine will say so itself
                    self.rows["(illegal)"] += 1
            execute()

        def entered(accepted: object, last: int) -> None:
            self.interrupts += 1
            enter(accepted, last)  # type: ignore[arg-type]

        sequencer.execute = counted  # type: ignore[method-assign]
        machine.core.exceptions.enter = entered  # type: ignore[method-assign]


def run(seed: int, stops: int, tally: Tally, folder: Path) -> str:
    """One program; the difference found, or nothing."""
    firmware = random_firmware(seed)
    plain, native = (Machine(engine=engine, ipl_slip=seed % 2) for engine in ("plain", "jit"))
    assert isinstance(native.runner, JitEngine)
    native.runner.threshold, native.runner.wait = 1, True
    native.runner.compiler = Compiler(ObjectCache(folder))
    tally.watch(plain)
    load(plain, firmware)
    load(native, firmware)
    generator = random.Random(seed)
    for _ in range(stops):
        cycles = generator.randrange(1, 600)
        one, other = plain.run(cycles), native.run(cycles)
        if one != other or difference(plain, native):
            return f"{one} {other} {difference(plain, native)}"
        if one.reason != "limit":
            break
    return ""


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--programs", type=int, default=2_000, help="random programs (default %(default)s)")
    parser.add_argument("--seed", type=int, default=10_000, help="first seed (default %(default)s)")
    parser.add_argument("--stops", type=int, default=20, help="comparisons per program (default %(default)s)")
    options = parser.parse_args()
    tally, start = Tally(), time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(options.seed, options.seed + options.programs):
            found = run(seed, options.stops, tally, Path(folder))
            if found:
                print(f"DIFFERENCE: seed {seed}: {found}")
                return 1
    rare = min(tally.rows.values(), default=0)
    print(f"{options.programs} programs, {tally.instructions} instructions, {len(tally.pairs)} (word, modes) pairs, "
          f"{len(tally.rows)} rows (rarest {rare} times), {tally.interrupts} exceptions: no difference, "
          f"{time.perf_counter() - start:.0f} s")
    return 0


if __name__ == "__main__":
    sys.exit(main())
