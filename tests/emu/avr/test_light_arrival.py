"""Light pulses arrive at their tick: while a robot wakes up, within long instructions, from the overhead controller."""

from __future__ import annotations

import pytest

from emu.avr.machine import HZ, Atmega328p
from emu.boards.kilobot.messages import TYPES, Message, frame, pulses_of
from emu.boards.kilobot.overhead import broadcast
from emu.boards.kilobot.swarm import KilobotSetup, KilobotSwarm
from tests.emu.avr.conftest import Build

SLEEPER = """
volatile uint8_t heard;
ISR(WDT_vect) {}
int main(void)
{
    DIDR1 = 3, WDTCSR = 1 << WDIE;
    set_sleep_mode(SLEEP_MODE_PWR_DOWN); sei(); sleep_mode();
    __builtin_avr_delay_cycles(200), heard = ACSR >> ACI & 1;
    for (;;) ;
}
"""
SHOT = """
int main(void)
{
    DDRB = 1;
    __builtin_avr_delay_cycles(2000), PORTB = 1, __builtin_avr_delay_cycles(7), PORTB = 0;
    for (;;) DDRC ^= 1;
}
"""


def test_light_while_a_robot_wakes_up(build: Build) -> None:
    """A pulse at any tick of the time that a slow robot takes to wake up from power-down is received."""
    sleeper, shot, clock = build(SLEEPER), build(SHOT), 0.91
    alone = Atmega328p(sleeper)
    alone.run_until(100_000)
    assert alone.state.asleep
    while alone.state.asleep:
        alone.step()
    wakes, before = int(alone.cycle / clock), 160_000
    for phase in range(32):
        robots = [KilobotSetup(sleeper, on_at=(before - wakes + late + 0.5) / HZ, clock=clock)
                  for late in range(-60, 20)]  # fmt: skip
        swarm = KilobotSwarm([*robots, KilobotSetup(shot, on_at=(before - 2_040 + phase + 0.5) / HZ)])
        swarm.run_until(before + 4_000)
        heard = [robot.peek("heard") for robot in swarm.robots[:-1]]
        assert all(heard), f"phase {phase}: {heard.count(0)} of {len(heard)} robots miss the pulse"


IDLE = "int main(void) { for (;;) DDRC ^= 1; }"
LONG_INSTRUCTIONS = """
volatile uint16_t got;
ISR(ANALOG_COMP_vect) { got++; }
static void __attribute__((noinline)) call(void) { __asm__ volatile(""); }
int main(void) { DIDR1 = 3, ACSR = 1 << ACIE | 1 << ACIS1 | 1 << ACIS0; sei(); for (;;) call(); }
"""


def test_every_pulse_of_the_overhead_controller_arrives(build: Build) -> None:
    """All robots get all pulses of a frame, whatever instructions they execute when it begins."""
    image = build(LONG_INSTRUCTIONS)
    swarm = KilobotSwarm([KilobotSetup(image, on_at=n * 1e-6, clock=0.94 + 0.003 * n) for n in range(40)])
    octets = frame(Message(bytes(range(9)), TYPES["run"]))
    pulses = 0
    for ticks in range(1_000, 1_020):
        swarm.run_until(swarm.now + ticks)
        broadcast(swarm, Message(bytes(range(9)), TYPES["run"]), 0.006)
        pulses += len(list(pulses_of(octets)))
        assert {robot.peek("got", 2) for robot in swarm.robots} == {pulses}


def test_light_in_the_past_is_refused(build: Build) -> None:
    """A pulse for a tick that its robot has passed is an error, not a loss; robots without power get none."""
    image = build(IDLE)
    swarm = KilobotSwarm([KilobotSetup(image), KilobotSetup(image, on_at=1.0)])
    swarm.run(0.001)
    with pytest.raises(ValueError, match="robot 0 has run past tick 7990: announce light 10 ticks ahead"):
        swarm.light(0, 7_990)
    swarm.light(1, 7_990)
    swarm.stop(0)
    swarm.light(0, 7_990)
    with pytest.raises(ValueError, match=r"a clock of 0\.7 is less than 0\.8"):
        KilobotSwarm([KilobotSetup(image, clock=0.7)])
