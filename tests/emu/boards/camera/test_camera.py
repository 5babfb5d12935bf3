"""The camera's bus (epuck.md §7): windows, timing, edges, I2C, power and plug."""

from __future__ import annotations

import random

import numpy as np
import pytest

from emu.boards.epuck.camera.scan import HREF, PCLK, VSYNC, per_frame
from emu.boards.epuck.camera.sensors import SENSORS
from emu.peripherals.timers.rules import write_ton

from ..conftest import Robot
from .camera_driver import capture, po3030, po6030, rgb565, scene


def test_openswarm_window_is_captured_pixel_by_pixel():
    """§7.5: for a window of 160 x 160, centred, with zoom 8, the sensor sends QQVGA, and software takes every second
    pixel and line."""
    robot = Robot()
    picture = scene()
    robot.board.camera.show(picture)
    robot.configure(po6030())
    data = capture(robot, 20, 2 * 40, skip_lines=1)
    pixels = data.reshape(20, 40, 2)[:, ::2]
    assert np.array_equal(pixels, rgb565(picture[160:320:8, 240:400:8]))


@pytest.mark.parametrize(("scale", "shift"), [(1, -1), (2, -1), (4, -1)])
def test_po3030k_rgb_window_begins_one_column_early(scale, shift):
    """§7.5: in every RGB mode of the PO3030K, the first stored pixel is that of column x - 1."""
    robot = Robot(camera="PO3030K")
    picture = scene()
    robot.board.camera.show(picture)
    robot.configure(po3030(scale=scale))
    data = capture(robot, 3, 2 * 10).reshape(3, 10, 2)
    columns = 240 + shift + scale * np.arange(10)
    rows = 160 + scale * np.arange(3)
    assert np.array_equal(data, rgb565(picture[rows][:, columns]))


