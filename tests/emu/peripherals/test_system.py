"""Oscillator, resets, watchdog, low-voltage detect, module disable (dspic30f6014a.md §3, §4, §17)."""

from __future__ import annotations

import pytest

from .conftest import Rig

HIGH, LOW = 0xFF00, 0x00FF


def unlock_high(rig, cycle, value):
    for step, byte in enumerate((0x78, 0x9A, value)):
        rig.at(cycle + step).write("OSCCON", byte << 8, HIGH)


def unlock_low(rig, cycle, value):
    for step, byte in enumerate((0x46, 0x57, value)):
        rig.at(cycle + step).write("OSCCON", byte, LOW)


@pytest.mark.parametrize(
    ("fosc", "fcy", "osccon"),
    [
        (0xFFE6, 14_745_600, 0x7720),  # XT with PLL x 8: the e-puck (§3)
        (0xFFE5, 7_372_800, 0x7720),  # XT with PLL x 4
        (0xFFE7, 29_491_200, 0x7720),  # XT with PLL x 16
        (0xC103, 7_370_000 / 4, 0x1100),  # FRC
        (0xC704, 7_370_000 / 4 * 0 + 14_745_600, 0x7720),  # FPR 00100 is reserved with FOS = 7
        (0xC304, 1_843_200, 0x3300),  # XT without PLL
        (0xC200, 128_000, 0x2200),  # LPRC
    ],
)
def test_clock_follows_the_configuration_word(fosc, fcy, osccon):
    """§2, §3: the configuration word selects the clock, with Fcy = Fosc / 4; OSCCON shows the source and the lock."""
    rig = Rig(fosc=fosc)
    assert rig.dev.fcy == pytest.approx(fcy, rel=1e-12)
    assert rig.read("OSCCON") == osccon


def test_osccon_accepts_a_byte_right_behind_its_two_keys(rig):
    """§3: OSCCON accepts a byte directly after its two keys: POST = 01 makes Tcy four times as long."""
    unlock_low(rig, 10, 0x40)
    assert rig.at(20).read("OSCCON") == 0x7760
    assert rig.dev.fcy == 14_745_600 / 4


def test_osccon_ignores_a_byte_one_instruction_late(rig):
    """§3: OSCCON ignores a byte if another instruction is between it and the keys."""
    rig.at(10).write("OSCCON", 0x46, LOW)
    rig.at(11).write("OSCCON", 0x57, LOW)
    rig.at(13).write("OSCCON", 0x40, LOW)
    assert rig.read("OSCCON") == 0x7720
    rig.at(20).write("OSCCON", 0x46, LOW)
    rig.at(22).write("OSCCON", 0x57, LOW)
    rig.at(23).write("OSCCON", 0x40, LOW)
    assert rig.read("OSCCON") == 0x7720


def test_osccon_ignores_words_wrong_keys_and_a_second_write(rig):
    """§3: OSCCON ignores word writes, wrong keys and a second byte after the same keys."""
    rig.at(10).write("OSCCON", 0x7740)
    assert rig.read("OSCCON") == 0x7720
    for step, byte in enumerate((0x46, 0x58, 0x40)):
        rig.at(20 + step).write("OSCCON", byte, LOW)
    assert rig.read("OSCCON") == 0x7720
    unlock_low(rig, 30, 0x40)
    rig.at(33).write("OSCCON", 0x80, LOW)
    assert rig.read("OSCCON") == 0x7760


def test_clock_switch_is_ignored_unless_fcksm_allows_it(rig):
    """§3: a clock switch is ignored with FCKSM = 1x, as on the e-puck: OSWEN reads 0 and COSC is unchanged."""
    unlock_high(rig, 10, 0x01)
    unlock_low(rig, 20, 0x01)
    assert rig.at(100000).read("OSCCON") == 0x7120
    assert rig.dev.fcy == 14_745_600


def test_clock_switch_to_the_frc():
    """§3: with FCKSM = 01 a clock switch to the FRC clears OSWEN and copies NOSC to COSC; elapsed seconds are
    continuous."""
    rig = Rig(fosc=0x7FE6)
    unlock_high(rig, 10, 0x01)
    unlock_low(rig, 20, 0x01)
    assert rig.at(23).read("OSCCON") == 0x1100
    assert rig.dev.fcy == 7_370_000 / 4
    assert rig.dev.seconds(23 + 1_842_500) == pytest.approx(23 / 14_745_600 + 1.0, rel=1e-9)


