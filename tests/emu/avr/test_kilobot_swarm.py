"""Programs written with firmware/kilobot on several emulated Kilobots: messages at the bit, commands, behaviours."""

from __future__ import annotations

import subprocess
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import pytest

from emu.avr.image import AvrImage, load_avr_image
from emu.avr.machine import HZ
from emu.boards.kilobot.messages import LEADER_PULSES, SLOT, STOP_OF_LEADER, TOLERANCE, Message
from emu.boards.kilobot.observer import WATCHED, KilobotObserver
from emu.boards.kilobot.overhead import broadcast
from emu.boards.kilobot.swarm import KilobotFaultError, KilobotSetup, KilobotSwarm
from tests.emu.avr.conftest import needs

FIRMWARE = Path(__file__).resolve().parents[3] / "firmware" / "kilobot"
RUNNING = 2
Program = Callable[[str], AvrImage]


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Program:
    """Return a function that builds a program of firmware/kilobot."""
    needs("avr-gcc")
    out = tmp_path_factory.mktemp("kilobot")

    def one(name: str) -> AvrImage:
        subprocess.run(["make", "-s", "-C", str(FIRMWARE), f"PROGRAM={name}", f"OUT={out}"], check=True)
        return load_avr_image(str(out / f"{name}.elf"))

    return one


def running(image: AvrImage, count: int, gap: float, **settings: float) -> KilobotSwarm:
    """Return a line of robots that have received RUN. Their clocks differ by up to 0.6 %."""
    robots = [KilobotSetup(image, x=gap * n, number=n, on_at=0.001 * n, clock=1 + 0.002 * (n * 37 % 7 - 3))
              for n in range(count)]  # fmt: skip
    swarm = KilobotSwarm(robots, seed=3, **settings)
    swarm.run(0.25)
    broadcast(swarm, "run", 0.4)
    assert [robot.peek("state") for robot in swarm.robots] == [RUNNING] * count
    return swarm


