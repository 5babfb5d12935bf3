"""Random C programs: every level, with and without -fno-lto, must give one checksum on the emulator, and avr-gcc with
simavr the same one.

`python tests/fuzz/csmith_campaign.py [--count N] [--seed S] [--seconds T] [--jobs J] [--log FILE] [--keep DIR]`.
Needs Debian's `csmith`; the AVR, another machine with 16-bit int, joins in when `gcc-avr avr-libc simavr` are there.
Programs that run too long at -O0 or do not fit into 8 kB of RAM are skipped. FILE gets a line per program, and programs
it names are not run again. Exit status 0 when all checksums agree; DIR keeps sources of failures.

Two things csmith leaves undefined here are repaired, because a compiler may do anything with them:
- its shift wrappers allow distances below 32 for every type; here the limit is the width of the shifted value;
- addresses of packed members may be odd, which an AVR does not mind; such programs come without packed structs.
"""

from __future__ import annotations

import argparse
import atexit
import functools
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from tests.fuzz.seeds import SKIPPED, base_seed  # noqa: E402
from tests.toolchain.c_programs import build, run  # noqa: E402

RUNTIME = Path(__file__).parent / "csmith_runtime"
HEADERS = Path("/usr/include/csmith")
Shape = tuple[str, str]
LEVELS = ("-O0", "-O1", "-Os", "-O2")
SHAPES: tuple[Shape, ...] = tuple((level, alone) for level in LEVELS for alone in ("", "-fno-lto"))
CYCLES = 15_000_000
SHORT = 500_000
"""Tcy for which starting native code does not pay."""
PLATFORM = "integer size = 2\npointer size = 2\n"
GENERATOR = [
    *("--max-funcs", "5", "--max-block-depth", "3", "--max-block-size", "3", "--max-expr-complexity", "6"),
    *("--max-array-dim", "2", "--max-array-len-per-dim", "5", "--max-struct-fields", "5", "--max-union-fields", "3"),
    *("--no-argc", "--concise"),
]
AVR = ["avr-gcc", "-mmcu=atmega1284p", "-Os", "-w"]
AVR_SECONDS = 20
BATCH = 6
"""Programs between two looks at the clock."""
MEMORY = re.compile(r"does not fit|no room for the stack|overflow")
MEMBER_ADDRESS = re.compile(r"&\w+(\[\w+\])*(\.|->)f\d")


@dataclass(frozen=True)
class Verdict:
    """`kind` is agreed, skipped or failed."""

    seed: int
    kind: str
    reason: str = ""


def available() -> bool:
    """Whether csmith and its headers are installed."""
    return shutil.which("csmith") is not None and (HEADERS / "safe_math.h").exists()


def avr_available() -> bool:
    """Whether the AVR reference can take part."""
    return all(shutil.which(name) for name in ("avr-gcc", "simavr"))