def test_tuning_does_not_change_the_seconds_that_have_passed():
    """§3: OSCTUN = 7 makes the internal oscillator 10.5 % faster from now on and does not change elapsed seconds."""
    rig = Rig(fosc=0x79E6)
    before = rig.at(1_842_500).dev.seconds(1_842_501)
    rig.write("OSCTUN", 7)
    assert rig.dev.seconds(1_842_501) == pytest.approx(before, rel=1e-9)
    assert rig.dev.seconds(1_842_501 + 1_842_500) == pytest.approx(before + 1 / 1.105, rel=1e-9)


def test_clock_switch_back_to_the_pll_waits_for_crystal_and_lock():
    """§3: a clock switch to the PLL waits for 1024 crystal periods and 20 us for the lock, counted in Tcy of the FRC:
    0.15889 ms x 1.8425 MHz = 293 Tcy."""
    rig = Rig(fosc=0x4106 | 0x0100)
    assert rig.read("OSCCON") == 0x1100
    unlock_high(rig, 10, 0x07)
    unlock_low(rig, 20, 0x01)
    assert rig.at(23 + 292).field("OSCCON", "OSWEN") == 1
    assert rig.at(23 + 293).read("OSCCON") == 0x7720


def test_pending_clock_switch_is_aborted_by_clearing_oswen():
    """§3: clearing OSWEN aborts a pending clock switch."""
    rig = Rig(fosc=0x4106)
    unlock_high(rig, 10, 0x07)
    unlock_low(rig, 20, 0x01)
    unlock_low(rig, 50, 0x00)
    assert rig.at(5000).read("OSCCON") == 0x1700


def test_clock_failure_with_the_monitor_runs_from_the_frc_and_traps():
    """§3: with FCKSM = 00 a clock failure switches to the FRC and traps."""
    rig = Rig(fosc=0x07E6)
    traps = []
    rig.cpu_signals.trap = traps.append
    rig.at(100).dev.oscillator.fail()
    assert traps == ["OSCFAIL"]
    assert rig.field("OSCCON", "CF") == 1
    assert rig.field("OSCCON", "COSC") == 1
    unlock_low(rig, 200, 0x00)
    assert rig.field("OSCCON", "CF") == 0


# -- resets -----------------------------------------------------------------------------------------------------------


def test_power_on_sets_por_and_bor(rig):
    """§4: power-on sets POR and BOR: RCON reads 0x0503 with LVDL = 0101."""
    assert rig.read("RCON") == 0x0503


@pytest.mark.parametrize(
    ("cause", "bit"), [("EXTR", 7), ("SWR", 6), ("WDTO", 4), ("BOR", 1), ("TRAPR", 15), ("IOPUWR", 14)]
)
def test_other_resets_add_their_bit_and_keep_the_rest(rig, cause, bit):
    """§4: other resets set their bit in RCON and keep the rest; the demo firmware clears POR, executes RESET and must
    find POR = 0, SWR = 1."""
    rig.write_all(RCON=0x0500, PR1=5)
    rig.at(50).dev.reset(cause)
    assert rig.read("RCON") == 0x0500 | 1 << bit
    assert rig.read("PR1") == 0xFFFF
    assert rig.read("TRISD") == 0xFFFF


def test_reset_stops_every_device(rig):
    """§4: a reset stops every device; operations in progress have no effect afterwards."""
    rig.write_all(PR1=100, T1CON=0x8000, U1MODE=0x8000, U1STA=0x400)
    rig.at(5).write("U1TXREG", 1)
    rig.at(20).dev.reset("SWR")
    rig.at(5000)
    assert rig.read("TMR1") == 0
    assert rig.read("IFS0") == 0
    assert rig.read("U1STA") == 0x110


def test_unknown_reset_cause_is_refused(rig):
    """An unknown reset cause is refused (§4)."""
    with pytest.raises(ValueError, match="not a reset cause"):
        rig.dev.reset("NAP")


# -- watchdog ---------------------------------------------------------------------------------------------------------

TWO_MS = 29_491  # 2 ms x 14.7456 MHz


def test_watchdog_resets_the_running_chip():
    """§4: the watchdog resets the running chip after 2 ms x 1 x 1."""
    rig = Rig(fwdt=0x8000)
    causes = []
    rig.cpu_signals.reset = causes.append
    rig.at(TWO_MS - 1)
    assert causes == []
    rig.at(TWO_MS)
    assert causes == ["WDTO"]


@pytest.mark.parametrize(("word", "factor"), [(0x8010, 8), (0x8020, 64), (0x8003, 4), (0x803F, 512 * 16)])
def test_watchdog_prescalers(word, factor):
    """§4: watchdog prescaler A is 1, 8, 64 or 512, B is 1..16; the longest period is 16.384 s."""
    rig = Rig(fwdt=word)
    assert rig.dev.watchdog.period == round(0.002 * factor * 14_745_600)


