"""Kilobots that communicate by infrared: several ATmega328P in simavr, run in lock step (board/kilobot/infrared)."""

from __future__ import annotations

import os
import struct
import subprocess
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import pytest

from emu.boards.kilobot.swarm import HIGH_GAIN_MM, REACH_MM, counts
from firmware.tools.simulated.kilobot import HZ, Kilobot
from firmware.tools.simulated.kilobots import Kilobots, Robot
from firmware.tools.simulated.machine import NotInstalled, peek, peek_words
from tests.cases import check_all
from tests.firmware.conftest import FIRMWARE, TARGET_APPS
from tests.firmware.ports.emulated_kilobots import EmulatedKilobots
from tests.firmware.ports.targets import make

MESSAGE, EVENT = 1, 2
"""Values of the firmware variable `wanted` (target/kilobot_infrared): send a message, send an event."""
STATISTICS = ("sent", "received", "damaged", "false_starts", "adaptations", "refused", "conflicts")
LIFETIME_S = 7.0
STRENGTH_OF_LOW_GAIN = 1024
DDRC, DDRD, ACSR = 0x27, 0x2A, 0x50
ACD = 1 << 7

SIMULATORS: dict[str, Callable[..., Any]] = {"simavr": Kilobots, "emulator": EmulatedKilobots}
Open = Callable[..., Any]


