"""Prove random firmware-like C (`c_shapes.py`) and functions of the kernel equivalent to their IR.

`python tests/fuzz/compiler/fuzz_prove.py [--files N] [--functions N]`. Each try proves some functions of one file of a
program at one level (`--functions 0`: all). A refutation is a fault of the compiler or of the proof; `toolchain prove`
shows its input. A proof covers all inputs, so it can find faults that the runs of `fuzz_compiler.py` do not reach.
"""

from __future__ import annotations

import random
import sys
import tempfile
from collections import Counter
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

ROOT = Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT))

from tests.fuzz.programs.c_shapes import Program  # noqa: E402
from tests.fuzz.seeds import SKIPPED, Campaign, parser  # noqa: E402

if TYPE_CHECKING:
    from toolchain.proof.problem import CompiledFile
    from toolchain.proof.prove import Verdict

LEVELS = ("-O0", "-O1", "-Os", "-O2")
FILES = ("one.c", "two.c", "three.c")
SYSTEM = ROOT / "firmware" / "openswarm"
FOLDERS = ("include", "hal", "kernel", "io", "port/dspic30f", "board/epuck")
KERNEL_FILES = ("clock.c", "fault.c", "error.c", "init.c")
KERNEL_EVERY = 5
"""One seed in so many proves functions of the kernel instead of random ones."""


def prove(made: CompiledFile, where: str, most: int, chance: random.Random) -> list[Verdict]:
    """Return verdicts on at most `most` functions of a file (0: all); AssertionError if one is refuted."""
    from toolchain.proof.prove import verdicts

    defined = [f.name for f in made.module.functions.values() if f.blocks]
    chosen = chance.sample(defined, min(most, len(defined))) if most else defined
    found = [verdict for function in chosen for verdict in verdicts(made, function)]
    for v in found:
        assert v.kind != "refuted", f"{where} {v.function}: {v.why}; {v.counterexample}"
    return found


def prove_kernel(file: str, most: int, chance: random.Random) -> list[Verdict]:
    """Prove functions of a kernel file at -Os."""
    from toolchain.proof.problem import compile_file

    folders = (f"-I{SYSTEM / name}" for name in FOLDERS)
    return prove(compile_file([str(SYSTEM / "kernel" / file), "-Os", "-w", "-std=gnu99", *folders]), file, most, chance)


def examine(seed: int, most: int) -> list[Verdict]:
    """Prove functions of one file. Raises AssertionError that names file, level and function of a refutation."""
    from toolchain.proof.problem import compile_file

    chance = random.Random(seed)
    if seed % KERNEL_EVERY == 0:
        return prove_kernel(chance.choice(KERNEL_FILES), most, chance)
    file, level = chance.choice(FILES), chance.choice(LEVELS)
    with tempfile.TemporaryDirectory(prefix="prove-") as name:
        for each, text in Program(seed).files.items():
            (Path(name) / each).write_text(text)
        made = compile_file([str(Path(name) / file), level, "-w", "-std=gnu11"])
    return prove(made, f"{file} {level}", most, chance)


def main() -> int:
    campaign = Campaign(parser(__doc__), "files", 30, "files")
    campaign.parser.add_argument("--functions", type=int, default=4, metavar="N", help="of each (default 4; 0: all)")
    options = campaign.parse()
    if find_spec("z3") is None:
        print("the solver is not installed (extra: test)")
        return SKIPPED
    counts: Counter[str] = Counter()
    for seed in campaign:
        try:
            counts.update(verdict.kind for verdict in examine(seed, options.functions))
        except AssertionError as error:
            return campaign.failed(error)
    if sum(counts.values()) >= 40 and counts["proved"] < sum(counts.values()) // 3:
        return campaign.failed(AssertionError(f"hardly anything is proved: {dict(counts)}"))
    return campaign.ended(f"{counts['proved']} functions proved, {counts['undecided']} undecided")


if __name__ == "__main__":
    sys.exit(main())
