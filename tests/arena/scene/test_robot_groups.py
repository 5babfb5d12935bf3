"""Groups of robots in a scene: their firmware and options, and random differences between robots."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from arena.camera.appearance import OBJECT
from arena.campaign.campaign import Plan
from arena.cli import main
from arena.commands.options.plan import plan_from
from arena.commands.run import parser as run_parser
from arena.scene.loader import SceneError, load_scene
from arena.trial.record import read_trial
from arena.world.physics import World, traits_of
from arena.world.poses import Poses
from tests.arena.reference_camera import ReferenceCamera
from tests.arena.robot_programs import BEGIN, REPEATING, SEND_SELECTOR


def test_groups_have_their_own_firmware_switch_and_number(
    assembled: Callable[[str], Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Each group of a trial with two images and a scripted robot has its own firmware, selector and number; the
    record is the same to the byte for one and two jobs."""
    one = assembled(SPEAKER.format(letter="P"))
    two = assembled(SPEAKER.format(letter="Q"))
    (tmp_path / "p.elf").write_bytes(one.read_bytes())
    path = tmp_path / "mixed.toml"
    path.write_text(f"""name = "mixed"
[[robots]]
count = 2
image = "p.elf"
selector = 3
id_first = 41
stimulus = '0.3s uart1 "{{id}}\\n"'
[[robots]]
image = "{two}"
selector = 9
[[robots]]
image = "scripted"
""")
    for jobs in ("1", "2"):
        assert main(["run", str(path), "--trials", "1", "--minutes", "0.01", "--jobs", jobs, "--out",
                     str(tmp_path / jobs)]) == 0  # fmt: skip
    trial = read_trial(tmp_path / "1" / "trial-0001.parquet")
    said = sorted((line["robot"], line["text"]) for row in trial.columns["log"] for line in row)
    assert said == [(0, "41"), (0, "PD"), (1, "42"), (1, "PD"), (2, "QJ")]
    assert trial.path.read_bytes() == (tmp_path / "2" / "trial-0001.parquet").read_bytes()
    assert {path.name for path in (tmp_path / "1").glob("firmware-*")} == {"firmware-1.elf", "firmware-2.elf"}
    hashes = trial.about["images_sha256"]
    assert hashes["p.elf"] != hashes[str(two)]
    assert hashes["scripted"] is None
    (tmp_path / "p.elf").write_bytes(two.read_bytes())
    assert main(["run", str(path), "--trials", "2", "--minutes", "0.01", "--out", str(tmp_path / "1")]) == 2
    assert "different images_sha256" in capsys.readouterr().err


SPEAKER = f"""{BEGIN}
        mov     #'{{letter}}', w0
        mov     w0, U1TXREG
{SEND_SELECTOR}{REPEATING}"""


def test_robots_without_spread_are_equal() -> None:
    """Without spread, the traits of all robots are equal to the bit."""
    scene = load_scene("clustering")
    assert {traits_of(scene, seed, robot) for seed in range(9) for robot in range(5)} == {(0.0, 0.0, (1.0, 1.0))}


def test_robots_differ_by_the_standard_deviations_of_the_scene() -> None:
    """The traits of 2,000 robots have the standard deviations of the scene. The same seed gives the same robots,
    another seed others."""
    scene = load_scene("clustering").with_values(
        robots__camera_yaw_sd_deg=2.0, robots__camera_pitch_sd_deg=1.5, robots__wheel_bias_sd=0.02
    )
    drawn = [traits_of(scene, seed, robot) for seed in range(400) for robot in range(5)]
    assert len(set(drawn)) == 2000
    assert math.degrees(np.std([one.yaw for one in drawn])) == pytest.approx(2.0, rel=0.06)
    assert np.std([one.pitch_deg for one in drawn]) == pytest.approx(1.5, rel=0.06)
    assert np.std([one.bias for one in drawn]) == pytest.approx(0.02, rel=0.06)
    assert np.mean([one.bias for one in drawn]) == pytest.approx(1.0, abs=0.002)
    assert traits_of(scene, 3, 1) == traits_of(scene, 3, 1)


def test_camera_yaw_and_wheel_bias_take_effect() -> None:
    """Camera yaw shifts the picture, and wheel bias turns the robot."""
    scene = load_scene("clustering").with_values(robots__count=1, objects__count=1, robots__wheel_noise=0.0)
    turned = scene.with_values(robots__camera_yaw_sd_deg=5.0, robots__camera_pitch_sd_deg=2.0)
    traits = traits_of(turned, 4, 0)
    x, y = 100 + 60 * math.cos(traits.yaw), 150 + 60 * math.sin(traits.yaw)
    camera = ReferenceCamera(turned, Poses([(100.0, 150.0, 0.0)], [(x, y)]), 0, None, traits)
    row = 240 + 602 * math.tan(math.radians(traits.pitch_deg))
    seen = [camera.column(u, (round(row - 20),))[0] == OBJECT for u in range(640)]
    assert np.mean(np.flatnonzero(seen)) == pytest.approx(320, abs=3)
    biased = scene.with_values(robots__wheel_bias_sd=0.05)
    world = World.of(biased, 2, [(100.0, 150.0, 0.0)], [(350.0, 20.0)])
    for _ in range(5000):
        world.step([(10.0, 10.0)])
    left, right = traits_of(biased, 2, 0).bias
    assert world.poses.robots[0][2] == pytest.approx(5 * 10 * (right - left) / 5.1, rel=0.02)


