"""Devices stopped in Idle or Sleep while others run, and delays in seconds during changes of Tcy."""

from __future__ import annotations

import pytest

from .conftest import Rig

LOW, HIGH = 0x00FF, 0xFF00


def unlock(rig: Rig, start: int, byte: int, lanes: int) -> None:
    """Write the keys and a byte of OSCCON in three consecutive cycles (§3)."""
    shift, keys = (8, (0x78, 0x9A)) if lanes == HIGH else (0, (0x46, 0x57))
    for step, value in enumerate((*keys, byte)):
        rig.at(start + step).write("OSCCON", value << shift, lanes)


def nap(rig: Rig, start: int, end: int, mode: int = 1) -> None:
    """Execute PWRSAV, so that clocks are stopped from `start` to `end`."""
    rig.at(start).dev.sleep(mode, start)
    rig.at(end).dev.wake(end)


# -- timers, and devices that use them ---------------------------------------------------------------------------------


def test_an_output_compare_waits_for_a_stopped_timer():
    """§7, §9: TSIDL stops the time base of an output compare in Idle, without match or edge; TMR2 is 19 when it
    resumes in cycle 200."""
    rig = Rig()
    for name, value in (("PR2", 99), ("OC1R", 50), ("OC1CON", 3), ("T2CON", 0xA000)):
        rig.write(name, value)
    rig.at(20).dev.sleep(1, 20)
    for cycle in range(21, 200):
        assert rig.at(cycle).dev.pins.get("RD0") == 0, cycle
    rig.dev.wake(200)
    assert rig.first_cycle(lambda: rig.dev.pins.get("RD0"), 200, 400) == 200 + 50 - 19 + 1


def test_a_stopped_output_compare_follows_its_timer_after_resuming():
    """§9: OCSIDL stops only the output compare; it resumes with the next match of its running timer."""
    rig = Rig()
    for name, value in (("PR2", 99), ("OC1R", 50), ("OC1CON", 0x2003), ("T2CON", 0x8000)):
        rig.write(name, value)
    nap(rig, 20, 210)
    cycle = rig.first_cycle(lambda: rig.dev.pins.get("RD0"), 211, 500)
    assert rig.at(cycle).read("TMR2") == 51


@pytest.mark.parametrize("late", [0, 1])
@pytest.mark.parametrize("mode", [1, 2])
def test_a_match_of_the_cycle_in_which_both_stop_still_moves_the_pin(mode, late):
    """§9: the pin changes one Tcy after the match, also if the match is in the last cycle before Idle or Sleep."""
    rig = Rig()
    for name, value in (("PR2", 99), ("OC1R", 50), ("OC1CON", 0x2003), ("T2CON", 0xA000)):
        rig.write(name, value)
    cycle = rig.first_cycle(lambda: rig.read("TMR2") == 50, 1, 99)
    nap(rig, cycle + late, cycle + 300, mode)
    assert rig.first_cycle(lambda: rig.dev.pins.get("RD0"), cycle + 300, cycle + 400) <= cycle + 301


@pytest.mark.parametrize("start", [110, 129, 130, 131, 199, 200, 201])
@pytest.mark.parametrize("tsidl", [0, 0x2000])
def test_pwm_stops_with_its_timer(start, tsidl):
    """§9: a PWM has no edges while its time base is stopped."""
    rig = Rig()
    for name, value in (("PR2", 99), ("OC1R", 30), ("OC1RS", 30), ("OC1CON", 6 | tsidl), ("T2CON", 0xA000)):
        rig.write(name, value)
    level, count = rig.at(start).dev.pins.get("RD0"), rig.read("TMR2")
    rig.dev.sleep(1, start)
    assert rig.at(500).dev.pins.get("RD0") == level == (count < 30)
    rig.dev.wake(500)
    for cycle in range(500, 900):
        assert rig.at(cycle).dev.pins.get("RD0") == ((cycle - 500 + count) % 100 < 30), cycle


def test_a_capture_takes_the_count_of_a_stopped_timer():
    """§8: a capture stores the count at which TSIDL stopped timer 2."""
    rig = Rig()
    rig.write_all(IC1CON=0x83, T2CON=0xA000)
    rig.at(20).dev.sleep(1, 20)
    count = rig.read("TMR2")
    rig.at(100).dev.pins.set("RD8", 1)
    assert rig.at(110).read("IC1BUF") == count


