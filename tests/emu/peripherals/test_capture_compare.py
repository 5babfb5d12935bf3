"""Input capture (dspic30f6014a.md §8) and output compare (§9)."""

from __future__ import annotations

import pytest

TON = 0x8000


def pulse(rig, pin, *cycles):
    for cycle in cycles:
        rig.at(cycle).dev.pins.set(pin, not rig.dev.pins.get(pin))


# -- input capture ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("mode", "captured"),
    [(1, [101, 201, 301, 401]), (2, [201, 401]), (3, [101, 301])],
)
def test_edges_are_captured_two_cycles_late(rig, mode, captured):
    """§8: every edge, falling or rising edges are captured two cycles late. Timer 2 counts from cycle 1, so an edge
    in 100 captures 101."""
    rig.write_all(T2CON=TON, IC1CON=0x80 | mode)
    pulse(rig, "RD8", 100, 200, 300, 400)
    rig.at(500)
    values = []
    while rig.field("IC1CON", "ICBNE"):
        values.append(rig.read("IC1BUF"))
    assert values == captured


def test_flag_rises_with_the_capture(rig):
    """§8: the flag rises together with the capture."""
    rig.write("IC3CON", 3)
    pulse(rig, "RD10", 100)
    assert not rig.at(101).flag("IC3IF")
    assert rig.at(102).flag("IC3IF")


@pytest.mark.parametrize(("mode", "every"), [(4, 4), (5, 16)])
def test_prescaled_captures(rig, mode, every):
    """§8: prescaled modes capture every 4th or 16th rising edge, counted from the enabling."""
    rig.write_all(T3CON=TON, IC2CON=mode)
    for number in range(1, 33):
        pulse(rig, "RD9", 100 * number, 100 * number + 50)
    rig.at(5000)
    assert rig.read("IC2BUF") == 100 * every + 1


def test_interrupt_every_nth_capture(rig):
    """§8: ICI = 2 interrupts at every third capture."""
    rig.write("IC1CON", 2 << 5 | 3)
    flags = []
    for number in range(1, 4):
        pulse(rig, "RD8", 100 * number, 100 * number + 50)
        flags.append(rig.at(100 * number + 60).flag("IC1IF"))
    assert flags == [0, 0, 1]


def test_fifth_capture_overflows_until_all_four_are_read(rig):
    """§8: a fifth unread capture is lost and sets ICOV until all four are read."""
    rig.write_all(T3CON=TON, IC1CON=3)
    for number in range(1, 6):
        pulse(rig, "RD8", 100 * number, 100 * number + 50)
    rig.at(600)
    assert rig.field("IC1CON", "ICOV") == 1
    assert [rig.read("IC1BUF") for _ in range(3)] == [101, 201, 301]
    assert rig.field("IC1CON", "ICOV") == 1
    assert rig.read("IC1BUF") == 401
    assert rig.read("IC1CON") == 3


def test_switching_off_empties_the_fifo(rig):
    """§8: ICM = 0 empties the FIFO."""
    rig.write("IC1CON", 1)
    pulse(rig, "RD8", 100)
    rig.at(110).write("IC1CON", 0)
    assert rig.read("IC1CON") == 0


def test_mode_7_is_an_interrupt_pin_while_the_cpu_sleeps(rig):
    """§8: mode 7 makes the pin an interrupt input while the CPU sleeps."""
    rig.write("IC8CON", 7)
    pulse(rig, "RD15", 100, 150)
    assert not rig.at(160).flag("IC8IF")
    rig.dev.sleep(2, 160)
    pulse(rig, "RD15", 200)
    assert rig.flag("IC8IF")


# -- output compare ---------------------------------------------------------------------------------------------------


def edges(rig, pin, end):
    """Return (cycle, level) of every change of a chip-driven pin up to `end`."""
    seen = []
    rig.dev.pins.watch(pin, lambda cycle, changed, levels: seen.append((cycle, int(bool(levels & changed)))))
    rig.at(end)
    return seen


@pytest.mark.parametrize(("mode", "level"), [(1, 1), (2, 0)])
def test_single_compare_changes_the_pin_once(rig, mode, level):
    """§9: a single compare changes the pin once: TMR2 = 50 in cycle 51, pin in 52, flag in 54."""
    rig.write_all(OC1R=50, OC1CON=mode, T2CON=TON)
    rig.at(5)
    assert rig.dev.pins.get("RD0") == 1 - level
    assert edges(rig, "RD0", 53) == [(52, level)]
    assert not rig.flag("OC1IF")
    assert rig.at(54).flag("OC1IF")
    assert edges(rig, "RD0", 200000) == []


