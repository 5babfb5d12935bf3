"""Device drivers under the kernel, and the clustering programs, on the emulated robot."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from emu.api import Machine
from emu.boards.epuck.analog import RESPONSE, reflection_at
from emu.boards.epuck.board import Epuck
from emu.boards.epuck.camera.pixels import decode
from emu.image.loader import load_image
from tests.firmware.conftest import Build

FCY = 14_745_600
HREF = 1 << 3
START = 8
"""Selector bit that starts the robot without the remote control (apps/clustering/README.md)."""
PROGRAMS = ["clustering", "clustering-bare"]
SCENES = {"object": (80, 0, 0), "robot": (0, 40, 0), "nothing": (100, 80, 80)}
TABLES = {
    0: {"nothing": (50, 100), "object": (100, 50), "robot": (10, 50)},
    1: {"nothing": (55, 99), "object": (98, 50), "robot": (89, 53)},
}
"""Wheel speeds of each class, in percent of 129 mm/s, by selector bit 0 (epuck.md §8)."""


def robot(path: Path, engine: str = "jit", **options) -> Machine:
    image = load_image(path)
    machine = Machine(image.chip, engine=engine, board=partial(Epuck, **options))
    machine.load(image)
    return machine


def plain(colour: tuple[int, int, int]) -> np.ndarray:
    return np.full((480, 640, 3), colour, np.uint8)


def noise(seed: int = 1) -> np.ndarray:
    return np.random.default_rng(seed).integers(0, 256, (480, 640, 3), dtype=np.uint8)


def captured(machine: Machine) -> np.ndarray:
    at = machine.address_of("frame")
    return decode(bytes(machine.record.bytes[at : at + 800]), "rgb565").reshape(20, 20, 3)


def window(picture: np.ndarray) -> np.ndarray:
    """Return every eighth of the centred 160 x 160 pixels, in RGB565 precision (epuck.md §7.5)."""
    return picture[160:320:8, 240:400:8] & np.array([0xF8, 0xFC, 0xF8], np.uint8)


def steps(machine: Machine) -> tuple[int, int]:
    motors = machine.board.motors
    return motors.left.steps, motors.right.steps


# -- clustering --------------------------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("table", TABLES)
@pytest.mark.parametrize("program", PROGRAMS)
def test_every_colour_gives_the_wheel_speeds_of_the_controller(image: Build, program: str, table: int) -> None:
    """Each colour sets the controller's wheel speeds to within one step/s (epuck.md §8, openswarm-original.md §8).

    A speed of v mm/s, truncated, is v * 1000 / 129 steps/s.
    """
    machine = robot(image(program), selector=START + table)
    for scene, percent in TABLES[table].items():
        machine.board.camera.show(plain(SCENES[scene]))
        machine.run(cycles=FCY // 2)  # the next frame shows the change
        before = steps(machine)
        machine.run(cycles=FCY)
        made = [now - then for now, then in zip(steps(machine), before, strict=True)]
        for count, share in zip(made, percent, strict=True):
            assert count == pytest.approx(share * 129 // 100 * 1000 / 129, abs=1), scene


@pytest.mark.parametrize("program", PROGRAMS)
def test_the_remote_control_starts_and_stops(image: Build, program: str) -> None:
    """The remote key OK starts clustering and STANDBY stops it; other keys and a held key have no effect.

    Source: openswarm-original.md §8.
    """
    machine = robot(image(program))
    machine.board.camera.show(plain(SCENES["object"]))
    machine.run(cycles=FCY // 4)
    assert steps(machine) == (0, 0)
    machine.board.remote.press("ok", repeat=3)
    machine.run(cycles=FCY // 2)
    moving = steps(machine)
    assert moving[0] > 100
    assert "front" in machine.board.leds.lit
    machine.board.remote.press(1)
    machine.run(cycles=FCY // 4)
    assert steps(machine)[0] > moving[0]
    machine.board.remote.press("standby")
    machine.run(cycles=FCY // 4)
    stopped = steps(machine)
    machine.run(cycles=FCY // 4)
    assert steps(machine) == stopped
    assert "front" not in machine.board.leds.lit


def test_the_bare_program_has_nothing_of_the_kernel(image: Build) -> None:
    """The link map of the bare clustering program contains no kernel object (experiment-contract.md §4)."""
    symbols = load_image(image("clustering-bare")).symbols
    for name in ("_Sys_Init_Kernel", "_Sys_Send_Event", "_os_memory", "_os_running", "_hal_yield"):
        assert symbols.find(name) is None, name
    assert symbols.find("_line_of_sight") is not None or symbols.find("_camera_capture_next") is not None


@pytest.mark.parametrize("program", PROGRAMS)
def test_without_a_camera_nothing_hangs_and_the_robot_stands(image: Build, program: str) -> None:
    """With the camera unplugged the program continues to run and the wheels stay still."""
    machine = robot(image(program), selector=START, camera=None)
    assert machine.run(cycles=FCY // 2).reason == "limit"
    assert steps(machine) == (0, 0)


# -- camera ------------------------------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("sensor", ["PO6030K", "PO3030K", "PO8030D"])
@pytest.mark.parametrize("program", PROGRAMS)
def test_every_pixel_is_right(image: Build, program: str, sensor: str) -> None:
    """All pixels of a frame are captured correctly (epuck.md §7.5)."""
    machine = robot(image(program), selector=START, camera=sensor)
    machine.board.camera.show(noise())
    machine.run(cycles=8_000_000)
    assert np.array_equal(captured(machine), window(noise()))


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["plain", "jit"])
def test_reads_come_16_to_18_tcy_behind_href(image: Build, engine: str) -> None:
    """The driver reads each pixel byte 16 to 18 Tcy after HREF during kernel calls, motor steps and 1 ms events.

    Frames are 1,600,000 Tcy apart: 9.216 frames/s (epuck.md §7.5, kernel.md §4, openswarm-original.md §5.5).
    """
    machine = robot(image("clustering"), engine=engine, selector=START)
    machine.board.camera.show(plain(SCENES["object"]))
    reads: list[int] = []
    machine.hook_sfr("PORTD", lambda is_write, _value: None if is_write else reads.append(machine.events.now))
    machine.run(cycles=6_000_000)
    scan = machine.board.camera.scan
    firsts = reads[::40]
    assert len(firsts) >= 2 * 20
    edges = [scan.edge_cycle(HREF, scan.edges(HREF, first)) for first in firsts]
    assert {first - edge for first, edge in zip(firsts, edges, strict=True)} <= {16, 17, 18}
    assert edges[20] - edges[0] == 1_600_000


def test_pixels_are_right_at_every_phase_of_the_camera(image: Build) -> None:
    """Pixels are correct at every phase of the camera against the clock, slices and handlers (kernel.md §4).

    An extra delay of more than about 2 Tcy would swap bytes. The phase passes all residues of the motor tick's 1,536
    Tcy in steps of 29, which is coprime to 1,536.
    """
    machine = robot(image("clustering"), selector=START)
    camera = machine.board.camera
    camera.show(noise())
    machine.run(cycles=FCY // 2)
    for phase in range(0, 1536, 29):
        camera.align(machine.cycle + 700_000 + phase, line=40)
        machine.run(cycles=1_700_000)
        assert np.array_equal(captured(machine), window(noise())), phase


def test_votes_and_ties_are_those_of_the_original(image: Build) -> None:
    """Classification votes as the original does: 24 pixels, two votes, red before green, the first wins a tie.

    Dark counts as red (openswarm-original.md §8).
    """
    machine = robot(image("clustering"), selector=START)

    def seen(picture: np.ndarray) -> int:
        machine.board.camera.show(picture)
        machine.run(cycles=FCY // 4)
        return machine.peek("speeds")  # left wheel speed: it differs for all three classes

    def with_votes(red: int, green: int) -> np.ndarray:
        picture = plain(SCENES["nothing"])
        places = [(x, y) for y in (4, 6, 8, 10, 12, 14) for x in (6, 9, 12, 15)]
        for number, (x, y) in enumerate(places[-red - green :] if red + green else []):
            picture[160 + 8 * y, 240 + 8 * x] = SCENES["object"] if number < red else SCENES["robot"]
        return picture

    object_, robot_, nothing = (seen(plain(SCENES[name])) for name in ("object", "robot", "nothing"))
    assert len({object_, robot_, nothing}) == 3
    assert seen(with_votes(1, 1)) == nothing
    assert seen(with_votes(2, 0)) == object_
    assert seen(with_votes(0, 2)) == robot_
    assert seen(with_votes(2, 22)) == object_
    assert seen(with_votes(1, 2)) == robot_
    assert seen(plain((0, 16, 0))) == object_, "dark is nearer than green"


# -- I2C --


def i2c_wire(machine: Machine):
    return machine.board.camera.chip.i2c.wire


def test_a_slave_that_holds_sda_is_clocked_free(image: Build) -> None:
    """If a slave holds SDA in the middle of a byte, the driver frees the bus by clock pulses and the camera works."""
    machine = robot(image("clustering"), selector=START)
    i2c_wire(machine).hold(sda=True, clocks=7)
    machine.board.camera.show(noise())
    machine.run(cycles=5_000_000)
    assert machine.board.camera.chip.i2c.wire.sda_high
    assert np.array_equal(captured(machine), window(noise()))


@pytest.mark.slow
@pytest.mark.parametrize("lines", [{"sda": True}, {"scl": True}])
def test_a_line_that_stays_low_stops_the_camera_not_the_robot(image: Build, lines: dict[str, bool]) -> None:
    """If a bus line stays low, the kernel starts and reports which device failed."""
    machine = robot(image("selftest"))
    i2c_wire(machine).hold(**lines)
    assert b"camera 0000 FAIL" in said(machine, FCY // 2)


def test_a_slave_may_stretch_the_clock(image: Build) -> None:
    """Clock stretching of 1 ms per byte stays within the driver's time-out (dspic30f6014a.md §11)."""
    machine = robot(image("clustering"), selector=START)
    machine.board.camera.stretch = lambda _cycle: FCY // 1000
    machine.board.camera.show(noise())
    machine.run(cycles=7_000_000)
    assert np.array_equal(captured(machine), window(noise()))


