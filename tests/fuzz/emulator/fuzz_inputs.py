"""Damaged files of all other kinds that commands read: each command ends with a documented status and a message.

`python tests/fuzz/emulator/fuzz_inputs.py [--inputs N] [--seed S] [--seconds T] [--format NAME]`; exits with 1 at the
first input with another outcome. Half of them begin with the valid sample, half with an input of the corpus.
`tests/fuzz/file_formats.py` has the kinds of files. `fuzz_loader.py` tests the loader
alone with many more ELF and HEX files, `fuzz_asm.py` assembly; `fuzz_guided.py` finds inputs by coverage.

With `--log FILE` the campaign runs until every kind has had --inputs inputs (default 100,000), in blocks: the kind with
the fewest inputs is next. After Ctrl-C, `kill` or --seconds the same command resumes. Each host and each process has a
file and a first seed (`--seed 0`, `--seed 1000000`) of its own. A failure is recorded and printed, and the run goes on.
"""

from __future__ import annotations

import os
import random
import resource
import signal
import subprocess
import sys
import tempfile
import traceback
from collections import Counter
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType

ROOT = Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT))

from tests.fuzz.emulator.fuzz_guided import stored_inputs  # noqa: E402
from tests.fuzz.file_formats import MOST_MEMORY, NAMES, Bench, Format, damaged  # noqa: E402
from tests.fuzz.input_log import AIM, BLOCK, FAILED, STORED, Block, InputLog, InputLogError, read_blocks  # noqa: E402
from tests.fuzz.seeds import Campaign, parser, resident_bytes  # noqa: E402
from tests.fuzz.verdicts import INTERRUPTED  # noqa: E402

MOST_RESIDENT = 2 << 30
"""Bytes of resident memory at which a long run begins in a new process: native code and caches of all inputs remain."""
LONGEST_INPUT_S = 120.0
"""CPU time in seconds after which the reading of one input counts as endless."""


class Reader:
    """Commands that read files, with their samples and corpora."""

    def __init__(self, bench: Bench, only: str | None) -> None:
        self._bench = bench
        self.kinds = [kind for kind in bench.formats if only in (None, kind.name)]
        self._bases = {kind.name: [kind.sample, *stored_inputs(kind.name)] for kind in self.kinds}

    def attempt(self, kind: Format, seed: int) -> str:
        """Return the outcome of the input of a seed. Re-raises exceptions of the command with a note of the input."""
        rng = random.Random(seed)
        base = kind.sample if rng.random() < 0.5 else rng.choice(self._bases[kind.name])
        data = damaged(kind, base, rng)
        try:
            with _limited():
                return self._bench.attempt(kind, data)
        except Exception as error:
            error.add_note(f"{kind.name}: {data[:4000]!r}")
            raise


@contextmanager
def _limited() -> Iterator[None]:
    """Raise AssertionError after LONGEST_INPUT_S seconds of CPU time of this process."""

    def end(_number: int, _frame: FrameType | None) -> None:
        raise AssertionError(f"still reading after {LONGEST_INPUT_S:g} s of CPU time")

    before = signal.signal(signal.SIGVTALRM, end)
    signal.setitimer(signal.ITIMER_VIRTUAL, LONGEST_INPUT_S)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0)
        signal.signal(signal.SIGVTALRM, before)


@contextmanager
def _reader(only: str | None) -> Iterator[Reader]:
    """Yield a reader in a temporary folder, which is the working directory meanwhile."""
    with tempfile.TemporaryDirectory(prefix="inputs-") as name:
        reader = Reader(Bench(Path(name)), only)
        before = Path.cwd()
        os.chdir(name)
        try:
            yield reader
        finally:
            os.chdir(before)


def campaign(seeds: Iterable[int], only: str | None = None) -> Counter[str]:
    """Return the number of inputs per format and outcome. Raises as `Reader.attempt`."""
    outcomes: Counter[str] = Counter()
    with _reader(only) as reader:
        for seed in seeds:
            kind = reader.kinds[seed % len(reader.kinds)]
            outcomes[f"{kind.name} {reader.attempt(kind, seed)}"] += 1
    return outcomes


class _MemoryFull(Exception):
    """The process has reached MOST_RESIDENT."""


class _Stopped(BaseException):
    """SIGINT or SIGTERM has arrived. It is no `Exception`: commands answer those."""


def _stop(number: int, _frame: FrameType | None) -> None:
    raise _Stopped(number)


def run_logged(plan: Campaign, log: InputLog, first: int, aim: int, only: str | None = None) -> int:
    """Run blocks until every kind has `aim` inputs or the time of `plan` is over. Return the exit status.

    Raises _MemoryFull."""
    commit = _commit()
    failures = 0
    before = {number: signal.signal(number, _stop) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        with _reader(only) as reader:
            while not plan.over:
                kind = min(reader.kinds, key=lambda one: log.count(one.name))
                if log.count(kind.name) >= aim:
                    break
                seed = log.next_seed(kind.name, first)
                outcomes: Counter[str] = Counter()
                for one in range(seed, seed + BLOCK):
                    try:
                        outcomes[reader.attempt(kind, one)] += 1
                    except Exception:
                        outcomes[FAILED] += 1
                        failures += 1
                        print(f"FAILED: --format '{kind.name}' --seed {one}\n{traceback.format_exc()}", flush=True)
                log.add(Block(kind.name, seed, BLOCK, dict(sorted(outcomes.items())), [commit]))
                if resident_bytes() > MOST_RESIDENT:
                    raise _MemoryFull
    except _Stopped:
        return 1 if failures else INTERRUPTED
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
    counts = {name: log.count(name) for name in NAMES if only in (None, name)}
    plan.ended(f"{min(counts.values()):,} to {max(counts.values()):,} inputs of a kind, {failures} failures")
    return 1 if failures else 0


def _commit() -> str:
    """Return the short hash of the commit, with + if files differ from it; "?" without a git history."""
    words = ["git", "-C", str(ROOT), "describe", "--always", "--exclude=*", "--abbrev=10", "--dirty=+"]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    return done.stdout.strip() or "?"


def main() -> int:
    made = parser(__doc__)
    made.add_argument("--format", metavar="NAME", help="this kind of file only")
    made.add_argument("--log", type=Path, metavar="FILE", help="record the inputs by kind, and resume")
    plan = Campaign(made, "inputs", 15_000, "files")
    options = plan.parse()
    if options.format not in (None, *NAMES):
        made.error(f"--format {options.format}: expected one of {', '.join(NAMES)}")
    resource.setrlimit(resource.RLIMIT_AS, (MOST_MEMORY, resource.getrlimit(resource.RLIMIT_AS)[1]))
    if options.log is not None:
        first = options.seed or 0
        if first % BLOCK:
            made.error(f"--seed {first}: with --log, expected a multiple of {BLOCK}")
        try:
            log = InputLog(options.log, read_blocks(STORED))
        except (InputLogError, OSError) as error:
            made.error(f"--log: {error}")
        try:
            return run_logged(plan, log, first, options.inputs or AIM, options.format)
        except _MemoryFull:
            if options.seconds is not None:
                return 0
        finally:
            log.close()
        os.execv(sys.executable, [sys.executable, *sys.argv])
    try:
        outcomes = campaign(plan, options.format)
    except Exception:
        return plan.failed(traceback.format_exc())
    return plan.ended(", ".join(f"{kind} {count}" for kind, count in sorted(outcomes.items())))


if __name__ == "__main__":
    sys.exit(main())
