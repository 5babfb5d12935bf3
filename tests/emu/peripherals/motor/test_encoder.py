"""Quadrature encoder interface and 10-bit ADC of the dsPIC30F4011 (DS70135G §14, FRM DS70064E §17)."""

from __future__ import annotations

import pytest

from tests.emu.peripherals.motor.motor_rig import MotorRig

A, B, INDEX = "RB4", "RB5", "RB3"
X2, X4, MATCH = 0x0400, 0x0600, 0x0100
FORWARD = ((A, 1), (B, 1), (A, 0), (B, 0))
"""A full turn of the encoder's pattern: A leads B."""


@pytest.fixture
def rig() -> MotorRig:
    made = MotorRig()
    made.write("ADPCFG", 0xFFFF)
    for pin in (A, B, INDEX):
        made.dev.pins.set(pin, 0)
    return made


def turn(rig: MotorRig, patterns: int, backwards: bool = False) -> None:
    """Move the encoder by full patterns, with 10 Tcy between two edges."""
    for _ in range(patterns):
        for pin, level in [(pin, 1 - level) for pin, level in reversed(FORWARD)] if backwards else FORWARD:
            rig.at(rig.events.now + 10).dev.pins.set(pin, level)


@pytest.mark.parametrize(("mode", "edges"), [(X4 | MATCH, 4), (X2 | MATCH, 2)])
def test_every_edge_of_a_or_of_both_phases_counts(rig: MotorRig, mode: int, edges: int) -> None:
    """§14.3: x4 counts every edge of both phases, x2 those of phase A; A leading B counts up."""
    rig.write("MAXCNT", 0xFFFF)
    rig.at(1).write("QEICON", mode)
    turn(rig, 5)
    assert rig.read("POSCNT") == 5 * edges
    assert rig.read("QEICON") >> 11 & 1 == 1
    turn(rig, 3, backwards=True)
    assert rig.read("POSCNT") == 2 * edges
    assert rig.read("QEICON") >> 11 & 1 == 0


def test_swapped_phases_count_the_other_way(rig: MotorRig) -> None:
    """§14: SWPAB exchanges the phases."""
    rig.write("MAXCNT", 99)
    rig.at(1).write("QEICON", X4 | MATCH | 0x80)
    turn(rig, 1)
    assert rig.read("POSCNT") == 100 - 4


def test_the_counter_restarts_at_maxcnt_with_an_interrupt(rig: MotorRig) -> None:
    """§14.3: with a reset by match, the edge after MAXCNT sets the counter to 0 and requests QEIIF."""
    rig.write("MAXCNT", 5)
    rig.at(1).write("QEICON", X4 | MATCH)
    turn(rig, 1)
    assert (rig.read("POSCNT"), rig.flag("QEI")) == (4, 0)
    turn(rig, 1)
    assert (rig.read("POSCNT"), rig.flag("QEI")) == (2, 1)


def test_the_index_pulse_resets_the_counter(rig: MotorRig) -> None:
    """§14.1: the index pulse coincides with both phases low; with POSRES it resets the counter."""
    rig.write("MAXCNT", 0xFFFF)
    rig.at(1).write("QEICON", X4 | 4)
    turn(rig, 3)
    rig.at(200).dev.pins.set(INDEX, 1)
    assert (rig.read("POSCNT"), rig.flag("QEI")) == (0, 1)
    assert rig.read("QEICON") >> 12 & 1 == 1


def test_a_count_beyond_maxcnt_is_an_error_in_index_mode(rig: MotorRig) -> None:
    """§14.2.1: MAXCNT + 1 sets CNTERR and requests the interrupt, which CEID disables."""
    for ceid in (0, 0x100):
        rig.clear_flags()
        rig.write_all(DFLTCON=ceid, MAXCNT=2, POSCNT=0, QEICON=X4)
        turn(rig, 1)
        assert rig.read("QEICON") >> 15 == 1
        assert rig.flag("QEI") == (ceid == 0)


def test_the_filter_removes_pulses_of_less_than_three_clocks(rig: MotorRig) -> None:
    """§14.4: an input must be stable for three clocks of the filter, here of 4 Tcy."""
    rig.write_all(MAXCNT=0xFFFF, DFLTCON=0x80 | 2 << 4)
    rig.at(1).write("QEICON", X4 | MATCH)
    rig.at(20).dev.pins.set(A, 1)
    rig.at(28).dev.pins.set(A, 0)
    assert rig.at(100).read("POSCNT") == 0
    rig.dev.pins.set(A, 1)
    assert rig.at(111).read("POSCNT") == 0
    assert rig.at(112).read("POSCNT") == 1


