"""12-bit ADC (dspic30f6014a.md §13)."""

from __future__ import annotations

import random

import pytest

from .conftest import Rig
from .reference_adc import difference

ADON, ASAM, SAMP, DONE = 0x8000, 4, 2, 1
AUTO, TIMER3, INT0 = 7 << 5, 2 << 5, 1 << 5


def code(rig, channel, value):
    rig.dev.adc.set_input(channel, value << 4)


def test_polled_conversion_of_the_library_takes_133_cycles(rig):
    """§13: a polled conversion with ADCS = 18 (TAD 9.5 Tcy) takes 14 TAD = 133 Tcy from the end of sampling; DONE and
    ADIF rise together."""
    code(rig, 9, 1234)
    rig.write_all(ADCHS=9, ADCON3=18, ADCON1=ADON)
    rig.at(10).write("ADCON1", ADON | SAMP)
    rig.at(100).write("ADCON1", ADON)
    assert rig.at(101).read("ADCON1") == ADON
    assert rig.at(233).read("ADCON1") == ADON
    assert not rig.flag("ADIF")
    assert rig.at(234).read("ADCON1") == ADON | DONE
    assert rig.flag("ADIF")
    assert rig.read("ADCBUF0") == 1234


@pytest.mark.parametrize(("adcs", "channels"), [(39, 0x001C), (23, 0x111C), (19, 0x00FC)])
def test_scans_of_the_epuck_take_900_cycles(rig, adcs, channels):
    """§13: with SAMC = 1, the e-puck's scans of 3, 5 and 6 channels take 900 Tcy: 3 x 15 x 20, 5 x 15 x 12, 6 x 15 x
    10. Buffers are in ascending channel order."""
    scanned = [number for number in range(16) if channels >> number & 1]
    for number in range(16):
        code(rig, number, 100 * number)
    rig.write_all(ADCSSL=channels, ADCON2=0x0400 | len(scanned) - 1 << 2, ADCON3=0x0100 | adcs)
    rig.at(10).write("ADCON1", ADON | ASAM | AUTO)
    assert not rig.at(910).flag("ADIF")
    assert rig.at(911).flag("ADIF")
    assert [rig.read(f"ADCBUF{n}") for n in range(len(scanned))] == [100 * number for number in scanned]
    rig.clear_flags()
    assert not rig.at(1810).flag("ADIF")
    assert rig.at(1811).flag("ADIF")


def test_buffer_fills_while_the_scan_runs(rig):
    """§13: each result is in its buffer at the end of its conversion, every 300 Tcy during the scan."""
    code(rig, 2, 22)
    code(rig, 3, 33)
    rig.write_all(ADCSSL=0x000C, ADCON2=0x0404, ADCON3=0x0127, ADCON1=ADON | ASAM | AUTO)
    assert rig.at(300).read("ADCBUF0") == 0
    assert rig.at(301).read("ADCBUF0") == 22
    assert rig.read("ADCBUF1") == 0
    assert rig.at(601).read("ADCBUF1") == 33


def test_half_cycle_tad_adds_up_without_drift(rig):
    """§13: with ADCS = 0 and SAMC = 1 a conversion takes 7.5 Tcy, so every second one ends in the middle of a cycle,
    without drift."""
    rig.write_all(ADCON3=0x0100, ADCON1=ADON | ASAM | AUTO)
    seen = []
    for cycle in range(1, 40):
        rig.at(cycle)
        if rig.flag("ADIF"):
            seen.append(cycle)
            rig.clear_flags()
    assert seen == [9, 16, 24, 31, 39]  # 1 + 7.5 n, rounded up


@pytest.mark.parametrize(
    ("form", "results"),
    [(0, [0, 0x800, 0xFFF]), (1, [0xF800, 0, 0x7FF]), (2, [0, 0x8000, 0xFFF0]), (3, [0x8000, 0, 0x7FF0])],
)
def test_result_formats(rig, form, results):
    """§13: FORM selects unsigned, signed, fractional and signed fractional results."""
    rig.write("ADCON3", 1)
    for value, expected in zip((0, 2048, 4095), results, strict=True):
        code(rig, 0, value)
        rig.write("ADCON1", ADON | form << 8 | SAMP)
        rig.write("ADCON1", ADON | form << 8)
        rig.at(rig.events.now + 20)
        assert rig.read("ADCBUF0") == expected
        rig.write("ADCON1", 0)


