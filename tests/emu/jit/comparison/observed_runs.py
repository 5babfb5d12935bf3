"""Runs under random observers, compared with a run without any: equal snapshots and equal output.

The program of a seed runs unobserved on the plain engine. Then it runs on the plain engine, on native code that is not
compiled yet, and on compiled code, each with observers of its own.
"""

from __future__ import annotations

import io
import random
from collections import Counter
from collections.abc import Callable
from contextlib import ExitStack
from functools import cache
from pathlib import Path
from typing import Final

from emu.chips.chip import Chip
from emu.chips.dspic30f6014a import DSPIC30F6014A
from emu.dspic30f.change_log import Watched, WatchedNumber
from emu.dspic30f.cycle_accounting import CycleAccounting
from emu.dspic30f.jit.counting import CycleCounting
from emu.dspic30f.jit.engine import JitEngine
from emu.image.loader import load_image
from emu.image.model import Image
from emu.instruments.changes import log_changes
from emu.instruments.coverage import Counts, count_executions
from emu.instruments.trace import Tracer
from emu.instruments.vcd import WaveformRecorder
from emu.machine.machine import Machine
from emu.machine.stops import Stop
from emu.system.arrivals import ArrivalLog, LoggedNumber
from emu.system.hook_filters import OPERATORS, Comparison
from tests.emu.jit.comparison.engine_pair import NO_WATCHDOG, Difference, QuickCompiler
from tests.emu.jit.comparison.random_firmware import BODY_WORDS, CODE, load, random_firmware

CYCLES: Final = 3_000
PEEKED: Final = ("TMR1", "TMR2", "PORTD", "U1STA", "IFS0", "ADCON1", "SR", "RCOUNT")
NEVER_REACHED: Final = 1 << 60
"""Threshold of translation that no code reaches, so that all code is interpreted."""
ENGINES: Final = ("plain", "jit, cold", "jit, warm")
Advance = Callable[[int], Stop | None]


@cache
def _any_image() -> Image:
    """Return an image for the names in traces."""
    return load_image(Path(__file__).parents[2] / "cli" / "hello.hex")


class Observed:
    """A machine under random observers. `names` lists the kinds of observers."""

    def __init__(self, machine: Machine, generator: random.Random, stack: ExitStack) -> None:
        self._machine: Final = machine
        self._generator: Final = generator
        self._stack: Final = stack
        self.advance: Advance = machine.advance
        kinds: dict[str, Callable[[], None]] = {
            "hook": self._hook, "filter": self._filter, "SFR hook": self._sfr_hook, "snapshots": self._snapshots,
        }  # fmt: skip
        instruments: dict[str, Callable[[], None]] = {
            "coverage": self._coverage, "profile": self._profile, "changes": self._changes, "trace": self._trace,
            "waveform": self._waveform, "no instrument": lambda: None,
        }  # fmt: skip
        if machine.engine == "plain":
            del instruments["profile"]  # it belongs to native code
        self.names: Final = [
            generator.choice(list(instruments)),
            *generator.sample(list(kinds), generator.randrange(4)),
        ]
        for name in self.names:
            (instruments | kinds)[name]()

    def _address(self) -> int:
        return self._generator.randrange(CODE, CODE + 2 * BODY_WORDS, 2)

    def _peek(self) -> None:
        for name in PEEKED:
            self._machine.peek(name)
        self._machine.save_state()

    def _hook(self) -> None:
        for _ in range(3):
            self._machine.hook_pc(self._address(), self._peek)

    def _filter(self) -> None:
        """Set hooks with filters that compare RAM, a frame, W registers and SFRs with random numbers."""
        generator, sfrs = self._generator, self._machine.chip.sfrs
        for _ in range(3):
            sfr, number = sfrs[generator.choice(PEEKED)].address, generator.randrange(0x800, 0xA00) & ~1
            places: list[tuple[int, int | None]] = [(at, None) for at in (2 * generator.randrange(15), sfr, number)]
            places += [(-2 * generator.randrange(1, 9), generator.choice((14, 15)))]
            address, base = generator.choice(places)
            operator, number = generator.choice(OPERATORS), generator.choice((0, 1, generator.getrandbits(16)))
            one = Comparison(address, 2, generator.random() < 0.5, operator, number, base)
            self._machine.hook_pc(self._address(), self._peek, (one,))

    def _sfr_hook(self) -> None:
        name = self._generator.choice(("LATD", "TMR1", "U1TXREG", "IFS0"))
        self._machine.hook_sfr(name, lambda _is_write, _word: self._peek())

    def _snapshots(self) -> None:
        advance, length = self.advance, self._generator.randrange(100, 900)

        def sliced(cycle: int) -> Stop | None:
            stop = None
            while stop is None and self._machine.cycle < cycle:
                self._machine.snapshot()
                stop = advance(min(cycle, self._machine.cycle + length))
            return stop

        self.advance = sliced

    def _coverage(self) -> None:
        self._stack.callback(count_executions(self._machine, Counts()))

    def _profile(self) -> None:
        runner = self._machine.runner
        assert isinstance(runner, JitEngine)
        counting = CycleCounting(CycleAccounting(self._machine.core), lambda pc: pc)
        self._stack.callback(runner.start_counting(counting))

    def _changes(self) -> None:
        generator = self._generator
        numbers = [WatchedNumber(generator.randrange(0x800, 0xA00) & ~1, generator.choice((1, 2, 4))) for _ in range(3)]
        watched: list[Watched] = [
            "ipl",
            "asleep",
            *numbers,
            WatchedNumber(generator.randrange(0x800, 0x900) & ~1, 2, 4),
        ]
        leaves = generator.choice((None, ()))
        self._stack.callback(log_changes(self._machine, watched, lambda _changes: None, leaves))

    def _trace(self) -> None:
        tracer = Tracer(self._machine, _any_image(), io.StringIO())
        self._stack.callback(tracer.close)
        self.advance = tracer.advance

    def _waveform(self) -> None:
        recorder = WaveformRecorder(self._machine, io.StringIO(), self._generator.choice(([], ["ipl", "asleep"])))
        self._stack.callback(recorder.close)
        self.advance = recorder.advance