def test_pulses_have_the_published_times(program: Program) -> None:
    """A frame's pulses are 270 cycles apart, the leader 2,420, and a frame takes 34,968 (kilobot.md §2)."""
    swarm = running(program("gradient"), 1, 0)
    robot = swarm.robots[0]
    robot.watch([0x25])
    robot.changes.clear()
    swarm.run(1.2)
    rises = [change.cycle for change in robot.changes if change.value & 1]
    falls = [change.cycle for change in robot.changes if not change.value & 1]
    assert {b - a for a, b in zip(rises, falls, strict=True)} == {9}
    first = rises[0]
    frame = [at - first for at in rises if at - first < 40_000]
    assert abs(frame[LEADER_PULSES - 1] - STOP_OF_LEADER) < 20
    assert abs(frame[-1] - 34_968) < 100
    starts = [n for n in frame[LEADER_PULSES:] if n in frame]
    assert all(min(abs(gap % SLOT), SLOT - gap % SLOT) < TOLERANCE // 4 for gap in (b - a for a, b in pairwise(starts)))
    assert abs(rises[len(frame)] - first - 16 * 262_144) < 3_000, "every 16 ticks"


def test_two_robots_exchange_messages(program: Program) -> None:
    """A message is received whole, with the distance of its strength; a decoder of pulses gives the same message."""
    for gap in (35, 50, 65):
        swarm = running(program("gradient"), 2, gap)
        sender = swarm.robots[0]
        observer = KilobotObserver({register: sender.peek(register) for register in WATCHED})
        sender.watch(WATCHED)
        sender.changes.clear()
        swarm.run(2.0)
        assert [robot.peek("gradient") for robot in swarm.robots] == [0, 1]
        assert abs(swarm.robots[1].peek("distance") - gap) <= 1
        sent = [report for report in observer.reports_of(sender.changes) if report.kind == "message"]
        assert len(sent) in (3, 4)
        assert {report.content["data"] for report in sent} == {"00" * 9}
        assert {report.content["crc"] for report in sent} == {"right"}


def test_robots_out_of_reach_hear_nothing(program: Program) -> None:
    """Beyond the reach no message arrives; a robot that comes near receives the next one."""
    swarm = running(program("gradient"), 2, 71)
    swarm.run(2.0)
    assert swarm.robots[1].peek("gradient") == 255
    swarm.move(1, 60, 0)
    swarm.run(1.5)
    assert swarm.robots[1].peek("gradient") == 1


@pytest.mark.slow
def test_a_gradient_forms(program: Program) -> None:
    """In a line each robot shows its hop count; the farthest one knows it within 0.6 s a hop (kilobot.md §5)."""
    swarm = running(program("gradient"), 6, 50)
    swarm.run(6 * 0.6)
    assert [robot.peek("gradient") for robot in swarm.robots] == list(range(6))


@pytest.mark.slow
def test_robots_blink_together(program: Program) -> None:
    """Synchronisation: after a minute six robots of different phases and clocks blink within 7 ticks of each other."""
    swarm = running(program("synchronise"), 6, 33)
    for robot in swarm.robots:
        robot.watch([0x2A])

    def spread(seconds: float) -> int:
        for robot in swarm.robots:
            robot.changes.clear()
        start = swarm.now
        swarm.run(seconds)
        times = [swarm.tick_of(n, next(change.cycle for change in robot.changes if change.value & 0x30))
                 for n, robot in enumerate(swarm.robots)]  # fmt: skip
        period = 50 * 262_144
        phases = sorted((at - start) % period for at in times)
        gaps = [b - a for a, b in pairwise(phases)] + [phases[0] + period - phases[-1]]
        return period - max(gaps)

    before = spread(4.0)
    swarm.run(60.0)
    assert spread(4.0) < 7 * 262_144 < before


def test_the_same_run_in_pieces(program: Program) -> None:
    """Messages, losses and clocks are the same however a run is cut; another seed loses other pulses."""
    image = program("gradient")
    found = []
    for pieces, seed in ((1, 5), (300, 5), (1, 6)):
        robots = [KilobotSetup(image, x=40 * n, number=n, on_at=0.002 * n, clock=1 + 0.003 * n) for n in range(3)]
        swarm = KilobotSwarm(robots, seed=seed, loss=0.02)
        swarm.run_until(HZ // 4)
        broadcast(swarm, "run", 0.4)
        start = swarm.now
        for n in range(1, pieces + 1):
            swarm.run_until(start + n * 2 * HZ // pieces)
        found.append([(robot.peek_bytes(0x100, 0x600), swarm.pulses_sent(n)) for n, robot in enumerate(swarm.robots)])
    assert found[0] == found[1]
    assert found[0] != found[2]


def test_commands(program: Program) -> None:
    """The overhead controller resets robots and puts them to sleep, from which they listen every 8 s and wake up."""
    swarm = running(program("gradient"), 2, 50)
    broadcast(swarm, "reset", 0.05)
    swarm.run(0.3)
    assert all(robot.state.resets for robot in swarm.robots)
    broadcast(swarm, "sleep", 0.3)
    swarm.run(0.5)
    slept = [robot.state.slept for robot in swarm.robots]
    swarm.run(6.0)
    assert all(robot.state.slept - before > 5.9 * HZ for robot, before in zip(swarm.robots, slept, strict=True))
    broadcast(swarm, "wakeup", 4.0)
    assert [robot.peek("state") for robot in swarm.robots] == [0, 0]


def test_a_fault_names_the_robot(program: Program) -> None:
    """A fault stops the swarm and names robot and place."""
    image = program("gradient")
    broken = AvrImage("broken", bytes([0x19, 0x94]) + image.flash[2:], 2, {})
    swarm = KilobotSwarm([KilobotSetup(image), KilobotSetup(broken, x=50)])
    with pytest.raises(KilobotFaultError, match="robot 1: illegal instruction 0x9419 at 0x0000, cycle 0"):
        swarm.run(1)


def test_settings_are_checked(program: Program) -> None:
    image = program("gradient")
    for settings, text in (({"loss": 1.0}, "loss"), ({"delay": 3}, "delay")):
        with pytest.raises(ValueError, match=text):
            KilobotSwarm([KilobotSetup(image)], **settings)
    crowded = KilobotSwarm([KilobotSetup(image)])
    for n in range(200):
        crowded.light(0, 1_000 + 30 * n)
    with pytest.raises(ValueError, match="more pulses of light"):
        crowded.run(0.1)
    with pytest.raises(ValueError, match="9 data bytes"):
        broadcast(KilobotSwarm([KilobotSetup(image)]), Message(b"short", 0), 0.1)
