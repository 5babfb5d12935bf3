"""Random C programs of csmith: every shape gives the checksum of the others, and of avr-gcc with simavr.

`python tests/fuzz/compiler/fuzz_csmith.py [--count N] [--seed S] [--seconds T] [--jobs J] [--log FILE] [--keep DIR]`.
A shape is an optimisation level, with or without -fno-lto, run on the emulator; equal images are run once. Needs
Debian's `csmith`. The AVR, which also has 16-bit int, is compared if `gcc-avr avr-libc simavr` are installed.
Programs that run too long at -O0 or do not fit into 8 kB of RAM are skipped. With FILE a campaign can be interrupted
and resumed, and several processes can share it (`verdicts.py`). Exit status 0 if all checksums agree; DIR receives
sources of failures.

The campaign repairs two kinds of undefined behaviour in csmith's programs:
- its shift wrappers allow distances below 32 for every type; here the limit is the width of the shifted value;
- addresses of packed members may be odd, which only an AVR permits; the programs contain no packed structs.

A read through a union of a member that is a struct depends on the layout of the struct. An AVR aligns no members and
has another layout, so its checksum is ignored for programs with such a union.
"""

from __future__ import annotations

import atexit
import functools
import os
import re
import shutil
import subprocess
import sys
import tempfile
from functools import partial
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT))

from emu.host.exit_status import BAD_INPUT  # noqa: E402
from tests.fuzz.seeds import SKIPPED, Campaign, parser  # noqa: E402
from tests.fuzz.verdicts import Book, LogError, Verdict, run_all  # noqa: E402
from tests.toolchain.c_programs import FrontEndOnce, build, run  # noqa: E402

RUNTIME = Path(__file__).parents[1] / "programs" / "csmith_runtime"
HEADERS = Path("/usr/include/csmith")
Shape = tuple[str, str]
LEVELS = ("-O0", "-O1", "-Os", "-O2")
SHAPES: tuple[Shape, ...] = tuple((level, alone) for level in LEVELS for alone in ("", "-fno-lto"))
CYCLES = 15_000_000
SHORT = 500_000
"""Runs below this number of Tcy use the interpreter, because starting the JIT would take longer."""
PLATFORM = "integer size = 2\npointer size = 2\n"
GENERATOR = [
    *("--max-funcs", "5", "--max-block-depth", "3", "--max-block-size", "3", "--max-expr-complexity", "6"),
    *("--max-array-dim", "2", "--max-array-len-per-dim", "5", "--max-struct-fields", "5", "--max-union-fields", "3"),
    *("--no-argc", "--concise"),
]
AVR = ["avr-gcc", "-mmcu=atmega1284p", "-Os", "-w"]
AVR_SECONDS = 20
MEMORY = re.compile(r"does not fit|no room for the stack|overflow")
STRUCT_IN_UNION = re.compile(r"^union \w+ \{[^}]*\bstruct \w+ +f\d", re.MULTILINE)
MEMBER_ADDRESS = re.compile(r"&\w+(\[\w+\])*(\.|->)f\d")


def available() -> bool:
    """Whether csmith and its headers are installed."""
    return shutil.which("csmith") is not None and (HEADERS / "safe_math.h").exists()


def avr_available() -> bool:
    """Whether avr-gcc, avr-libc and simavr are installed."""
    return all(shutil.which(name) for name in ("avr-gcc", "simavr"))