def test_toggle_mode_repeats_every_period(rig):
    """§9: toggle mode changes the pin in every period: with period 100, matches in 51, 151, 251."""
    rig.write_all(PR2=99, OC2R=50, OC2CON=3, T2CON=TON)
    assert edges(rig, "RD1", 300) == [(52, 1), (152, 0), (252, 1)]


def test_single_pulse_lies_between_the_two_registers(rig):
    """§9: a single pulse rises one cycle after OCxR and falls one cycle after OCxRS; the flag rises two cycles
    later."""
    rig.write_all(PR2=199, OC5R=20, OC5RS=21, OC5CON=4, T2CON=TON)
    assert edges(rig, "RD4", 24) == [(22, 1), (23, 0)]
    assert not rig.flag("OC5IF")
    assert rig.at(25).flag("OC5IF")
    assert edges(rig, "RD4", 2000) == []


def test_continuous_pulses(rig):
    """§9: continuous pulses repeat in every period, here on timer 3."""
    rig.write_all(PR3=99, OC3R=10, OC3RS=40, OC3CON=0x08 | 5, T3CON=TON)
    assert edges(rig, "RD2", 250) == [(12, 1), (42, 0), (112, 1), (142, 0), (212, 1), (242, 0)]


def test_pwm_duty_changes_with_the_next_period(rig):
    """§9: a new PWM duty cycle is effective from the next period on: with 100 Tcy, of which 30 are high, OCxRS
    written in 150 counts from 201 on. TyIF rises, not OCxIF."""
    rig.write_all(PR2=99, OC1R=30, OC1RS=30, OC1CON=6, T2CON=TON)
    assert edges(rig, "RD0", 150) == [(101, 1), (131, 0)]
    rig.write("OC1RS", 60)
    assert edges(rig, "RD0", 299) == [(201, 1), (261, 0)]
    assert rig.flag("T2IF")
    assert not rig.flag("OC1IF")


@pytest.mark.parametrize(("duty", "expected"), [(0, []), (100, [(101, 1)]), (500, [(101, 1)])])
def test_pwm_extremes(rig, duty, expected):
    """§9: a PWM with duty 0 stays low, and one with a duty above PR stays high."""
    rig.write_all(PR2=99, OC1RS=duty, OC1CON=6, T2CON=TON)
    assert edges(rig, "RD0", 1000) == expected


def test_duty_in_force_is_read_only(rig):
    """§9: OCxR, which holds the current duty, is read-only while OCM = 6."""
    rig.write_all(OC1R=5, OC1CON=6)
    rig.write("OC1R", 9)
    assert rig.read("OC1R") == 5


def test_fault_pin_floats_the_output_until_the_mode_is_written_again(rig):
    """§9: the fault input OCFA (RB6, active low) floats the output until the mode is written again."""
    rig.write("ADPCFG", 0xFFFF)
    rig.dev.pins.set("RB6", 1)
    rig.at(2).write("PR2", 99)
    rig.write_all(OC1RS=50, OC1CON=7, T2CON=TON)
    rig.at(120)
    assert rig.dev.pins.get("RD0") == 1
    rig.dev.pins.set("RB6", 0)
    assert rig.at(122).field("OC1CON", "OCFLT") == 1
    assert rig.flag("OC1IF")
    assert not rig.dev.pins.drive[3] & 1
    rig.dev.pins.set("RB6", 1)
    rig.at(130).write("OC1CON", 7)
    assert rig.field("OC1CON", "OCFLT") == 0
    assert rig.at(240).dev.pins.get("RD0") == 1


def test_switching_off_gives_the_pin_back(rig):
    """§6, §9: after OCM = 0 the pin follows LAT again."""
    rig.write_all(TRISD=0, LATD=1, OC1CON=1)
    assert rig.at(2).dev.pins.get("RD0") == 0
    rig.write("OC1CON", 0)
    assert rig.at(4).dev.pins.get("RD0") == 1


def test_new_compare_value_moves_the_match(rig):
    """§9: a new compare value moves the next match."""
    rig.write_all(OC1R=50, OC1CON=1, T2CON=TON)
    rig.at(20).write("OC1R", 80)
    assert edges(rig, "RD0", 200) == [(82, 1)]


def test_externally_clocked_timer_drives_the_compare_too(rig):
    """§9: a timer with an external clock drives the compare too: its third edge in 300 is counted in 301 and changes
    the pin in 302."""
    rig.write_all(OC1R=3, OC1CON=1, T2CON=TON | 2)
    seen = []
    rig.dev.pins.watch("RD0", lambda cycle, changed, levels: seen.append(cycle))
    for number in range(1, 4):
        pulse(rig, "RC1", 100 * number, 100 * number + 50)
    rig.at(400)
    assert seen == [302]
