"""Neighbour messages on the emulated robot: next to the camera, and between two robots (io/infrared/README.md)."""

from __future__ import annotations

import math
import struct
from itertools import pairwise

import numpy as np
import pytest

from arena.infrared.channel import OpticalChannel
from arena.robots.firmware_controller import FirmwareController
from arena.scene.loader import FCY, load_scene
from arena.world.poses import Poses
from emu.machine.machine import Machine
from tests.firmware.conftest import TARGET_APPS, Build
from tests.firmware.drivers.test_drivers_on_target import captured, noise, robot, window

pytestmark = pytest.mark.slow

SENT, RECEIVED = 0, 1
"""Field indices in sys_infrared_statistics."""


def statistics(machine: Machine) -> tuple[int, ...]:
    at = machine.address_of("infrared_statistics")
    return struct.unpack("<7H", bytes(machine.record.bytes[at : at + 14]))


def test_the_camera_loses_no_pixel_while_frames_are_sent(image: Build) -> None:
    """The camera captures every pixel while infra-red frames are sent.

    The link runs at IPL 4, below the capture (kernel.md §4, openswarm_infrared.h).
    """
    machine = robot(image("infrared", TARGET_APPS), selector=15)
    machine.board.camera.show(noise())
    machine.run(cycles=FCY // 2)
    for _ in range(2):
        machine.run(cycles=1_600_000 + 137_000)
        assert np.array_equal(captured(machine), window(noise()))
    assert statistics(machine)[SENT] >= 3


def test_a_number_in_the_data_eeprom_is_the_robots(image: Build) -> None:
    """The robot number is the last word of the data EEPROM if that is 1 to 2047 (openswarm_infrared.h)."""
    machine = robot(image("infrared", TARGET_APPS))
    machine.program.put(0x7FFFFE, 42)
    machine.run(cycles=FCY // 50)
    assert machine.record.u16[machine.address_of("infrared_number") >> 1] == 42


def test_what_touches_is_near(image: Build) -> None:
    """Proximity measurement in mm continues beside the link and reports a touching object as near.

    The receivers settle late after a strong reflection.
    """
    machine = robot(image("infrared", TARGET_APPS))
    at = machine.address_of("millimetres")
    for counts, millimetres in ((300, 39), (1744, 15), (3700, 3)):
        for sensor in range(8):
            machine.board.ir.reflection[sensor] = counts
        machine.run(cycles=FCY // 5)
        assert all(abs(found - millimetres) <= 1 for found in machine.record.bytes[at : at + 8])


def test_an_event_of_one_robot_is_sent_on_another(image: Build) -> None:
    """Turning one robot's selector lights the body LED of the other too: the event is shared over the infra-red
    channel.

    Source: openswarm_remote.h. Noise destroys one frame in thirty, so the selector turns up to three times.
    """
    values = {"robots__count": 2, "objects__count": 0, "infrared__noise_counts": 2.0}
    scene = load_scene("clustering").with_values(**values)
    channel = OpticalChannel(2, scene.clock.quantum_tcy)
    controllers = [
        FirmwareController(scene, 1, number, image("infrared", TARGET_APPS), 0, channel) for number in range(2)
    ]
    poses = Poses([(150.0, 150.0, math.pi / 2), (162.0, 150.0, math.pi / 2)], [])
    ticks = [math.ceil(seconds * FCY / scene.clock.quantum_tcy) for seconds in (0, 0.4, 0.55, 0.7, 0.85)]
    for turn, (begin, end) in enumerate(pairwise(ticks)):
        if turn:
            controllers[0].machine.board.selector.position = turn + 4
        for tick in range(begin, end):
            for controller in controllers:
                controller.control_step(tick, poses)
        lit = [controller.reading().leds != 0 for controller in controllers]
        assert lit[0] == (turn > 0)
        if lit == [True, True]:
            break
    assert all("body" in controller.machine.board.leds.lit for controller in controllers)
    assert [statistics(controller.machine)[RECEIVED] for controller in controllers] == [1, 2]  # with first beacons
