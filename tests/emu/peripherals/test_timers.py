"""Timers 1-5. Sections are those of dspic30f6014a.md; rules are those of its §7."""

from __future__ import annotations

import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from emu.peripherals.timers.arithmetic import advance, counts_until

TON, TSIDL, TGATE, TCS, T32 = 0x8000, 0x2000, 0x40, 0x02, 0x08


@pytest.mark.parametrize(("tckps", "prescale"), [(0, 1), (1, 8), (2, 64), (3, 256)])
def test_first_count_comes_one_full_prescaled_clock_after_ton(rig, tckps, prescale):
    """§7 rule 7: the first count comes one full prescaled clock after TON; a write in cycle t acts from t + 1
    (engines.md §4.2)."""
    rig.at(10).write("T1CON", TON | tckps << 4)
    assert rig.at(11 + prescale - 1).read("TMR1") == 0
    assert rig.at(11 + prescale).read("TMR1") == 1
    assert rig.at(11 + 5 * prescale).read("TMR1") == 5


def test_flag_of_an_unprescaled_timer_rises_when_the_count_reads_0_again(rig):
    """§7 rules 1 and 2: the flag of an unprescaled timer rises when the count is 0 again: TMR = PR in cycle 110, flag
    and 0 in 111; the period is PR + 1 = 100."""
    rig.write("PR1", 99)
    rig.at(10).write("T1CON", TON)
    assert rig.at(110).read("TMR1") == 99
    assert not rig.flag("T1IF")
    assert rig.at(111).read("TMR1") == 0
    assert rig.flag("T1IF")
    rig.write("IFS0", 0)
    assert not rig.at(210).flag("T1IF")
    assert rig.at(211).flag("T1IF")


def test_flag_of_a_prescaled_timer_comes_with_the_match_not_with_the_rollover(rig):
    """§7 rule 2: the flag of a prescaled timer rises after the match, not at the roll-over: with prescale 64, TMR
    becomes 3 in cycle 1 + 192; flag in 194, roll-over in 257."""
    rig.write_all(PR2=3, T2CON=TON | 2 << 4)
    assert rig.at(192).read("TMR2") == 2
    assert rig.at(193).read("TMR2") == 3
    assert not rig.flag("T2IF")
    assert rig.at(194).flag("T2IF")
    assert rig.at(256).read("TMR2") == 3
    assert rig.at(257).read("TMR2") == 0


def test_cleared_flag_is_not_set_again_while_the_count_stays_at_the_period(rig):
    """§7 rule 3: a cleared flag is set again only at the next match, a whole period (4 x 64) later, although the
    count is still equal to PR."""
    rig.write_all(PR2=3, T2CON=TON | 2 << 4)
    rig.at(195).write("IFS0", 0)
    assert not rig.at(449).flag("T2IF")
    assert rig.at(450).flag("T2IF")


def test_writing_the_period_value_into_the_count_does_not_raise_the_flag(rig):
    """§7 rule 3: writing PR's value to TMR does not set the flag, because only counting does; the next clock rolls
    over."""
    rig.write("PR1", 50)
    rig.at(10).write("T1CON", TON)
    rig.at(20).write("TMR1", 50)
    assert rig.at(21).read("TMR1") == 50
    assert rig.at(22).read("TMR1") == 0
    assert not rig.at(72).flag("T1IF")
    assert rig.at(73).flag("T1IF")  # TMR is 0 in cycle 22 and 50 in 72


def test_period_0_holds_the_timer_at_0_without_interrupts(rig):
    """§7 rule 4: PR = 0 holds the timer at 0 without interrupts."""
    rig.write_all(PR1=0, T1CON=TON)
    assert rig.at(70000).read("TMR1") == 0
    assert not rig.flag("T1IF")