def _run(
    seed: int, engine: str, chip: Chip, is_observed: bool
) -> tuple[Machine, bytes, list[tuple[int, int]], list[str], list[list[int]]]:
    """Run the program of a seed.

    Return the machine, its snapshot, the bytes it sent with their cycles, the observers, and recorded arrivals.
    """
    firmware, generator = random_firmware(seed, chip), random.Random(f"{seed} {engine}")
    machine = Machine(chip, engine=engine.partition(",")[0], ipl_slip=seed & 1)
    machine.stop_on_fault = False
    if isinstance(machine.runner, JitEngine):
        machine.runner.compiler, machine.runner.wait = QuickCompiler(0), True
        machine.runner.threshold = NEVER_REACHED if engine == "jit, cold" else 1
    if seed & 2:
        machine.program.put(chip.config["FWDT"].address, NO_WATCHDOG)
    load(machine, firmware)
    inputs = random.Random(seed)
    for uart in machine.uart.values():
        for _ in range(3):
            uart.feed(bytes([inputs.randrange(256)]), inputs.randrange(1, CYCLES))
    sent: list[tuple[int, int]] = []
    for uart in machine.uart.values():
        uart.listen(lambda byte, cycle: sent.append((cycle, byte)), lazy=True)
    names: list[str] = []
    arrivals = ArrivalLog(machine.record, 3, (LoggedNumber(2, 4), LoggedNumber(0x8F0, 2)), is_logged=True)
    with ExitStack() as stack:
        advance = machine.advance
        if is_observed:
            observed = Observed(machine, generator, stack)
            advance, names = observed.advance, observed.names
            for hook in arrivals.hooks[: seed % 4]:
                machine.hook_pc(inputs.randrange(CODE, CODE + 2 * BODY_WORDS, 2), hook)
        for cycle in (CYCLES // 3, CYCLES):
            while machine.cycle < cycle:
                before = machine.cycle
                stop = advance(cycle)
                if (stop is not None and stop.reason == "halt") or machine.cycle == before:
                    break
    return machine, machine.snapshot(), sorted(sent), names, arrivals.entries()


def check_observed(seed: int, tally: Counter[str], chip: Chip = DSPIC30F6014A) -> None:
    """Run the program of a seed without and with observers on every engine. Count them in `tally`.

    Raises Difference, also if the engines record different arrivals.
    """
    plain, state, sent, *_ = _run(seed, "plain", chip, is_observed=False)
    first: list[list[int]] | None = None
    for engine in ENGINES:
        machine, found, also, names, arrivals = _run(seed, engine, chip, is_observed=True)
        tally.update(names)
        where = f"seed {seed}, {engine}, {', '.join(names)}"
        if machine.cycle != plain.cycle or also != sent:
            raise Difference(f"{where}: cycle {machine.cycle} of {plain.cycle}, output {also} of {sent}")
        if found != state:
            at = next(n for n, pair in enumerate(zip(found, state, strict=True)) if pair[0] != pair[1])
            raise Difference(f"{where}: {machine.record.field_at(at)}")
        first = arrivals if first is None else first
        if arrivals != first:
            raise Difference(f"{where}: {len(arrivals)} arrivals, {len(first)} on {ENGINES[0]}, or other values")