def after_camera_line(machine: Machine, act: Callable[[], None]) -> bytes:
    """Return the self-test's report; call `act` between its camera line and its interrupt-driven I2C transfer."""
    heard = bytearray()
    machine.uart[1].on_byte = lambda byte, _cycle: heard.append(byte)
    while b"camera" not in heard or not heard.endswith(b"\n"):
        assert machine.run(cycles=FCY // 1000).reason == "limit"
    act()
    machine.run(cycles=FCY // 5)
    return bytes(heard)


@pytest.mark.slow
def test_faults_of_a_running_bus_are_survived(image: Build) -> None:
    """Bus faults during interrupt-driven transfers under the kernel are reported, and the report continues."""

    def report(act: Callable[[Machine], None]) -> bytes:
        machine = robot(image("selftest"))
        heard = after_camera_line(machine, lambda: act(machine))
        assert b"proximity 0" in heard
        return heard

    def stretch(machine: Machine, cycles: int) -> None:
        machine.board.camera.stretch = lambda _cycle: cycles

    assert b"i2c 0 96 0\r" in report(lambda machine: None)
    assert b"i2c 0 96 0\r" in report(lambda machine: i2c_wire(machine).hold(sda=True, clocks=5))
    assert b"i2c 0 96 0\r" in report(lambda machine: stretch(machine, FCY // 1000))
    assert b"i2c 2 0 0 FAIL" in report(lambda machine: machine.board.camera.unplug())  # I2C_NO_ACK
    assert b"i2c 5 0 0 FAIL" in report(lambda machine: i2c_wire(machine).hold(sda=True))  # I2C_STUCK
    assert b"i2c 4 0 0 FAIL" in report(lambda machine: stretch(machine, FCY))  # I2C_TIMEOUT


def test_a_bit_lasts_151_tcy(image: Build) -> None:
    """A bit on SCL lasts 151 Tcy: with I2CBRG = 150 the bus runs at 97.65 kHz (dspic30f6014a.md §11)."""
    machine = robot(image("clustering"))
    scl = 1 << 2
    falls: list[int] = []
    level = scl
    for cycle in range(machine.cycle, 60_000):
        before, level = level, machine.pins.levels(6, cycle) & scl
        machine.run_until(cycle + 1)
        sending = machine.peek("I2CSTAT") >> 14 & 1  # TRSTAT: in the middle of a byte
        if before and not level and sending:
            falls.append(cycle)
    apart = [later - earlier for earlier, later in pairwise(falls)]
    assert apart.count(151) >= 7 * 10, "at least ten bytes"
    assert {tcy for tcy in apart if tcy < 2 * 151} == {151}


# -- analog inputs, self-test --


def said(machine: Machine, cycles: int) -> bytes:
    heard = bytearray()
    machine.uart[1].on_byte = lambda byte, _cycle: heard.append(byte)
    machine.run(cycles=cycles)
    return bytes(heard)


def test_the_self_test_finds_every_device(image: Build) -> None:
    """The self-test finds every device and reports over UART1: 1 s at 129 mm/s makes 1000 steps."""
    machine = robot(image("selftest"), selector=5)
    machine.board.camera.show(plain(SCENES["robot"]))
    report = said(machine, 5 * FCY // 2)
    assert b"FAIL" not in report
    for line in (b"selector 5", b"camera 6030", b"green", b"leds done", b"motors done", b"end"):
        assert line in report, line
    assert steps(machine) == pytest.approx((1000, 1000), abs=2)
    assert machine.board.motors.left.illegal == 0


def test_distance_follows_the_reference_curve(image: Build) -> None:
    """Measured distances of 0-10 cm follow the reference curve through emitter, converter and driver.

    The curve is column OpenSwarm of epuck.md §5, log-linear between its points. Each millimetre is measured; the
    tolerance is 1 count (the converter rounds the dark and the lit reading) plus 1 mm.
    """
    machine = robot(image("selftest"))
    machine.run(cycles=FCY // 10)
    reflection, distance = machine.address_of("reflection"), machine.address_of("millimetres")
    for first in range(0, 104, 8):  # eight distances per run, one per sensor
        for sensor in range(8):
            machine.board.ir.set_distance(sensor, first + sensor)
        machine.run(cycles=FCY // 30)
        for sensor in range(8):
            mm = first + sensor
            assert machine.peek(reflection + 2 * sensor) == pytest.approx(reflection_at(mm), abs=1), (mm, sensor)
            found = machine.record.bytes[distance + sensor]
            assert abs(found - mm) <= 1 or (found == 255 and mm >= 100), (mm, sensor, found)
    for mm, counts in RESPONSE:
        assert reflection_at(mm) == pytest.approx(counts)


def test_ambient_light_does_not_change_the_distance(image: Build) -> None:
    """Ambient light does not change the distance: reflection = ambient reading - lit reading (epuck.md §5)."""
    machine = robot(image("selftest"))
    for sensor in range(8):
        machine.board.ir.set_distance(sensor, 20)
    for ambient in (3800, 2500, 1500):
        for sensor in range(8):
            machine.board.ir.set_ambient(sensor, ambient)
        machine.run(cycles=FCY // 10)
        at = machine.address_of("reflection")
        assert all(abs(machine.peek(at + 2 * sensor) - 857) <= 1 for sensor in range(8)), ambient


# -- interpreter and JIT --


@pytest.mark.slow
@pytest.mark.parametrize("program", PROGRAMS)
def test_engines_agree_to_the_bit(image: Build, program: str) -> None:
    """Interpreter and JIT agree in registers, memory, devices and robot state.

    The run includes camera frames, a change of the scene and a remote key.
    """
    states = []
    for engine in ("plain", "jit"):
        machine = robot(image(program), engine=engine, selector=START)
        machine.board.camera.show(noise())
        machine.run(cycles=3_456_789)
        machine.board.camera.show(plain(SCENES["object"]))
        machine.board.remote.press("standby")
        machine.run(cycles=2_345_678)
        states.append((machine.cycle, machine.pc, bytes(machine.record.bytes)[:0x2800], steps(machine)))
    assert states[0] == states[1]
