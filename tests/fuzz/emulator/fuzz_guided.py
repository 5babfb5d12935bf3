"""Damaged files chosen by coverage: inputs that reach new branches of the readers are kept and damaged further.

`python tests/fuzz/emulator/fuzz_guided.py [--kinds N] [--seed S] [--seconds T] [--format NAME] [--keep]` passes the
files of `file_formats.py` to their commands with Atheris, one kind after the other, and exits with 1 at the first input
with another outcome than a documented status. Each kind begins with its corpus, `tests/fuzz/corpus/KIND.zip`, in which
`--keep` stores the inputs that have reached new branches. Exit status 77 without Atheris.
"""

from __future__ import annotations

import importlib.util
import os
import random
import re
import subprocess
import sys
import tempfile
import zipfile
import zlib
from itertools import accumulate
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT))

from tests.fuzz.seeds import SKIPPED, Campaign, parser  # noqa: E402

CORPUS = ROOT / "tests" / "fuzz" / "corpus"
LARGEST = 16_384
"""Maximum length of an input in bytes; the samples of records and images are shorter."""
MOST_STORED = 12_288
"""Maximum length of a corpus in bytes, compressed: only its shortest inputs are stored."""
ENTRY = 104
"""Bytes of an archive for each entry beside its data."""
SECONDS = 4.0
"""Seconds for each kind of file, beside a start of about ten."""
PACKAGES = ["emu", "toolchain", "arena", "openswarm"]
"""Packages whose branches count, also of modules that a command imports."""
STEADY = (1980, 1, 1, 0, 0, 0)
"""Time of all entries of an archive, so that equal corpora are equal files."""


def archive_of(kind: str) -> Path:
    """Return the path of the corpus of a kind of file, which may not exist."""
    return CORPUS / f"{kind.replace(' ', '-')}.zip"


def stored_inputs(kind: str) -> list[bytes]:
    """Return the inputs in the corpus of a kind of file."""
    if not archive_of(kind).exists():
        return []
    with zipfile.ZipFile(archive_of(kind)) as stored:
        return [stored.read(name) for name in stored.namelist()]


def unpack(kind: str, folder: Path) -> None:
    """Write the corpus of a kind of file into `folder`, one file per input."""
    folder.mkdir()
    for number, data in enumerate(stored_inputs(kind)):
        (folder / f"{number:03}").write_bytes(data)


def pack(kind: str, folder: Path) -> int:
    """Store the shortest inputs in `folder` as the corpus of a kind of file. Return their number."""
    CORPUS.mkdir(exist_ok=True)
    inputs = sorted((path.read_bytes() for path in folder.iterdir()), key=lambda data: (len(data), data))
    lengths = accumulate(len(zlib.compress(data, 9)) + ENTRY for data in inputs)
    kept = max(1, sum(length <= MOST_STORED for length in lengths))
    with zipfile.ZipFile(archive_of(kind), "w", zipfile.ZIP_DEFLATED, compresslevel=9) as stored:
        for number, data in enumerate(inputs[:kept]):
            stored.writestr(zipfile.ZipInfo(f"{number:03}", STEADY), data, zipfile.ZIP_DEFLATED)
    return kept


def fuzz(kind_name: str, inputs: Path, arguments: list[str]) -> None:
    """Run libFuzzer on one kind of file in this process, which ends with libFuzzer's status.

    `inputs` is the folder of the corpus, to which the valid sample is added.
    """
    import atheris

    with tempfile.TemporaryDirectory(prefix="guided-") as name, atheris.instrument_imports(PACKAGES):
        from tests.fuzz.file_formats import Bench, damaged

        bench = Bench(Path(name))
        kind = next(one for one in bench.formats if one.name == kind_name)
        (inputs / "sample").write_bytes(kind.sample)

        def attempt(data: bytes) -> None:
            bench.attempt(kind, data)

        def mutate(data: bytes, largest: int, seed: int) -> bytes:
            rng = random.Random(seed)
            if rng.random() < 0.3:
                return bytes(atheris.Mutate(data, largest))
            return damaged(kind, data or kind.sample, rng)[:largest]

        os.chdir(name)
        atheris.Setup([sys.argv[0], *arguments, str(inputs)], attempt, custom_mutator=mutate)
        atheris.Fuzz()


def run(kind: str, folder: Path, arguments: list[str]) -> tuple[int, str]:
    """Fuzz one kind of file in a child process with the corpus `folder`/inputs. Return its status and output."""
    command = [sys.executable, __file__, "--child", kind, str(folder / "inputs"), *arguments]
    done = subprocess.run(command, capture_output=True, text=True, errors="replace", cwd=folder, check=False)
    lines = [line for line in (done.stdout + done.stderr).splitlines() if not line.startswith("INFO: ")]
    return done.returncode, "\n".join(lines)


def explore(kind: str, seed: int, seconds: float, keep: bool) -> tuple[int, str]:
    """Fuzz a kind of file for some seconds. Return the number of inputs, and the failure or ""."""
    with tempfile.TemporaryDirectory(prefix="corpus-") as name:
        folder = Path(name)
        unpack(kind, folder / "inputs")
        limits = [
            f"-max_len={LARGEST}",
            "-rss_limit_mb=8192",
            "-timeout=300",
            "-error_exitcode=1",
            "-timeout_exitcode=1",
        ]
        ends = [f"-max_total_time={max(1, round(seconds))}", f"-seed={seed}", "-print_final_stats=1"]
        status, said = run(kind, folder, [f"-artifact_prefix={folder}/", *limits, *ends])
        tried = re.search(r"stat::number_of_executed_units:\s*(\d+)", said)
        if status:
            damage = b"".join(path.read_bytes() for path in folder.glob("*-*") if path.is_file())
            return 0, f"{kind}: {damage[:4000]!r}\n{said[-6000:]}"
        if keep:
            pack(kind, folder / "inputs")
        return int(tried[1]) if tried else 0, ""


def main() -> int:
    if sys.argv[1:2] == ["--child"]:
        fuzz(sys.argv[2], Path(sys.argv[3]), sys.argv[4:])
    from tests.fuzz.file_formats import NAMES

    made = parser(__doc__)
    made.add_argument("--format", metavar="NAME", help="this kind of file only")
    made.add_argument(
        "--each", type=float, default=SECONDS, metavar="S", help=f"seconds per kind (default {SECONDS:g})"
    )
    made.add_argument("--keep", action="store_true", help="store the corpus")
    plan = Campaign(made, "kinds", len(NAMES), "kinds of files")
    options = plan.parse()
    if importlib.util.find_spec("atheris") is None:
        print("atheris is not installed (extra: test)")
        return SKIPPED
    if options.format not in (None, *NAMES):
        made.error(f"--format {options.format}: expected one of {', '.join(NAMES)}")
    tried: dict[str, int] = {}
    for seed in plan:
        kind = options.format or NAMES[seed % len(NAMES)]
        count, failure = explore(kind, seed, options.each, options.keep)
        if failure:
            return plan.failed(failure)
        tried[kind] = tried.get(kind, 0) + count
    return plan.ended(", ".join(f"{kind} {count}" for kind, count in sorted(tried.items())))


if __name__ == "__main__":
    sys.exit(main())