@pytest.mark.parametrize(("scale", "shift"), [(1, 0), (2, 1), (4, 3)])
def test_po3030k_grey_window(scale, shift):
    """§7.5: grey windows of the PO3030K start at column x for VGA, x + 1 for QVGA and x + 3 for QQVGA."""
    robot = Robot(camera="PO3030K")
    ramp = np.tile((np.arange(640) // 4).astype(np.uint8) + 40, (480, 1))
    ramp[:, ::4] += 90
    robot.board.camera.show(ramp)
    robot.configure(po3030(scale=scale, form="grey"))
    data = capture(robot, 2, 12)
    assert np.array_equal(data[0], ramp[160, 240 + shift + scale * np.arange(12)])


@pytest.mark.parametrize(
    ("sensor", "writes", "frame", "fps"),
    [
        ("PO6030K", po6030(), 1_600_000, 9.216), ("PO6030K", po6030(form="grey"), 800_000, 18.432),
        ("PO6030K", po6030(scale=1), 6_400_000, 2.304), ("PO3030K", po3030(), 3_408_000, 4.33),
        ("PO3030K", po3030(form="grey"), 1_704_000, 8.65), ("PO3030K", po3030(scale=2), 6_816_000, 2.16),
        ("PO3030K", po3030(scale=1), 13_632_000, 1.08),
    ],
)  # fmt: skip
def test_frame_rates(sensor, writes, frame, fps):
    """§7.4, §7.1: a frame lasts 800 x 500 or 852 x 1000 columns of N Tcy."""
    robot = Robot(camera=sensor)
    robot.configure(writes)
    assert robot.board.camera.scan.timing.frame_tcy == frame
    assert robot.board.camera.frames_per_second == pytest.approx(fps, rel=2e-3)


@pytest.mark.parametrize(("scale", "form", "line"), [(4, "rgb565", 13632), (1, "rgb565", 13632), (2, "grey", 6816)])
def test_line_spacing_of_the_fast_driver_is_the_same_in_every_mode(scale, form, line):
    """§7.4: lines of the fast driver are 6816 Tcy apart for grey and 13632 for RGB, with one byte every 8 Tcy."""
    robot = Robot(camera="PO3030K")
    robot.configure(po3030(scale=scale, form=form))
    camera = robot.board.camera
    assert camera.scan.href(1) - camera.scan.href(0) == line
    assert camera.scan.timing.byte_tcy == 8


def test_short_exposure_shortens_the_frame_of_the_po3030k():
    """§7.4: a frame of the PO3030K has max(852, integration + 2) rows."""
    robot = Robot(camera="PO3030K")
    robot.configure([*po3030(), (0, 0x1A, 0x01), (0, 0x1B, 0x00)])
    assert robot.board.camera.scan.timing.frame_tcy == 852 * 852 * 4


def test_vsync_rises_two_columns_behind_href_of_its_row():
    """§7.4: VSYNC rises two columns (2 N Tcy) after HREF of its row, so the handler takes the next line."""
    robot = Robot(camera="PO3030K")
    robot.configure(po3030())
    camera = robot.board.camera
    rise = camera.scan.edge_cycle(VSYNC, 1)
    assert rise - camera.scan.href(0) == 8
    assert camera.scan.bits(rise) & VSYNC
    assert not camera.scan.bits(rise - 1) & VSYNC


@pytest.mark.parametrize("sensor", sorted(SENSORS))
@pytest.mark.parametrize("mask", [HREF, VSYNC, PCLK])
def test_edge_arithmetic_agrees_with_the_levels(sensor, mask):
    """Closed forms of the signal edges equal the levels stepped cycle by cycle, around the ends of lines and frames."""
    robot = Robot(camera=sensor)
    robot.configure({"PO3030K": [], "PO6030K": [(0, 0x91, 0x90)], "PO8030D": [(0, 0x6A, 0x04)]}[sensor])
    camera = robot.board.camera
    number, checked = 1, 0
    while checked < 60:
        cycle = camera.scan.edge_cycle(mask, number)
        assert camera.scan.bits(cycle) & mask
        assert not camera.scan.bits(cycle - 1) & mask
        assert (camera.scan.edges(mask, cycle - 1), camera.scan.edges(mask, cycle)) == (number - 1, number)
        number += 1 if checked % 3 else max(per_frame(mask, camera.scan.timing) * 3 // 10, 1)
        checked += 1


def test_byte_stands_on_the_bus_from_half_a_byte_before_to_half_behind():
    """§7.5: byte k is on the bus for HREF + 8 k - 4 <= t < HREF + 8 k + 4."""
    robot = Robot()
    robot.board.camera.show(np.full((480, 640, 3), 255, np.uint8))
    robot.configure(po6030())
    camera = robot.board.camera
    edge = camera.scan.href(30)
    assert [camera.bits(edge + t) >> 8 for t in (-5, -4, 3)] == [0, 255, 255]
    last = edge + 8 * camera.scan.timing.line_bytes - 4
    assert [camera.bits(t) >> 8 for t in (last - 1, last)] == [255, 0]


@pytest.mark.parametrize(("sensor", "identity"), [("PO3030K", 0x3030), ("PO6030K", 0x6030), ("PO8030D", 0x8030)])
def test_identity_over_i2c(sensor, identity):
    """§7.1: the I2C module reads the identity from registers 0 and 1 at 0xDC/0xDD."""
    robot = Robot(camera=sensor)
    robot.write_all(I2CBRG=150, I2CCON=0x9000)

    def operation(name, value):
        robot.write("IFS0", 0)
        robot.write(name, value)
        while not robot.read("IFS0") & 1 << 14:
            robot.later(50)

    def register(number):
        operation("I2CCON", 0x9001)
        operation("I2CTRN", 0xDC)
        operation("I2CTRN", number)
        operation("I2CCON", 0x9002)
        operation("I2CTRN", 0xDD)
        assert not robot.read("I2CSTAT") & 0x8000
        operation("I2CCON", 0x9008)
        value = robot.read("I2CRCV")
        operation("I2CCON", 0x9030)
        operation("I2CCON", 0x9004)
        return value

    assert register(0) << 8 | register(1) == identity


def test_reset_line_stops_the_sensor_and_clears_its_registers(robot):
    """§2: RC13 = 0 stops the sensor and clears its registers."""
    robot.configure([(1, 0x80, 0x80)])
    robot.output("RC13", 0)
    camera = robot.board.camera
    assert not camera.start(False, 10)
    assert camera.scan.edge_cycle(HREF, 1) > 1 << 60
    robot.at(1000).output("RC13", 1)
    assert camera.register(1, 0x80) == 0x20
    assert camera.start(False, 1010)
    assert camera.scan.href(0) > 1000


def test_unplugged_camera_gives_neither_answers_nor_edges(robot):
    """An unplugged camera does not answer at address 0x6E and has no VSYNC edges."""
    robot.write_all(PR5=1, T5CON=0x8002)
    robot.board.camera.unplug()
    robot.at(20_000_000)
    assert not robot.read("IFS1") & 1 << 6
    assert 0x6E not in robot.board.chip.i2c.wire.devices
    robot.board.camera.plug()
    robot.at(40_000_000)
    assert robot.read("IFS1") & 1 << 6


def test_lines_of_a_moving_scene_are_seen_when_they_are_read_out(robot):
    """The pixel source receives the cycle of each line, so that a moving scene shows the rolling shutter."""
    seen = []

    def rows(y, cycle):
        seen.append((y, cycle))
        return np.zeros((640, 3), np.uint8)

    robot.board.camera.show_rows(rows)
    robot.configure(po6030())
    capture(robot, 3, 4)
    line = 800 * 4 * 4
    assert [y for y, _ in seen] == [160, 164, 168]
    assert [later - seen[0][1] for _, later in seen] == [0, line, 2 * line]


def test_snapshot_restores_registers_and_timing(robot):
    """A restored snapshot has the camera's registers and timing; derived state is computed again."""
    robot.configure(po6030())
    state = robot.machine.snapshot()
    frame = robot.board.camera.scan.timing.frame_tcy
    robot.configure([(1, 0x80, 0x20), (0, 0x91, 0xB0)])
    assert robot.board.camera.scan.timing.frame_tcy != frame
    robot.machine.restore(state)
    assert robot.board.camera.scan.timing.frame_tcy == frame


def test_po8030d_delivers_the_openswarm_window():
    """openswarm-original.md §5.5: the PO8030D delivers the window of 160 x 160, centred, with zoom 8."""
    robot = Robot(camera="PO8030D")
    picture = scene()
    robot.board.camera.show(picture)
    window = {0x08: 0x00, 0x09: 0x3B, 0x10: 0x00, 0x11: 0xA0, 0x12: 0x01, 0x13: 0xE4, 0x6A: 0x02, 0x6C: 0x00}
    mode = {0x4E: 0x30, 0xB7: 3, 0x93: 0x80, 0x94: 0x80}
    robot.configure([*((0, reg, value) for reg, value in window.items()), *((1, r, v) for r, v in mode.items())])
    pixels = capture(robot, 20, 2 * 40, skip_lines=1).reshape(20, 40, 2)[:, ::2]
    assert np.array_equal(pixels, rgb565(picture[160:320:8, 240:400:8]))


def test_t1_counts_one_edge_of_pclk_per_byte(robot):
    """§2, §7.4: T1 counts one PCLK edge (T1CK) per byte, only within lines."""
    robot.configure(po6030())
    camera = robot.board.camera
    robot.write("PR1", 0xFFFF)
    robot.at(camera.scan.href(5) - 100).write("TMR1", 0)
    robot.write("T1CON", 0x8002)
    robot.at(camera.scan.href(6) - 100)
    assert robot.read("TMR1") == camera.scan.timing.line_bytes == 202
    robot.at(camera.scan.href(6) + 8 * 10 + 1)
    assert robot.read("TMR1") == 202 + 11


def test_polling_portc_sees_the_sync_lines(robot):
    """§2: PORTC shows HREF in bit 3 and VSYNC in bit 4."""
    robot.configure(po6030())
    scan = robot.board.camera.scan
    edge, vsync = scan.href(0), scan.edge_cycle(VSYNC, 1)
    assert [robot.at(cycle).read("PORTC") & (HREF | VSYNC) for cycle in (edge - 1, edge)] == [0, HREF]
    assert [robot.at(cycle).read("PORTC") & VSYNC for cycle in (vsync - 1, vsync)] == [0, VSYNC]


def test_plug_is_part_of_a_snapshot(robot):
    """A camera that was plugged in at the time of a snapshot answers and sends edges after the restore."""
    state = robot.machine.snapshot()
    robot.board.camera.unplug()
    robot.machine.restore(state)
    assert 0x6E in robot.board.chip.i2c.wire.devices
    edge = robot.board.camera.scan.edge_cycle(HREF, 1)
    assert robot.at(edge).read("PORTC") & HREF


@pytest.mark.parametrize("line", [0, 40, 119])
def test_an_edge_can_be_put_on_any_cycle(robot, line):
    """`align` moves an HREF edge to any cycle, and counters of HREF count the moved edge. Tests of interrupt latency
    use this."""
    robot.configure(po6030())
    camera = robot.board.camera
    robot.at(10_000).write("T4CON", 0x8002)
    wanted = robot.events.now + 12_345
    camera.align(wanted, line)
    assert camera.scan.bits(wanted) & ~camera.scan.bits(wanted - 1) & HREF
    before = robot.at(wanted).read("TMR4")
    assert robot.at(wanted + 1).read("TMR4") == before + 1
    assert camera.scan.line_at(wanted) == (line, wanted)


def test_unplugging_in_the_middle_of_a_line_ends_it_at_once(robot):
    """Unplugging the camera ends the current line at once, both for Python and for rules."""
    robot.board.camera.show(np.full((480, 640), 255, np.uint8))
    robot.configure(po6030())
    camera = robot.board.camera
    robot.at(camera.scan.href(10) + 100)
    assert robot.read("PORTD") >> 8 == 255
    camera.unplug()
    assert robot.read("PORTD") >> 8 == 0
    assert robot.machine.record.u64[robot.machine.record.fields["camera.line_to"].index] <= robot.events.now


@pytest.mark.parametrize("seed", range(4))
def test_timers_on_sync_lines_are_switched_alike_with_and_without_the_rule(seed):
    """Switching TON of timers on HREF and VSYNC, around edges and matches, leaves the same record with the rule of
    native code and with the device's hooks."""
    robots = [Robot(), Robot()]
    bus, events = robots[0].machine.bus, [robot.events for robot in robots]
    hooks = robots[1].machine.bus
    hooks.rules[:] = [None if rule and rule.writes is write_ton else rule for rule in hooks.rules]
    followed, write = [], bus.integers.write

    def counted(rule, value, lanes):
        done = write(rule, value, lanes)
        followed.extend([done] * (rule.writes is write_ton))
        return done

    bus.integers.write = counted
    draw = random.Random(seed)
    for robot in robots:
        robot.configure(po6030())
        robot.write("PR5", 1)
        robot.later(20)
    for step in range(200):
        register, bits = draw.choice(("T4CON", "T5CON")), 0x8002
        kind = draw.random()
        if kind < 0.55:
            on = draw.random() < 0.5
            value, lanes = (0x8002 if on else 2), draw.choice((0xFFFF, 0xFF00))
        elif kind < 0.6:
            value, lanes = draw.choice((0x8002, 0x800A, 0x0012, 0x8030, 0x8012, 0x2002, 0x8022)), 0xFFFF
        elif kind < 0.8:
            register, value, lanes = draw.choice(("TMR4", "TMR5")), draw.choice((0, 0, 1, 2, 3, 50)), 0xFFFF
        elif kind < 0.9:
            register, value, lanes = draw.choice(("PR4", "PR5")), draw.choice((0, 1, 1, 2, 3, 9)), 0xFFFF
        else:
            value, lanes = bits, 0xFFFF
        camera = robots[0].board.camera
        now = events[0].now
        edge = camera.scan.nth_rise(draw.choice((HREF, HREF, VSYNC)), now, draw.choice((1, 1, 2)))
        later = draw.choice((1, 1, 2, 3, 40, max(edge - now + draw.randrange(-2, 4), 1)))
        for robot in robots:
            robot.machine.bus.write(robot.machine.chip.sfrs[register].address, value, lanes)
            robot.later(later)
            robot.machine.peripherals.pins.flush()
            robot.machine.record.u64[robot.events.deadline_index] = 0  # derived state
        counts = [[robot.read(name) for name in ("TMR4", "TMR5")] for robot in robots]
        assert counts[0] == counts[1], (step, register, hex(value), counts)
        record = robots[0].machine.record
        both = record.snapshot(), robots[1].machine.record.snapshot()
        if both[0] != both[1]:
            fields = {record.field_at(i) for i, (one, other) in enumerate(zip(*both, strict=True)) if one != other}
            pytest.fail(f"step {step}, {register} = {value:#x}, lanes {lanes:#x}: {fields}")
    assert sum(followed) > 20
