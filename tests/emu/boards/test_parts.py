"""Devices of the e-puck except the camera (sections are those of epuck.md)."""

from __future__ import annotations

import random
import statistics
from itertools import pairwise

import pytest

from emu.boards.epuck.analog import reflection_at
from emu.boards.epuck.simple import LED_PINS

from .conftest import Robot

FCY = 14_745_600
PHASES = [0xA, 0x6, 0x5, 0x9]


# -- LEDs, selector, battery ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("name", "pin"), list(LED_PINS.items()))
def test_led_is_lit_while_its_pin_is_driven_high(robot, name, pin):
    """§2: an LED is lit while its pin is driven high; LED3 is RA12 and LED4 is RA10."""
    robot.output(pin, 1)
    assert robot.board.leds.lit == (name,)
    robot.output(pin, 0)
    assert robot.board.leds.lit == ()


def test_selector_shows_its_position_on_port_g(robot):
    """§2: the selector position is S0 + 2 S1 + 4 S2 + 8 S3 on RG6..RG9."""
    robot.board.selector.position = 11
    assert robot.at(2).read("PORTG") >> 6 & 0xF == 11
    with pytest.raises(ValueError, match="positions 0 to 15"):
        robot.board.selector.position = 16


def test_low_battery_pulls_its_line_down(robot):
    """§2: a battery below 3.4 V pulls RF1 low."""
    assert robot.at(2).read("PORTF") & 2
    robot.board.battery.volts = 3.39
    assert not robot.at(4).read("PORTF") & 2


# -- motors -----------------------------------------------------------------------------------------------------------


def drive(robot, shift, indices, period=1000):
    """Write phase patterns one bit per cycle, as BSET and BCLR do."""
    robot.write("TRISD", 0xFF00)
    for index in indices:
        target = PHASES[index % 4] if index is not None else 0
        for bit in range(4):
            latch = robot.read("LATD")
            mask = 1 << shift + bit
            robot.write("LATD", latch | mask if target >> bit & 1 else latch & ~mask)
            robot.later(1)
        robot.later(period - 4)


def test_right_motor_goes_forward_with_rising_and_left_with_falling_phases(robot):
    """§3: 5000 rising phases turn the right motor forward, 5000 falling ones the left. Intermediate patterns of
    bit-by-bit writes do not count."""
    drive(robot, 4, range(5001))
    drive(robot, 0, range(5000, -1, -1))
    motors = robot.board.motors
    assert (motors.left.steps, motors.right.steps) == (5000, 5000)
    assert (motors.left.lost, motors.left.illegal, motors.right.lost, motors.right.illegal) == (0, 0, 0, 0)