def test_count_above_the_period_runs_to_the_top_and_wraps_silently(rig):
    """§7 rule 5: a count above PR runs to the top and wraps without a flag: 0xFFF0 in cycle 1, 0 in 17, 10 in 27."""
    rig.write_all(TMR1=0xFFF0, PR1=10, T1CON=TON)
    assert rig.at(16).read("TMR1") == 0xFFFF
    assert rig.at(17).read("TMR1") == 0
    assert not rig.at(27).flag("T1IF")
    assert rig.at(28).flag("T1IF")


def test_writing_the_count_clears_the_prescaler(rig):
    """§7 rule 6: writing TMR clears the prescaler; here 7 of 8 clocks are lost."""
    rig.at(0).write("T1CON", TON | 1 << 4)
    rig.at(8).write("TMR1", 100)
    assert rig.at(16).read("TMR1") == 100
    assert rig.at(17).read("TMR1") == 101


def test_byte_write_to_the_count_keeps_the_other_byte_as_counted(rig):
    """§18: a byte write to TMR changes only that byte; the count is 0x0131 when its high byte becomes 0x02."""
    rig.write("T1CON", TON)
    rig.at(1 + 0x131).write("TMR1", 0x0200, lanes=0xFF00)
    assert rig.at(2 + 0x131).read("TMR1") == 0x0231


def test_clearing_ton_freezes_the_count_and_empties_the_prescaler(rig):
    """§7 rules 6 and 10: clearing TON stops the count and clears the prescaler."""
    rig.write("T1CON", TON | 1 << 4)
    rig.at(30).write("T1CON", 1 << 4)  # counts at 8, 16 and 24, then 6 more clocks
    assert rig.at(1000).read("TMR1") == 3
    rig.write("T1CON", TON | 1 << 4)
    assert rig.at(1008).read("TMR1") == 3
    assert rig.at(1009).read("TMR1") == 4


def test_rewriting_the_same_control_word_does_not_disturb_the_count(rig):
    """§7 rule 6 (choice): rewriting the same value to TxCON keeps count and prescaler; only a change of the clock
    source or prescale clears the prescaler."""
    rig.write_all(PR1=3, T1CON=TON | 1 << 4)
    rig.at(5).write("T1CON", TON | 1 << 4)
    rig.at(24).write("T1CON", TON | 1 << 4)  # TMR becomes 3 in the next cycle
    assert rig.at(25).read("TMR1") == 3
    assert rig.at(26).flag("T1IF")


def test_match_of_the_cycle_in_which_the_timer_is_stopped_still_counts(rig):
    """§7 rule 10: a match in the cycle in which TON is cleared still sets the flag: TMR = PR and the write are in
    cycle 11, the flag rises in 12."""
    rig.write_all(PR1=10, T1CON=TON)
    rig.at(11).write("T1CON", 0)
    assert rig.at(12).flag("T1IF")
    assert not rig.at(12).field("T1CON", "TON")


def test_new_period_applies_from_the_next_cycle(rig):
    """§7: a new period is effective from the next cycle on: PR changes from 100 to 20 while the count is 10; 20 is
    reached in cycle 21, the flag rises in 22."""
    rig.write_all(PR1=100, T1CON=TON)
    rig.at(11).write("PR1", 20)
    assert not rig.at(21).flag("T1IF")
    assert rig.at(22).flag("T1IF")
    assert rig.at(22).read("TMR1") == 0


def test_external_clock_counts_rising_edges_one_cycle_later(rig):
    """§7 rule 9: with an external clock, a rising edge in cycle 100 is counted in 101; falling edges are not
    counted."""
    rig.write("T4CON", TON | TCS)
    rig.at(100).dev.pins.set("RC3", 1)
    assert rig.at(100).read("TMR4") == 0
    assert rig.at(101).read("TMR4") == 1
    rig.at(110).dev.pins.set("RC3", 0)
    rig.at(120).dev.pins.set("RC3", 1)
    assert rig.at(130).read("TMR4") == 2


