"""Steps while the CPU waits in Idle for input and a timer runs: they end at a limit, and they can be interrupted."""

from __future__ import annotations

import io
from pathlib import Path

import pytest

import emu
from emu.dap.debuggee import SLICE_CYCLES, Debuggee
from emu.dap.server import Server
from emu.debug.history import History
from emu.inject.faults import Fault, inject_fault
from emu.machine.stops import SLEEP_CYCLES, STILL_ASLEEP
from emu.prompt.reader import Prompt
from tests.emu.cli.programs import assembled, executable

PROGRAM = """
    mov #0x900, w15
    mov #0x8000, w0
    mov w0, {U1MODE}
    bset.b 0x8d, #1
    mov #999, w0
    mov w0, {PR2}
    mov #0x8000, w0
    mov w0, {T2CON}
    wait:
    pwrsav #1
    nop
    bra @wait
    receive:
    bclr.b 0x85, #1
    mov {U1RXREG}, w1
    retfie
"""
WAIT, RECEIVE = (assembled(PROGRAM)[1][name] for name in ("wait", "receive"))
ASLEEP_AT = 100_000


@pytest.fixture
def machine(tmp_path: Path) -> emu.Machine:
    """Return a machine whose program waits in Idle until UART1 receives a byte; timer 2 runs without an interrupt."""
    path = tmp_path / "idle.elf"
    path.write_bytes(executable(PROGRAM, {"U1RXInterrupt": "receive"}))
    return emu.load(path, board=None)


def test_a_step_of_a_sleeping_machine_ends_at_its_limit(machine: emu.Machine) -> None:
    """A step of a sleeping machine ends at its limit, which the stop states; the CPU stays in Idle and wakes when a
    byte arrives."""
    machine.run(cycles=ASLEEP_AT)
    stop = machine.step(ASLEEP_AT + 5_000)
    assert stop is not None
    assert (stop.reason, stop.detail, machine.cycle) == ("limit", STILL_ASLEEP, ASLEEP_AT + 5_000)
    stop = machine.step()
    assert stop is not None
    assert (stop.reason, machine.cycle) == ("limit", ASLEEP_AT + 5_000 + SLEEP_CYCLES)
    machine.uart[1].feed(b"x")
    assert machine.step() is None
    assert machine.pc == RECEIVE + 2


def test_an_interrupted_step_executes_nothing(machine: emu.Machine) -> None:
    """`Machine.interrupt`, as a signal handler calls it, ends the step; the CPU stays in Idle."""
    machine.run(cycles=ASLEEP_AT)
    machine.interrupt()
    pc = machine.pc
    stop = machine.step()
    assert stop is not None
    assert (stop.reason, machine.pc, machine.is_asleep) == ("interrupted", pc, True)


def test_a_condition_is_not_waited_for_beyond_the_limit_of_the_run(machine: emu.Machine) -> None:
    """A run with a condition single-steps, and in Idle it ends at its last cycle."""
    stop = machine.run(cycles=ASLEEP_AT, until=lambda: False)
    assert (stop.reason, machine.cycle) == ("limit", ASLEEP_AT)


def test_a_step_back_from_a_sleep_leads_to_its_start(machine: emu.Machine) -> None:
    """A step back from Idle leads to its start, because the Idle period is one step; the step before it is the PWRSAV
    instruction."""
    history = History(machine)
    history.advance(ASLEEP_AT)
    assert history.step_back()
    began = machine.cycle
    assert machine.is_asleep
    assert history.step_back()
    assert (machine.pc, machine.cycle) == (WAIT, began - 1)


def test_a_step_in_the_past_sleeps_until_the_recorded_input(machine: emu.Machine) -> None:
    """In a replay, a step in Idle receives the recorded input that ended it, and enters the handler in the same
    cycle."""
    history = History(machine)
    history.advance(ASLEEP_AT)
    machine.uart[1].feed(b"x")
    handler = machine.hook_pc(RECEIVE, lambda: True)
    stop = history.advance(2 * ASLEEP_AT)
    assert stop is not None
    entered = machine.cycle
    handler()
    history.advance(3 * ASLEEP_AT)
    history.seek(1_000)
    assert history.step() is None
    assert (machine.pc, machine.cycle) == (RECEIVE, entered)


def test_a_step_of_the_past_continues_in_the_present(machine: emu.Machine) -> None:
    """An Idle period that the recording does not end lasts as long as one without a recording."""
    history = History(machine)
    history.advance(ASLEEP_AT)
    history.seek(1_000)
    stop = history.step()
    assert stop is not None
    assert (stop.reason, machine.cycle, history.is_past) == ("limit", 1_000 + SLEEP_CYCLES, False)


@pytest.mark.slow
@pytest.mark.parametrize("command", ["step", "stepi", "next", "nexti"])
def test_steps_of_the_prompt_end_with_a_sentence(
    machine: emu.Machine, command: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """Steps of the prompt end with a message: the first step by instruction executes PWRSAV, the second one waits,
    and so does a step by lines in a program without lines."""
    prompt = Prompt("emu debug", lambda client: Server(client, lambda _launch: machine))
    script = f"break *{WAIT:#x}\nrun\n{command}\n{command}\nreverse-stepi\ntime\n"
    assert prompt.serve({}, io.StringIO(script)) == 0
    out = capsys.readouterr().out
    assert f"pause: {STILL_ASLEEP}" in out
    assert out.splitlines()[-1].startswith("cycle 11, ")  # start of the Idle period


def test_a_client_pauses_a_step_that_waits(machine: emu.Machine) -> None:
    """A pause request, as Ctrl-C makes it, ends a waiting step after one slice."""
    polls: list[int] = []

    def is_stop_requested() -> bool:
        polls.append(machine.cycle)
        return len(polls) == 3

    history = History(machine)
    debuggee = Debuggee(machine, is_stop_requested, lambda _text: None, history)
    history.advance(ASLEEP_AT)
    event = debuggee.step_instruction()
    assert event.reason == "pause"
    assert machine.cycle == ASLEEP_AT + 3 * SLICE_CYCLES


def test_a_fault_that_skips_an_instruction_of_a_sleeping_machine_ends(machine: emu.Machine) -> None:
    """A fault that skips an instruction of a sleeping machine has no effect, because no instruction follows."""
    machine.run(cycles=ASLEEP_AT)
    assert inject_fault(Fault(0, "skip", ASLEEP_AT, 0, 0), machine) == "no instruction to skip"