@functools.cache
def headers() -> Path:
    """Folder with csmith's safe_math.h, its shift distances limited by the width of the shifted value."""
    folder = Path(tempfile.mkdtemp(prefix="csmith-headers-"))
    text = (HEADERS / "safe_math.h").read_text()
    (folder / "safe_math.h").write_text(text.replace(">= 32)", ">= (int)(8 * sizeof(left + 0)))"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return folder


def generate(seed: int, folder: Path) -> Path:
    """Program number `seed`; the generator reads the sizes of int and pointers from platform.info."""
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
    """Options common to both compilers."""
    return ["-std=gnu11", f"-I{RUNTIME}", f"-I{headers()}", f"-I{HEADERS}"]


def ours(source: Path, level: str, alone: str, folder: Path) -> tuple[str, str]:
    """(checksum, "") or ("", why there is none)."""
    image = folder / f"{source.stem}{level}{alone}.elf"
    built = build([source], image, level, *alone.split(), "-w", *flags())
    if built.status != 0:
        return "", f"memory: {built.first_error}" if MEMORY.search(built.messages) else f"build: {built.first_error}"
    ran = run(image, CYCLES, engine="interp", native_after=SHORT)
    if ran.status is None:
        return "", ran.why
    return ran.uart.decode("latin-1").strip(), ""


def on_avr(source: Path, folder: Path) -> str:
    """Checksum by avr-gcc and simavr; "" when it does not build, end or print."""
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
    plain = re.sub(r"\x1b\[\d*m", "", said.stdout + said.stderr)  # simavr colours what the UART says
    found = re.search(r"\b[0-9A-F]{8}\b", plain)
    return found[0] if found else ""


def examine(seed: int, keep: Path | None = None, shapes: tuple[Shape, ...] = SHAPES) -> Verdict:
    """Generate, build and run one program everywhere."""
    with tempfile.TemporaryDirectory(prefix="csmith-") as name:
        folder = Path(name)
        source = generate(seed, folder)
        verdict = compare(seed, source, folder, shapes)
        if verdict.kind == "failed" and keep is not None:
            keep.mkdir(parents=True, exist_ok=True)
            shutil.copy(source, keep / source.name)
        return verdict


def compare(seed: int, source: Path, folder: Path, shapes: tuple[Shape, ...] = SHAPES) -> Verdict:
    """Checksums of one program in all shapes, -O0 first, and on the AVR. The compiler verifies its machine code."""
    os.environ["DSPIC_VERIFY_MACHINE"] = "1"
    sums = {}
    for level, alone in shapes:
        shape = f"{level} {alone}".strip()
        sums[shape], why = ours(source, level, alone, folder)
        if why.startswith("memory"):
            return Verdict(seed, "skipped", "does not fit into the device's memory")
        if why == "trap: stack error":
            return Verdict(seed, "skipped", "needs more stack than there is RAM")
        if why.startswith("limit") and len(sums) == 1:
            return Verdict(seed, "skipped", f"still running after {CYCLES} cycles at {shape}")
        if why:
            return Verdict(seed, "failed", f"{shape}: {why}")
    reference = on_avr(source, folder) if avr_available() else ""
    first = next(iter(sums.values()))
    if len(set(sums.values())) != 1:
        return Verdict(seed, "failed", f"{sums}, avr {reference or 'unknown'}")
    if reference and reference != first:
        return Verdict(seed, "failed", f"{first} at every level, avr {reference}")
    return Verdict(seed, "agreed", "with avr" if reference else "levels only")


def _examine(work: tuple[int, Path | None]) -> Verdict:
    try:
        return examine(*work)
    except Exception as error:
        return Verdict(work[0], "failed", f"internal error: {type(error).__name__}: {error}")


def main() -> int:
    """Command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter,
        epilog="example: csmith_campaign.py --count 1000 --jobs 2")  # fmt: skip
    parser.add_argument("--count", type=int, help="programs (default 1000; with --seconds no limit)")
    parser.add_argument("--seed", type=int, default=base_seed(), help="of the first program (default: from the commit)")
    parser.add_argument("--seconds", type=float, help="begin no new program after S seconds", metavar="S")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--log", type=Path, help="file of verdicts, read and continued")
    parser.add_argument("--keep", type=Path, help="folder for the sources of failures")
    options = parser.parse_args()
    if not available():
        print("csmith is not installed (Debian package csmith): nothing to do", file=sys.stderr)
        return SKIPPED
    count = options.count if options.count is not None or options.seconds is not None else 1000
    done, start, seed = known(options.log), time.monotonic(), options.seed
    with ProcessPoolExecutor(options.jobs) as pool:
        while count is None or seed < options.seed + count:
            if options.seconds is not None and time.monotonic() - start >= options.seconds:
                break
            end = seed + BATCH if count is None else min(seed + BATCH, options.seed + count)
            work = [(number, options.keep) for number in range(seed, end) if number not in done]
            seed = end
            for verdict in pool.map(_examine, work):
                done[verdict.seed] = verdict
                if options.log:
                    with options.log.open("a") as log:
                        print(json.dumps(asdict(verdict)), file=log)
                if verdict.kind == "failed":
                    print(f"FAILED at seed {verdict.seed}: {verdict.reason}", flush=True)
                    print(f"again: python tests/fuzz/csmith_campaign.py --seed {verdict.seed} --count 1", flush=True)
    counts = Counter(f"{v.kind} {v.reason if v.kind != 'failed' else ''}".strip() for v in done.values())
    print("\n".join(f"{count} {kind}" for kind, count in sorted(counts.items())))
    return 1 if counts["failed"] else 0


def known(log: Path | None) -> dict[int, Verdict]:
    """Verdicts of an earlier, interrupted campaign."""
    if log is None or not log.exists():
        return {}
    return {row["seed"]: Verdict(**row) for row in map(json.loads, log.read_text().splitlines())}


if __name__ == "__main__":
    sys.exit(main())