def test_alternating_inputs(rig):
    """§13: ALTS alternates between multiplexers A and B."""
    code(rig, 3, 3)
    code(rig, 12, 12)
    rig.write_all(ADCHS=0x0C03, ADCON2=0x000D, ADCON3=0x0101, ADCON1=ADON | ASAM | AUTO)
    rig.at(1 + 4 * 15)
    assert [rig.read(f"ADCBUF{n}") for n in range(4)] == [3, 12, 3, 12]


def test_buffer_halves_take_turns(rig):
    """§13: with BUFM, results alternate between buffers 0..7 and 8..F; BUFS reads which half is being filled."""
    rig.write("ADCON2", 0x0006)  # SMPI = 1
    rig.write_all(ADCON3=0x0101, ADCON1=ADON | ASAM | AUTO)
    for index, level in enumerate((10, 20, 30, 40, 50)):
        code(rig, 0, level)
        rig.at(1 + 15 * (index + 1))
        if index == 1:
            assert rig.read("ADCON2") & 0x80
    assert [rig.read(f"ADCBUF{n}") for n in "0189"] == [50, 20, 30, 40]
    assert not rig.read("ADCON2") & 0x80


def test_timer_3_match_ends_sampling(rig):
    """§13: with SSRC = 010, the T3 flag in cycle 101 ends sampling; the conversion takes 7 (ADCS + 1) = 70 Tcy."""
    rig.write_all(PR3=99, ADCON3=9, ADCON1=ADON | ASAM | TIMER3, T3CON=0x8000)
    assert rig.at(101).flag("T3IF")
    assert not rig.at(170).flag("ADIF")
    assert rig.at(171).flag("ADIF")
    rig.clear_flags()
    assert rig.at(271).flag("ADIF")


def test_timer_2_and_3_as_a_pair_trigger_too(rig):
    """§7, §13: a match of the 32-bit pair T2:T3 ends sampling."""
    rig.write_all(PR2=99, PR3=0, ADCON3=9, ADCON1=ADON | ASAM | TIMER3, T2CON=0x8008)
    assert rig.at(171).flag("ADIF")


def test_int0_edge_ends_sampling(rig):
    """§13: with SSRC = 001, an INT0 edge in cycle 100 sets the flag in 101 and gives a result in 171."""
    rig.write_all(ADCON3=9, ADCON1=ADON | ASAM | INT0)
    rig.at(100).dev.pins.set("RF6", 1)
    assert not rig.at(170).flag("ADIF")
    assert rig.at(171).flag("ADIF")


def test_switching_off_aborts_and_restarts_the_pointers(rig):
    """§13: switching off aborts a conversion without a result and keeps ADCBUF; the next ADON starts with buffer 0."""
    code(rig, 0, 77)
    rig.write_all(ADCON2=2 << 2, ADCON3=0x0101, ADCON1=ADON | ASAM | AUTO)
    rig.at(20).write("ADCON1", ASAM | AUTO)
    assert rig.at(500).read("ADCBUF0") == 77
    assert rig.read("ADCBUF1") == 0
    code(rig, 0, 88)
    rig.write("ADCON1", ADON | ASAM | AUTO)
    rig.at(516)
    assert rig.read("ADCBUF0") == 88


def test_negative_input_an1_is_subtracted(rig):
    """§13: with CH0NA the level of AN1 is subtracted; negative differences are clipped to 0."""
    code(rig, 5, 1000)
    code(rig, 1, 400)
    rig.write_all(ADCHS=0x15, ADCON3=1, ADCON1=ADON | SAMP)
    rig.write("ADCON1", ADON)
    assert rig.at(50).read("ADCBUF0") == 600