def test_counter_with_period_1_interrupts_once_per_edge_only_if_the_handler_clears_it(rig):
    """§7 rule 2: with PR = 1, as in the camera drivers, the first edge from 0 matches. If the handler does not clear
    TMR, every second edge is missed."""

    def pulse(cycle):
        rig.at(cycle).dev.pins.set("RC4", 1)
        rig.at(cycle + 5).dev.pins.set("RC4", 0)

    rig.write_all(PR5=1, T5CON=TON | TCS)
    pulse(100)
    assert rig.at(105).flag("T5IF")
    rig.clear_flags()
    rig.write("TMR5", 0)
    pulse(200)
    assert rig.flag("T5IF")
    rig.clear_flags()
    pulse(300)  # from 1 to 0: no match
    assert not rig.at(310).flag("T5IF")
    pulse(400)
    assert rig.at(410).flag("T5IF")


def test_counter_flag_rises_two_cycles_behind_the_edge(rig):
    """§7 rules 2 and 9: the flag of a counter rises two cycles after the edge: edge in 100, count in 101, flag in
    102."""
    rig.write_all(PR5=1, T5CON=TON | TCS)
    rig.at(100).dev.pins.set("RC4", 1)
    assert not rig.at(101).flag("T5IF")
    assert rig.at(102).flag("T5IF")


def test_counter_prescaler_counts_edges(rig):
    """§7: with prescale 8, eight rising edges make one count."""
    rig.write("T4CON", TON | TCS | 1 << 4)
    for edge in range(17):
        rig.at(100 + 20 * edge).dev.pins.set("RC3", 1)
        rig.at(110 + 20 * edge).dev.pins.set("RC3", 0)
    assert rig.at(1000).read("TMR4") == 2


def test_gated_timer_counts_while_the_pin_is_high_and_flags_the_falling_edge(rig):
    """§7 gated mode: the timer counts while the pin is high, 80 counts from 100 to 180. The falling edge sets the
    flag, not the match with PR."""
    rig.write_all(PR1=40, T1CON=TON | TGATE)
    assert rig.at(100).read("TMR1") == 0
    rig.dev.pins.set("RC14", 1)
    assert rig.at(150).read("TMR1") == 49 - 41
    assert not rig.at(180).flag("T1IF")
    rig.dev.pins.set("RC14", 0)
    assert rig.at(182).flag("T1IF")
    assert rig.at(500).read("TMR1") == 80 - 41


def test_wide_timer_counts_32_bits_and_interrupts_with_the_odd_timer(rig):
    """§7: a 32-bit timer counts in TMR3:TMR2 up to PR3:PR2 and sets T3IF, not T2IF."""
    rig.write_all(PR2=0x0005, PR3=0x0001, T2CON=TON | T32)
    assert rig.at(1 + 0x10005).read("TMR2") == 5
    assert rig.peek("TMR3") == 1
    assert not rig.flag("T3IF")
    assert rig.at(2 + 0x10005).flag("T3IF")
    assert not rig.flag("T2IF")
    assert rig.read("TMR2") == 0


def test_reading_the_low_word_of_a_wide_timer_latches_the_high_word(rig):
    """§7, §18: reading TMR2 of a 32-bit timer latches the upper half of the count in TMR3HLD."""
    rig.write_all(PR2=0xFFFF, T2CON=TON | T32)
    assert rig.at(0x10000).read("TMR2") == 0xFFFF
    assert rig.at(0x10001).peek("TMR3") == 1
    assert rig.read("TMR3HLD") == 0
    assert rig.read("TMR2") == 0
    assert rig.read("TMR3HLD") == 1


def test_writing_the_low_word_of_a_wide_timer_takes_the_high_word_from_the_holding_register(rig):
    """§7: writing TMR2 of a 32-bit timer also writes TMR3HLD to the upper half of the count."""
    rig.write_all(T2CON=TON | T32, TMR3HLD=0x1234)
    rig.at(50).write("TMR2", 0x5678)
    assert rig.at(51).read("TMR2") == 0x5678
    assert rig.peek("TMR3") == 0x1234


