"""Kilobots in the arena: motion by duties, images of avr-gcc, infrared by position, light, commands, mixed trials."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from arena.cli import main
from arena.commands.options.plan import with_overrides
from arena.scene.loader import Scene, SceneError, load_scene
from arena.trial.record import read_trial
from arena.world.physics import World
from emu.avr.image import AvrImage
from tests.emu.avr.conftest import compiled, needs

REGISTERS = "#include <avr/io.h>\n#include <stdint.h>\n"
DRIVE = """
static void duties(uint8_t left, uint8_t right)
{
    DDRB |= 1 << 3, DDRD |= 1 << 3;
    TCCR2A = 0xA1, TCCR2B = 2, OCR2A = left, OCR2B = right;
}
"""
EXACT = ["kilobots.motor_sd=0", "kilobots.calibration_sd=0", "kilobots.motion_noise=0", "kilobots.clock_sd=0"]
Columns = dict[str, Any]
Run = Callable[..., Columns]


@pytest.fixture
def run(tmp_path: Path) -> Run:
    """Return a function that runs a scene for some seconds and returns the columns of its record."""
    needs("avr-gcc")

    def one(scene: str, seconds: float, *options: str, out: str = "out", status: int = 0) -> Columns:
        (tmp_path / "scene.toml").write_text(f'name = "test"\n[clock]\nquantum_ms = 10\n{scene}')
        arguments = ["--trials", "1", "--minutes", str(seconds / 60), "--jobs", "1", "--out", str(tmp_path / out)]
        assert main(["run", str(tmp_path / "scene.toml"), *arguments, *options]) == status
        return read_trial(tmp_path / out / "trial-0001.parquet").columns

    return one


@pytest.fixture
def image(tmp_path: Path) -> Callable[[str], AvrImage]:
    """Return a function that builds the body of `main` for the ATmega328P, as image.elf beside the scene."""

    def one(body: str) -> AvrImage:
        (tmp_path / "program.c").write_text(f"{REGISTERS}{DRIVE}int main(void)\n{{\n{body}\n    for (;;) {{}}\n}}\n")
        return compiled(tmp_path / "program.c", tmp_path / "image.elf", "-Os")

    return one


def kilobots(poses: str, image: str = "image.elf") -> str:
    """Return a group of Kilobots."""
    return f'[[robots]]\nkind = "kilobot"\nimage = "{image}"\nplace = "poses"\nposes = {poses}\n'


def test_motors_move_a_robot_as_published(run: Run, image: Callable[[str], AvrImage]) -> None:
    """Both motors: 1 cm/s ahead; one: 45 degrees/s about the rear leg on its side of the turn (kilobot.md §1)."""
    for duties, turn in (("65, 65", 0), ("70, 0", 1), ("0, 70", -1)):
        image(f"duties({duties});")
        found = run(kilobots("[[100, 100, 0]]"), 4, *(part for value in EXACT for part in ("--set", value)),
                    out=f"out{turn}")  # fmt: skip
        at = found["t"] == 1.0
        x, y, heading = (float(found[f"r0_{name}"][-1] - found[f"r0_{name}"][at][0]) for name in ("x", "y", "heading"))
        assert heading == pytest.approx(math.radians(45) * 3 * turn, rel=0.01, abs=1e-3)
        if not turn:
            assert (x, y) == (pytest.approx(3.0, rel=0.01), pytest.approx(0, abs=0.01))
            continue
        start = float(found["r0_heading"][at][0])
        legs = [(-0.9 * math.cos(a) - 1.3 * turn * math.sin(a), -0.9 * math.sin(a) + 1.3 * turn * math.cos(a))
                for a in (start, start + heading)]  # fmt: skip
        assert (x, y) == (pytest.approx(legs[0][0] - legs[1][0], abs=0.05),
                          pytest.approx(legs[0][1] - legs[1][1], abs=0.05)), "the leg stays where it is"  # fmt: skip


def test_robots_differ_and_calibration_compensates(tmp_path: Path) -> None:
    """Weak motors get higher duties in the EEPROM; calibrated speeds are within 10 % of the nominal."""
    scene = load_scene("orbit")
    scene = with_overrides(scene, ["kilobots.motor_sd=0.1"])
    world = World(scene, 3)
    from arena.robots.kilobot import _setup

    image = AvrImage("none", b"\xff" * 0x8000, 0, {})
    setups = [_setup(scene, 3, robot, image) for robot in range(2)]
    assert len({setup.duties for setup in setups}) == 2
    assert len({setup.clock for setup in setups}) == 2
    for robot, setup in zip(world._robots, setups, strict=True):
        speeds = [setup.duties[side] * robot.bias[side] / 70 for side in (0, 1)]
        assert speeds == pytest.approx([1, 1], abs=0.1)


def test_a_dense_crowd_jams(run: Run, image: Callable[[str], AvrImage]) -> None:
    """Robots that drive into each other touch but do not overlap, and none leaves the walls."""
    image("duties(70, 66);")
    scene = ('[arena]\nwidth_cm = 30\nheight_cm = 30\n[[robots]]\nkind = "kilobot"\nimage = "image.elf"\n'
             'place = "hexagonal"\ncount = 19\nspacing_cm = 3.3\n')  # fmt: skip
    found = run(scene, 6, "--set", "kilobots.speed_cm_s=3")
    places = np.array([[found[f"r{n}_{axis}"][-1] for axis in ("x", "y")] for n in range(19)])
    first = np.array([[found[f"r{n}_{axis}"][0] for axis in ("x", "y")] for n in range(19)])
    apart = np.hypot(*(first[:, None] - first[None]).transpose(2, 0, 1))[~np.eye(19, dtype=bool)]
    assert apart.min() == pytest.approx(3.3, abs=1e-3)
    assert (np.sort(apart.reshape(19, 18), axis=1)[:, :6].max(axis=1) < 3.301).sum() == 7, "hexagonal: 7 inner robots"
    gaps = np.hypot(*(places[:, None] - places[None]).transpose(2, 0, 1))[~np.eye(19, dtype=bool)]
    assert gaps.min() > 3.3 - 0.1
    assert np.hypot(*(places - first).T).max() > 1.0
    assert (places > 1.6).all()
    assert (places < 28.4).all()


def test_messages_follow_the_positions(run: Run) -> None:
    """A robot in reach takes the hop count of its neighbour, and the record has colours and messages."""
    found = run(kilobots("[[100, 100], [105, 100], [110, 100], [140, 100]]", "gradient"), 5)
    red, yellow, green, dark = 1, 1 + 4, 4, 0
    assert [int(found[f"r{n}_leds"][-1]) for n in range(4)] == [red, yellow, green, dark]
    messages = [one for sample in found["messages"] for one in sample]
    assert {one["robot"] for one in messages} == {0, 1, 2}
    assert {one["text"] for one in messages if one["robot"] == 1} == {"0x00 01" + "00" * 8}
    changes = [one for sample in found["lights"] for one in sample if one["robot"] == 1]
    assert [one["leds"] for one in changes][-1] == yellow


def test_the_record_depends_on_the_seed_only(run: Run, tmp_path: Path) -> None:
    """The same seed gives the same bytes with one and two threads; another seed gives others."""
    files = []
    for number, options in enumerate((["--jobs", "1"], ["--jobs", "2"], ["--seed", "2"])):
        run(kilobots("[[100, 100], [104, 100]]", "orbit"), 3, *options, out=str(number))
        files.append((tmp_path / str(number) / "trial-0001.parquet").read_bytes())
    assert files[0] == files[1] != files[2]


def test_light_and_commands_reach_the_firmware(run: Run, image: Callable[[str], AvrImage]) -> None:
    """The sensor of ambient light rises near a lamp: this program drives at the counts over 4."""
    image("    ADMUX = 0x07, ADCSRA = 0x87;\n    for (;;) {\n        ADCSRA |= 0x40;\n"
          "        while (ADCSRA & 0x40) {}\n        duties(ADC >> 2, 0);\n    }")  # fmt: skip
    found = run("[[lamps]]\nx_cm = 100\ny_cm = 100\ncounts = 400\n" + kilobots("[[150, 100], [300, 100]]"), 1)
    near, far = (float(found[f"r{n}_left"][-1]) for n in range(2))
    assert near == pytest.approx((300 + 0.25 * 400 * 4) / 4, abs=15), "it turns by some cm"
    assert far == pytest.approx((300 + 0.25 * 400 / 4) / 4, abs=2)
    quiet = run(kilobots("[[100, 100], [104, 100]]", "gradient"), 2, "--set", "kilobots.overhead=0.2 wakeup 0.2",
                out="quiet")  # fmt: skip
    assert not any(len(sample) for sample in quiet["messages"]), "without RUN no program runs"


def test_a_fault_stops_one_robot_only(run: Run, image: Callable[[str], AvrImage], capsys: Any) -> None:
    """A robot with an illegal instruction is reported and stops; the others continue. The run exits with status 1."""
    image('duties(65, 65); __asm__ volatile (".word 0x9419");')
    found = run(kilobots("[[50, 50, 0]]") + kilobots("[[100, 100], [105, 100]]", "gradient"), 3, status=1)
    assert "robot 0 stopped: illegal instruction 0x9419 at " in "".join(capsys.readouterr())
    assert found["r0_x"][-1] - 50 < 0.1
    assert int(found["r1_leds"][-1]) == 1


def test_resets_are_in_the_log(run: Run, image: Callable[[str], AvrImage]) -> None:
    """A watchdog reset and a jump to address 0 are lines of the record."""
    image("    if (MCUSR & 8) {\n        __builtin_avr_delay_cycles(12000);\n"
          '        __asm__ volatile ("jmp 0");\n    }\n    WDTCSR = 0x18, WDTCSR = 0x08;')  # fmt: skip
    found = run(kilobots("[[50, 50]]"), 0.1, "--set", "clock.sample_s=0.05")
    lines = [line["text"] for sample in found["log"] for line in sample]
    assert lines[0] == "reset: by the watchdog"
    assert lines[1] == "reset: the program has jumped to address 0"


def test_kinds_mix(run: Run) -> None:
    """A scripted e-puck and Kilobots share a world; a removed battery darkens one Kilobot."""
    scene = '[start]\nremote = ""\noff = [[1, 2.0]]\n' + kilobots("[[100, 100], [105, 100]]", "gradient")
    found = run(f'{scene}[[robots]]\nplace = "poses"\nposes = [[200, 200, 0]]\n', 4, "--brain", "scripted")
    assert int(found["r0_leds"][-1]) == 1
    assert int(found["r1_leds"][3]) == 5
    assert int(found["r1_leds"][-1]) == 0
    assert abs(found["r2_x"][-1] - 200) + abs(found["r2_y"][-1] - 200) > 1


def refused(tmp_path: Path, text: str) -> str:
    """Return the message with which a scene is refused."""
    (tmp_path / "scene.toml").write_text(f'name = "test"\n{text}')
    with pytest.raises(SceneError) as caught:
        load_scene(str(tmp_path / "scene.toml"))
    return str(caught.value)


def test_poses_come_from_a_file(tmp_path: Path) -> None:
    """A file has one pose per line; wrong lines are named with file and line."""
    (tmp_path / "poses.csv").write_text("# x,y,degrees\n10,20\n\n30,40,90\n")
    text = '[[robots]]\nkind = "kilobot"\nplace = "poses"\nposes = "poses.csv"\n'
    (tmp_path / "scene.toml").write_text(f'name = "test"\n{text}')
    scene: Scene = load_scene(str(tmp_path / "scene.toml"))
    assert scene.groups[0].poses == ((10.0, 20.0), (30.0, 40.0, 90.0))
    assert scene.groups[0].count == 2
    (tmp_path / "poses.csv").write_text("10,20\n10;20\n")
    assert "scene.toml:5: robots.poses: " in refused(tmp_path, text)
    assert "poses.csv:2: '10;20'; expected x,y or x,y,degrees" in refused(tmp_path, text)
    (tmp_path / "poses.csv").unlink()
    assert "No such file" in refused(tmp_path, text)


def test_wrong_values_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A Kilobot has an image and no controller of an e-puck; commands follow each other."""
    assert "a Kilobot runs an `image`" in refused(tmp_path, '[[robots]]\nkind = "kilobot"\ncontroller = "A"\n')
    for text in ("1 run", "1 go 2", "1 run 2; 2 sleep 1", "x run 1", "1 run nan"):
        assert "kilobots.overhead: " in refused(tmp_path, f'[kilobots]\noverhead = "{text}"\n')
    for text, words in (("[[3, 1.5]]", "shares of 0"), ("[[3, 0.1], [2, 0.1]]", "rising"), ("[3]", "expected a list")):
        assert words in refused(tmp_path, f"[kilobots]\nlost_at = {text}\n")
    assert "replaces lost_share" in refused(tmp_path, "[kilobots]\nlost_share = 0.1\nlost_at = [[3, 0.1]]\n")
    group = '[[robots]]\nkind = "kilobot"\nimage = "gradient"\n'
    for line in ('stimulus = "x"', "selector = 3", 'remote = "ok"'):
        assert f"robots.{line.split()[0]} has no effect on a Kilobot" in refused(tmp_path, f"{group}{line}\n")
    text = refused(tmp_path, f"{group}count = 7\nid_first = 65530\n")
    assert "scene.toml:6: robots.id_first is 65530: the UIDs of 7 Kilobots go beyond 65535" in text
    links = f'[bluetooth]\nlinks = [[0, 1]]\n{group}[[robots]]\nplace = "poses"\nposes = [[10, 10]]\n'
    assert "scene.toml:3: bluetooth.links: ['0', '1']: a Kilobot has no Bluetooth" in refused(tmp_path, links)
    path = tmp_path / "scene.toml"
    path.write_text('name = "test"\n[[robots]]\nkind = "kilobot"\n')
    assert main(["run", str(path), "--out", str(tmp_path / "out")]) == 2
    assert "a Kilobot runs the image of a firmware; none is named" in capsys.readouterr().err
    path.write_text('name = "test"\n[[robots]]\nkind = "kilobot"\n[[robots]]\n')
    assert main(["run", str(path), "--brain", "gradient", "--out", str(tmp_path / "out")]) == 2
    assert "--brain gradient cannot run on robots of two kinds" in capsys.readouterr().err
    path.write_text('name = "test"\n[[robots]]\nkind = "kilobot"\nimage = "nothing.hex"\n')
    assert main(["run", str(path), "--out", str(tmp_path / "out")]) == 2
    assert "expected an ELF or HEX file for AVR, or one of counts, edge, gradient, orbit, " in capsys.readouterr().err
