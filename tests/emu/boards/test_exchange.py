"""The robot's inputs and outputs as arrays, for simulated worlds."""

from __future__ import annotations

import numpy as np
import pytest

from .test_parts import convert, drive


def test_outputs_contain_steps_lights_and_emitters(robot):
    """epuck.md §2, §3: the output array contains motor steps, LEDs and infrared emitters."""
    outputs = robot.board.outputs
    steps = outputs.steps
    outputs.update()
    assert not steps.any()
    assert not outputs.leds.any()
    drive(robot, 4, [0, 1, 2, 3, 0])
    drive(robot, 0, [0, 2])
    robot.output("RA9", 1)
    robot.output("RC2", 1)
    robot.output("RG1", 1)
    robot.output("RF0", 1)
    outputs.update()
    assert outputs.steps is steps
    assert steps.tolist() == [0, 4]
    assert outputs.lost.tolist() == [1, 0]
    assert np.flatnonzero(outputs.leds).tolist() == [2, 9]
    assert outputs.emitters.tolist() == [False, False, False, True]
    assert outputs.speaker_on
    assert outputs.camera_running
    robot.output("RC13", 0)
    outputs.update()
    assert not outputs.camera_running


def test_inputs_reach_the_pins_when_applied(robot):
    """epuck.md §2, §5, §6: inputs reach the pins when `apply` is called."""
    inputs = robot.board.inputs
    inputs.selector = 9
    inputs.battery = 3.2
    inputs.acceleration[:] = 0.5, 0, -1
    inputs.ambient[4] = 2000
    inputs.distance[1] = 20
    inputs.share[1] = 0.5
    robot.later(10)
    assert robot.read("PORTG") >> 6 & 0xF == 0
    inputs.apply()
    robot.later(10)
    assert robot.read("PORTG") >> 6 & 0xF == 9
    assert not robot.read("PORTF") & 2
    assert [convert(robot, channel) for channel in (5, 6, 7, 12)] == [2448, 2048, 1248, 2000]
    robot.output("RF8", 1)
    robot.later(20_000)
    assert convert(robot, 8) == 3800
    assert 3800 - convert(robot, 9) == pytest.approx(857 / 2, abs=1)


def test_samples_before_a_change_use_the_old_inputs(robot):
    """A conversion that sampled before `apply` has a result from the inputs before the change."""
    robot.write_all(ADPCFG=0, ADCHS=13, ADCON3=0x0102, ADCON2=0x3C, ADCON1=0x80E4)
    robot.later(100)
    robot.board.outputs.update()
    robot.board.inputs.ambient[5] = 1000
    robot.board.inputs.apply()
    robot.later(200)
    codes = [robot.read(f"ADCBUF{index:X}") for index in range(8)]
    assert codes == sorted(codes, reverse=True)
    assert set(codes) == {3800, 1000}
    assert codes.index(1000) == 5  # sampling ends every 15 TAD = 22.5 Tcy, for the first time after 1.5 Tcy


def test_values_out_of_range_are_refused(robot):
    """Input values out of range are refused."""
    robot.board.inputs.selector = 16
    with pytest.raises(ValueError, match="positions 0 to 15"):
        robot.board.inputs.apply()
