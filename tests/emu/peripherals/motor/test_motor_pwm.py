"""Motor control PWM of the dsPIC30F4011. Sections are those of its data sheet DS70135G."""

from __future__ import annotations

import pytest

from tests.emu.peripherals.motor.motor_rig import MotorRig

PTEN, UP_DOWN, DOUBLE, SINGLE = 0x8000, 2, 3, 1


def start(rig: MotorRig, *, period: int = 99, duty: int = 60, con: int = 0, outputs: int = 0x77, dead: int = 0) -> None:
    """Start the time base in cycle 0, so that the first period begins in cycle 1."""
    rig.write("PTPER", period)
    for pair in (1, 2, 3):
        rig.write(f"PDC{pair}", duty)
    rig.write_all(DTCON1=dead, PWMCON1=outputs)
    rig.clear_flags()
    rig.write("PTCON", PTEN | con)


def test_an_edge_aligned_output_is_active_for_half_the_duty_register() -> None:
    """§15.3: active from PTMR = 0, inactive when PDC/2 is reached; the period is PTPER + 1 counts."""
    rig = MotorRig()
    start(rig)
    assert rig.edges("RE1", 2, 320) == [(31, "RE1", 0), (101, "RE1", 1), (131, "RE1", 0), (201, "RE1", 1),
                                        (231, "RE1", 0), (301, "RE1", 1)]  # fmt: skip


@pytest.mark.parametrize(("prescale", "tick"), [(0, 1), (1, 4), (2, 16), (3, 64)])
def test_the_prescaler_stretches_period_and_duty(prescale: int, tick: int) -> None:
    """§15.1.5: PTCKPS selects 1, 4, 16 or 64 Tcy per count."""
    rig = MotorRig()
    start(rig, period=9, duty=8, con=prescale << 2)
    assert rig.edges("RE1", 2, 1 + 20 * tick) == [
        (1 + 4 * tick, "RE1", 0), (1 + 10 * tick, "RE1", 1), (1 + 14 * tick, "RE1", 0), (1 + 20 * tick, "RE1", 1)
    ]  # fmt: skip


def test_a_centred_output_is_active_around_the_start_of_the_period() -> None:
    """§15.4: inactive when counting up through PDC/2, active again when counting down through it."""
    rig = MotorRig()
    start(rig, period=50, duty=40, con=UP_DOWN)
    assert rig.edges("RE1", 2, 201) == [(21, "RE1", 0), (81, "RE1", 1), (121, "RE1", 0), (181, "RE1", 1)]


@pytest.mark.parametrize(("mode", "duty", "level"), [(0, 0, 0), (0, 200, 1), (UP_DOWN, 0, 0), (UP_DOWN, 198, 1)])
def test_duty_cycles_of_0_and_100_percent_have_no_edges(mode: int, duty: int, level: int) -> None:
    """§15.3, §15.4: a duty of 0 is inactive; more than PTPER, or with centred outputs PTPER, is always active."""
    rig = MotorRig()
    start(rig, duty=duty, con=mode)
    assert set(rig.levels("RE1", 2, 500)) == {level}


def test_complementary_outputs_never_overlap() -> None:
    """§15.7: DTA counts of dead time separate the edges of PWMxL and PWMxH."""
    rig = MotorRig()
    start(rig, dead=5)
    assert rig.edges("RE0 RE1", 50, 150) == [(101, "RE0", 0), (106, "RE1", 1), (131, "RE1", 0), (136, "RE0", 1)]


@pytest.mark.parametrize(("prescale", "factor"), [(0, 1), (1, 2), (2, 4), (3, 8)])
def test_the_dead_time_has_a_prescaler(prescale: int, factor: int) -> None:
    """§15.7.3: DTAPS selects 1, 2, 4 or 8 Tcy per count of DTA."""
    rig = MotorRig()
    start(rig, dead=prescale << 6 | 3)
    assert rig.edges("RE0 RE1", 60, 126) == [(101, "RE0", 0), (101 + 3 * factor, "RE1", 1)]


def test_a_pulse_shorter_than_the_dead_time_is_lost() -> None:
    """§15.7: an output whose comparison changes back within the dead time does not become active."""
    rig = MotorRig()
    start(rig, duty=8, dead=5)
    assert all(pin == "RE0" for _, pin, _ in rig.edges("RE0 RE1", 50, 400))


def test_independent_outputs_follow_the_comparison_together() -> None:
    """§15.8: with PMODx, no dead time separates the two outputs of a pair."""
    rig = MotorRig()
    start(rig, outputs=0x0777, dead=5)
    assert rig.edges("RE2 RE3", 2, 101) == [(31, "RE2", 0), (31, "RE3", 0), (101, "RE2", 1), (101, "RE3", 1)]


