"""Random firmware-like C (`c_shapes.py`): all shapes give one checksum and one sequence of volatile accesses.

`python tests/fuzz/compiler/fuzz_compiler.py [--programs N] [--seed S] [--seconds T] [--jobs J] [--log FILE] [--keep
DIR]`; exits with 1 if a program differs. A shape is an optimisation level, with or without -fno-lto, run on the
emulator. If gcc is installed, the host's model of the program gives the expected result. DIR receives the sources of
failures. With FILE a campaign can be interrupted and resumed, and several processes can share it (`verdicts.py`). The
compiler verifies its machine code after every pass. Equal images of several shapes are run once.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from functools import partial
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT))

import emu  # noqa: E402
from emu.host.exit_status import BAD_INPUT  # noqa: E402
from tests.fuzz.programs.c_shapes import Program  # noqa: E402
from tests.fuzz.seeds import Campaign, parser  # noqa: E402
from tests.fuzz.verdicts import Book, LogError, Verdict, run_all  # noqa: E402
from tests.toolchain.c_programs import FrontEndOnce, build  # noqa: E402

SHAPES = tuple((level, alone) for level in ("-O0", "-O1", "-Os", "-O2") for alone in ("", "-fno-lto"))
CYCLES = 3_000_000
HOST_SECONDS = 600
"""Limit of gcc and of the model on the host, which only a program that hangs reaches, also on a busy machine."""
PORTS = ("PR1", "PR2", "PR3", "PR4", "PR5", "OC1RS", "OC1R", "OC2RS", "OC2R")
SOURCES = ("one.c", "two.c", "three.c")
NO_ROOM = re.compile(r"does not fit|no room for the stack|overflow")


@dataclass(frozen=True)
class Seen:
    """Result of a run: the checksum, and port and direction of every volatile access in order."""

    checksum: str
    trace: tuple[str, ...]


def model(folder: Path) -> Seen | None:
    """Run the program on the host and return its result; None if gcc is not installed."""
    if shutil.which("gcc") is None:
        return None
    program = folder / "model"
    command = ["gcc", "-DHOST", "-O1", "-w", "-std=gnu11", *(str(folder / name) for name in SOURCES)]
    subprocess.run([*command, "-o", str(program)], check=True, capture_output=True, timeout=HOST_SECONDS)
    said = subprocess.run([str(program)], check=True, capture_output=True, text=True, timeout=HOST_SECONDS).stdout
    *trace, checksum = said.split()
    return Seen(checksum, tuple(trace))


class OnTheChip:
    """One program that is compiled by our compiler and runs on the emulator."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._front = FrontEndOnce()
        self._ran: dict[bytes, Seen | str] = {}

    def seen(self, level: str, alone: str) -> Seen | str:
        """Build one shape and return the result of its run, or the reason for its failure."""
        image = self.folder / f"program{level}{alone}.elf"
        sources = [self.folder / name for name in SOURCES]
        built = build(sources, image, level, *alone.split(), "-w", "-std=gnu11", front=self._front)
        if built.status:
            return f"build: {built.first_error}"
        content = image.read_bytes()
        if content not in self._ran:
            self._ran[content] = seen_of(image)
        return self._ran[content]


def seen_of(image: Path) -> Seen | str:
    """Run an image and return its result, or the reason why it did not end."""
    machine = emu.load(image, engine="auto")
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
    """Generate one program and compare all its shapes."""
    os.environ["DSPIC_VERIFY_MACHINE"] = "1"
    with tempfile.TemporaryDirectory(prefix="shapes-") as name:
        folder = Path(name)
        for file, text in Program(seed).files.items():
            (folder / file).write_text(text)
        try:
            verdict = compare(seed, folder)
        except Exception as error:
            said = str(error).splitlines()
            verdict = Verdict(seed, "failed", f"{type(error).__name__}: {said[0] if said else ''}")
        if verdict.kind == "failed" and keep is not None:
            shutil.copytree(folder, keep / str(seed), dirs_exist_ok=True)
        return verdict


def compare(seed: int, folder: Path) -> Verdict:
    """Compare all shapes with the host's model, or with the first shape if there is none."""
    expected, whose = model(folder), "the host's model"
    chip, compared = OnTheChip(folder), []
    for level, alone in SHAPES:
        seen = chip.seen(level, alone)
        shape = f"{level} {alone}".strip()
        compared.append(shape)
        verdict = partial(Verdict, seed, shapes=tuple(compared))
        if isinstance(seen, str):
            if NO_ROOM.search(seen):
                return verdict("skipped", "does not fit into the device's memory")
            return verdict("failed", f"{shape}: {seen}")
        if expected is None:
            expected, whose = seen, shape
        if seen.trace != expected.trace:
            at = next((k for k, (a, b) in enumerate(zip(seen.trace, expected.trace, strict=False)) if a != b),
                      min(len(seen.trace), len(expected.trace)))  # fmt: skip
            return verdict("failed", f"{shape}: access {at} is {seen.trace[at : at + 4]}, of {whose} "
                                     f"{expected.trace[at : at + 4]}")  # fmt: skip
        if seen.checksum != expected.checksum:
            return verdict("failed", f"{shape}: {seen.checksum}, {whose} {expected.checksum}")
    return verdict("agreed")


def main() -> int:
    """Run the campaign from the command line."""
    options = parser(__doc__)
    options.add_argument("--jobs", type=int, default=2)
    options.add_argument("--log", type=Path, help="file of verdicts, read and continued")
    options.add_argument("--keep", type=Path, help="folder for the sources of failures")
    campaign = Campaign(options, "programs", 200, "programs")
    given = campaign.parse()
    try:
        return run_all(campaign, partial(examine, keep=given.keep), Book(given.log, "compiler"), given.jobs)
    except LogError as error:
        print(f"error: {error}", file=sys.stderr)
        return BAD_INPUT


if __name__ == "__main__":
    sys.exit(main())