@pytest.mark.parametrize("start", [20, 63, 64, 65, 100])
def test_a_prescaler_keeps_its_count_while_the_timer_is_stopped(start):
    """§7: the prescaler keeps its count while the timer is stopped: 64 Tcy of running time make a count, however long
    the stop was."""
    rig = Rig()
    rig.write("T3CON", 0xA020)
    nap(rig, start, 1000)
    running = start - 1
    for cycle in range(1000, 1300):
        assert rig.at(cycle).read("TMR3") == (running + cycle - 1000) // 64, cycle


@pytest.mark.parametrize(("before", "after"), [(1, 0), (0, 1)])
def test_a_gate_change_while_the_timer_was_stopped(before, after):
    """§7: after a stop, a gated timer counts while its gate is high, whatever the gate did during the stop."""
    rig = Rig()
    rig.dev.pins.set("RC1", before)
    rig.write("T2CON", 0xA040)
    rig.at(20).dev.sleep(1, 20)
    rig.at(50).dev.pins.set("RC1", after)
    rig.at(60).dev.wake(60)
    first = rig.at(61).read("TMR2")
    assert rig.at(161).read("TMR2") - first == (100 if after else 0)


@pytest.mark.parametrize(("register", "value"), [("PR2", 77), ("TMR2", 7), ("T2CON", 0x8050), ("T2CON", 0x8040)])
def test_a_closing_gate_interrupts_whatever_is_written_in_its_cycle(register, value):
    """§7: the falling edge of the gate sets the flag, whatever is written to the timer in the same cycle."""
    rig = Rig()
    rig.dev.pins.set("RC1", 1)
    rig.write("T2CON", 0x8040)
    rig.at(20).dev.pins.set("RC1", 0)
    rig.write(register, value)
    assert rig.at(22).flag("T2IF") == 1


def test_timer_three_is_on_its_own_when_its_partner_is_switched_off():
    """§7, §17: if timer 2 is disabled there is no 32-bit pair, and timer 3 follows T3CON."""
    rig = Rig()
    rig.write_all(T3CON=0x8000, T2CON=0x8008)
    rig.at(20).write("PMD1", 1 << 12)
    first = rig.at(100).read("TMR3")
    assert rig.at(150).read("TMR3") == first + 50


def test_an_output_compare_has_no_match_when_its_timer_is_disabled():
    """§17: an output compare has no match if its timer is disabled."""
    rig = Rig()
    for name, value in (("PR2", 99), ("OC1R", 50), ("OC1CON", 3), ("T2CON", 0x8000)):
        rig.write(name, value)
    rig.at(20).write("PMD1", 1 << 12)
    assert rig.at(400).dev.pins.get("RD0") == 0


# -- delays in seconds -------------------------------------------------------------------------------------------------


def test_the_watchdog_keeps_its_seconds_when_the_tcy_changes():
    """§4: a change of Tcy does not change the watchdog's period of 2 ms, because it counts the LPRC, which no
    postscaler divides."""
    rig = Rig(fwdt=0x8000)
    expired = []
    rig.cpu_signals.reset = lambda _cause: expired.append(rig.dev.seconds(rig.events.now))
    unlock(rig, 100, 0xC0, LOW)
    rig.at(3000)
    assert expired == [pytest.approx(2e-3, rel=1e-2)]


def test_programming_takes_its_seconds_when_the_tcy_changes():
    """§16: a change of Tcy does not change the programming time of 2 ms, which the memory's own timer measures."""
    rig = Rig()
    for cycle, name, value in ((1, "NVMADRU", 0x7F), (2, "NVMADR", 0xF000), (3, "NVMCON", 0x4044),
                               (4, "NVMKEY", 0x55), (5, "NVMKEY", 0xAA), (6, "NVMCON", 0xC044)):  # fmt: skip
        rig.at(cycle).write(name, value)
    unlock(rig, 10, 0xC0, LOW)
    cycle = rig.first_cycle(lambda: rig.flag("NVMIF"), 20, 1000)
    assert rig.dev.seconds(cycle) == pytest.approx(2e-3, rel=1e-2)