@functools.cache
def headers() -> Path:
    """Return a folder with csmith's safe_math.h, in which shift distances are limited by the width of the shifted
    value."""
    folder = Path(tempfile.mkdtemp(prefix="csmith-headers-"))
    text = (HEADERS / "safe_math.h").read_text()
    (folder / "safe_math.h").write_text(text.replace(">= 32)", ">= (int)(8 * sizeof(left + 0)))"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return folder


def generate(seed: int, folder: Path) -> Path:
    """Generate the program of a seed; csmith reads the sizes of int and pointers from platform.info."""
    (folder / "platform.info").write_text(PLATFORM)
    path = folder / f"csmith_{seed}.c"
    for variant in ([], ["--no-packed-struct"]):
        text = subprocess.run(
            ["csmith", "--seed", str(seed), *GENERATOR, *variant],
            cwd=folder, capture_output=True, text=True, check=True, timeout=60,
        ).stdout  # fmt: skip
        if "#pragma pack" not in text or not MEMBER_ADDRESS.search(text):
            break
    path.write_text(text)
    return path


def flags() -> list[str]:
    """Return the options that both compilers receive."""
    return ["-std=gnu11", f"-I{RUNTIME}", f"-I{headers()}", f"-I{HEADERS}"]


class OnTheChip:
    """One program that is compiled by our compiler and runs on the emulator."""

    def __init__(self, source: Path, folder: Path) -> None:
        self.source, self.folder = source, folder
        self._front = FrontEndOnce()
        self._ran: dict[bytes, tuple[str, str]] = {}

    def checksum(self, level: str, alone: str) -> tuple[str, str]:
        """Build and run one shape and return (checksum, ""), or ("", reason for the failure)."""
        image = self.folder / f"{self.source.stem}{level}{alone}.elf"
        built = build([self.source], image, level, *alone.split(), "-w", *flags(), front=self._front)
        if built.status != 0:
            stage = "memory" if MEMORY.search(built.messages) else "build"
            return "", f"{stage}: {built.first_error}"
        content = image.read_bytes()
        if content not in self._ran:
            ran = run(image, CYCLES, engine="auto", native_after=SHORT)
            self._ran[content] = ("", ran.why) if ran.status is None else (ran.uart.decode("latin-1").strip(), "")
        return self._ran[content]


def on_avr(source: Path, folder: Path) -> str:
    """Return the checksum by avr-gcc and simavr, or "" if the program does not build, end or print."""
    image = folder / f"{source.stem}.avr.elf"
    command = [*AVR, *flags(), str(source), "-o", str(image)]
    if subprocess.run(command, capture_output=True, check=False).returncode != 0:
        return ""
    try:
        said = subprocess.run(
            ["simavr", "-m", "atmega1284p", "-f", "16000000", str(image)],
            capture_output=True, text=True, check=False, timeout=AVR_SECONDS,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        return ""
    plain = re.sub(r"\x1b\[\d*m", "", said.stdout + said.stderr)  # simavr colours the UART's output
    found = re.search(r"\b[0-9A-F]{8}\b", plain)
    return found[0] if found else ""


def examine(seed: int, keep: Path | None = None, shapes: tuple[Shape, ...] = SHAPES) -> Verdict:
    """Generate one program and compare all its shapes."""
    with tempfile.TemporaryDirectory(prefix="csmith-") as name:
        folder = Path(name)
        source = generate(seed, folder)
        verdict = compare(seed, source, folder, shapes)
        if verdict.kind == "failed" and keep is not None:
            keep.mkdir(parents=True, exist_ok=True)
            shutil.copy(source, keep / source.name)
        return verdict


def compare(seed: int, source: Path, folder: Path, shapes: tuple[Shape, ...] = SHAPES) -> Verdict:
    """Compare the checksums of all shapes, -O0 first, and of the AVR. The compiler verifies its machine code."""
    os.environ["DSPIC_VERIFY_MACHINE"] = "1"
    chip, sums = OnTheChip(source, folder), {}
    for level, alone in shapes:
        shape = f"{level} {alone}".strip()
        sums[shape], why = chip.checksum(level, alone)
        verdict = partial(Verdict, seed, shapes=tuple(sums))
        if why.startswith("memory"):
            return verdict("skipped", "does not fit into the device's memory")
        if why == "trap: stack error":
            return verdict("skipped", "needs more stack than there is RAM")
        if why.startswith("limit") and len(sums) == 1:
            return verdict("skipped", f"still running after {CYCLES} cycles at {shape}")
        if why:
            return verdict("failed", f"{shape}: {why}")
    reference = on_avr(source, folder) if avr_available() else ""
    first = next(iter(sums.values()))
    if len(set(sums.values())) != 1:
        return verdict("failed", f"{sums}, avr {reference or 'unknown'}")
    if reference and reference != first and STRUCT_IN_UNION.search(source.read_text()):
        return verdict("agreed", "levels only, a union holds a struct")
    if reference and reference != first:
        return verdict("failed", f"{first} at every level, avr {reference}")
    return verdict("agreed", "with avr" if reference else "levels only")


def main() -> int:
    """Run the campaign from the command line."""
    options = parser(__doc__)
    options.epilog = "example: csmith_campaign.py --count 1000 --jobs 2"
    options.add_argument("--jobs", type=int, default=2)
    options.add_argument("--log", type=Path, help="file of verdicts, read and continued")
    options.add_argument("--keep", type=Path, help="folder for the sources of failures")
    campaign = Campaign(options, "count", 1000, "programs")
    given = campaign.parse()
    if not available():
        print("csmith is not installed (Debian package csmith): nothing to do", file=sys.stderr)
        return SKIPPED
    try:
        return run_all(campaign, partial(examine, keep=given.keep), Book(given.log, "csmith"), given.jobs)
    except LogError as error:
        print(f"error: {error}", file=sys.stderr)
        return BAD_INPUT


if __name__ == "__main__":
    sys.exit(main())
