"""Long runs: loops of millions of instructions in native code, which are counted exactly and compared.

A machine with the engine's default block code is compared with one that has exact code alone. Exact code updates the
record after every instruction and counts instructions. At random points the plain interpreter, which also counts, runs
from the same snapshot and is compared with both.
"""

from __future__ import annotations

import ctypes
import random
from typing import Any, Final

from emu.dspic30f.jit.engine import BLOCK_LEVEL, HOT_LEVEL, JitEngine
from emu.dspic30f.jit.environment import ENV_WORDS
from emu.dspic30f.jit.ir.values import Number
from emu.dspic30f.jit.translate import function
from emu.dspic30f.jit.translate.function import Translator
from emu.machine.machine import Machine
from tests.emu.jit.comparison.engine_pair import NO_WATCHDOG, Difference, QuickCompiler, Tally, advance
from tests.emu.jit.comparison.random_firmware import difference, load
from tests.emu.jit.comparison.straight_body import Shape
from tests.emu.jit.comparison.straight_firmware import straight_firmware

EXECUTED: Final = ENV_WORDS - 1
"""Index of the word in the native environment in which native code counts instructions."""


class CountedInterpreter:
    """Counter of the instructions that a machine with the plain engine executes."""

    def __init__(self, machine: Machine) -> None:
        self.executed = 0
        execute = machine.core.sequencer.execute

        def counted() -> None:
            self.executed += 1
            execute()

        machine.core.sequencer.execute = counted  # type: ignore[method-assign]


class CountingTranslator(Translator):
    """Translator whose exact code counts the executed instructions; `advance` is called once per instruction."""

    def advance(self, pc: int, cycles: Number, mask: int, times: int = 1) -> None:
        super().advance(pc, cycles, mask, times)
        if self.exact:
            e = self.e
            place = e.name()
            e.line(f"{place} = getelementptr i64, ptr %env, i64 {EXECUTED}")
            e.store(place, e.load(place, 64) + 1, 64)


class CountedExact:
    """Wrapper of a native machine that makes it run only exact code and counts its instructions."""

    def __init__(self, machine: Machine) -> None:
        runner = machine.runner
        assert isinstance(runner, JitEngine)
        self._runner: Final = runner
        runner.share_group = object()
        self.python = 0
        execute = machine.core.sequencer.execute

        def counted() -> None:
            self.python += 1
            execute()

        machine.core.sequencer.execute = counted  # type: ignore[method-assign]
        runner._interpret = counted
        runner._run_cold = lambda _limit: counted()
        request = runner._request

        def requested(code: Any, pc: int) -> None:
            function.Translator = CountingTranslator  # type: ignore[misc]
            try:
                request(code, pc)
            finally:
                function.Translator = Translator  # type: ignore[misc]
            ctypes.memset(ctypes.addressof(code.blocks), 0, ctypes.sizeof(code.blocks))

        runner._request = requested  # type: ignore[method-assign]

    @property
    def executed(self) -> int:
        """Return the number of instructions so far."""
        return self.python + int(self._runner._env[EXECUTED])


def native_machine(ipl_slip: int, level: int) -> Machine:
    """Return a machine that compiles an address at the second arrival, before it runs it; `level` is that of blocks."""
    machine = Machine(engine="jit", ipl_slip=ipl_slip)
    runner = machine.runner
    assert isinstance(runner, JitEngine)
    runner.threshold, runner.wait, runner.compiler = 2, True, QuickCompiler(level)
    return machine


def check_long(seed: int, instructions: int, share: float = 0.003) -> Tally:
    """Check a program with loops for about `instructions`; the interpreter runs the share `share` of them. Raises
    Difference."""
    shape = Shape(instructions=300, periods=(1500, 9000), loops=(20, 300), calm=True)
    firmware = straight_firmware(seed, shape)
    generator = random.Random(seed)
    level = HOT_LEVEL if seed & 2 else BLOCK_LEVEL
    blocks, exact = native_machine(seed & 1, level), native_machine(seed & 1, level)
    interpreted = Machine(engine="plain", ipl_slip=seed & 1)
    count = CountedExact(exact)
    interpreter = CountedInterpreter(interpreted)
    for machine in (blocks, exact, interpreted):
        machine.stop_on_fault = False
        machine.program.put(machine.chip.config["FWDT"].address, NO_WATCHDOG)
        load(machine, firmware)
    tally = Tally()
    while count.executed < instructions:
        advance(blocks, exact, int(10 ** generator.uniform(1, 6.6)), tally, generator.random() < 0.1)
        while interpreter.executed < share * count.executed:
            beside(interpreted, interpreter, blocks, exact, count, int(10 ** generator.uniform(1, 5.3)))
            tally.stops += 1
    runner = blocks.runner
    assert isinstance(runner, JitEngine)
    tally.programs["long"] += 1
    tally.instructions["long"] += count.executed
    tally.instructions["of these beside the interpreter"] += interpreter.executed
    tally.entries["long"] += runner.interrupts
    return tally


def beside(
    interpreted: Machine,
    interpreter: CountedInterpreter,
    blocks: Machine,
    exact: Machine,
    count: CountedExact,
    cycles: int,
) -> None:
    """Run the interpreter and the native machines from one snapshot and compare their states. Raises Difference."""
    interpreted.restore(blocks.snapshot())
    before = interpreter.executed, count.executed
    stops = [machine.run(cycles) for machine in (interpreted, blocks, exact)]
    found = difference(interpreted, blocks) or difference(interpreted, exact)
    ran = interpreter.executed - before[0], count.executed - before[1]
    if found or stops[0] != stops[1] or stops[0] != stops[2] or ran[0] != ran[1]:
        raise Difference(f"{stops} instructions {ran} {found}")
