"""Neighbour messages on the emulated robot: beside the camera, and between robots that talk (io/infrared/README.md)."""

from __future__ import annotations

import math
import struct

import numpy as np

from arena.infrared.channel import OpticalChannel
from arena.robots.firmware_controller import FirmwareController
from arena.scene.loader import FCY, load_scene
from arena.world.physics import Poses
from emu.machine.machine import Machine
from tests.firmware.conftest import TARGET_APPS, Build
from tests.firmware.drivers.test_drivers_on_target import captured, noise, robot, window

SENT, RECEIVED = 0, 1
"""Places in sys_infrared_statistics."""


def statistics(machine: Machine) -> tuple[int, ...]:
    at = machine.address_of("infrared_statistics")
    return struct.unpack("<7H", bytes(machine.record.bytes[at : at + 14]))


def test_the_camera_loses_no_pixel_while_frames_are_sent(image: Build) -> None:
    """kernel.md §4; openswarm_infrared.h: the link is at IPL 4, below the capture."""
    machine = robot(image("infrared", TARGET_APPS), selector=15)
    machine.board.camera.show(noise())
    machine.run(cycles=FCY // 2)
    for _ in range(2):
        machine.run(cycles=1_600_000 + 137_000)
        assert np.array_equal(captured(machine), window(noise()))
    assert statistics(machine)[SENT] >= 3


def test_a_number_in_the_data_eeprom_is_the_robots(image: Build) -> None:
    """openswarm_infrared.h: the last word, if it holds 1 to 2047."""
    machine = robot(image("infrared", TARGET_APPS))
    machine.program.put(0x7FFFFE, 42)
    machine.run(cycles=FCY // 50)
    assert machine.record.u16[machine.address_of("infrared_number") >> 1] == 42


def test_what_touches_is_near(image: Build) -> None:
    """Proximity is measured meanwhile, in mm; receivers settle late after a strong reflection."""
    machine = robot(image("infrared", TARGET_APPS))
    at = machine.address_of("millimetres")
    for counts, millimetres in ((300, 39), (1744, 15), (3700, 3)):
        for sensor in range(8):
            machine.board.ir.reflection[sensor] = counts
        machine.run(cycles=FCY // 5)
        assert all(abs(found - millimetres) <= 1 for found in machine.record.bytes[at : at + 8])


def test_an_event_of_one_robot_is_sent_on_another(image: Build) -> None:
    """openswarm_remote.h: the selector of one robot lights the body LED of the other too, over the arena's channel."""
    values = {"robots__count": 2, "objects__count": 0, "infrared__noise_counts": 2.0}
    scene = load_scene("clustering").with_values(**values)
    channel = OpticalChannel(2, scene.clock.quantum_tcy)
    controllers = [
        FirmwareController(scene, 1, number, image("infrared", TARGET_APPS), 0, channel) for number in range(2)
    ]
    poses = Poses([(150.0, 150.0, math.pi / 2), (162.0, 150.0, math.pi / 2)], [])
    ticks = [math.ceil(seconds * FCY / scene.clock.quantum_tcy) for seconds in (0.4, 0.55)]
    for tick in range(ticks[1]):
        if tick == ticks[0]:
            assert [controller.reading().leds for controller in controllers] == [0, 0]
            controllers[0].machine.board.selector.position = 5
        for controller in controllers:
            controller.control_step(tick, poses)
    assert all("body" in controller.machine.board.leds.lit for controller in controllers)
    assert [statistics(controller.machine)[RECEIVED] for controller in controllers] == [1, 2]  # the first beacons
