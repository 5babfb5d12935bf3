"""Damaged files of all other kinds that commands read: each command ends with a documented status and a message.

`python tests/fuzz/emulator/fuzz_inputs.py [--inputs N] [--seed S] [--seconds T] [--format NAME]`; exits with 1 at the
first input with another outcome. Half of them begin with the valid sample, half with an input of the corpus.
`tests/fuzz/file_formats.py` has the kinds of files. `fuzz_loader.py` tests the loader
alone with many more ELF and HEX files, `fuzz_asm.py` assembly; `fuzz_guided.py` finds inputs by coverage.
"""

from __future__ import annotations

import os
import random
import resource
import sys
import tempfile
import traceback
from collections import Counter
from collections.abc import Iterable
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT))

from tests.fuzz.emulator.fuzz_guided import stored_inputs  # noqa: E402
from tests.fuzz.file_formats import MOST_MEMORY, Bench, damaged  # noqa: E402
from tests.fuzz.seeds import Campaign, parser  # noqa: E402


def campaign(seeds: Iterable[int], only: str | None = None) -> Counter[str]:
    """Return the number of inputs per format and outcome. Re-raises exceptions of a command with a note of format and
    input."""
    outcomes: Counter[str] = Counter()
    with tempfile.TemporaryDirectory(prefix="inputs-") as name:
        bench = Bench(Path(name))
        chosen = [kind for kind in bench.formats if only in (None, kind.name)]
        bases = {kind.name: [kind.sample, *stored_inputs(kind.name)] for kind in chosen}
        before = Path.cwd()
        os.chdir(name)
        try:
            for seed in seeds:
                rng = random.Random(seed)
                kind = chosen[seed % len(chosen)]
                base = kind.sample if rng.random() < 0.5 else rng.choice(bases[kind.name])
                data = damaged(kind, base, rng)
                try:
                    outcomes[f"{kind.name} {bench.attempt(kind, data)}"] += 1
                except Exception as error:
                    error.add_note(f"{kind.name}: {data[:4000]!r}")
                    raise
        finally:
            os.chdir(before)
    return outcomes


def main() -> int:
    made = parser(__doc__)
    made.add_argument("--format", metavar="NAME", help="this kind of file only")
    plan = Campaign(made, "inputs", 15_000, "files")
    options = plan.parse()
    resource.setrlimit(resource.RLIMIT_AS, (MOST_MEMORY, resource.getrlimit(resource.RLIMIT_AS)[1]))
    try:
        outcomes = campaign(plan, options.format)
    except Exception:
        return plan.failed(traceback.format_exc())
    return plan.ended(", ".join(f"{kind} {count}" for kind, count in sorted(outcomes.items())))


if __name__ == "__main__":
    sys.exit(main())