def test_odd_control_register_is_ignored_in_wide_mode(rig):
    """§7: T3CON is ignored in 32-bit mode."""
    rig.write_all(T3CON=TON, T2CON=TON | T32)
    rig.at(10).write("T3CON", 0)
    assert rig.at(101).read("TMR2") == 100


def test_timer_with_tsidl_stops_in_idle_and_the_others_do_not(rig):
    """§7: a timer with TSIDL stops in Idle, others do not: T1 does not count from cycle 100 to 600, T2 does."""
    rig.write_all(PR1=149, T1CON=TON | TSIDL, T2CON=TON)
    rig.at(100).dev.sleep(1, 100)
    rig.at(600).dev.wake(600)
    assert rig.read("TMR1") == 99
    assert rig.read("TMR2") == 599
    assert not rig.at(650).flag("T1IF")
    assert rig.at(651).flag("T1IF")


def test_only_timer_1_as_asynchronous_counter_runs_in_sleep(rig):
    """§7: in Sleep only timer 1 as asynchronous counter (TSYNC = 0) counts; T4 as counter does not."""
    rig.write_all(PR1=2, T1CON=TON | TCS, T4CON=TON | TCS)
    rig.at(100).dev.sleep(2, 100)
    for cycle in (200, 300):
        rig.at(cycle).dev.pins.set("RC14", 1)
        rig.dev.pins.set("RC3", 1)
        rig.at(cycle + 50).dev.pins.set("RC14", 0)
        rig.dev.pins.set("RC3", 0)
    assert rig.at(400).flag("T1IF")
    rig.dev.wake(400)
    assert rig.read("TMR1") == 2
    assert rig.read("TMR4") == 0


def test_native_description_reproduces_the_count(rig):
    """README: the record fields base, tick and period determine the count and the time of the match."""
    rig.write_all(PR1=999, T1CON=TON | 1 << 4)
    rig.at(4321)
    fields = rig.record.fields
    base = rig.record.u64[fields["t1.base"].index]
    tick = rig.record.u32[fields["t1.tick"].index]
    assert rig.read("TMR1") == (4321 - base) // tick % 1000
    assert rig.record.u64[fields["t1.period"].index] == 8000


