"""Compiled driver programs (programs/) on the complete robot."""

from __future__ import annotations

from functools import partial
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from emu.api import Machine
from emu.boards.epuck.analog import RESPONSE
from emu.boards.epuck.board import Epuck
from emu.boards.epuck.camera.pixels import decode
from emu.boards.epuck.stimulus import parse
from emu.image.loader import load_image

FCY = 14_745_600


def start(path: Path, engine: str = "auto", **options) -> Machine:
    image = load_image(path)
    machine = Machine(image.chip, engine=engine, board=partial(Epuck, **options))
    machine.load(image)
    return machine


def picture() -> np.ndarray:
    """Return a picture in which all pixels of the captured grid differ."""
    y, x = np.mgrid[0:480, 0:640]
    return np.stack([(x - 240) * 3 // 2, (y - 160) * 3 // 2, (x * 7 + y * 13)], axis=2).astype(np.uint8)


def captured(machine: Machine) -> np.ndarray:
    address = machine.address_of("frame")
    return decode(bytes(machine.record.bytes[address : address + 800]), "rgb565").reshape(20, 20, 3)


def expected_capture() -> np.ndarray:
    """Return the expected capture: 160 x 160 centred, zoom 8, in RGB565."""
    return picture()[160:320:8, 240:400:8] & np.array([0xF8, 0xFC, 0xF8], np.uint8)


# -- camera -----------------------------------------------------------------------------------------------------------


def test_camera_driver_captures_every_pixel(program):
    """epuck.md §7.5: the fast driver captures all 20 x 20 pixels of 160 x 160, centred, zoom 8, RGB565 from a
    PO6030K."""
    machine = start(program("camera.c", "lines.s"))
    machine.board.camera.show(picture())
    assert machine.run(cycles=4_000_000).reason == "halt"
    assert machine.peek("id") == 0x6030
    assert np.array_equal(captured(machine), expected_capture())


def test_handler_reads_the_bus_16_to_18_tcy_behind_href_and_frames_come_every_1600000(program):
    """epuck.md §7.1, §7.5: the handler reads the bus 16 to 18 Tcy after HREF. Frames of 800 x 500 columns of 4 Tcy
    come every 1,600,000 Tcy (9.216 per second), lines every 12,800 Tcy."""
    machine = start(program("camera.c", "lines.s"))
    machine.board.camera.show(picture())
    machine.run(cycles=100_000)
    machine.poke("frames", 3)
    reads: list[int] = []
    machine.hook_sfr("PORTD", lambda is_write, _value: None if is_write else reads.append(machine.events.now))
    machine.run(cycles=8_000_000)
    assert len(reads) == 3 * 20 * 40
    scan = machine.board.camera.scan
    firsts = reads[::40]
    edges = [scan.edge_cycle(1 << 3, scan.edges(1 << 3, first)) for first in firsts]
    assert {first - edge for first, edge in zip(firsts, edges, strict=True)} <= {16, 17, 18}
    assert [edges[20] - edges[0], edges[40] - edges[20]] == [1_600_000, 1_600_000]
    assert {later - earlier for earlier, later in pairwise(edges[:20])} == {2 * 12_800}
    assert {later - earlier for earlier, later in pairwise(reads[:40])} == {8, 24}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("sources", "cycles", "noise"),
    [
        (("camera.c", "lines.s"), 900_000, 1.0), (("steps.c",), 1_500_000, 1.0), (("proximity.c",), 400_000, 0.0),
        (("proximity.c",), 200_000, 1.0), (("adscan.c",), 400_000, 0.0), (("adscan.c",), 200_000, 1.0),
        (("startup.c",), 150_000, 0.0), (("serial.c",), 200_000, 1.0),
    ],
)  # fmt: skip
def test_engines_agree_to_the_bit_on_a_busy_robot(program, sources, cycles, noise):
    """engines.md §4.3: the same inputs give the same record in the same cycle in every engine, including noise,
    remote control and radio.

    Without noise the analog inputs are numbers, which native code converts without Python.
    """
    states = []
    for engine in ("plain", "auto"):
        machine = start(program(*sources), engine, seed=7)
        robot = machine.board
        robot.camera.show(picture())
        robot.noise.strength = noise
        robot.bluetooth.loss = 0.2
        robot.stimulus.play(parse(robot, '1ms remote ok\n2ms ir 0 20\n3ms uart1 "hello"\n4ms lamp 0.7'))
        machine.run_until(cycles)
        robot.outputs.update()
        states.append((machine.cycle, machine.record.field_at, machine.snapshot()))
    (cycle, name, one), (other_cycle, _, two) = states
    assert cycle == other_cycle
    assert [name(place) for place in range(len(one)) if one[place] != two[place]] == []


def test_snapshot_in_the_middle_of_a_line_continues_alike(program):
    """A snapshot in the middle of a camera line contains the line on the bus, the frame's phase and the registers."""
    machine = start(program("camera.c", "lines.s"))
    machine.board.camera.show(picture())
    reads = 0

    def count(is_write: bool, _value: int) -> None:
        nonlocal reads
        reads += 1
        if reads == 130:
            machine.interrupt()

    machine.hook_sfr("PORTD", count)
    assert machine.run(cycles=4_000_000).reason == "interrupted"
    state = machine.snapshot()
    other = start(program("camera.c", "lines.s"))
    other.board.camera.show(picture())
    other.restore(state)
    assert other.run(cycles=4_000_000).cycle == machine.run(cycles=4_000_000).cycle
    assert np.array_equal(captured(other), expected_capture())


def test_unplugged_camera_does_not_hang_the_program(program):
    """epuck.md §7.1: a program with an unplugged camera, which reads 0xFF and sends no frame, does not hang."""
    machine = start(program("startup.c"), camera=None)
    assert machine.run(cycles=20_000_000).reason == "halt"
    assert machine.peek("camera_id") == 0xFFFF
    machine = start(program("camera.c", "lines.s"), camera=None)
    assert machine.run(cycles=3_000_000).reason == "limit"
    assert machine.peek("lines_left") == 20


# -- motors -----------------------------------------------------------------------------------------------------------


def test_steps_over_a_minute_are_exact(program):
    """epuck.md §3: with an interrupt every 14,746 Tcy, the left motor makes 59,998 steps in 60 s, and the right one a
    third of them backward."""
    machine = start(program("steps.c"), engine="auto")
    machine.run_until(60 * FCY)
    robot = machine.board
    robot.outputs.update()
    assert abs(robot.outputs.steps[0] - 60 * FCY / 14_746) <= 1
    assert robot.outputs.steps[1] == -(robot.outputs.steps[0] // 3)
    assert robot.outputs.lost.tolist() == robot.outputs.illegal.tolist() == [0, 0]
    assert robot.outputs.coil_cycles.tolist() == pytest.approx([60 * FCY] * 2, rel=1e-5)


# -- infrared ---------------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_polled_proximity_driver_measures_the_reference_curve(program):
    """epuck.md §5: the polled driver measures the reference curve with all eight sensors, because 350 us settle to
    better than 0.4 %."""
    machine = start(program("proximity.c"))
    inputs = machine.board.inputs

    def measure() -> list[int]:
        done = machine.peek("rounds") + 2
        machine.run(cycles=2_000_000, until=lambda: machine.peek("rounds") == done)
        return [machine.peek(machine.address_of("reflected") + 2 * sensor) for sensor in range(8)]

    for distance, counts in RESPONSE[::3]:
        inputs.distance[:] = distance
        inputs.apply()
        assert measure() == pytest.approx([counts] * 8, rel=0.004, abs=1)
    inputs.share[3] = 0.2
    inputs.distance[5] = np.inf
    inputs.apply()
    dim = measure()
    assert dim[3] == pytest.approx(0.2 * dim[0], abs=2)
    assert dim[5] == 0


# -- start-up ---------------------------------------------------------------------------------------------------------


def test_start_up_program_finds_the_robot_the_reference_describes(program):
    """epuck.md §2, §6, §7.1; chip reference §4: the start-up program clears POR, executes RESET once and finds SWR
    set; no device answers at 0x3C."""
    machine = start(program("startup.c"), selector=13)
    machine.program.put(0x7FFFFE, 0xFFF7)
    said = bytearray()
    machine.board.bluetooth.on_byte = lambda byte, _start: said.append(byte)
    assert machine.run(cycles=20_000_000).reason == "halt"
    machine.uart[1].drain()
    assert [cause for _, cause in machine.resets] == ["POR", "POR", "SWR"]
    assert machine.peek("RCON") & 0x00C3 == 0x0042  # SWR and BOR are set; POR was cleared, EXTR was never set
    assert machine.peek("ports_ok") == 1
    assert machine.peek("accelerometer_id") == 0xFF
    assert machine.peek("camera_id") == 0x6030
    assert machine.peek("selector") == 13
    assert machine.peek("eeprom_word") == 0xFFF7
    assert (machine.peek("battery_ok"), machine.peek("remote_idle")) == (1, 1)
    assert bytes(said) == (
        b'\f\aWELCOME to the SerCom protocol on e-Puck\r\nthe EPFL education robot type "H" for help\r\n'
    )


@pytest.mark.parametrize(("sensor", "identity"), [("PO3030K", 0x3030), ("PO8030D", 0x8030)])
def test_cameras_are_identified_by_their_registers(program, sensor, identity):
    """epuck.md §7.1: the program identifies each camera by its registers."""
    machine = start(program("startup.c"), camera=sensor)
    assert machine.run(cycles=20_000_000).reason == "halt"
    assert machine.peek("camera_id") == identity


# -- faults -----------------------------------------------------------------------------------------------------------


def test_low_battery_is_seen_by_the_program(program):
    """epuck.md §2: the program reads RF1 = 0 if the battery is below 3.4 V."""
    machine = start(program("startup.c"))
    machine.board.battery.volts = 3.3
    assert machine.run(cycles=20_000_000).reason == "halt"
    assert machine.peek("battery_ok") == 0


def test_framing_errors_and_overruns_reach_the_program(program):
    """Chip reference §10.2: FERR is set with its character; clearing OERR empties the full FIFO."""
    machine = start(program("serial.c"))
    robot = machine.board
    heard = bytearray()
    robot.bluetooth.on_byte = lambda byte, _start: heard.append(byte)
    script = """
    0.001s uart1 "abc"
    0.002s uart1 "XY" framing
    0.003s uart1 "d"
    0.004s uart1 "s1234567890"
    0.020s uart1 "e"
    0.021s bluetooth down
    0.022s uart1 "zzz"
    0.023s bluetooth up
    0.024s uart1 "f"
    """
    robot.stimulus.play(parse(robot, script))
    machine.run_until(FCY // 30)
    assert machine.peek("framing_errors") == 2
    assert machine.peek("overruns") == 1
    assert heard == b"abcdsef"
    assert robot.bluetooth.lost == 3


def test_stuck_data_line_ends_the_probe_with_collisions_not_in_a_hang(program):
    """Chip reference §11: a start with SDA stuck low is a collision; the polled driver gives up and continues."""
    machine = start(program("startup.c"))
    machine.board.stimulus.play(parse(machine.board, "2000 i2c sda 0"))
    assert machine.run(cycles=40_000_000).reason == "halt"
    assert machine.peek("camera_id") != 0x6030
    assert machine.peek("I2CSTAT") & 1 << 10


def test_scanning_driver_measures_everything_at_the_vendors_rates(program):
    """epuck.md §5: the scanning driver makes a scan in 900 Tcy plus the handler's time, a pair in 65 scans, and all
    four pairs in about 15.9 ms."""
    machine = start(program("adscan.c"))
    robot = machine.board
    robot.inputs.distance[:] = [10, 20, 30, 40, 50, 60, 80, np.inf]
    robot.inputs.acceleration[:] = 0.25, -0.25, 1
    robot.inputs.apply()
    robot.microphones.play(1, lambda _cycle: 100.0)
    machine.run_until(2 * FCY // 10)
    array = {
        name: [machine.peek(machine.address_of(name) + 2 * index) for index in range(count)]
        for name, count in (("reflected", 8), ("ambient", 8), ("acceleration", 3), ("microphone", 3))
    }
    assert array["reflected"] == pytest.approx([3548, 857, 474, 296, 205, 153, 84, 0], rel=0.01, abs=2)
    assert array["ambient"] == [3800] * 8
    assert array["acceleration"] == [2248, 1848, 2848]
    assert array["microphone"] == [2048, 2148, 2048]
    period = 2 * FCY / 10 / machine.peek("scans")
    assert 900 <= period <= 1000
    assert machine.peek("rounds") == pytest.approx(machine.peek("scans") / 260, abs=1)