GROUP = """name = "group"
[[robots]]
count = 2
image = "aggregation"
selector = 3
[[objects]]
count = 2
"""


def plan_of(tmp_path: Path, text: str, *words: str) -> Plan:
    """Return the plan of `arena run` for these scene and options."""
    (tmp_path / "group.toml").write_text(text)
    return plan_from(run_parser().parse_args([str(tmp_path / "group.toml"), *words]), 1)


def test_a_brain_replaces_the_images_of_a_scene_whose_groups_all_have_one(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """`--brain` replaces the images of all groups if each group has one; the plan names the image. A missing file is
    an error in every scene."""
    (tmp_path / "group.toml").write_text(GROUP)
    out = str(tmp_path / "out")
    assert main(["run", str(tmp_path / "group.toml"), "--brain", "/lost.elf", "--out", out]) == 2
    assert "--brain /lost.elf: no such file" in capsys.readouterr().err
    plan = plan_of(tmp_path, GROUP, "--brain", "scripted")
    assert (plan.brain, plan.image, plan.images, plan.has_firmware) == ("scripted", None, (), False)
    assert plan.key()["images_sha256"] == {}
    own = plan_of(tmp_path, GROUP.replace("aggregation", "scripted"))
    assert (own.brain, own.image, own.images) == ("scripted", None, (("scripted", None),))
    mixed = GROUP.replace("aggregation", "scripted") + '[[robots]]\nname = "others"\n'
    with pytest.raises(ValueError, match=r"--brain /lost\.elf"):
        plan_of(tmp_path, mixed, "--brain", "/lost.elf")
    assert plan_of(tmp_path, mixed, "--brain", "scripted").images == (("scripted", None),)


def test_options_of_a_scene_with_groups_act_or_name_the_key_to_write(tmp_path: Path) -> None:
    """Options can set counts and keys of a single table of groups; for several tables, poses and replaced values they
    are refused."""
    text = GROUP.replace("aggregation", "scripted")
    scene = plan_of(tmp_path, text, "--robots", "4", "--objects", "3", "--set", "objects.radius_cm=6").scene
    assert (scene.robots.count, scene.groups[0].count, scene.objects.count) == (4, 4, 3)
    assert scene.kind_of(0).radius_cm == 6
    assert len(World(scene, 1).poses.robots) == 4
    scene = plan_of(tmp_path, text, "--set", "robots.count=5", "--set", "robots.wheel_noise=0.2").scene
    assert (scene.robots.count, scene.robots.wheel_noise) == (5, 0.2)
    with pytest.raises(SceneError, match=r"robots\.count is 20000; expected 0 to 10000"):
        plan_of(tmp_path, text, "--robots", "20000")
    for change, words, message in (
        (("[[objects]]", "[[robots]]\n[[objects]]"), "robots.count=4", "write `count` into the [[robots]] tables"),
        (("count = 2\nimage", 'place = "poses"\nposes = [[20, 20]]\nimage'), "robots.count=4", "write all `poses`"),
        (("", ""), "start.selector=1", "start.selector has no effect in this scene; change `selector`"),
        (("", ""), "infrared.object_share=0.5", "change `share` in the [[objects]] tables"),
        (("[[robots]]", "[arena]\npolygon = [[0, 0], [200, 0], [0, 200]]\n[[robots]]"), "arena.width_cm=90",
         "arena.width_cm has no effect in this scene; change `polygon` in [arena]"),
    ):  # fmt: skip
        with pytest.raises(SceneError, match=re.escape(message)):
            plan_of(tmp_path, text.replace(*change, 1), "--set", words)


def test_a_controller_without_effect_is_refused(tmp_path: Path) -> None:
    """`--controller` selects the speeds of scripted robots and the selector of firmware; it is refused if the scene
    sets both."""
    text = GROUP.replace("aggregation", "scripted")
    assert plan_of(tmp_path, text, "--controller", "B").controller == "B"
    assert plan_of(tmp_path, text).controller == "A"
    with pytest.raises(ValueError, match=r"--controller B has no effect .* change `controller` or `selector`"):
        plan_of(tmp_path, text.replace("selector = 3", 'controller = "A"'), "--controller", "B")


def test_a_quantum_that_no_robot_runs_in_is_refused(tmp_path: Path) -> None:
    """`clock.quantum_ms` acts on trials with firmware, `clock.scripted_quantum_ms` on those without; the other one is
    refused."""
    text = GROUP.replace("aggregation", "scripted")
    assert plan_of(tmp_path, text, "--set", "clock.scripted_quantum_ms=5").scene.clock.quantum_ms == 5
    with pytest.raises(ValueError, match=r"clock\.quantum_ms has no effect: no robot runs firmware"):
        plan_of(tmp_path, text, "--set", "clock.quantum_ms=5")
