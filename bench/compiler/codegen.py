"""Measure code quality: words and cycles of reference functions, and XC16's words where they are known.

    python -m bench.compiler.codegen [--level=-Os] [--json]

Words are those of the function with its return, without the run-time helpers that it calls. Cycles are from entry to
return of one call on the emulator, helpers included. XC16's words are from abi-elf.md §8.2 (verified output of v1.25,
-Os).
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

import emu
from toolchain.driver import driver
from toolchain.elf.read import read_object

ROOT = Path(__file__).resolve().parents[2]
SOURCES = Path(__file__).parent / "codegen_src"

XC16_OS_WORDS = {
    "sat": 8, "crc16": 19, "dot": 12, "find": 12, "itoa10": 25, "add32": 3, "sub32": 3, "neg32": 3, "shl1": 3,
    "sar1": 3, "lt32": 8, "ltu32": 8, "eq32": 8, "shlv32": 6, "mul16": 2, "mulss": 2, "muluu": 2, "mul32": 10,
    "div16": 4, "mod16": 5, "divu10": 4, "div32": 1, "shl4": 6, "shr8": 5,
}  # fmt: skip
"""Words of XC16's functions: abi-elf.md §8.2, both tables, column -Os. mul32 is 4 words plus the 6 words of ___mulsi3
(§2.8), because our mul32 calls no helper. div32 calls a helper under both compilers, which is not counted."""

GOAL_TOTAL, GOAL_SINGLE = 0.85, 1.0


@dataclass(frozen=True)
class Figure:
    """One function: words and cycles of this compiler, XC16's words or None."""

    name: str
    words: int
    cycles: int
    xc16_words: int | None

    @property
    def ratio(self) -> float | None:
        """Size relative to XC16's."""
        return self.words / self.xc16_words if self.xc16_words else None


def sizes(level: str, folder: Path) -> dict[str, int]:
    """Return words per function of separately compiled objects, so that no function is inlined or specialised."""
    words: dict[str, int] = {}
    for source in ("compared.c", "programs.c"):
        target = folder / (source + ".o")
        if driver.main([level, "-fno-builtin", "-c", str(SOURCES / source), "-o", str(target)]) != 0:
            raise SystemExit(1)
        for section in read_object(target.read_bytes(), target.name).sections:
            if section.is_code and section.name.startswith(".text.") and section.data:
                words[section.name.removeprefix(".text._")] = len(section.data) // 4
    return words


def cycles(level: str, folder: Path, names: list[str]) -> dict[str, int]:
    """Return cycles from the first instruction of each function to the one after its call."""
    image = folder / "all.elf"
    sources = [str(SOURCES / name) for name in ("main.c", "compared.c", "programs.c")]
    if driver.main([level, "-fno-lto", *sources, "-o", str(image)]) != 0:
        raise SystemExit(1)
    machine = emu.load(image, engine="auto")
    assert machine.image is not None
    entries = {symbol.address: name for name in names if (symbol := machine.image.symbols.find("_" + name))}
    measured: dict[str, int] = {}
    while len(measured) < len(entries):
        stop = machine.run(cycles=2_000_000, until=lambda: machine.pc in entries)
        if stop.reason != "until":
            break
        name, start, top = entries[machine.pc], machine.cycle, machine.w[15]
        machine.run(cycles=2_000_000, until=_returned(machine, top - 4))
        measured[name] = machine.cycle - start
    return measured


def _returned(machine: emu.Machine, depth: int) -> Callable[[], bool]:
    """Whether the stack pointer has its value from before the call."""
    return lambda: machine.w[15] == depth


def measure(level: str) -> list[Figure]:
    """Return the rows of all functions of `codegen_src`."""
    with tempfile.TemporaryDirectory(prefix="codegen-") as name:
        words = sizes(level, Path(name))
        spent = cycles(level, Path(name), list(words))
    known = XC16_OS_WORDS if level == "-Os" else {}
    return [Figure(name, count, spent.get(name, 0), known.get(name)) for name, count in words.items()]


def main() -> int:
    """Print the table and return exit status 0."""
    parser = argparse.ArgumentParser(description=__doc__, epilog="example: python -m bench.compiler.codegen")
    parser.add_argument("--level", default="-Os")
    parser.add_argument("--json", action="store_true")
    options, _ = parser.parse_known_args()
    figures = measure(options.level)
    compared = [f for f in figures if f.xc16_words]
    ours, theirs = sum(f.words for f in compared), sum(f.xc16_words or 0 for f in compared)
    if options.json:
        print(
            json.dumps(
                {"level": options.level, "functions": [asdict(f) for f in figures], "words": ours, "xc16": theirs}
            )
        )
        return 0
    print(f"{options.level:14} {'words':>6} {'bytes':>6} {'cycles':>7} {'XC16':>5} {'ratio':>6}")
    for f in figures:
        other = f"{f.xc16_words:5} {f.ratio:6.2f}{' !' if (f.ratio or 0) > GOAL_SINGLE else ''}" if f.ratio else ""
        print(f"{f.name:14} {f.words:6} {3 * f.words:6} {f.cycles:7} {other}")
    if theirs:
        print(
            f"{'compared total':14} {ours:6} {3 * ours:6} {'':7} {theirs:5} {ours / theirs:6.3f}  (goal {GOAL_TOTAL})"
        )
    return 0


if __name__ == "__main__":
    sys.exit(main())
