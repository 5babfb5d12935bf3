"""Stimulus files and the observer."""

from __future__ import annotations

import pytest

from emu.boards.epuck.observer import RobotObserver
from emu.boards.epuck.stimulus import StimulusError, parse

FCY = 14_745_600

SCRIPT = """
# what happens to the robot
1ms    selector 5
20000  battery 3.2          # cycles
0.002s ir 3 20
0.002s light 2 1000
3000us tilt 0 0 -1
0.004s uart2 "ok\\r"
0.005s pin RB2 1
0.006s remote ok
0.007s camera unplug
0.008s bluetooth down
0.008s lamp 0.5
0.008s noise 1
0.008s uart2 "x" framing
"""


def test_steps_happen_at_their_times(robot):
    """Stimulus steps execute at their times, given in seconds or cycles in any order."""
    robot.write_all(U2BRG=7, U2MODE=0x8000)
    robot.board.stimulus.play(parse(robot.board, SCRIPT))
    robot.at(round(0.001 * FCY) - 1)
    assert robot.board.selector.position == 0
    robot.at(round(0.001 * FCY))
    assert robot.board.selector.position == 5
    assert robot.board.battery.volts == 4.0
    robot.at(round(0.0055 * FCY))
    assert robot.board.battery.volts == 3.2
    assert robot.board.ir.reflection[3] == 857
    assert robot.board.ir.ambient[2] == 1000
    assert [robot.read("U2RXREG") for _ in range(3)] == [0x6F, 0x6B, 0x0D]
    robot.at(FCY // 10)
    assert 0x6E not in robot.board.chip.i2c.wire.devices
    assert not robot.board.bluetooth.connected
    assert (robot.board.camera.lamp, robot.board.noise.strength) == (0.5, 1.0)
    assert robot.read("U2STA") & 4


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("1s", "expected one of selector"), ("1s dance", "expected one of selector"),
        ("soon selector 1", "begins with its time"), ("-1s selector 1", "begins with its time"),
        ("1.5 selector 1", "begins with its time"), ("1s selector 16", "positions 0 to 15"),
        ("1s selector", "expected 1 arguments"), ("1s ir 8 20", "sensors are 0 to 7"),
        ("1s remote 64", "commands 0 to 63"), ("1s remote louder", "invalid literal"),
        ("1s pin RH1 0", "not a pin name"), ("1s pin RA6 2", "a level is 0 or 1"),
        ("1s uart1 hello", "malformed|expected|invalid"), ("1s battery 9", "0 to 5 V"),
        ("1s camera off", "expected `plug`"), ("1s picture", "expected 1 arguments"),
        ("1s lamp -1", "brightness is"), ("1s bluetooth off", "`up` or `down`"),
        ("1s i2c sda", "expected `sda CLOCKS`"), ("1s noise -1", "strength of noise"),
        ("1s light 3 4096", "0 to 4095 counts"), ("1s light 3 nan", "0 to 4095 counts"),
        ("1s tilt 0 0 nan", "-100 to 100 g"), ("1s tilt inf 0 0", "-100 to 100 g"),
        ("1s ir 0 nan", "0 mm or more"), ("1s ir nan 5", "sensors are 0 to 7"),
        ("1s i2c sda 65536", "0 .until `free`. to 65535 clocks"), ("1s i2c sda -1", "to 65535 clocks, not -1"),
        ('1s uart1 "x" wrong', "expected one of framing"), ('1s uart1 "open', "No closing quotation"),
    ],
)  # fmt: skip
def test_mistakes_are_reported_with_file_and_line(robot, line, message):
    """An error in a stimulus file is reported with file, line and expected input."""
    with pytest.raises(StimulusError, match=rf"^file:2: .*({message})"):
        parse(robot.board, "# first\n" + line, "file")


def test_script_position_is_part_of_a_snapshot(robot):
    """After a restore, the stimulus steps after the snapshot are repeated."""
    robot.board.stimulus.play(parse(robot.board, "1000 selector 1\n3000 selector 2"))
    robot.at(2000)
    state = robot.machine.snapshot()
    robot.at(4000)
    assert robot.board.selector.position == 2
    robot.machine.restore(state)
    assert robot.board.selector.position == 1
    robot.at(4000)
    assert robot.board.selector.position == 2


def test_observer_reports_visible_outputs(robot):
    """The observer reports LEDs, motors and text lines, each with its time."""
    lines = []
    RobotObserver(robot.board, ["leds", "motors", "uart1"], lines.append)
    robot.at(FCY).output("RA6", 1)
    robot.output("RC1", 1)
    robot.output("RA6", 0)
    assert [line.split("  ")[-1] for line in lines] == ["leds led0", "leds led0 front", "leds front"]
    assert lines[0].split()[0] == "1.000000"
    lines.clear()
    robot.write_all(U1BRG=7, U1MODE=0x8000, U1STA=0x400)
    for byte in b"Hi\r\n":
        robot.write("U1TXREG", byte)
        robot.later(1500)
    assert [line.split("  ")[-1] for line in lines] == ["uart1 'Hi'"]
    lines.clear()
    robot.write("TRISD", 0xFF00)
    for pattern in (0xA0, 0x60, 0x50, 0x90, 0xA0):
        robot.write("LATD", pattern)
        robot.later(FCY // 20)
    assert len(lines) == 2
    assert "motors 0 1 steps" in lines[0]


def test_unknown_topics_are_refused(robot):
    """Unknown topics of the observer are refused."""
    with pytest.raises(ValueError, match="cannot watch 'smell'"):
        RobotObserver(robot.board, ["smell"], print)


def test_key_presses_beyond_the_queue_are_dropped(robot):
    """The remote control queues 64 frames; further key presses are dropped without an error."""
    robot.board.stimulus.play(parse(robot.board, "1000 remote ok\n" * 100))
    robot.at(2000)
    assert robot.read("PORTF") & 0x40