@pytest.fixture(scope="module")
def image(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make("kilobot", "kilobot_infrared", tmp_path_factory.mktemp("pulses"), apps=TARGET_APPS)


@pytest.fixture(params=[pytest.param("simavr", marks=pytest.mark.slow), "emulator"])
def swarm(request: pytest.FixtureRequest) -> Iterator[Open]:
    """Return a function that creates a swarm for one test, in simavr and in the project's emulator.

    A missing Debian package skips the test.
    """
    opened: list[Any] = []

    def open_one(robots: Sequence[Robot], **settings: Any) -> Any:
        try:
            opened.append(SIMULATORS[request.param](robots, **settings))
        except NotInstalled as missing:
            pytest.skip(str(missing))
        return opened[-1]

    yield open_one
    for one in opened:
        one.close()


def say(robot: Kilobot, what: int, text: bytes) -> None:
    robot.poke_bytes(robot.symbols["text"], text)
    robot.poke_bytes(robot.symbols["length"], bytes([len(text)]))
    robot.poke_bytes(robot.symbols["wanted"], bytes([what]))


def message(robot: Kilobot) -> tuple[int, int, int, int, bytes]:
    """Return the last message received: source, strength, sensor, corrected bits, payload."""
    raw = robot.peek_bytes(robot.symbols["last_message"], 15)
    source, strength, sensor, corrected, size = struct.unpack_from("<HHBBB", raw)
    return source, strength, sensor, corrected, raw[7 : 7 + size]


def statistics(robot: Kilobot) -> dict[str, int]:
    words = peek_words(robot, "infrared_statistics", len(STATISTICS))
    return dict(zip(STATISTICS, words, strict=True))


def event(robot: Kilobot) -> bytes:
    return robot.peek_bytes(robot.symbols["last_event"], peek(robot, "event_size"))


def pair(image: Path, distance: float = 50.0) -> list[Robot]:
    return [Robot(image, 0, number=11), Robot(image, distance, number=2047, on_at=0.0042)]


# ---- Two robots -----------------------------------------------------------------------------------------------------


def test_two_exchange_messages(image: Path, swarm: Open) -> None:
    """Two robots report each other as SEEN and exchange messages with source, strength and payload.

    Source: openswarm_infrared.h.
    """
    both = swarm(pair(image))
    both.run(0.2)
    left, right = both.robots
    assert [peek(robot, "sightings") for robot in both.robots] == [1, 1], "by their first beacons"
    say(left, MESSAGE, b"\x00\xff\x55\xaa\x01\x80hi")
    say(right, MESSAGE, b"?")
    both.run(0.2)
    strength = counts(HIGH_GAIN_MM, 50)
    assert message(right) == (11, strength, 0, 0, b"\x00\xff\x55\xaa\x01\x80hi")
    assert message(left) == (2047, strength, 0, 0, b"?")
    for robot in both.robots:
        assert peek(robot, "messages") == 1
        assert statistics(robot) == {"sent": 2, "received": 2} | dict.fromkeys(STATISTICS[2:], 0)


def test_every_byte_arrives(image: Path, swarm: Open) -> None:
    """All 256 byte values arrive, in messages of eight, at any phase of the kernel's clock."""
    both = swarm(pair(image))
    both.run(0.2)
    for first in range(0, 256, 8):
        text = bytes(range(first, first + 8))
        say(both.robots[0], MESSAGE, text)
        both.run(0.05)
        assert message(both.robots[1])[4] == text
    assert peek(both.robots[1], "messages") == 32
    assert statistics(both.robots[1])["damaged"] == 0


def test_strength_tells_the_distance(image: Path, swarm: Open) -> None:
    """The received strength decreases with distance, and robots beyond the range receive nothing.

    The receiver measures at high gain, and at low gain where that saturates.
    """
    both = swarm(pair(image))
    seen = []
    for distance in (33.0, 38.0, 42.0, 50.0, 60.0, REACH_MM):
        both.move(1, distance, 0)
        both.run(0.2)
        say(both.robots[1], MESSAGE, b"!")
        both.run(0.2)
        seen.append(message(both.robots[0])[1])
    assert seen == sorted(seen, reverse=True)
    assert len(set(seen)) == len(seen)
    assert [strength >= STRENGTH_OF_LOW_GAIN for strength in seen] == [True, True, True, False, False, False]
    before = statistics(both.robots[0])
    both.move(1, REACH_MM + 1, 0)
    say(both.robots[1], MESSAGE, b"!")
    both.run(0.5)
    assert statistics(both.robots[0])["received"] == before["received"]


def test_a_shared_event_comes_on_both(image: Path, swarm: Open) -> None:
    """A shared event with eight bytes occurs once on each robot, also on one reached only through a relay robot.

    Source: openswarm_remote.h.
    """
    line = swarm([Robot(image, 50.0 * n, number=n + 1, on_at=0.003 * n) for n in range(3)])
    line.run(0.5)
    say(line.robots[0], EVENT, b"8 bytes!")
    line.run(0.5)
    assert [event(robot) for robot in line.robots] == [b"8 bytes!"] * 3
    say(line.robots[2], EVENT, b"")
    line.run(0.5)
    assert [event(robot) for robot in line.robots] == [b""] * 3
    assert [peek(robot, "events") for robot in line.robots] == [2, 2, 2]


def test_who_is_silent_is_lost(image: Path, swarm: Open) -> None:
    """A silent robot is reported LOST after SYS_NEIGHBOUR_LIFETIME, and SEEN when it sends again."""
    both = swarm(pair(image))
    left = both.robots[0]
    both.run(3.0)
    both.move(1, 500.0, 0)
    both.run(LIFETIME_S - 2.7)  # the last beacon is at most 2.6 s old
    assert peek(left, "losses") == 0
    both.run(3.0)
    assert (peek(left, "losses"), peek(left, "last_lost")) == (1, 2047)
    both.move(1, 40.0, 0)
    both.run(3.0)
    assert (peek(left, "sightings"), peek(left, "last_seen")) == (2, 2047)


# ---- Three robots ---------------------------------------------------------------------------------------------------


def talk(together: Kilobots, speakers: Sequence[int], rounds: int, seconds: float) -> None:
    for n in range(rounds):
        for index in speakers:
            say(together.robots[index], MESSAGE, bytes([index, n] * 4))
        together.run(seconds)


def test_who_cannot_hear_each_other_collide(image: Path, swarm: Open) -> None:
    """Overlapping frames of robots that cannot receive each other are refused; all other frames arrive.

    The robots at the ends of the line start 0 to 19 ms apart; a frame lasts 7 ms.
    """
    line = swarm([Robot(image, 60.0 * n, number=n + 1) for n in range(3)])
    line.run(0.2)
    whole = []
    for n in range(20):
        before = peek(line.robots[1], "messages")
        say(line.robots[0], MESSAGE, bytes([0, n] * 4))
        line.run(0.001 * n)
        say(line.robots[2], MESSAGE, bytes([2, n] * 4))
        line.run(0.05)
        whole.append(peek(line.robots[1], "messages") - before)
        source, *_, payload = message(line.robots[1])
        assert not peek(line.robots[1], "messages") or payload == bytes([source - 1, payload[1]] * 4)
    assert whole[:3] == [0, 0, 0]
    assert whole[-6:] == [2] * 6
    assert statistics(line.robots[1])["damaged"] >= 3


def test_who_hear_each_other_take_turns(image: Path, swarm: Open) -> None:
    """Robots that receive each other take turns, and each frame arrives at both others unless two begin at once.

    Two that begin within 4 us of each other take the other's first pulse for a reflection (ECHO), and lose both frames.
    Each begins at its next tick, of 977 us: less than 1 % of the pairs of messages are lost, 0.3 of 40 pairs, and more
    than 3 of 40 with a probability of 0.0004.
    """
    heap = swarm([Robot(image, 30.0 * n, number=n + 1, on_at=0.0011 * n) for n in range(3)])
    heap.run(0.2)
    collisions = 0
    for n in range(40):
        before = [peek(robot, "messages") for robot in heap.robots]
        damaged = statistics(heap.robots[1])["damaged"]
        talk(heap, (0, 2), 1, 0.06)
        arrived = [peek(robot, "messages") - earlier for robot, earlier in zip(heap.robots, before, strict=True)]
        if arrived == [0, 0, 0]:
            assert statistics(heap.robots[1])["damaged"] > damaged
            collisions += 1
        else:
            assert arrived == [1, 2, 1], n
    assert collisions <= 3


def test_a_frame_arrives_soon_after_a_pulse(image: Path, swarm: Open) -> None:
    """A frame arrives if the receiver got no other pulse in the 1.1 ms before it, whatever the phase of its ticks."""
    before, leading_byte, ahead_us = 0.2, 0.0004, 20

    def with_message() -> tuple[Any, Kilobot]:
        both = swarm(pair(image))
        both.run(before)
        say(both.robots[0], MESSAGE, b"soon")
        return both, both.robots[1]

    both, right = with_message()
    frame_begins(both, right)
    begin = both.now / HZ - leading_byte

    def check(silent_us: float) -> None:
        both, right = with_message()
        both.run(begin - (silent_us + ahead_us) * 1e-6 - before)
        both.flash(1, ahead_us)
        both.run(0.03)
        assert (peek(right, "messages"), statistics(right)["false_starts"]) == (1, 1)

    check_all(check, range(1100, 2000, 200))


def test_numbers_are_drawn(image: Path, swarm: Open) -> None:
    """Robots with erased EEPROMs that start in the same cycle draw different numbers, because of converter noise."""
    heap = swarm([Robot(image, 20.0 * n) for n in range(3)], seed=5)
    heap.run(3.0)
    numbers = {peek(robot, "infrared_number") for robot in heap.robots}
    assert len(numbers) == 3
    assert 0 not in numbers
    assert [peek(robot, "sightings") for robot in heap.robots] == [2, 2, 2]


# ---- Damaged frames -------------------------------------------------------------------------------------------------


def frame_begins(both: Kilobots, listener: Kilobot) -> None:
    """Run until the robot has received a leading byte."""
    receive = 2
    for _ in range(20_000):
        both.run(20e-6)
        if peek(listener, "state", size=1) == receive:
            return
    pytest.fail("no frame begins")


def test_a_foreign_pulse_damages_a_frame(image: Path, swarm: Open) -> None:
    """A frame damaged by a foreign pulse is refused, and the next frame arrives."""

    def check(after_us: float) -> None:
        both = swarm(pair(image))
        both.run(0.2)
        left, right = both.robots
        say(left, MESSAGE, bytes(8))  # zeros: any added light changes a bit
        frame_begins(both, right)
        if after_us:
            both.run(after_us * 1e-6)
        for _ in range(12):  # every 29 us, so that some pulses hit a byte
            both.run(29e-6)
            both.flash(1, 0)
        both.run(0.1)
        assert (peek(right, "messages"), statistics(right)["damaged"]) == (0, 1)
        say(left, MESSAGE, b"again")
        both.run(0.1)
        assert message(right)[4] == b"again"

    check_all(check, [0, 300, 700, 1100, 2500, 5000])


def test_pulses_that_are_lost(image: Path, swarm: Open) -> None:
    """If one pulse in a hundred is lost, some frames are refused and none is received with wrong content."""
    both = swarm(pair(image), seed=7, loss=0.01)
    both.run(0.2)
    for n in range(60):
        text = bytes((n * 37 + k * 11) & 0xFF for k in range(8))
        before = peek(both.robots[1], "messages")
        say(both.robots[0], MESSAGE, text)
        both.run(0.05)
        if peek(both.robots[1], "messages") != before:
            assert message(both.robots[1])[4] == text
    assert 10 < peek(both.robots[1], "messages") < 50
    assert statistics(both.robots[1])["damaged"] > 5


def test_stray_light_begins_nothing(image: Path, swarm: Open) -> None:
    both = swarm(pair(image))
    both.run(0.2)
    for _ in range(10):
        both.flash(1, 100)
        both.run(0.01)
    assert statistics(both.robots[1])["false_starts"] == 10
    say(both.robots[0], MESSAGE, b"still")
    both.run(0.1)
    assert message(both.robots[1])[4] == b"still"


# ---- Reproducible runs ----------------------------------------------------------------------------------------------


def test_the_same_run_twice(image: Path, swarm: Open) -> None:
    """Repeating a run of three robots with losses gives the same RAM, cycle and UART output."""
    found = []
    for _ in range(2):
        heap = swarm([Robot(image, 25.0 * n) for n in range(3)], seed=9, loss=0.003)
        heap.run(0.5)
        talk(heap, (0, 1, 2), 20, 0.05)
        found.append([(robot.now, robot.peek_bytes(0x100, 2048), robot.uart()) for robot in heap.robots])
    assert found[0] == found[1]
    assert any(statistics(robot)["damaged"] for robot in heap.robots)


def test_in_pieces_as_in_one(image: Path, swarm: Open) -> None:
    """Splitting a run into pieces changes neither the messages nor the state of the robots."""
    found = []
    for pieces in (1, 700):
        both = swarm(pair(image), seed=3)
        for _ in range(pieces):
            both.run(0.7 / pieces)
        found.append([(statistics(robot), peek(robot, "lit_at"), peek(robot, "seen")) for robot in both.robots])
    assert found[0] == found[1]
    assert found[0][0][0]["received"] > 0


# ---- Applications ---------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_neighbours_tell_what_they_hear(tmp_path: Path, swarm: Open) -> None:
    """The unchanged e-puck application reports neighbours with numbers and distances.

    Distances come from the tables in the EEPROM; without tables they are 0.
    """
    app = make("kilobot", "neighbours", tmp_path)

    def check(distance: int) -> None:
        both = swarm([Robot(app, 0, number=5), Robot(app, distance, number=6, calibrated=False, on_at=0.01)])
        both.run(3.5)
        lines = [line.split(b", sensor 0, ") for line in both.robots[0].uart().splitlines()]
        assert [text for text, _ in lines] == [b"6 says 0", b"6 says 1", b"6 says 2"]
        assert all(abs(int(told.removesuffix(b" mm")) - distance) <= 1 for _, told in lines)
        assert both.robots[1].uart() == b"".join(b"5 says %d, sensor 0, 0 mm\n" % n for n in range(3))

    check_all(check, [36, 45, 48, 69])


def test_an_alarm_lights_all(tmp_path: Path, image: Path, swarm: Open) -> None:
    """The unchanged e-puck alarm application lights all robots through the event that `pulses` shares.

    A lit LED is recognised by the direction of its pins.
    """
    app = make("kilobot", "alarm", tmp_path)
    line = swarm([Robot(image, 0, number=1), Robot(app, 50, number=2, on_at=0.01), Robot(app, 100, number=3)])
    line.run(0.5)
    say(line.robots[0], EVENT, struct.pack("<H", 3))
    line.run(0.3)
    lit = [(robot.peek_bytes(DDRC, 1)[0] & 0x3C, robot.peek_bytes(DDRD, 1)[0] & 0x30) for robot in line.robots[1:]]
    assert lit == [(0x3C, 0x30)] * 2
    line.run(1.2)
    assert [robot.peek_bytes(DDRC, 1)[0] & 0x3C for robot in line.robots[1:]] == [0, 0]


def test_stacks_suffice(image: Path, swarm: Open) -> None:
    """At the deepest nesting of frames, events and losses a part of the kernel stack remains unused."""
    heap = swarm([Robot(image, 25.0 * n, number=n + 1, on_at=0.01 * n) for n in range(3)])
    stack = 208  # device.mk
    bottoms = [robot.symbols["os_memory"] & 0xFFFF for robot in heap.robots]
    for robot, bottom in zip(heap.robots, bottoms, strict=True):
        robot.watch_stack(bottom, bottom + stack - 1)
    for n in range(20):
        for robot in heap.robots:
            say(robot, EVENT if n % 2 else MESSAGE, bytes([n] * 8))
        heap.run(0.04)
    heap.move(2, 500, 0)
    heap.run(10.0)
    assert [peek(robot, "losses") for robot in heap.robots] == [1, 1, 2]
    for robot, bottom in zip(heap.robots, bottoms, strict=True):
        assert robot.lowest_sp() - bottom >= 32


def test_the_threshold_is_the_e_pucks(tmp_path: Path) -> None:
    """A program that sets the infrared threshold is not built for the Kilobot, whose threshold is fixed in hardware.

    Source: openswarm_infrared.h.
    """
    (tmp_path / "app").mkdir()
    (tmp_path / "app" / "app.mk").write_text("DEVICES := infrared\n")
    (tmp_path / "app" / "main.c").write_text(
        "#include <openswarm_infrared.h>\nint main(void) { return Sys_Set_InfraredThreshold(4); }\n"
    )
    words = [f"APPS={os.path.relpath(tmp_path, FIRMWARE)}", "APP=app", "PORT=avr", f"OUT={tmp_path / 'out'}"]
    done = subprocess.run(["make", "-s", "-C", str(FIRMWARE), *words], capture_output=True, text=True, check=False,
                          env={**os.environ, "MAKEFLAGS": ""})  # fmt: skip
    if "is not installed" in done.stderr:
        pytest.skip(done.stderr.strip())
    assert done.returncode != 0
    assert "Sys_Set_InfraredThreshold" in done.stderr


def test_without_the_device_the_comparator_is_off(tmp_path: Path, swarm: Open) -> None:
    """Images that do not use infrared leave the analog comparator switched off."""
    alone = swarm([Robot(make("kilobot", "hello", tmp_path))])
    alone.run(0.1)
    assert alone.now == HZ // 10
    assert alone.robots[0].peek_bytes(ACSR, 1)[0] & ACD
