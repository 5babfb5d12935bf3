"""Measure compile time: 3,000 lines of C to ELF, the rebuild of an application, and the driver's start.

    python -m bench.compiler.compile_time [--lines N] [--json]

CPU seconds of all processes, the least of RUNS runs; goals: 1.2 s for 3,000 lines at -Os, 1.0 s for an application
after a change of one file (`make -C firmware`).
"""

from __future__ import annotations

import argparse
import json
import resource
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
FILES = 10
RUNS = 3
APP = "hello"

# One unit of generated source with typical firmware functions. {n} makes names unique.
UNIT = """
struct item{n} {{ struct item{n} *next; int key; long weight; unsigned char flags; }};
static struct item{n} pool{n}[6];
static const int table{n}[8] = {{1, 2, 4, 8, 16, 32, 64, {n} & 127}};
int lookup{n}(int i)
{{
    int sum = 0;
    for (int k = 0; k < 8; k++)
        if ((i >> k) & 1)
            sum += table{n}[k];
    return sum;
}}
long insert{n}(int key, long weight)
{{
    struct item{n} *at = &pool{n}[key % 6];
    at->key = key;
    at->weight += weight;
    at->flags |= 1u << (key & 7);
    at->next = key > 3 ? pool{n} : 0;
    return at->weight;
}}
int classify{n}(int c)
{{
    switch (c) {{
    case 0: return 3;
    case 1: return lookup{n}(c);
    case 2: return (int)insert{n}(c, {n});
    case 3: return 7;
    case 7: return 9;
    default: return c * {n} / 7;
    }}
}}
unsigned checksum{n}(const unsigned char *p, unsigned count)
{{
    unsigned crc = {n};
    while (count--) {{
        crc ^= *p++;
        for (int k = 0; k < 8; k++)
            crc = crc & 1 ? crc >> 1 ^ 0xA001 : crc >> 1;
    }}
    return crc;
}}
"""


def write_program(folder: Path, lines: int) -> tuple[list[Path], int]:
    """Write FILES source files of about `lines` lines in total, and a main that uses every unit."""
    units = max(FILES, lines // UNIT.count("\n"))
    texts = ["" for _ in range(FILES)]
    calls, prototypes = [], []
    for n in range(units):
        texts[n % FILES] += UNIT.format(n=n)
        prototypes.append(f"int classify{n}(int); unsigned checksum{n}(const unsigned char *, unsigned);")
        calls.append(f"    sum += classify{n}(sum & 7) + (int)checksum{n}((const unsigned char *)&sum, 2);")
    paths = []
    for number, text in enumerate(texts):
        paths.append(folder / f"part{number}.c")
        paths[-1].write_text(text)
    main = folder / "main.c"
    main.write_text(
        "\n".join(prototypes) + "\nint main(void)\n{\n    int sum = 3;\n" + "\n".join(calls) + "\n    return sum;\n}\n"
    )
    return [main, *paths], sum(path.read_text().count("\n") for path in [main, *paths])


def _cpu_seconds() -> float:
    """Return the CPU seconds of all child processes that have ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def driver_seconds(*words: str, runs: int = RUNS) -> float:
    """Return the least CPU seconds of several runs of the driver, each in its own process."""
    found = []
    for _ in range(runs):
        started = _cpu_seconds()
        subprocess.run([sys.executable, "-m", "toolchain", "cc", *words], cwd=ROOT, check=False, capture_output=True)
        found.append(_cpu_seconds() - started)
    return min(found)


def rebuild_seconds(folder: Path) -> float:
    """Return the least CPU seconds of `make` after a change of one file of an application, copied to `folder`."""
    shutil.copytree(ROOT / "firmware" / "apps" / APP, folder / APP)
    source = folder / APP / "main.c"
    text = source.read_text()
    words = [f"APP={APP}", f"APPS={folder}", f"OUT={folder / 'out'}", f"PYTHON={sys.executable}"]
    found = []
    for number in range(RUNS + 1):
        source.write_text(f"{text}\nint changed_{number};\n")
        started = _cpu_seconds()
        subprocess.run(["make", "-s", "-C", str(ROOT / "firmware"), *words], check=True)
        found.append(_cpu_seconds() - started)
    return min(found[1:])


def main() -> int:
    """Print the figures and return exit status 0."""
    parser = argparse.ArgumentParser(description=__doc__, epilog="example: python -m bench.compiler.compile_time")
    parser.add_argument("--lines", type=int, default=3000)
    parser.add_argument("--json", action="store_true")
    options, _ = parser.parse_known_args()
    with tempfile.TemporaryDirectory(prefix="compile-") as name:
        folder = Path(name)
        sources, lines = write_program(folder, options.lines)
        words = ["-Os", *map(str, sources), "-o", str(folder / "x.elf")]
        (folder / "warm.c").write_text("int main(void) { return 0; }\n")
        empty = ["-Os", str(folder / "warm.c"), "-o", str(folder / "warm.elf")]
        driver_seconds(*empty, runs=1)  # builds the run-time library
        figures = {"lines": float(lines), "full_s": driver_seconds(*words)}
        figures["application_rebuilt_s"] = rebuild_seconds(folder)
        figures["usage_error_s"] = driver_seconds("--nonsense")
        figures["empty_main_s"] = driver_seconds(*empty)
    print(json.dumps(figures) if options.json else "\n".join(f"{k:20} {v:8.2f}" for k, v in figures.items()))
    return 0


if __name__ == "__main__":
    sys.exit(main())
