"""Artefacts of a failed test: a folder with the state of the firmware and its recent history.

report.txt     the assertion; the fault, or the state of the robot: thread, call stack with source lines, last branches
waves.vcd      pins and UART bytes of the last STRETCH_MS, or since the last input, for GTKWave
uart1.txt      all output, one file for each UART with output
state.bin      the whole state, for `Machine.restore`
"""

from __future__ import annotations

from pathlib import Path
from typing import Final, TextIO

from emu.debug.fault_report import state_report
from emu.debug.replay import sandboxed
from emu.instruments.vcd import WaveformRecorder
from openswarm.testing.robot import Robot

STRETCH_MS: Final = 50
"""Maximum length of the waveform in milliseconds."""


def write(robot: Robot, folder: Path, failure: str) -> str:
    """Write the artefacts of `robot` into `folder`; return the text of the report, which begins with `failure`."""
    folder.mkdir(parents=True, exist_ok=True)
    report = str(robot.fault) if robot.fault is not None else state_report(robot.machine, "the test failed;").report()
    report = report.replace("firmware fault: the test", "the test")
    text = failure if report in failure else f"{failure}\n\n{report}"
    (folder / "report.txt").write_text(text + "\n", encoding="utf-8")
    for number, line in robot.uart.items():
        if line.said:
            (folder / f"uart{number}.txt").write_bytes(bytes(line.said))
    (folder / "state.bin").write_bytes(robot.machine.snapshot())
    with (folder / "waves.vcd").open("w", encoding="utf-8") as stream:
        _waves(robot, stream)
    return (folder / "report.txt").read_text(encoding="utf-8").rstrip()


def _waves(robot: Robot, stream: TextIO) -> None:
    """Record the waveform by replaying the last stretch from a checkpoint, in a sandbox."""
    machine = robot.machine
    end, began = machine.cycle, machine.checkpoints.start
    with sandboxed(machine, began):
        machine.run_until(end - machine.cycles_in(STRETCH_MS / 1000))
        waves = WaveformRecorder(machine, stream, again=True)
        waves.advance(end)
        waves.close()
