"""The motor application on a dsPIC30F4011 with a simulated motor; waveforms against the data sheet DS70135G."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

from emu.image.loader import load_image
from emu.machine.machine import Machine

FIRMWARE = Path(__file__).parents[3] / "firmware"
PERIOD, DEAD_TIME, TAD, STEP = 1474, 30, 5, 16 * 1474
"""Tcy: PTPER + 1; DTA; TAD of the converter; 16 PWM periods of a control step (bridge.h)."""
CONVERSIONS = 4 * 12 * TAD
FASTEST = 40
"""Quarter lines per control step of the unloaded motor at full voltage."""
PATTERN = ((0, 0), (1, 0), (1, 1), (0, 1))
"""Levels of phase A and B in the order of forward rotation."""


class Motor:
    """A machine with a motor of first order: its speed follows the mean voltage with a time constant."""

    def __init__(self, image: Path, engine: str) -> None:
        program = load_image(image)
        self.machine = machine = Machine(program.chip, engine=engine)
        machine.load(program)
        self.speed = 0.0
        self.angle = 0.0
        self.shown = 0
        self.text = bytearray()
        machine.uart[1].listen(lambda byte, _start: self.text.append(byte))
        for pin in ("RB3", "RB4", "RB5"):
            machine.pins.set(pin, 0)
        machine.pins.set("RE8", 1)

    def inputs(self, demand: int, current: int) -> None:
        """Set the potentiometer and the shunt's voltage, in codes of 10 bits."""
        for channel, code in ((6, demand), (0, current), (1, 700)):
            self.machine.peripherals.adc.set_input(channel, code << 6)

    def run(self, steps: int) -> None:
        """Run control steps; the duty registers are the voltage of the step, which moves the encoder."""
        for _ in range(steps):
            voltage = (self.machine.peek("PDC1") - self.machine.peek("PDC2")) / (2 * PERIOD)
            self.speed += (voltage * FASTEST - self.speed) / 20
            target = self.angle + self.speed
            edges = int(target // 1) - int(self.angle // 1)
            begin = self.machine.cycle
            for edge in range(abs(edges)):
                self.machine.run_until(begin + (edge + 1) * STEP // (abs(edges) + 1))
                self.shown += 1 if edges > 0 else -1
                for pin, level in zip(("RB4", "RB5"), PATTERN[self.shown % 4], strict=True):
                    self.machine.pins.set(pin, level)
            self.angle = target
            self.machine.run_until(begin + STEP)


@pytest.fixture(scope="module")
def image(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("motor")
    words = ["make", "-s", "-C", str(FIRMWARE), "APP=motor", f"OUT={folder}"]
    assert subprocess.run(words, check=False).returncode == 0
    return folder / "firmware.elf"


@pytest.mark.parametrize("engine", ["plain", "jit"])
def test_the_waveforms_are_those_of_the_data_sheet(image: Path, engine: str) -> None:
    """DS70135G §15: period PTPER + 1, dead time between the switches of a leg, duty PDC / 2 less the dead time."""
    motor = Motor(image, engine)
    motor.inputs(demand=0, current=0)
    motor.run(3)
    edges: list[tuple[int, int, int]] = []
    motor.machine.pins.edges = edges
    motor.machine.run(cycles=3 * PERIOD)
    motor.machine.pins.edges = None
    leg = []
    before = 0
    for cycle, port, levels in edges:
        if port == 4:
            leg += [(cycle, bit, levels >> bit & 1) for bit in (0, 1) if (levels ^ before) >> bit & 1]
            before = levels
    rises = [cycle for cycle, bit, level in leg if (bit, level) == (1, 1)][-2:]
    falls = {cycle: level for cycle, bit, level in leg if bit == 0}
    assert rises[1] - rises[0] == PERIOD
    assert falls[rises[1] - DEAD_TIME] == 0  # the low switch opens when the period starts
    high_opens = next(cycle for cycle, bit, level in leg if (bit, level) == (1, 0) and cycle > rises[0])
    assert high_opens - (rises[0] - DEAD_TIME) == motor.machine.peek("PDC1") // 2
    assert falls[high_opens + DEAD_TIME] == 1


def test_the_samples_are_taken_in_the_middle_of_a_period(image: Path) -> None:
    """§15.12, FRM DS70064E §17.12: the special event at SEVTCMP ends sampling; four conversions of 12 TAD follow."""
    motor = Motor(image, "jit")
    motor.inputs(demand=0, current=0)
    motor.run(3)
    machine = motor.machine
    while machine.peek("PTMR") > 100:
        machine.run_until(machine.cycle + 1)
    start = machine.cycle - machine.peek("PTMR")
    motor.inputs(demand=0, current=333)
    sampled = start + PERIOD // 2
    machine.run_until(sampled + 2)
    motor.inputs(demand=0, current=0)
    machine.run_until(sampled + CONVERSIONS // 2 - 2)
    assert machine.peek("ADCBUF1") == 0
    machine.run_until(sampled + CONVERSIONS + 2)
    assert (machine.peek("ADCBUF1"), machine.peek("ADCBUF2")) == (333, 700)


@pytest.mark.slow
def test_the_controller_reaches_the_demanded_speed(image: Path) -> None:
    """The PI controller turns the motor at the speed that the potentiometer demands, and reports it."""
    motor = Motor(image, "jit")
    motor.inputs(demand=12 << 5, current=0)
    motor.run(260)
    assert abs(motor.speed - 12) < 1
    assert b"speed 12\n" in motor.text


def test_too_much_current_takes_the_voltage_off(image: Path) -> None:
    """Above the limit both legs have the same duty cycle, so no voltage is at the motor."""
    motor = Motor(image, "jit")
    motor.inputs(demand=12 << 5, current=950)
    motor.run(140)
    assert motor.machine.peek("PDC1") == motor.machine.peek("PDC2")
    assert b"current limit" in motor.text


def test_the_fault_input_opens_both_legs(image: Path) -> None:
    """§15.10: while RE8 is low, all four switches are off; the program reports the fault."""
    motor = Motor(image, "jit")
    motor.inputs(demand=12 << 5, current=0)
    motor.run(5)
    motor.machine.pins.set("RE8", 0)
    motor.run(2)
    assert motor.machine.peek("PORTE") & 0x0F == 0
    motor.machine.pins.set("RE8", 1)
    motor.run(20)
    assert b"fault\n" in motor.text
    assert motor.machine.peek("PORTE") & 0x0F
