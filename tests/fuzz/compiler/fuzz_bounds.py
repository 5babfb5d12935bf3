"""Random C at every level: no run exceeds the cycles, the stack or the interrupt latency that `toolchain.bounds`
computes.

`python tests/fuzz/compiler/fuzz_bounds.py [--programs N] [--seed S] [--seconds T]`; exits with 1 at the first program
that exceeds a bound. Generators of the programs, by seed:
- `c_shapes.py`: interrupts, escaping addresses, volatile, large frames, loops with fixed counts; every second program
  also contains `c_features.py`, which often makes it unbounded;
- `c_annotations.py`, every third seed: programs that are bounded only by their annotations;
- `c_interrupts.py`, every sixth seed: responses of interrupts, and the stack under nested interrupts, are compared at
  many phases.

The summary states how tight the bounds of `main` are. A long campaign fails if `c_interrupts.py` never generated one
of the constructs listed there.
"""

from __future__ import annotations

import sys
import tempfile
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT))

import emu  # noqa: E402
from emu.system.events import NEVER  # noqa: E402
from tests.fuzz.compiler.fuzz_compiler import NO_ROOM  # noqa: E402
from tests.fuzz.programs import c_annotations, c_interrupts, c_shapes  # noqa: E402
from tests.fuzz.seeds import Campaign, parser  # noqa: E402
from tests.toolchain.bounds.responses import Watched, watched  # noqa: E402
from tests.toolchain.c_programs import build  # noqa: E402
from toolchain.bounds.interference import report_of  # noqa: E402
from toolchain.bounds.program import Program  # noqa: E402
from toolchain.bounds.report import Bound, BoundAnalysis  # noqa: E402
from toolchain.elf.read import read_executable  # noqa: E402

LEVELS = ("-Os", "-O0", "-O2", "-O1")
CYCLES = 400_000
"""Maximum length of a measured run in cycles."""
HANDLER = "__T1Interrupt"
NOTED = 1
"""Seeds with this remainder modulo 3 make programs with annotations."""
INTERRUPTED = 3
"""Seeds with this remainder modulo 6 make programs about interrupts."""
PHASES, WATCHED = 24, 4_000
"""Number of runs of a program about interrupts, and cycles of each run."""
ENOUGH = 40
"""Number of programs about interrupts after which every construct must have occurred."""
NESTED = 3
"""Depth of nested handlers that a long campaign must reach; it is the number of handlers."""


@dataclass
class Seen:
    """Maxima of one function or handler: cycles from its first instruction to the one after its return, without
    interrupts, and bytes of stack above the return address."""

    cycles: int = 0
    stack: int = 0


def measure(image: Path) -> dict[str, Seen] | str:
    """Run an image and return the maxima of `main` and of the interrupt handler, or why they could not be measured."""
    machine = emu.load(image, engine="plain")
    assert machine.image is not None
    main, handler = (machine.image.symbols.find(name) for name in ("_main", HANDLER))
    assert main is not None
    return _follow(machine, main.address, handler.address if handler is not None else None)


def _follow(machine: emu.Machine, main: int, handler: int | None) -> dict[str, Seen] | str:
    while machine.pc != main:
        if machine.step() is not None:
            return "main is not reached"
    seen = {"_main": Seen(), HANDLER: Seen()}
    base = machine.w[15]
    inside: tuple[int, int] | None = None  # stack pointer and cycle at the handler's first instruction
    start, away = machine.cycle, 0
    while True:
        before = machine.pc, machine.cycle, machine.w[15]
        if machine.service_boundary(NEVER) is not None or machine.cycle - start > CYCLES:
            return "it runs too long"
        if machine.pc != before[0]:
            if inside is None and machine.pc == handler:
                inside = before[2] + 4, machine.cycle
                away += machine.cycle - before[1]
            else:
                return "a trap"
        if machine.step() is not None:
            return "it stops"
        if inside is not None:
            found = seen[HANDLER]
            found.stack = max(found.stack, machine.w[15] - inside[0])
            if machine.w[15] == inside[0] - 4:
                found.cycles = max(found.cycles, machine.cycle - inside[1])
                away += machine.cycle - inside[1]
                inside = None
            continue
        seen["_main"].stack = max(seen["_main"].stack, machine.w[15] - base)
        if machine.w[15] < base:
            seen["_main"].cycles = machine.cycle - start - away
            return seen