def test_the_cpu_stalls_until_flash_is_programmed_when_the_tcy_changes():
    """§3, §16: the CPU stalls until flash is programmed. If a switch to the crystal ends during an erase, the rest
    takes an eighth of the Tcy."""
    rig, held = switching(), []
    rig.cpu_signals.stall_until = held.append
    for cycle, name, value in ((31, "NVMADRU", 0), (32, "NVMADR", 0x4000), (33, "NVMCON", 0x4041),
                               (34, "NVMKEY", 0x55), (35, "NVMKEY", 0xAA), (36, "NVMCON", 0xC041)):  # fmt: skip
        rig.at(cycle).write(name, value)
    done = rig.first_cycle(lambda: rig.flag("NVMIF"), 37, 30_000)
    assert held[-1] == done
    assert rig.dev.seconds(done) == pytest.approx(2e-3, rel=1e-2)


def test_a_slower_tcy_does_not_delay_a_clock_switch():
    """§3: dividing Tcy by 64 during a clock switch does not delay it: 1024 periods of the crystal and the lock take
    0.159 ms."""
    rig = Rig(fosc=0x4106)
    unlock(rig, 10, 0x07, HIGH)
    unlock(rig, 20, 0xC1, LOW)
    cycle = rig.first_cycle(lambda: not rig.field("OSCCON", "OSWEN"), 30, 1000)
    assert rig.dev.seconds(cycle) == pytest.approx(23 / 1_842_500 + 1024 / 7_372_800 + 20e-6, rel=0.2)


def test_a_watchdog_faster_than_the_cpu_ends_idle_at_once():
    """§3, §4: if a Tcy (32 kHz through 64: 7.8 ms) is longer than the watchdog's 2 ms, Idle ends in the next cycle."""
    rig, woken = Rig(fosc=0x4006, fwdt=0x8000), []
    rig.cpu_signals.wake = lambda: woken.append(rig.events.now)
    unlock(rig, 5, 0xC0, LOW)
    assert rig.dev.fcy == 128
    rig.dev.sleep(1, 7)
    rig.at(10)
    assert woken == [8, 9, 10]


def test_a_watchdog_that_software_switched_on_ends_with_a_reset():
    """§4: every reset clears SWDTEN and so stops a watchdog that software enabled; software cannot change FWDTEN."""
    rig, expired = Rig(fwdt=0x0000), []
    rig.cpu_signals.reset = expired.append
    rig.at(10).write("RCON", 0x0520)
    rig.at(100).dev.reset("WDTO")
    assert rig.read("RCON") == 0x0510
    rig.at(100_000)
    assert not expired


# -- interrupted clock switches ----------------------------------------------------------------------------------------


def switching(fosc: int = 0x7FE6) -> Rig:
    """Request a switch from the PLL to the crystal in cycle 22."""
    rig = Rig(fosc=fosc)
    unlock(rig, 10, 0x03, HIGH)
    unlock(rig, 20, 0x01, LOW)
    assert rig.at(30).read("OSCCON") == 0x7321
    return rig


def test_a_reset_leaves_a_pending_switch_to_end():
    """§3, §4: a reset that keeps the clock selection does not abort a pending clock switch."""
    rig = switching()
    rig.dev.reset("SWR")
    assert rig.at(40).read("OSCCON") == 0x7321
    assert rig.at(10_000).read("OSCCON") == 0x3300


def test_sleep_abandons_a_pending_switch():
    """§3: Sleep aborts a pending clock switch: the old clock is kept and OSWEN falls."""
    rig = switching()
    rig.dev.sleep(2, 30)
    assert rig.at(10_000).read("OSCCON") == 0x7320


def test_a_clock_failure_abandons_a_pending_switch():
    """§3: a clock failure aborts a pending clock switch: the fail-safe monitor selects the FRC and clears OSWEN."""
    rig = switching(0x3FE6)
    rig.dev.oscillator.fail()
    assert rig.at(10_000).read("OSCCON") == 0x1308


def test_a_switch_to_the_current_clock_ends_at_once():
    """§3: a switch to the current clock ends at once, because no oscillator has to start."""
    rig = Rig(fosc=0x7FE6)
    unlock(rig, 10, 0x01, LOW)
    assert rig.at(13).read("OSCCON") == 0x7720