def test_duty_cycles_are_double_buffered() -> None:
    """§15.5.1: a written duty acts from the next period on; UDIS holds it back, IUE lets it act at once."""
    rig = MotorRig()
    start(rig)
    rig.at(10).write("PDC1", 100)
    assert rig.edges("RE1", 10, 190) == [(31, "RE1", 0), (101, "RE1", 1), (151, "RE1", 0)]
    rig.write_all(PWMCON2=1, PDC1=20)
    assert rig.edges("RE1", 190, 299) == [(201, "RE1", 1), (251, "RE1", 0)]
    rig.write("PWMCON2", 4)
    rig.at(302).write("PDC1", 20)
    assert rig.edges("RE1", 302, 399) == [(311, "RE1", 0)]


def test_the_interrupt_comes_at_the_end_of_a_period_by_the_postscaler() -> None:
    """§15.1.1, §15.1.6: PWMIF rises when PTMR is reset, once in PTOPS + 1 periods."""
    rig = MotorRig()
    start(rig, con=2 << 4)
    assert rig.at(300).flag("PWM") == 0
    assert rig.at(301).flag("PWM") == 1


def test_double_updates_interrupt_twice_in_a_period() -> None:
    """§15.1.4: with PTMOD = 3 the interrupt comes at PTMR = PTPER and at 0, and duties load at both."""
    rig = MotorRig()
    start(rig, period=50, duty=40, con=DOUBLE)
    rig.at(30).write("PDC1", 60)
    assert rig.at(51).flag("PWM") == 1
    rig.clear_flags()
    assert rig.edges("RE1", 51, 100) == [(71, "RE1", 1)]
    assert rig.at(101).flag("PWM") == 1


def test_a_single_shot_stops_after_one_period() -> None:
    """§15.1.2: with PTMOD = 1 the time base stops at the match and clears PTEN."""
    rig = MotorRig()
    start(rig, con=SINGLE)
    assert rig.edges("RE1", 2, 400) == [(31, "RE1", 0)]
    assert rig.read("PTCON") & PTEN == 0
    assert rig.flag("PWM") == 1


def test_the_time_base_reads_its_count_and_direction() -> None:
    """§15.1: PTMR<14:0> counts, PTMR<15> is PTDIR."""
    rig = MotorRig()
    start(rig, period=50, con=UP_DOWN)
    assert [rig.at(cycle).read("PTMR") for cycle in (1, 31, 51, 52, 100, 101)] == [0, 30, 0x8032, 0x8031, 0x8001, 0]


def test_an_overridden_output_has_the_state_of_ovdcon() -> None:
    """§15.9: POVDxy = 0 gives the pin the level POUTxy."""
    rig = MotorRig()
    start(rig)
    rig.at(10).write("OVDCON", 0x3E01)
    assert set(rig.levels("RE0", 12, 200)) == {1}
    assert rig.edges("RE1", 200, 299) == [(201, "RE1", 1), (231, "RE1", 0)]


@pytest.mark.parametrize(("latched", "until"), [(0, None), (0x80, 301)])
def test_a_fault_drives_the_outputs_until_a_later_period(latched: int, until: int | None) -> None:
    """§15.10: a low fault pin drives the pair to FAOVxy; the latched mode also waits for FLTAIF to be cleared."""
    rig = MotorRig()
    start(rig, duty=120)
    rig.write("FLTACON", 0x0101 | latched)
    rig.at(150).dev.pins.set("RE8", 0)
    assert (rig.dev.pins.get("RE0"), rig.dev.pins.get("RE1"), rig.flag("FLTA")) == (1, 0, 1)
    rig.at(250).dev.pins.set("RE8", 1)
    found = rig.edges("RE1", 250, 399)
    assert [edge for edge in found if edge[2] == 1] == ([(until, "RE1", 1)] if until else [])
    rig.clear_flags()
    assert [edge for edge in rig.edges("RE1", 399, 455) if edge[2] == 1] == [(401, "RE1", 1)]


@pytest.mark.parametrize(("word", "high", "low"), [(0xFFFF, 1, 0), (0xFDFF, 0, 0), (0xFEFF, 1, 1)])
def test_the_configuration_word_selects_the_polarity(word: int, high: int, low: int) -> None:
    """§15.10: HPOL = 0 and LPOL = 0 make the outputs active low."""
    rig = MotorRig(word)
    start(rig, duty=200)
    assert (rig.at(50).dev.pins.get("RE1"), rig.dev.pins.get("RE0")) == (high, low)


def test_pins_that_the_module_does_not_own_belong_to_the_port() -> None:
    """§15.10: PENxy = 0 leaves a pin to LATE and TRISE."""
    rig = MotorRig()
    rig.write_all(TRISE=0, LATE=0x20)
    start(rig, outputs=0x01)
    assert rig.at(50).dev.pins.get("RE5") == 1
    assert rig.edges("RE1 RE3", 50, 300) == []


def test_a_disabled_module_returns_its_pins() -> None:
    """PMD1.PWMMD resets the module: its registers read 0 and the port has the pins again."""
    rig = MotorRig()
    rig.write_all(TRISE=0, LATE=0x02)
    start(rig, duty=0)
    rig.at(50).write("PMD1", 0x0200)
    assert rig.at(52).read("PTPER") == 0
    assert rig.dev.pins.get("RE1") == 1
