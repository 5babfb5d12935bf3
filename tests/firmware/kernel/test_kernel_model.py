"""The kernel against its model (tests/firmware/model): random programs, calls of the headers, planted faults."""

from __future__ import annotations

import re
import shutil
from functools import partial
from pathlib import Path
from random import Random

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.cases import check_all
from tests.firmware.conftest import TARGET_APPS, Build
from tests.firmware.contracts import CALL, HEADERS, callers
from tests.firmware.model import kernel as _kernel  # noqa: F401  (its import declares every call)
from tests.firmware.model.calls import CALLS
from tests.firmware.model.compare import Kernels, build, random_programs
from tests.firmware.model.generator import MOST_CALLS, Generator
from tests.firmware.model.on_target import (
    DEFINES,
    DEFINES_IN_QEMU,
    DEFINES_OF_KILOBOT,
    Comparison,
    CpuInQemu,
    KilobotCpu,
    Robot,
)
from tests.firmware.model.planted_faults import FAULTS, FOUND_BY, plant
from tests.firmware.model.program import Program, named_texts
from tests.firmware.ports.targets import BOARDS, in_qemu, kilobot, make
from tests.fuzz.seeds import base_seed

PROGRAMS = 600
MODELLED = (
    "",
    "_cleanup",
    "_join",
    "_mutex",
    "_notification",
    "_quota",
    "_remote",
    "_scheduler",
    "_semaphore",
    "_service",
    "_timer",
)
"""Headers whose calls the model knows: openswarm.h and its options."""
NOT_MODELLED = {
    "_compat": "other spellings",
    "_config": "no calls",
    "_infrared": "devices: tests/firmware/infrared",
    "_interrupt": "macros of a port: tests/firmware/kernel/test_interrupts_on_target.py",
    "_io": "devices: tests/firmware/drivers",
    "_reset": "outlives the run of a program",
}
"""The other headers, and why the model does not know their calls."""
OUTSIDE = {
    "Sys_Init_Kernel": "its effect is the model's initial state",
    "Sys_Assertion_Failed": "ends the system",
    "Sys_Next_Ready": "for schedulers, which the interpreter has two of",
    "Sys_Pid_Of": "for schedulers",
    "Sys_Priority_Of": "for schedulers",
}
"""Calls of MODELLED headers that no program makes, and why."""


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build the interpreter for the POSIX port and return its folder."""
    if shutil.which("gcc") is None:
        pytest.skip("the interpreter of kernel programs is built with gcc, which is not installed (Debian package gcc)")
    folder = tmp_path_factory.mktemp("model") / "built"
    build(folder)
    build(folder / "remote", "REMOTE=1")
    return folder


def at_known_boundaries() -> list[Program]:
    return [Program.parse(text) for text in named_texts("interrupted.txt").values()]


def differences(kernels: Kernels, programs: list[Program]) -> list[str]:
    pairs = zip(programs, kernels.check(programs), strict=True)
    return [f"{program}\n{difference}" for program, difference in pairs if difference]


def test_every_header_is_modelled_or_listed() -> None:
    names = {path.stem.removeprefix("openswarm") for path in HEADERS.glob("openswarm*.h")}
    assert names <= {*MODELLED, *NOT_MODELLED}


@pytest.mark.parametrize("header", MODELLED)
def test_the_model_knows_every_call_of_a_header(header: str) -> None:
    """The model knows each call, with the contexts that its contract line permits."""
    name = f"openswarm{header}.h"
    declared = set(CALL.findall((HEADERS / name).read_text()))
    permitted = callers(name)
    assert declared - CALLS.keys() - OUTSIDE.keys() == set()
    assert {call: CALLS[call] for call in permitted if call in CALLS} == {
        call: letters for call, letters in permitted.items() if call in CALLS
    }
    without = {call for call in declared & CALLS.keys() if call not in permitted}
    assert not without, f"no contract line: {sorted(without)}"


def test_a_program_survives_its_text() -> None:
    for program in random_programs(base_seed(), 20):
        assert Program.parse(str(program)) == program
        assert len(program) <= MOST_CALLS + 10


@pytest.mark.slow
def test_random_programs_agree(built: Path) -> None:
    """Programs that the commit determines have the same results, callbacks and final state on kernel and model."""
    assert not differences(Kernels(built / "interpreter"), random_programs(base_seed(), PROGRAMS))
    shared = random_programs(base_seed(), PROGRAMS // 6, remote=True)
    assert not differences(Kernels(built / "remote" / "interpreter"), shared)


@pytest.mark.slow
def test_drawn_programs_agree(built: Path) -> None:
    """Kernel and model agree on programs that hypothesis generates and shrinks."""
    kernels = Kernels(built / "interpreter")

    @settings(max_examples=60, deadline=None, suppress_health_check=list(HealthCheck))
    @given(st.randoms(use_true_random=False))
    def agree(random: Random) -> None:
        assert not differences(kernels, [Generator(random).program()])

    agree()


@pytest.mark.slow
def test_interrupts_at_known_boundaries_agree(built: Path) -> None:
    """Kernel and model agree if the interrupt occurs at a boundary that only one order of steps explains."""
    assert not differences(Kernels(built / "interpreter"), at_known_boundaries())


@pytest.mark.slow
def test_planted_faults_are_found(built: Path, tmp_path: Path) -> None:
    """For each planted fault, kernel and model differ on the recorded program; without the fault they agree.

    The campaign recorded the first program that found each fault. Every fourth fault is planted; the commit determines
    which.
    """
    assert FOUND_BY.keys() == {fault.name for fault in FAULTS}
    programs = {name: Program.parse(text) for name, text in FOUND_BY.items()}
    for remote, interpreter in ((False, built / "interpreter"), (True, built / "remote" / "interpreter")):
        names = [fault.name for fault in FAULTS if fault.remote == remote]
        assert not differences(Kernels(interpreter), [programs[name] for name in names])

    def check(number: int) -> None:
        fault = FAULTS[number]
        folder = tmp_path / str(number)
        assert differences(Kernels(plant(fault, built, folder)), [programs[fault.name]]), fault.name
        shutil.rmtree(folder)

    check_all(check, range(base_seed() % 4, len(FAULTS), 4))


def check_on(machine: Comparison, program: Program) -> None:
    difference = machine.difference(program)
    assert difference is None, f"{program}\n{difference}"


@pytest.mark.slow
def test_programs_agree_on_the_robot(image: Build) -> None:
    """Programs that the commit determines agree with the model on the emulated dsPIC30F, too.

    Allocations fail and interrupts come within calls there as on the POSIX port.
    """
    robot = Robot(image("model", TARGET_APPS, f"DEFINES={DEFINES}"))
    check_all(partial(check_on, robot), random_programs(base_seed(), 15))
    assert robot.compared > 7


@pytest.mark.slow
@pytest.mark.parametrize("target", BOARDS)
def test_programs_agree_in_qemu(target: str, tmp_path: Path) -> None:
    """Programs agree with the model on the Cortex-M4 and the RISC-V, also with an interrupt at a known boundary."""
    image = make(target, "model", tmp_path, f"DEFINES={DEFINES_IN_QEMU}", apps=TARGET_APPS)
    in_qemu(target, image).close()  # skips if QEMU is missing
    machine = CpuInQemu(BOARDS[target], image)
    check_on(machine, Program.parse(WITHDRAWN_REQUEST))
    check_all(partial(check_on, machine), [*random_programs(base_seed() + 1, 15), *at_known_boundaries()])
    assert machine.compared > 20


@pytest.mark.slow
def test_programs_agree_on_the_kilobot(tmp_path: Path) -> None:
    """At least 200 programs agree with the model on the Kilobot's ATmega328P, also with an interrupt within a call.

    Few programs fit its RAM.
    """
    image = make("kilobot", "model", tmp_path, f"DEFINES={DEFINES_OF_KILOBOT}", apps=TARGET_APPS)
    kilobot(image).close()  # skips if simavr is missing
    machine = KilobotCpu(image)
    for text in (SPEEDS_OUT_OF_RANGE, WITHDRAWN_REQUEST):
        check_on(machine, Program.parse(text))
    assert machine.compared == 2
    check_on(machine, Program.parse(NO_ROOM_FOR_A_THREAD))
    check_on(machine, Program.parse(FRAGMENTED_HEAP))
    assert machine.compared == 2
    assert machine.lost > 0
    check_all(partial(check_on, machine), at_known_boundaries())
    seed = base_seed()
    while machine.compared < 200:
        check_all(partial(check_on, machine), random_programs(seed, 20))
        seed += 1
    assert machine.overflows < 20


SPEEDS_OUT_OF_RANGE = """main 0: START_KERNEL(0, 0, 0); SUBSCRIBE(5, 4, 1); SEND(5, 6, 1); YIELD(0, 0, 0)
handler 1: MOTOR_SPEEDS(0, 0, 0)"""
"""The error of the motors' handler is that of all handlers, where a store under a lock looks like an interrupt."""
WITHDRAWN_REQUEST = """main 0: REGISTER(0, 0, 0); SUBSCRIBE(0, 4, 0); SET_SCHEDULER(1, 0, 0); START_KERNEL(0, 0, 0); \
START_SECTION(0, 0, 0); SEND_INT(0, 0, 0); SET_SCHEDULER(0, 0, 0); END_SECTION(0, 0, 0); SLEEP(1, 0, 0)"""
"""Round robin withdraws the switch that the message requested: the end of the section delivers no message."""