def examine(seed: int, folder: Path) -> tuple[str, dict[str, tuple[Seen, Bound]]]:
    """Test one program at one level. Return its outcome, and the measured maxima and the bound of each function."""
    level = LEVELS[seed % len(LEVELS)]
    noted = seed % 3 == NOTED
    files = c_annotations.Program(seed).files if noted else c_shapes.Program(seed, has_features=seed % 2 == 1).files
    for name, text in files.items():
        (folder / name).write_text(text)
    image = folder / "program.elf"
    options = (level, "-w", "-g", "-std=gnu11", *(["-fno-lto"] if seed // 8 % 3 == 2 else []))
    built = build([folder / name for name in files if name.endswith(".c")], image, *options)
    if built.status:
        if NO_ROOM.search(built.messages):
            return "too large", {}
        raise AssertionError(f"{level}: {built.first_error}")
    seen = measure(image)
    if isinstance(seen, str):
        return seen, {}
    executable = read_executable(image.read_bytes(), str(image))
    program = Program(executable)
    analyst = BoundAnalysis(program)
    pairs = {}
    for name, what in seen.items():
        address = program.address(name)
        if what.cycles and address is not None:
            pairs[name] = what, analyst.bound(name, address, *(("call", 0) if name == "_main" else ("interrupt", 4)))
    open_ends = {reason for _, bound in pairs.values() for reason in bound.unbounded.values()}
    for name, (what, bound) in pairs.items():
        if bound.cycles is not None:
            assert what.cycles <= bound.cycles, f"{level} {name}: {what.cycles} cycles, bound {bound.cycles}"
        if bound.stack_is_known:
            assert what.stack <= bound.bytes, f"{level} {name}: {what.stack} bytes of stack, bound {bound.bytes}"
    return (f"not bounded: {', '.join(sorted(open_ends))}" if open_ends else "bounded"), pairs


@dataclass
class Held:
    """Summary of the programs about interrupts: generated constructs, and numbers of programs and of nested
    handlers."""

    kinds: Counter[str]
    programs: int = 0
    bounded: int = 0
    nested: int = 0

    def examine(self, seed: int, folder: Path) -> str:
        """Run one program at one level and return the outcome. Raises AssertionError above a bound."""
        program, level = c_interrupts.Program(seed), LEVELS[seed // 6 % len(LEVELS)]
        (folder / "a.c").write_text(program.text)
        image = folder / "program.elf"
        built = build([folder / "a.c"], image, level, "-w", "-g", "-std=gnu11")
        assert not built.status, f"{level}: {built.first_error}"
        names = [f"{timer}Interrupt" for timer in c_interrupts.TIMERS]
        seen = watched(image, names, program.phases(PHASES), WATCHED)
        executable = read_executable(image.read_bytes(), str(image))
        report = report_of(Program(executable), ["main"])
        said = {one.name.removeprefix("_"): one.cycles for one in report.responses} | {"stack": report.stacks["main"]}
        for name, most in _worst(seen).items():
            limit = said[name]
            assert limit is None or most <= limit, f"{level} {name}: {most}, bound {limit}"
        self.kinds += program.kinds
        self.programs, self.nested = self.programs + 1, max(self.nested, seen.nested)
        self.bounded += None not in said.values()
        return "responses" if None not in said.values() else "responses not bounded"

    def missing(self) -> list[str]:
        """Return the constructs and results that a long campaign must contain and that are missing."""
        if self.programs < ENOUGH:
            return []
        absent = sorted(c_interrupts.KINDS - self.kinds.keys())
        absent += [] if self.nested >= NESTED else [f"{NESTED} handlers within each other"]
        return absent + ([] if 2 * self.bounded > self.programs else ["bounds for most programs about interrupts"])


def _worst(seen: Watched) -> dict[str, int]:
    return {name: one.late for name, one in seen.handlers.items()} | {"stack": seen.stack}


def main() -> int:
    """Run the campaign from the command line."""
    campaign = Campaign(parser(__doc__), "programs", 300, "programs")
    campaign.parse()
    outcomes: Counter[str] = Counter()
    ratios: list[float] = []
    held = Held(Counter())
    for seed in campaign:
        with tempfile.TemporaryDirectory(prefix="bounds-") as folder:
            try:
                if seed % 6 == INTERRUPTED:
                    outcomes[held.examine(seed, Path(folder))] += 1
                    continue
                outcome, pairs = examine(seed, Path(folder))
            except AssertionError as error:
                return campaign.failed(error)
        outcomes[outcome] += 1
        found = pairs.get("_main")
        if found is not None and found[1].cycles is not None:
            ratios.append(found[1].cycles / found[0].cycles)
    ratios.sort()
    summary = ", ".join(f"{count} {what}" for what, count in outcomes.most_common())
    if ratios:
        summary += f"; main: bound / measured {ratios[len(ratios) // 2]:.2f} median, {ratios[-1]:.2f} maximum"
    missing = held.missing()
    if missing:
        print(f"never made: {', '.join(missing)}", file=sys.stderr)
        return 1
    return campaign.ended(summary)


if __name__ == "__main__":
    sys.exit(main())