class Pulse:
    """Waveform clock with a rising edge in every cycle that is a multiple of `every`."""

    def __init__(self, every):
        self.every = every

    def bits(self, cycle):
        return 0xFFFF if cycle % self.every < self.every // 2 else 0

    def rises(self, mask, after, until):
        return until // self.every - after // self.every

    def nth_rise(self, mask, after, count):
        return (after // self.every + count) * self.every


def test_described_clock_is_counted_without_an_event_per_edge(rig):
    """§7 rule 9: a timer counts a waveform clock without an event per edge. With edges every 100 cycles, the 7th edge
    after cycle 1 is in 700, the flag in 702."""
    rig.dev.pins.attach(2, 1 << 3, Pulse(100))
    rig.write("PR4", 7)
    rig.at(1).write("T4CON", TON | TCS)
    assert rig.at(700).read("TMR4") == 6
    assert rig.at(701).read("TMR4") == 7
    assert not rig.flag("T4IF")
    assert rig.at(702).flag("T4IF")
    assert rig.at(801).read("TMR4") == 0


def test_a_waveform_clock_can_change(rig):
    """When a waveform announces a change, the edges before the change stay counted."""
    wave = Pulse(100)
    rig.dev.pins.attach(2, 1 << 3, wave)
    rig.write("PR4", 7)
    rig.at(1).write("T4CON", TON | TCS)

    def slower():
        wave.every = 1000

    rig.at(350)
    rig.dev.pins.change_waveform(350, slower)
    assert rig.at(999).read("TMR4") == 3
    assert rig.at(1001).read("TMR4") == 4
    assert rig.at(4002).flag("T4IF")


@settings(max_examples=300, deadline=None)
@given(st.integers(0, 20), st.integers(0, 20), st.integers(0, 60))
def test_closed_form_of_the_count_agrees_with_counting(start, period, counts):
    """§7 rules 1, 4, 5: the closed form of the count equals step-by-step counting, for a counter whose maximum is
    15."""
    top = 15
    start, period = start & top, period & top
    value, seen = start, [start]
    for _ in range(counts):
        value = 0 if value in (period, top) else value + 1
        seen.append(value)
    assert advance(start, counts, period, top) == value
    for target in range(top + 1):
        changes = (n for n, count in enumerate(seen) if n and count == target and count != seen[n - 1])
        expected = None if target == period == 0 else next(changes, None)
        found = counts_until(start, target, period, top)
        assert expected == (found if found is not None and found <= counts else None)


def test_only_plain_16_bit_matches_are_offered_to_native_code(rig):
    """README: native code handles only plain 16-bit matches. The period field is 0, which calls Python, for a 32-bit,
    gated or stopped timer and for PR = 0."""
    period = rig.record.fields["t2.period"].index

    def offered():
        return rig.record.u64[period]

    rig.write("PR2", 999)
    assert offered() == 0
    rig.write("T2CON", TON)
    assert offered() == 1000
    rig.write("T2CON", TON | T32)
    assert offered() == 0
    rig.write("T2CON", TON | TGATE)
    assert offered() == 0
    rig.write_all(T2CON=TON, PR2=0)
    assert offered() == 0


class Ticking:
    """Reference model of a timer that makes one step per Tcy, written from the rules of §7."""

    def __init__(self):
        self.count = self.prescaler = 0
        self.period, self.control = 0xFFFF, 0
        self.coming = self.flag = False

    def step(self, writes):
        """Advance one cycle; `writes` made in it are effective from the next cycle on."""
        control, period = writes.get("CON", self.control), writes.get("PR", self.period)
        clocks = (1, 8, 64, 256)
        stepped = False
        if self.control & TON:
            self.prescaler += 1
            if self.prescaler == clocks[self.control >> 4 & 3]:
                self.prescaler, stepped = 0, True
                self.count = 0 if self.count in (self.period, 0xFFFF) else self.count + 1
        if (control ^ self.control) & (TON | 0x30):
            self.prescaler = 0
        if "TMR" in writes:
            self.count, self.prescaler, stepped = writes["TMR"], 0, False
        self.flag |= self.coming
        reached = stepped and self.count == self.period == period != 0
        self.coming = reached and bool(control & TON)
        self.control, self.period = control, period


@pytest.mark.parametrize("seed", range(12))
def test_computed_timer_agrees_with_a_ticking_one_under_any_writes(rig, seed):
    """§7 rules 1-8, 10: for random writes, count and flag equal those of the reference model in every cycle."""
    draw, model = random.Random(seed), Ticking()
    for cycle in range(4000):
        rig.at(cycle)
        assert rig.read("TMR1") == model.count, cycle
        assert rig.flag("T1IF") == model.flag, cycle
        if model.flag:
            rig.write("IFS0", 0)
            model.flag = False
        writes = {}
        if draw.random() < 0.06:
            name = draw.choice(("PR", "PR", "TMR", "TMR", "CON"))
            values = {
                "PR": (0, 1, 2, 3, 7, 20, model.count, (model.count + 1) & 0xFFFF, 0xFFFF),
                "TMR": (0, 1, 5, 0xFFFD, model.period, max(model.period - 1, 0)),
                "CON": (TON, TON, TON, TON | 0x10, TON | TSIDL, 0),
            }
            writes[name] = draw.choice(values[name])
            rig.write({"PR": "PR1", "TMR": "TMR1", "CON": "T1CON"}[name], writes[name])
        model.step(writes)