def test_external_references_scale_the_result(rig):
    """§13: with VCFG = 011 the result is floor(4096 (V - VREF-) / (VREF+ - VREF-))."""
    rig.dev.adc.set_references(0x4000, 0xC000)
    rig.dev.adc.set_input(0, 0x6000)
    rig.write_all(ADCON2=3 << 13, ADCON3=1, ADCON1=ADON | SAMP)
    rig.write("ADCON1", ADON)
    assert rig.at(50).read("ADCBUF0") == 1024


def test_analog_pins_read_0_on_the_port(rig):
    """§6: pins configured as analog read 0 on the port; ADPCFG = 0 is the reset state."""
    rig.dev.pins.set("RB4", 1)
    assert rig.at(3).read("PORTB") == 0
    rig.write("ADPCFG", 0x0010)
    assert rig.at(5).read("PORTB") == 0x10


def test_source_is_evaluated_at_the_end_of_each_sampling(rig):
    """§13: a source is evaluated at the end of each sampling, SAMC TAD after its start: in cycles 21 and 321 for SAMC
    = 1 and TAD 20."""
    seen = []
    rig.dev.adc.source[0] = lambda cycle: seen.append(cycle) or 0
    rig.write_all(ADCON2=4, ADCON3=0x0127, ADCON1=ADON | ASAM | AUTO)
    rig.at(602)
    assert seen == [21, 321]


def test_idle_with_adsidl_waits(rig):
    """§17: with ADSIDL, the ADC stops during Idle and then continues."""
    rig.write_all(ADCON3=9, ADCON1=ADON | 0x2000 | SAMP)
    rig.at(10).write("ADCON1", ADON | 0x2000)
    rig.at(20).dev.sleep(1, 20)
    rig.at(1020).dev.wake(1020)
    assert not rig.at(1080).flag("ADIF")
    assert rig.at(1081).flag("ADIF")


@pytest.mark.parametrize("seed", range(10))
def test_reads_do_not_change_conversions(seed):
    """Polling in every cycle and not polling give the same results, because conversions are computed on access."""
    outcomes = []
    for polls in (False, True):
        draw, rig, seen = random.Random(seed), Rig(), []
        for channel in range(16):
            rig.dev.adc.source[channel] = lambda cycle, channel=channel: (cycle * 16 + channel * 997) & 0xFFFF
        rig.write_all(ADCSSL=draw.randrange(1, 0x10000), ADCHS=draw.randrange(0x2000) & 0x1F1F)
        rig.write_all(ADCON2=draw.randrange(5) << 2 | draw.choice((0, 0x400)) | draw.choice((0, 1)))
        rig.write("ADCON3", draw.randrange(32) << 8 | draw.randrange(12))
        changes = {draw.randrange(3000): draw.randrange(0x10000) for _ in range(6)}
        rig.write("ADCON1", ADON | ASAM | AUTO | draw.randrange(4) << 8)
        for cycle in range(1, 3000):
            rig.at(cycle)
            if polls:
                rig.read("ADCON1")
                rig.read("ADCBUF3")
            if cycle in changes:
                name = ("ADCSSL", "ADCHS", "ADCON3")[changes[cycle] % 3]
                rig.write(name, changes[cycle] & (0x0F1F if name == "ADCHS" else 0xFFF))
            if rig.flag("ADIF"):
                seen.append(cycle)
                rig.clear_flags()
        outcomes.append((seen, [rig.read(f"ADCBUF{n:X}") for n in range(16)], rig.record.snapshot()))
    assert outcomes[0][0]
    assert outcomes[0][:2] == outcomes[1][:2]


def test_the_scan_starts_again_behind_every_interrupt(rig):
    """§13: a scan restarts after every interrupt: with five inputs and three results per interrupt, always the first
    three are converted."""
    for number in range(16):
        rig.dev.adc.set_input(number, 100 * number << 4)
    rig.write_all(ADCSSL=0x1F00, ADCON3=0x0101, ADCON2=0x0408, ADCON1=0x80E4)
    for _ in range(4):
        rig.first_cycle(lambda: rig.flag("ADIF"), rig.events.now, rig.events.now + 200)
        rig.clear_flags()
        assert [rig.read(f"ADCBUF{n}") for n in range(3)] == [800, 900, 1000]


