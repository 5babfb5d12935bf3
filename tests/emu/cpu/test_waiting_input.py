"""Snapshots contain the pending UART input of any length: restore, time travel and fault campaigns."""

from __future__ import annotations

from pathlib import Path

import pytest

import emu
from emu.debug.history import History
from emu.image.loader import load_image
from emu.inject.campaign import Campaign
from emu.inject.faults import KINDS
from emu.inject.trial import Trials
from emu.peripherals.uart.rx_queue import CAPACITY
from tests.emu.cli.programs import executable

RECEIVER = """
    mov #0x8000, w0
    mov w0, {U1MODE}
    clr {U1BRG}
    mov #0x1000, w2
    wait:
    btss {U1STA}, #0
    bra @wait
    mov {U1RXREG}, w1
    mov.b w1, [w2++]
    bra @wait
"""
ECHO = """
    mov #0x8000, w0
    mov w0, {U1MODE}
    mov #0x0400, w0
    mov w0, {U1STA}
    clr {U1BRG}
    wait:
    btss {U1STA}, #0
    bra @wait
    mov {U1RXREG}, w1
    mov w1, {U1TXREG}
    bra @wait
"""
BUFFER = 0x1000
DATA = bytes((i * 7 + i // 251) & 255 for i in range(3 * CAPACITY))
WHOLE = 600_000
"""Number of cycles in which all of DATA arrives."""


@pytest.fixture
def program(tmp_path: Path) -> Path:
    """Return a program that stores the input of UART1."""
    path = tmp_path / "receiver.elf"
    path.write_bytes(executable(RECEIVER))
    return path


def _fed(program: Path) -> emu.Machine:
    machine = emu.load(program, board=None)
    machine.run(cycles=100)
    machine.uart[1].feed(DATA)
    return machine


def _received(machine: emu.Machine) -> bytes:
    return machine.peek_bytes(BUFFER, machine.w[2] - BUFFER) if machine.w[2] > BUFFER else b""


def test_a_restored_machine_receives_all_input(program: Path) -> None:
    """A machine restored from a snapshot taken before the run, the same or another one, receives all pending input."""
    machine = _fed(program)
    state = machine.snapshot()
    machine.run(cycles=WHOLE)
    assert _received(machine) == DATA
    machine.restore(state)
    assert machine.snapshot() == state
    machine.run(cycles=WHOLE)
    assert _received(machine) == DATA
    other = emu.load(program, board=None)
    other.restore(state)
    other.run(cycles=WHOLE)
    assert other.snapshot() == machine.snapshot()


def test_restoring_an_earlier_snapshot_discards_later_input(program: Path) -> None:
    """Input fed after a snapshot does not arrive after its restore."""
    machine = emu.load(program, board=None)
    machine.run(cycles=100)
    state = machine.snapshot()
    machine.uart[1].feed(DATA)
    machine.restore(state)
    machine.run(cycles=WHOLE)
    assert _received(machine) == b""


def test_time_travel_keeps_the_waiting_input(program: Path) -> None:
    """Running back and forth leads to the same state, and the run then continues as without time travel."""
    machine = _fed(program)
    history = History(machine)
    history.advance(300_000)
    present = machine.snapshot()
    history.seek(1_000)
    history.advance(300_000)
    assert machine.snapshot() == present
    history.advance(WHOLE)
    assert _received(machine) == DATA


def test_a_snapshot_with_damaged_input_is_refused(program: Path) -> None:
    """A snapshot with damaged input is refused, and the machine keeps its state."""
    machine = _fed(program)
    state = machine.snapshot()
    with pytest.raises(ValueError, match="bytes"):
        machine.restore(state[:-1])
    assert machine.snapshot() == state


def test_trials_of_a_fault_campaign_keep_the_waiting_input(tmp_path: Path) -> None:
    """A flipped RAM bit does not change the output of a program that echoes its input and uses no RAM."""
    path = tmp_path / "echo.elf"
    path.write_bytes(executable(ECHO))
    campaign = Campaign(
        seed=1, trials=4, seconds=0.05, start=0.002, selector=0, hang=1.5, input={1: [(0.0001, DATA)]}, detect={},
        faults=dict.fromkeys(KINDS, 0) | {"ram": 1}, fingerprint="",
    )  # fmt: skip
    trials = Trials(load_image(path), campaign)
    assert trials.golden.output[1] == DATA
    assert {trials.run(number).outcome for number in range(campaign.trials)} == {"masked"}
