"""Random programs of kernel calls on the kernel's POSIX port and on its model.

Usage: `python tests/fuzz/kernel/fuzz_kernel_model.py [--batches N] [--seconds S] [--planted]`. Each seed makes a batch
of 500 programs of at most 60 calls, made by threads, handlers, conditions, cleanups and interrupts, with failing
allocations (tests/firmware/model). Results, callbacks and final state must be equal. The campaign prints the shrunk
program that differs. With --planted it plants faults in copies of the kernel instead and states how many programs found
each.
"""

from __future__ import annotations

import shutil
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT))

from tests.firmware.model.compare import Kernels, build, random_programs  # noqa: E402
from tests.firmware.model.planted_faults import find_all  # noqa: E402
from tests.fuzz.seeds import SKIPPED, Campaign, parser  # noqa: E402

PROGRAMS = 500
KINDS = 6
"""Of six batches in a row, one shares events with other robots, and one runs under sanitizers."""
SANITIZE = "-fsanitize=address,undefined -fno-sanitize-recover=undefined"
MOST = 40_000
"""Programs after which a planted fault counts as not found."""


def main() -> int:
    campaign = Campaign(parser(__doc__), "batches", 200, f"batches of {PROGRAMS} programs")
    campaign.parser.add_argument("--planted", action="store_true", help="count the programs that find planted faults")
    options = campaign.parse()
    if shutil.which("gcc") is None:
        print("skipped: gcc is not installed")
        return SKIPPED
    with tempfile.TemporaryDirectory() as folder:
        built = Path(folder, "built")
        build(built)
        build(built / "remote", "REMOTE=1")
        if options.planted:
            missed = 0
            for fault, tried, program in find_all(built, Path(folder, "planted"), campaign.seed, MOST):
                missed += program is None
                print(f"{fault.name}: {f'{tried:,} programs' if tried else 'not found'}", flush=True)
            return campaign.failed(f"{missed} faults not found") if missed else campaign.ended("every fault found")
        plain, sharing = Kernels(built / "interpreter"), Kernels(built / "remote" / "interpreter")
        sanitized = Kernels(build(built / "sanitized", f"SANITIZE={SANITIZE}"))
        for seed in campaign:
            remote = seed % KINDS == 0
            kernels = sharing if remote else sanitized if seed % KINDS == 1 else plain
            programs = random_programs(seed, PROGRAMS, remote)
            for program, difference in zip(programs, kernels.check(programs), strict=True):
                if difference is not None:
                    smaller = kernels.shrunk(program)
                    (seen,) = kernels.check([smaller])
                    return campaign.failed(f"kernel and model differ after\n{smaller}\n{seen}")
    return campaign.ended(f"{campaign.done * PROGRAMS:,} programs, no difference")


if __name__ == "__main__":
    sys.exit(main())