def test_clrwdt_restarts_the_watchdog_and_clears_wdto():
    """§4: CLRWDT restarts the watchdog and clears WDTO."""
    rig = Rig(fwdt=0x8000)
    causes = []
    rig.cpu_signals.reset = causes.append
    rig.at(20000).write("RCON", 0x0510)
    rig.dev.clear_watchdog(20000)
    assert rig.field("RCON", "WDTO") == 0
    rig.at(20000 + TWO_MS - 1)
    assert causes == []
    rig.at(20000 + TWO_MS)
    assert causes == ["WDTO"]


def test_watchdog_wakes_the_sleeping_chip_without_reset():
    """§4: the watchdog wakes the sleeping chip without a reset and sets WDTO and SLEEP."""
    rig = Rig(fwdt=0x8000)
    woken, causes = [], []
    rig.cpu_signals.wake = lambda: woken.append(rig.events.now)
    rig.cpu_signals.reset = causes.append
    rig.at(100).dev.sleep(2, 100)
    rig.at(100 + TWO_MS)
    assert woken == [100 + TWO_MS]
    assert causes == []
    assert (rig.field("RCON", "WDTO"), rig.field("RCON", "SLEEP")) == (1, 1)


def test_software_enables_the_watchdog_with_swdten(rig):
    """§4: with FWDTEN = 0, SWDTEN enables the watchdog; the e-puck's prescalers 512 and 16 give 16.384 s."""
    causes = []
    rig.cpu_signals.reset = causes.append
    rig.at(1000).write("RCON", 0x0523)
    rig.at(1000 + 241_591_910)
    assert causes == ["WDTO"]


# -- low voltage ------------------------------------------------------------------------------------------------------


def test_low_voltage_interrupt_needs_a_stable_band_gap(rig):
    """§4, §17: the low-voltage interrupt needs a stable band gap: BGST rises 20 us (295 Tcy) after LVDEN."""
    rig.write("RCON", 0x1503)
    assert rig.at(295).field("RCON", "BGST") == 0
    assert rig.at(296).field("RCON", "BGST") == 1
    rig.dev.lvd.set_supply(3300)
    assert not rig.at(400).flag("LVDIF")
    rig.dev.lvd.set_supply(2000)
    assert rig.at(401).flag("LVDIF")


# -- module disable ---------------------------------------------------------------------------------------------------


def test_disabled_module_reads_0_and_ignores_writes(rig):
    """§17: the registers of a module that PMD1 (T1MD) disables read 0 and ignore writes."""
    rig.write_all(PR1=7, PMD1=1 << 11)
    assert rig.read("PR1") == 0
    rig.write_all(PR1=9, PMD1=0)
    assert rig.read("PR1") == 0xFFFF


def test_disabled_timer_stops_counting(rig):
    """§17: a disabled timer stops counting."""
    rig.write_all(PR1=100, T1CON=0x8000)
    rig.at(50).write("PMD1", 1 << 11)
    rig.at(500).write("PMD1", 0)
    assert not rig.flag("T1IF")
    assert rig.read("T1CON") == 0


def test_module_switches_follow_a_restored_snapshot(rig):
    """After a restore, the modules that PMD1 in the record disables are off, although this state is not stored
    itself."""
    rig.write("PR1", 7)
    before = rig.record.snapshot()
    rig.write("PMD1", 1 << 11)
    rig.record.restore(before)
    rig.dev.restored()
    assert rig.read("PR1") == 7


# -- idle -------------------------------------------------------------------------------------------------------------


def test_pwrsav_sets_the_status_bit_of_its_mode(rig):
    """§4, §17: PWRSAV sets the status bit IDLE or SLEEP of its mode. RCON has no clock that stops meanwhile."""
    rig.at(10).dev.sleep(1, 10)
    rig.at(20).dev.wake(20)
    assert (rig.field("RCON", "IDLE"), rig.field("RCON", "SLEEP")) == (1, 0)
    rig.at(30).dev.sleep(2, 30)
    assert rig.dev.timer[1].is_frozen
    assert not rig.dev.resets.is_frozen
    rig.at(40).dev.wake(40)
    assert (rig.field("RCON", "IDLE"), rig.field("RCON", "SLEEP")) == (1, 1)


def test_uart_with_usidl_waits_in_idle(rig):
    """§17: a UART with USIDL stops in Idle: a frame that would end in cycle 1409 ends 1000 cycles later."""
    sent = []
    rig.dev.uart[1].on_byte = lambda byte, start: sent.append(rig.events.now)
    rig.write_all(U1BRG=7, U1MODE=0xA000)
    rig.at(1).write("U1STA", 0x400)
    rig.at(10).write("U1TXREG", 1)
    rig.at(200).dev.sleep(1, 200)
    rig.at(1200).dev.wake(1200)
    rig.at(5000)
    assert sent == [2409]