@pytest.mark.parametrize(("prescale", "tick"), [(0, 1), (1, 8), (2, 64), (3, 256)])
def test_the_timer_mode_counts_up_to_maxcnt(rig: MotorRig, prescale: int, tick: int) -> None:
    """§14.6: QEIM = 001 makes POSCNT a timer with the period MAXCNT + 1."""
    rig.write("MAXCNT", 9)
    rig.clear_flags()
    rig.at(10).write("QEICON", 0x0900 | prescale << 3)
    assert rig.at(11 + 5 * tick).read("POSCNT") == 5
    assert (rig.at(10 + 10 * tick).flag("QEI"), rig.at(11 + 10 * tick).flag("QEI")) == (0, 1)
    assert rig.read("POSCNT") == 0


# -- 10-bit ADC ------------------------------------------------------------------------------------------------------

LEVELS = (0x1000, 0x5000, 0x9000, 0xD000, 0x2000, 0x6000)
"""Levels on AN0 to AN5."""
TAD = 4
"""Half Tcy per TAD: ADCS = 3."""
CONVERSION = 12 * TAD // 2
"""Tcy per conversion (§17.7)."""


def converter(con1: int, con2: int, chs: int = 0, samc: int = 2) -> MotorRig:
    """Return a rig whose converter is switched on in cycle 10."""
    rig = MotorRig()
    for channel, level in enumerate(LEVELS):
        rig.dev.adc.set_input(channel, level)
    for name, value in (("ADCON3", samc << 8 | TAD - 1), ("ADCON2", con2), ("ADCHS", chs)):
        rig.write(name, value)
    rig.clear_flags()
    rig.at(10).write("ADCON1", 0x8000 | con1)
    return rig


def test_a_conversion_has_ten_bits_and_takes_12_tad() -> None:
    """§17.4: SAMC TAD of sampling and 12 TAD of conversion; the result has 10 bits."""
    rig = converter(0x00E4, 0, chs=3)
    done = 11 + 2 * TAD // 2 + CONVERSION
    assert (rig.at(done - 1).flag("ADC"), rig.at(done).flag("ADC")) == (0, 1)
    assert rig.read("ADCBUF0") == 0xD000 >> 6


@pytest.mark.parametrize(("form", "value"), [(0, 0x340), (1, 0x140), (2, 0xD000), (3, 0x5000)])
def test_the_result_has_four_formats(form: int, value: int) -> None:
    """§17.17: integer, signed integer, fractional, signed fractional."""
    rig = converter(0x00E4 | form << 8, 0, chs=3)
    assert rig.at(100).read("ADCBUF0") == value


@pytest.mark.parametrize(("chps", "channels"), [(1, 2), (2, 4)])
def test_channels_that_sample_together_are_converted_in_turn(chps: int, channels: int) -> None:
    """§17.13: with SIMSAM all channels hold the levels of one cycle; CH0 to CH3 are converted one after the other."""
    rig = converter(0x00EC, chps << 8, chs=5)
    sampled = 11 + 2 * TAD // 2
    for channel in range(6):
        rig.at(sampled + 1).dev.adc.set_input(channel, 0)
    done = sampled + channels * CONVERSION
    assert (rig.at(done - 1).flag("ADC"), rig.at(done).flag("ADC")) == (0, 1)
    expected = [0x6000 >> 6, 0x1000 >> 6, 0x5000 >> 6, 0x9000 >> 6][:channels]
    assert [rig.read(f"ADCBUF{index}") for index in range(channels)] == expected


def test_the_other_channels_have_a_second_set_of_inputs() -> None:
    """§17.8: CH123SA selects AN3 to AN5 for CH1 to CH3."""
    rig = converter(0x00EC, 0x0200, chs=0x0020)
    assert [rig.at(400).read(f"ADCBUF{index}") for index in range(4)] == [
        level >> 6 for level in (0x1000, 0xD000, 0x2000, 0x6000)
    ]


def test_the_special_event_of_the_pwm_starts_a_conversion() -> None:
    """§17.12, §15.12: SSRC = 011 ends sampling when PTMR reaches SEVTCMP."""
    rig = converter(0x006C, 0x0200, chs=5)
    rig.write_all(PTPER=999, SEVTCMP=500)
    rig.at(20).write("PTCON", 0x8000)
    done = 21 + 500 + 4 * CONVERSION
    assert (rig.at(done - 1).flag("ADC"), rig.at(done).flag("ADC")) == (0, 1)
    assert rig.read("ADCBUF0") == 0x6000 >> 6
