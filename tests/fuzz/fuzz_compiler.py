"""Random firmware-like C (`c_shapes.py`) at every level, with and without -fno-lto, on the emulator: one checksum and
one sequence of accesses to volatile registers, those of the host's model where gcc is installed.

`python tests/fuzz/fuzz_compiler.py [--programs N] [--seed S] [--seconds T] [--jobs J] [--keep DIR]`; exits 1 with the
first program that differs; DIR gets its sources. The compiler verifies its machine code after every pass meanwhile.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from itertools import islice
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

import emu  # noqa: E402
from tests.fuzz.c_shapes import Program  # noqa: E402
from tests.fuzz.seeds import Course, parser  # noqa: E402
from tests.toolchain.c_programs import build  # noqa: E402

SHAPES = tuple((level, alone) for level in ("-O0", "-O1", "-Os", "-O2") for alone in ("", "-fno-lto"))
CYCLES = 3_000_000
PORTS = ("PR1", "PR2", "PR3", "PR4", "PR5", "OC1RS", "OC1R", "OC2RS", "OC2R")
SOURCES = ("one.c", "two.c", "three.c")
NO_ROOM = re.compile(r"does not fit|no room for the stack|overflow")


@dataclass(frozen=True)
class Seen:
    """What a run showed: the checksum, and port and direction of every volatile access in order."""

    checksum: str
    trace: tuple[str, ...]


@dataclass(frozen=True)
class Verdict:
    """`kind` is agreed, skipped or failed."""

    kind: str
    reason: str


def model(folder: Path) -> Seen | None:
    """The program on the host, None where there is no gcc."""
    if shutil.which("gcc") is None:
        return None
    program = folder / "model"
    command = ["gcc", "-DHOST", "-O1", "-w", "-std=gnu11", *(str(folder / name) for name in SOURCES)]
    subprocess.run([*command, "-o", str(program)], check=True, capture_output=True, timeout=60)
    said = subprocess.run([str(program)], check=True, capture_output=True, text=True, timeout=20).stdout
    *trace, checksum = said.split()
    return Seen(checksum, tuple(trace))


def on_the_chip(folder: Path, level: str, alone: str) -> Seen | str:
    """The program on the emulator, or why there is no result."""
    image = folder / f"program{level}{alone}.elf"
    built = build([folder / name for name in SOURCES], image, level, *alone.split(), "-w", "-std=gnu11")
    if built.status:
        return f"build: {built.first_error}"
    machine = emu.load(image, engine="interp")
    trace: list[str] = []
    for k, name in enumerate(PORTS):
        machine.hook_sfr(name, partial(_note, trace, k))
    stop = machine.run(cycles=CYCLES)
    if stop.reason != "halt":
        return f"run: {stop.reason} {stop.detail} at {stop.pc:#x}"
    return Seen(f"{machine.peek('_checksum', 4):08x}", tuple(trace))


def _note(trace: list[str], port: int, write: bool, word: int) -> None:
    trace.append(f"{port}{'w' if write else 'r'}")


def examine(seed: int, keep: Path | None = None) -> Verdict:
    """One program in all shapes."""
    os.environ["DSPIC_VERIFY_MACHINE"] = "1"
    with tempfile.TemporaryDirectory(prefix="shapes-") as name:
        folder = Path(name)
        for file, text in Program(seed).files.items():
            (folder / file).write_text(text)
        try:
            verdict = compare(folder)
        except Exception as error:
            verdict = Verdict("failed", f"{type(error).__name__}: {str(error).splitlines()[0] if str(error) else ''}")
        if verdict.kind == "failed" and keep is not None:
            shutil.copytree(folder, keep / str(seed), dirs_exist_ok=True)
        return verdict


def compare(folder: Path) -> Verdict:
    """All shapes with the model, or with each other."""
    expected, whose = model(folder), "the host's model"
    for level, alone in SHAPES:
        seen = on_the_chip(folder, level, alone)
        shape = f"{level} {alone}".strip()
        if isinstance(seen, str):
            if NO_ROOM.search(seen):
                return Verdict("skipped", "does not fit into the device's memory")
            return Verdict("failed", f"{shape}: {seen}")
        if expected is None:
            expected, whose = seen, shape
        if seen.trace != expected.trace:
            at = next((k for k, (a, b) in enumerate(zip(seen.trace, expected.trace, strict=False)) if a != b),
                      min(len(seen.trace), len(expected.trace)))  # fmt: skip
            return Verdict("failed", f"{shape}: access {at} is {seen.trace[at : at + 4]}, of {whose} "
                                     f"{expected.trace[at : at + 4]}")  # fmt: skip
        if seen.checksum != expected.checksum:
            return Verdict("failed", f"{shape}: {seen.checksum}, {whose} {expected.checksum}")
    return Verdict("agreed", "")


def main() -> int:
    """Command line."""
    options = parser(__doc__)
    options.add_argument("--jobs", type=int, default=2)
    options.add_argument("--keep", type=Path, help="folder for the sources of a failure")
    course = Course(options, "programs", 200, "programs")
    given = course.parse()
    counts: Counter[str] = Counter()
    seeds = iter(course)
    with ProcessPoolExecutor(given.jobs) as pool:
        while batch := list(islice(seeds, 2 * given.jobs)):
            for seed, verdict in zip(batch, pool.map(partial(examine, keep=given.keep), batch), strict=True):
                counts[f"{verdict.kind} {verdict.reason}".strip()] += 1
                if verdict.kind == "failed":
                    course.seed = seed
                    return course.failed(verdict.reason)
    return course.ended(", ".join(f"{n} {kind}" for kind, n in sorted(counts.items())))


if __name__ == "__main__":
    sys.exit(main())