@pytest.mark.parametrize("blinks", [False, True])
def test_step_history_equals_reads_at_each_quantum(blinks):
    """Step counts from the ring of port changes equal reads at each quantum, although the ring also holds changes of
    the LEDs. The LEDs' watchers receive all of their changes."""
    quick, plain = Robot(), Robot()
    draw = random.Random(7)
    index, cycle, lit, entries, ends = 0, 100, [], [], list(range(1_000, 41_000, 1_000))
    while cycle < 40_000:
        index += draw.choice([1, 1, 1, -1, 0])
        entries.append(cycle << 24 | 3 << 16 | PHASES[index % 4] << 4 | PHASES[-index // 2 % 4])
        if blinks and draw.random() < 0.2:
            entries.append(cycle + 1 << 24 | draw.choice([0, 0x40, 0x80]))
        cycle += draw.choice([5, 300, 700])

    def leave(robot: Robot, changes: list[int]) -> None:
        pins = robot.machine.pins
        pins.ring[: len(changes)] = memoryview(b"".join(one.to_bytes(8, "little") for one in changes)).cast("Q")
        robot.machine.record.u64[robot.machine.record.fields["pins.ring_count"].index] = len(changes)

    quick.machine.pins.watch("RA6", lambda *edge: lit.append(edge), lazy=True)
    made, looked = [], []
    for robot in (quick, plain):
        robot.board.motors.record_history()
    for first in range(0, len(ends), 4):
        until = ends[first + 3]
        due = [one for one in entries if (until - 4_000) <= one >> 24 < until]
        leave(quick, due)
        quick.at(until)
        made += quick.board.motors.steps_by(ends[first : first + 4])
        assert not any(quick.machine.pins.ring)
        for end in ends[first : first + 4]:
            leave(plain, [one for one in due if end - 1_000 <= one >> 24 < end])
            plain.at(end)
            looked += plain.board.motors.steps()
    assert made == looked
    assert max(looked) > 5
    assert quick.machine.pins._reported.tolist() == plain.machine.pins._reported.tolist()
    assert bool(lit) == blinks


def test_reversing_counts_backward(robot):
    """§3: reversed phases count backward."""
    drive(robot, 4, [0, 1, 2, 3, 2, 1, 0, 3, 2])
    assert robot.board.motors.right.steps == 3 - 5


def test_jump_by_two_phases_loses_the_step(robot):
    """§3: a jump by two phases does not turn the motor."""
    drive(robot, 4, [0, 2, 3])
    assert (robot.board.motors.right.steps, robot.board.motors.right.lost) == (1, 1)


def test_a_constant_pattern_that_is_not_a_phase_counts_as_illegal(robot):
    """§3: a constant pattern that is no phase counts as illegal, because each of the four phases drives two coils."""
    robot.write_all(TRISD=0xFF00, LATD=0x0F)
    assert robot.at(15).board.motors.left.illegal == 0
    assert robot.at(16).board.motors.left.illegal == 1


def test_reading_the_motors_does_not_change_the_record(robot):
    """Reading the motors does not change the record, although steps are computed on access."""
    other = Robot()
    for one in (robot, other):
        one.write("TRISD", 0xFF00)
        one.write("LATD", 0x05)
    assert robot.at(40).board.motors.steps() == (0, 0)
    assert robot.at(60).machine.snapshot() == other.at(60).machine.snapshot()


def test_coils_off_keep_the_rotor_in_place(robot):
    """§3: turning the coils off between steps (power save) does not turn the motor."""
    drive(robot, 4, [0, None, 1, None, 2])
    assert robot.board.motors.right.steps == 2


def test_coil_time_is_counted_to_the_cycle(robot):
    """§3: coils that are on from cycle 11 to 111 count 100 cycles."""
    robot.write("TRISD", 0xFF00)
    robot.at(10).write("LATD", 0x5)
    robot.at(110).write("LATD", 0)
    assert robot.at(500).board.motors.left.coil_cycles == 100


# -- infrared ---------------------------------------------------------------------------------------------------------


def convert(robot, channel):
    """Make one polled conversion as the library does (chip reference §13)."""
    robot.write_all(ADPCFG=0, ADCON1=0, ADCON3=0x12, ADCHS=channel)
    robot.write("ADCON1", 0x8000)
    robot.write("ADCON1", 0x8002)
    robot.later(20)
    robot.write("ADCON1", 0x8000)
    robot.later(140)
    return robot.read("ADCBUF0")


PULSES = ["RF7", "RF8", "RG0", "RG1"]


@pytest.mark.parametrize("sensor", range(8))
def test_reflection_is_seen_only_under_the_sensors_own_pulse_line(robot, sensor):
    """§5: emitter line n lights sensors n and n + 4; after 350 us their raw counts are lower by the reflection."""
    robot.board.ir.set_distance(sensor, 20)
    assert convert(robot, 8 + sensor) == 3800
    robot.output(PULSES[(sensor + 1) % 4], 1)
    robot.later(6000)
    assert convert(robot, 8 + sensor) == 3800
    robot.output(PULSES[sensor % 4], 1)
    robot.later(5168)
    assert 3800 - convert(robot, 8 + sensor) == pytest.approx(857, abs=5)


@pytest.mark.parametrize(
    ("mm", "counts"),
    [(0, 3788), (10, 3548), (20, 857), (30, 474), (40, 296), (50, 205), (60, 153), (80, 84), (100, 53), (150, 0)],
)
def test_distance_sweep_gives_the_reference_curve(robot, mm, counts):
    """§5: proximity (ambient minus lit) over distance equals the reference table."""
    robot.board.ir.set_distance(2, mm)
    dark = convert(robot, 10)
    robot.output("RG0", 1)
    robot.later(5168)
    assert dark - convert(robot, 10) == pytest.approx(counts, rel=0.005, abs=1)


def test_curve_falls_everywhere():
    """§5: proximity decreases with distance everywhere and is log-linear between the points of the table."""
    values = [reflection_at(0.5 * step) for step in range(201)]
    assert all(near > far for near, far in pairwise(values))


def test_receiver_settles_with_its_time_constant(robot):
    """§5, §10: the receiver settles with 60 us = 885 Tcy: 63 % after this time, more than 99 % after 300 us."""
    ir = robot.board.ir
    ir.set_distance(0, 10)
    robot.at(1000).output("RF7", 1)
    lowered = [3800 - (ir._level(0, 1001 + cycles) >> 4) for cycles in (0, 885, 4424)]
    assert lowered[0] == 0
    assert lowered[1] == pytest.approx(3548 * 0.632, rel=0.002)
    assert lowered[2] > 3548 * 0.99


def test_accelerometer_at_rest_reads_one_g_on_z(robot):
    """§6: the accelerometer at rest reads 2048, 2048 and 2848, which is 1 g on z."""
    assert [convert(robot, channel) for channel in (5, 6, 7)] == [2048, 2048, 2848]


def test_microphones_hear_a_function_of_the_cycle(robot):
    """§6: the microphones on AN2 to AN4 convert a function of the cycle."""
    assert convert(robot, 2) == 2048
    robot.board.microphones.play(1, lambda cycle: 500.0)
    assert convert(robot, 3) == 2548


# -- remote control ---------------------------------------------------------------------------------------------------


def test_remote_frame_has_its_bits_where_the_library_samples_them(robot):
    """§6: the remote control's frame has its bits where the library samples them. From the first falling edge, low at
    2.1 ms and the toggle bit at 3.0 ms, then address and command every 1.8 ms."""
    robot.board.remote.press("ok", address=5, cycle=10_000)
    while robot.board.chip.pins.get("RF6"):
        robot.later(100)
    start = robot.events.now

    def level(milliseconds):
        robot.at(start + round(milliseconds * 1e-3 * FCY))
        return robot.board.chip.pins.get("RF6")

    assert level(2.1) == 0
    assert level(3.0) == 1
    assert [level(4.8 + 1.8 * bit) for bit in range(5)] == [0, 0, 1, 0, 1]
    assert [level(13.8 + 1.8 * bit) for bit in range(6)] == [1, 1, 0, 1, 0, 1]
    assert level(30.0) == 1


def test_toggle_bit_changes_with_every_press_and_frames_wait_for_each_other(robot):
    """§6: the toggle bit changes with every key press, and frames repeat after 113.8 ms without overlap."""
    edges = []
    robot.board.chip.pins.watch("RF6", lambda cycle, changed, levels: edges.append(cycle))
    robot.board.remote.press("swap")
    robot.board.remote.press("swap")
    robot.at(round(0.3 * FCY))
    starts = [edge for before, edge in zip([-(10**9), *edges], edges, strict=False) if edge - before > 0.05 * FCY]
    assert starts[1] - starts[0] == round(0.1138 * FCY)


def test_remote_raises_int0(robot):
    """§6: the falling edge of a remote control frame raises INT0."""
    robot.write("INTCON2", 1)
    robot.board.remote.press(12)
    robot.at(20_000)
    assert robot.read("IFS0") & 1


# -- codec, Bluetooth -------------------------------------------------------------------------------------------------


def test_codec_takes_words_only_out_of_reset(robot):
    """§6: the codec ignores words while AUDIO_ON (RF0) keeps it in reset."""
    robot.write_all(DCICON2=0x01EF, DCICON3=3, TSCON=1, RSCON=1, TXBUF0=0x1234, DCICON1=0x8040)
    robot.at(1000)
    assert robot.board.codec.words == 0
    robot.output("RF0", 1)
    robot.write("TXBUF0", 0x4321)
    robot.at(5000)
    assert robot.board.codec.words == 2
    assert robot.read("RXBUF0") == 0


def test_codec_control_words_follow_samples_with_bit_0_set(robot):
    """§6: a primary word with LSB = 1 requests a secondary frame, whose control word writes the DAC volume 0x5F into
    register 7."""
    heard = []
    robot.board.codec.on_sample = lambda sample, _cycle: heard.append(sample)
    robot.output("RF0", 1)
    robot.at(100)
    for word in (0x7FFF, 0x075F, 0x8000, 0x0002):
        robot.board.chip.dci.on_word(word, 0, 200)
    assert robot.board.codec.registers[7] == 0x5F
    assert heard == [0x7FFF, -0x8000, 2]
    robot.output("RF0", 0)
    assert robot.board.codec.registers[7] == 0


def test_noise_is_off_by_default_repeatable_and_scaled(robot):
    """§5, §6: noise is off by default; it has sigma = max(5, 3 %), +-20 for microphones, and repeats with its seed."""
    ir, microphones = robot.board.ir, robot.board.microphones
    assert {ir._level(0, cycle) >> 4 for cycle in range(100)} == {3800}
    robot.board.noise.strength = 1.0
    codes = [ir._level(0, cycle) >> 4 for cycle in range(0, 200_000, 100)]
    assert codes == [ir._level(0, cycle) >> 4 for cycle in range(0, 200_000, 100)]
    assert codes != [ir._level(1, cycle) >> 4 for cycle in range(0, 200_000, 100)]
    assert statistics.mean(codes) == pytest.approx(3800, abs=0.5)
    assert statistics.stdev(codes) == pytest.approx(5, rel=0.1)
    silence = [microphones._level(2, None, cycle) >> 4 for cycle in range(2000)]
    assert statistics.stdev(silence) == pytest.approx(7, rel=0.1)


def send(robot, data):
    robot.write_all(U1BRG=7, U1MODE=0x8000, U1STA=0x400)
    for byte in data:
        robot.write("U1TXREG", byte)
        robot.later(1500)


def test_bluetooth_passes_bytes_both_ways(robot):
    """§6: Bluetooth passes bytes unchanged in both directions."""
    heard = []
    robot.board.bluetooth.on_byte = lambda byte, start: heard.append(byte)
    send(robot, b"hello")
    robot.board.bluetooth.feed(b"hi")
    robot.later(4000)
    assert bytes(heard) == b"hello"
    assert [robot.read("U1RXREG") for _ in range(2)] == [0x68, 0x69]


def test_bluetooth_dropouts_lose_bytes(robot):
    """Bluetooth loses all bytes in the given dropout windows."""
    heard = []
    robot.board.bluetooth.on_byte = lambda byte, start: heard.append(byte)
    robot.board.bluetooth.dropouts.append((1500, 4500))
    send(robot, b"abcdef")
    robot.later(4000)
    assert bytes(heard) == b"adef"[: len(heard)]
    assert robot.board.bluetooth.lost == 2


def test_random_loss_repeats_with_its_seed():
    """Random loss of bytes repeats with the same seed."""

    def run(seed):
        robot = Robot(seed=seed)
        robot.board.bluetooth.loss = 0.5
        heard = []
        robot.board.bluetooth.on_byte = lambda byte, start: heard.append(byte)
        send(robot, bytes(range(60)))
        return heard

    assert run(1) == run(1)
    assert run(1) != run(2)
    assert 10 < len(run(3)) < 50