@pytest.mark.parametrize("mode", [1, 2])
def test_levels_may_change_while_the_converter_is_stopped(rig, mode):
    """§17: in Idle with ADSIDL, or in Sleep, the ADC converts nothing, whatever the levels do; later results take 15
    TAD each."""
    rig.write_all(ADCON2=4, ADCON3=0x0109, ADCON1=ADON | 0x2000 | ASAM | AUTO)
    rig.at(20).dev.sleep(mode, 20)
    assert rig.dev.adc.samples_from is None
    code(rig.at(500), 0, 77)
    rig.dev.adc.set_references(0, 0x8000)
    assert rig.read("ADCBUF0") == 0
    rig.at(1020).dev.wake(1020)
    assert not rig.at(1150).flag("ADIF")
    assert rig.at(1151).flag("ADIF")
    assert rig.read("ADCBUF1") == 77


def test_a_shorter_setting_ends_sampling_but_not_in_the_past(rig):
    """§13: if manual sampling has lasted 1000 Tcy when automatic mode is set, one conversion of 14 TAD starts at that
    time, none before."""
    rig.write_all(ADCON3=0x0109, ADCON1=ADON | ASAM)
    rig.at(1000).write("ADCON1", ADON | ASAM | SAMP | AUTO)
    code(rig, 0, 55)
    assert rig.at(1070).read("ADCON1") == ADON | ASAM | AUTO
    assert not rig.flag("ADIF")
    assert rig.at(1071).read("ADCON1") == ADON | ASAM | AUTO | SAMP | DONE
    assert rig.flag("ADIF")
    assert rig.read("ADCBUF0") == 55


@pytest.mark.parametrize("looks", [False, True])
@pytest.mark.parametrize(("cycle", "done"), [(75, 0), (76, DONE), (80, DONE), (81, 0)])
@pytest.mark.parametrize("lanes", [0xFFFF, 0xFF00])
def test_done_in_a_write_is_what_it_was_in_that_cycle(rig, looks, cycle, done, lanes):
    """§13: writing 1 to DONE, or a byte write above it, keeps the value of DONE in that cycle, whether it was read
    before or not. With SAMC = 1 and TAD 5 Tcy, DONE is set in cycles 76 to 80."""
    rig.write_all(ADCON2=15 << 2, ADCON3=0x0109, ADCON1=ADON | ASAM | AUTO)
    rig.at(cycle)
    if looks:
        rig.read("ADCON1")
    rig.write("ADCON1", ADON | ASAM | AUTO | SAMP | DONE, lanes)
    assert rig.read("ADCON1") & DONE == done


@pytest.mark.parametrize(("fosc", "post"), [(0xFFE6, 3), (0xFCE6, 3), (0xFAE6, 0), (0xF8E6, 0)])
def test_own_oscillator_at_slow_clocks(fosc, post):
    """§13: the ADRC oscillator's 1.5 us are less than half a Tcy at 230 kHz and below, where a TAD is half a Tcy. The
    clock changes in the middle of a conversion."""
    rig = Rig(fosc=fosc)
    rig.write_all(ADCON3=0x0180, ADCON1=ADON | ASAM | AUTO)
    rig.at(100)
    for byte in (0x46, 0x57, post << 6):
        rig.write("OSCCON", byte, 0x00FF)
        rig.at(rig.events.now + 1)
    rig.first_cycle(lambda: rig.flag("ADIF"), 103, 112)
    rig.clear_flags()
    first = rig.first_cycle(lambda: rig.flag("ADIF"), rig.events.now, 130)
    rig.clear_flags()
    assert first + 7 <= rig.first_cycle(lambda: rig.flag("ADIF"), first, 140) <= first + 8


@pytest.mark.parametrize("seed", range(20))
def test_the_converter_equals_the_reference_model(seed):
    """The converter equals the reference model in every half Tcy, for settings changed at any time, in Sleep or not,
    read often or rarely."""
    assert difference(seed) is None
