"""Camera driver under the kernel: pixels are correct at every line timing, and the line-of-sight sensor classifies."""

from __future__ import annotations

import json

import numpy as np
import pytest

from emu.boards.picture import write_picture
from emu.cli import main
from emu.machine.machine import Machine
from tests.firmware.capture_sweep import capture_at, expected_line, start, sweep
from tests.firmware.conftest import TARGET_APPS, Build
from tests.firmware.drivers.test_drivers_on_target import FCY, PROGRAMS, SCENES, START, TABLES, plain, robot
from tests.fuzz.seeds import base_seed


def noise(seed: int = 1) -> np.ndarray:
    return np.random.default_rng(seed).integers(0, 256, (480, 640, 3), dtype=np.uint8)


@pytest.mark.slow
def test_lines_are_right_wherever_href_falls_in_a_kernel_call(image: Build) -> None:
    """A line is captured correctly at every phase of HREF against kernel calls (kernel.md §4).

    The test samples every 199th cycle of a round of all calls, without or with IPL slip, from a cycle that the commit
    determines; fuzz_camera.py samples all cycles.
    """
    machine = start(image("capture", TARGET_APPS), noise(), ipl_slip=base_seed() % 2)
    assert sweep(machine, noise(), stride=199, phase=base_seed() % 199) > 130


@pytest.mark.slow
def test_a_capture_that_comes_late_spoils_the_line(image: Build) -> None:
    """A capture that starts late must spoil the line: proof that the sweep detects errors.

    A byte is valid for 8 Tcy, and the driver reads it 16-18 Tcy after HREF (epuck.md §7.5).
    """
    machine = start(image("capture", TARGET_APPS), noise())
    state, expected = machine.snapshot(), expected_line(noise())
    assert np.array_equal(capture_at(machine, state, 0), expected)
    assert not np.array_equal(capture_at(machine, state, 0, masked=8), expected)


@pytest.mark.slow
def test_cpu_load_of_capture_and_classification_is_printed(image: Build, capsys, tmp_path) -> None:
    """Print the CPU load of capture and classification in percent, from exact cycle counts.

    A frame of 1,600,000 Tcy causes 20 line interrupts of about 658 Tcy and the VSYNC interrupt. Classification costs
    most for a scene without red, because it then inspects all 24 pixels.
    """
    white = tmp_path / "white.png"
    write_picture(str(white), plain(SCENES["nothing"]), 1)
    groups = ["--group", "capture=__T[45]Interrupt", "--group", "classification=*/line_of_sight.c"]
    command = ["profile", str(image("clustering")), "--selector", "8", "--camera", str(white), *groups]
    assert main([*command, "--skip", "0.5", "--seconds", "0.1085069445", "--json"]) == 0  # one frame
    facts = json.loads(capsys.readouterr().out)
    assert facts["cycles"] == pytest.approx(FRAME_TCY, abs=2)
    assert facts["idle"]["cycles"] + sum(part["cycles"] for part in facts["files"].values()) == facts["cycles"]
    assert sum(part["cycles"] for part in facts["levels"].values()) == facts["busy"]["cycles"]
    capture, classification = facts["groups"]["capture"], facts["groups"]["classification"]
    assert 20 * 658 <= capture["cycles"] <= 20 * (658 + 10) + 20
    assert capture["percent"] == pytest.approx(0.83, abs=0.01)
    assert 24 * 20 <= classification["cycles"] <= 24 * 120
    assert main([*command[:2], "--seconds", "0.01", "--group", "x=nothing_like_it"]) == 2
    assert "nothing_like_it" in capsys.readouterr().err


# -- line of sight -----------------------------------------------------------------------------------------------------

FRAME_TCY = 1_600_000


def classification(machine: Machine, frames: int = 3) -> str:
    """Return the class that the firmware assigns to the scene, derived from the wheel speeds of the three classes."""
    machine.run(cycles=frames * FRAME_TCY)
    before = machine.board.motors.left.steps, machine.board.motors.right.steps
    machine.run(cycles=FCY // 4)
    after = machine.board.motors.left.steps, machine.board.motors.right.steps
    rates = [4 * (now - then) for now, then in zip(after, before, strict=True)]
    expected = {name: [percent * 129 // 100 * 1000 / 129 for percent in pair] for name, pair in TABLES[0].items()}
    return min(expected, key=lambda name: sum(abs(a - b) for a, b in zip(expected[name], rates, strict=True)))


def scene_picture(colour: tuple[int, int, int], brightness: float, deviation: float = 0.0) -> np.ndarray:
    """Return a scene with the sensor's noise (sigma 2-4 of 255) and with corners darkened by 30 % (epuck.md §7.6)."""
    y, x = np.mgrid[0:480, 0:640]
    corner = ((x - 319.5) ** 2 + (y - 239.5) ** 2) / (319.5**2 + 239.5**2)
    light = (np.array(colour) * brightness)[None, None, :] * (1 - 0.3 * corner)[:, :, None]
    noisy = light + np.random.default_rng(3).normal(0, deviation, (480, 640, 3))
    return np.clip(noisy, 0, 255).round().astype(np.uint8)


@pytest.mark.slow
@pytest.mark.parametrize("scene", SCENES)
@pytest.mark.parametrize("program", PROGRAMS)
def test_automatic_exposure_keeps_colours_apart_in_any_light(image: Build, program: str, scene: str) -> None:
    """With automatic exposure, colours are classified correctly from 1/8 to 100 times the normal light (epuck.md §7.6).

    Exposure converges within 5 to 10 frames. Noise and vignetting are enabled.
    """
    machine = robot(image(program), selector=START)
    machine.board.camera.show(scene_picture(SCENES[scene], 1.0, deviation=4.0))
    for lamp in (1.0, 0.125, 100.0, 0.3, 5.0, 1.0):
        machine.board.camera.lamp = lamp
        assert classification(machine, frames=12) == scene, lamp


@pytest.mark.parametrize(
    ("scene", "darkest", "brightest"), [("object", 0.0, 3.2), ("robot", 0.7, 6.0), ("nothing", 0.65, 2.5)]
)
def test_colours_stay_apart_while_exposure_has_not_followed(
    image: Build, scene: str, darkest: float, brightest: float
) -> None:
    """With the exposure held, red is classified at any light, green from 0.5 and white from 0.58 of the normal light.

    The reference colours are dark (also objects), green 0 40 0, red 80 0 0 and white 100 80 80
    (openswarm-original.md §8). The upper limit is the saturation of 8 bits.
    """
    machine = robot(image("clustering"), selector=START)
    for brightness in np.geomspace(max(darkest, 0.05), brightest, 6):
        machine.board.camera.show(scene_picture(SCENES[scene], brightness, deviation=2.0))
        assert classification(machine) == scene, brightness


def test_the_light_at_which_white_and_green_are_lost_is_that_of_the_distances(image: Build) -> None:
    """With the exposure held, green below 0.5 of the light is dark; white from 0.577 to 0.25 is green, below that dark.

    The limits follow from the distances to the reference colours.
    """
    machine = robot(image("clustering"), selector=START)
    for colour, seen in (
        ((0, 19, 0), "object"),
        ((0, 24, 0), "robot"),
        ((56, 44, 40), "robot"),
        ((24, 16, 16), "object"),
    ):
        machine.board.camera.show(plain(colour))
        assert classification(machine) == seen, colour
