"""What counting costs: `emu profile` beside a plain run of the same image in native code.

    python bench/profiling.py [--seconds S] [--repeat N] [--json]

Each ratio is the median of N paired runs in host CPU time, with native code of both kinds complete before it is timed:
bench/c/compute.c, the kernel with busy threads (firmware/apps/compute) and the paper's Listing 1. With --timed,
what happened is also kept in order, as for --speedscope and --perfetto. With --cold each run is a whole process.
"""

from __future__ import annotations

import argparse
import json
import resource
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

import emu  # noqa: E402
from emu.dspic30f.jit.engine import JitEngine  # noqa: E402
from emu.profile.shares import Profiler  # noqa: E402

MIPS = 14_745_600  # design §4.2


def images(folder: Path) -> dict[str, Path]:
    """What is run."""
    image = folder / "c.elf"
    source = ROOT / "bench" / "c" / "compute.c"
    words = ["-Os", "-g", "-DROUNDS=65535", str(source), "-o", str(image)]
    subprocess.run([sys.executable, "-m", "toolchain", "cc", *words], check=True, cwd=ROOT)
    found = {"computing C": image}
    for app, name in (("compute", "kernel with busy threads"), ("listing1", "Listing 1")):
        command = ["make", "-s", "-C", str(ROOT / "firmware"), f"APP={app}", f"PYTHON={sys.executable}"]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        found[name] = folder / f"{app}.elf"
        shutil.copy(ROOT / "firmware" / "build" / app / "firmware.elf", found[name])
    return found


def spent(image: Path, cycles: int, how: str) -> float:
    """Host seconds of `cycles` behind as many that are not timed: "plain", "counted" or "timed"."""
    machine = emu.load(image)
    assert isinstance(machine.runner, JitEngine)
    assert machine.image is not None
    machine.runner.wait = True
    with ExitStack() as stack:
        if how != "plain":
            stack.enter_context(Profiler(machine, machine.image, timed=how == "timed").counting())
        machine.run_until(cycles)
        start = time.process_time()
        machine.run_until(2 * cycles)
    return time.process_time() - start


def of_a_process(image: Path, seconds: float, how: str) -> float:
    """Host seconds of `emu run` or `emu profile` from start to end."""
    folder = image.parent
    more = {"plain": [], "counted": [], "timed": ["--speedscope", str(folder / "timeline.json")]}[how]
    words = ["run" if how == "plain" else "profile", str(image), "--seconds", f"{seconds:g}", *more]
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([sys.executable, "-m", "emu", *words], check=True, stdout=subprocess.DEVNULL,
                   stderr=subprocess.DEVNULL, cwd=ROOT)  # fmt: skip
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main() -> int:
    """Measure and print."""
    assert __doc__ is not None
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=20, help="simulated time of a run (default 20)")
    parser.add_argument("--repeat", type=int, default=3, help="pairs of runs (default 3)")
    parser.add_argument("--timed", action="store_true", help="keep what happened in order too")
    parser.add_argument("--cold", action="store_true", help="whole processes, from start to end")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    options = parser.parse_args()
    how, cycles = "timed" if options.timed else "counted", int(options.seconds * MIPS)

    def once(image: Path, kind: str) -> float:
        return of_a_process(image, options.seconds, kind) if options.cold else spent(image, cycles, kind)

    with tempfile.TemporaryDirectory() as folder:
        ratios = {
            name: statistics.median(once(image, how) / once(image, "plain") for _ in range(options.repeat))
            for name, image in images(Path(folder)).items()
        }
    if options.json:
        print(json.dumps(ratios))
    else:
        for name, ratio in ratios.items():
            print(f"{name:28} {ratio:6.2f} x the time of a plain run")
    return 0


if __name__ == "__main__":
    sys.exit(main())