def test_a_brown_out_takes_the_clock_of_the_configuration():
    """§3, §4: a brown-out selects the clock of the configuration word, as power-on does; elapsed seconds continue."""
    rig = Rig(fosc=0x7FE6)
    unlock(rig, 10, 0x01, HIGH)
    unlock(rig, 20, 0x81, LOW)
    rig.at(60_000)
    seconds = rig.dev.seconds(60_000)
    rig.dev.reset("BOR")
    assert rig.read("OSCCON") == 0x7720
    assert rig.dev.fcy == 14_745_600
    assert rig.dev.seconds(60_000) == pytest.approx(seconds)


# -- serial devices in Sleep -------------------------------------------------------------------------------------------


def test_sleep_cuts_a_reception_off():
    """§10: Sleep stops the receiver's clock and so discards a character that is being received."""
    rig = Rig()
    rig.write_all(U1BRG=7, U1MODE=0x8000)
    rig.dev.uart[1].feed(b"A")
    nap(rig, 600, 10_000, 2)
    assert rig.field("U1STA", "RIDLE") == 1
    rig.at(20_000)
    assert rig.field("U1STA", "URXDA") == 0
    rig.dev.uart[1].feed(b"B")
    assert rig.at(30_000).read("U1RXREG") == ord("B")


@pytest.mark.parametrize("freed", [200, 400])
def test_an_i2c_clock_released_while_the_module_is_stopped(freed):
    """§11: a transfer that waits for SCL while the module is stopped starts in the cycle after SCL is released and
    the module runs again, whichever is later."""
    rig = Rig()
    rig.write_all(I2CBRG=150, I2CCON=0xB000)
    rig.at(5).write("I2CCON", 0xB001)
    rig.at(1000).write("I2CCON", 0xB002)
    rig.at(1001).dev.i2c.wire.hold(scl=True)
    rig.at(3000)
    rig.clear_flags()
    rig.write("I2CTRN", 0x55)
    rig.at(3100).dev.sleep(1, 3100)
    rig.at(3100 + freed).dev.i2c.wire.release()
    assert rig.at(9000).flag("MI2CIF") == 0
    rig.dev.wake(9000)
    assert rig.first_cycle(lambda: rig.flag("MI2CIF"), 9001, 12_000) == 9001 + 9 * 151


def test_a_master_does_not_resume_a_word_aborted_by_sleep():
    """§12: Sleep aborts the word that a master is sending; the word in TXB is sent after the wake-up."""
    rig = Rig()
    sent = []
    rig.dev.spi[1].exchange = lambda word, _bits: sent.append(word) or 0
    rig.write_all(SPI1CON=0x20, SPI1STAT=0x8000, SPI1BUF=0x11)
    rig.at(5).write("SPI1BUF", 0x22)
    nap(rig, 600, 10_000, 2)
    rig.at(30_000)
    assert sent == [0x22]


@pytest.mark.parametrize("mode", [1, 2])
def test_a_slave_works_on_the_outside_clock_while_the_chip_sleeps(mode):
    """§12: a slave is clocked by SCK, so it receives a word in Sleep, and its flag wakes the chip."""
    rig = Rig()
    rig.write("SPI1STAT", 0xA000)
    rig.at(20).dev.sleep(mode, 20)
    assert rig.at(100).dev.spi[1].clock_word(0x5A)
    assert rig.at(1000).flag("SPI1IF") == 1
    assert rig.read("SPI1BUF") == 0x5A


class Square:
    """Waveform on RC3 that rises every 100 Tcy, starting at 100."""

    def bits(self, cycle: int) -> int:
        return 8 if cycle % 100 < 50 else 0

    def rises(self, mask: int, after: int, until: int) -> int:
        return max(until, 0) // 100 - max(after, 0) // 100

    def nth_rise(self, mask: int, after: int, count: int) -> int:
        return (max(after, 0) // 100 + count) * 100

    def constant_until(self, cycle: int) -> int:
        return cycle


@pytest.mark.parametrize("start", [350, 299, 300, 301, 302])
def test_a_stopped_counter_misses_edges_of_a_waveform(start):
    """§7: edges between PWRSAV and the wake-up are not counted; the match is at the fourth counted edge."""
    rig = Rig()
    rig.dev.pins.attach(2, 8, Square())
    rig.write_all(PR4=4, T4CON=0xA002)
    nap(rig, start, 1020)
    counted = (start - 1) // 100
    cycle = rig.first_cycle(lambda: rig.flag("T4IF"), 1020, 2000)
    assert cycle == 1000 + 100 * (4 - counted) + 2
    assert rig.at(1960).read("TMR4") == (counted + 9) % 5