FRAGMENTED_HEAP = """main 0: START_WITH(0, 2, 0); START_KERNEL(0, 0, 0); SUBSCRIBE(5, 1, 3)
thread 2: SUBSCRIBE(3, 1, 18)
handler 2: KILL(0, 0, 0); TICK(0, 0, 0); SEND_INT(5, 0, 0)
handler 3: TICK(0, 0, 0); READ(0, 0, 0)"""
"""A message of the clock is lost on the Kilobot alone, which sets no error (Sys_Get_LastError)."""


NO_ROOM_FOR_A_THREAD = """main 0: START_WITH(0, 0, 0); START_WITH(0, 1, 0); START_KERNEL(0, 0, 0); FAIL(0, 1, 0); \
LATER(1, 0, 0); START_WITH(0, 0, 0)
thread 1: START_JOINABLE(0, 3, 4)
thread 3: FAIL(0, 1, 0); START_WITH(0, 0, 0)"""
"""The heap's holes are too small for a thread. Not every place of the interrupt explains the records until there."""


def test_the_readme_states_every_planted_fault() -> None:
    """The table in model/README.md states how many programs it took to find each planted fault."""
    text = (Path(__file__).parents[1] / "model" / "README.md").read_text()
    assert {name for name, _ in re.findall(r"\| ([^|]+) \| ([\d,]+) (?=\|)", text)} == FOUND_BY.keys()
