"""Devices under a running program, on every engine: consecutive instructions, sleep and interrupts.

Sections without a file name are those of the chip reference.
"""

from __future__ import annotations

import pytest

from emu.chips.dspic30f6014a import SFRS, VECTORS
from tests.emu.cpu.cpu_rig import START, Rig

from .drills.device_programs import CHIPS, difference

ENGINES = ("plain", "jit")
A = {name: f"{sfr.address:#x}" for name, sfr in SFRS.items()}


@pytest.fixture(params=ENGINES)
def engine(request):
    return request.param


def run(text, engine, cycles=100_000, **w):
    """Run a program, with register names in braces, until it stops at `end: bra end`."""
    rig = Rig(text.format(**A), engine, **w)
    rig.machine.program.put(0xF80000, 0xFFE6)
    rig.machine.peripherals.oscillator.power_up(power_on=True)
    if "end" in rig.labels:
        rig.note("end", stop=True)
    rig.machine.run(cycles)
    return rig


def test_three_byte_moves_in_a_row_unlock_the_oscillator(engine):
    """§3: keys and data in consecutive MOV.B through a pointer unlock OSCCON."""
    rig = run(
        """
        mov #{OSCCON}, w1 | mov #0x46, w2 | mov #0x57, w3 | mov #0x40, w4 | mov.b w2, [w1]
        mov.b w3, [w1] | mov.b w4, [w1]
        end: bra end
        """,
        engine,
    )
    assert rig.machine.peek("OSCCON") == 0x7760


def test_an_instruction_between_the_keys_keeps_the_oscillator_locked(engine):
    """§3: an instruction between the keys keeps OSCCON locked."""
    rig = run(
        """
        mov #{OSCCON}, w1 | mov #0x46, w2 | mov #0x57, w3 | mov #0x40, w4 | mov.b w2, [w1]
        mov.b w3, [w1] | nop | mov.b w4, [w1]
        end: bra end
        """,
        engine,
    )
    assert rig.machine.peek("OSCCON") == 0x7720


def test_reading_the_port_right_behind_the_latch_needs_a_nop(engine):
    """§6: MOV PORTD, w1 directly after MOV w0, LATD reads the old pins; after a NOP it reads the new ones."""
    rig = run(
        """
        clr {TRISD} | mov #0x1234, w0 | mov w0, {LATD} | mov {PORTD}, w1 | mov {PORTD}, w2
        end: bra end
        """,
        engine,
    )
    assert (rig.machine.w[1], rig.machine.w[2]) == (0, 0x1234)


def test_bset_on_the_port_copies_pins_and_on_the_latch_does_not(engine):
    """§6: BSET on PORTD reads the low input pin 0 and clears its latch bit (bytes: isa.md §6.5); BSET on LATD does
    not."""
    rig = run(
        """
        mov #0x00FF, w0 | mov w0, {TRISD} | mov #0x0001, w0 | mov w0, {LATD} | nop | bset {LATD}, #8
        nop | mov {LATD}, w1 | bset {PORTD}, #1 | mov {LATD}, w2
        end: bra end
        """,
        engine,
    )
    assert (rig.machine.w[1], rig.machine.w[2]) == (0x0101, 0x0102)


def test_a_timer_read_by_the_program_counts_every_cycle(engine):
    """§7: a timer counts every cycle: after BSET T1CON in cycle 0, TMR1 read 1, 2 and 6 cycles later is 0, 1 and 5."""
    rig = run(
        """
        bset {T1CON}, #15 | mov {TMR1}, w1 | mov {TMR1}, w2 | nop | nop | nop | mov {TMR1}, w3
        end: bra end
        """,
        engine,
    )
    assert [rig.machine.w[n] for n in (1, 2, 3)] == [0, 1, 5]


def test_a_wide_timer_is_read_consistently_through_its_holding_register(engine):
    """§7: reading a 32-bit timer through its holding register is consistent, also if TMR2 carries into TMR3 between
    both reads."""
    rig = run(
        """
        mov #0xFFFF, w0 | mov w0, {PR2} | mov w0, {PR3} | mov #8, w0 | mov w0, {T2CON} | mov #7, w0
        mov w0, {TMR3HLD} | mov #0xFFFC, w0 | mov w0, {TMR2} | mov #0x8008, w0 | mov w0, {T2CON} | nop
        nop | mov {TMR2}, w1 | mov {TMR3HLD}, w2 | mov {TMR2}, w3 | mov {TMR3HLD}, w4
        end: bra end
        """,
        engine,
    )
    assert [rig.machine.w[n] for n in (1, 2, 3, 4)] == [0xFFFE, 7, 0, 8]


def test_polling_the_converter_takes_the_time_of_the_conversion(engine):
    """§13: after BCLR of SAMP, the first poll after 133 Tcy reads DONE; the loop of BTSS and BRA takes 3 Tcy."""
    rig = Rig(
        """
        mov #18, w0 | mov w0, {ADCON3} | mov #9, w0 | mov w0, {ADCHS} | bset {ADCON1}, #15
        bset {ADCON1}, #1 | repeat #50 | nop
        convert: bclr {ADCON1}, #1
        wait: btss {ADCON1}, #0 | bra wait
        done: mov {ADCBUF0}, w1
        end: bra end
        """.format(**A),
        engine,
    )
    rig.machine.peripherals.adc.set_input(9, 777 << 4)
    rig.note("convert")
    rig.note("done", stop=True)
    rig.machine.run(2000)
    # BCLR in cycle c; the result is there from c + 1 + 133; polls in c + 1, c + 4, ...; the skip takes one cycle more
    assert rig.first("done") - rig.first("convert") == 1 + 135 + 2
    rig.machine.run(5)
    assert rig.machine.w[1] == 777


def test_an_input_that_changes_in_the_cycle_of_its_interrupt_does_not_take_it(engine):
    """§13, §17: an input level that is set between two runs of a CPU in Idle, at any cycle, does not delay an
    interrupt."""
    program = """
        mov #0x001C, w0 | mov w0, {ADCSSL} | mov #0x0408, w0 | mov w0, {ADCON2} | mov #0x0113, w0
        mov w0, {ADCON3} | mov #0x80E4, w0 | mov w0, {ADCON1} | bset {IEC0}, #11 | mov #0x00E0, w0
        mov w0, {SR}
        wait: pwrsav #1 | bclr {IFS0}, #11 | inc w5, w5 | bra wait
        """.format(**A)
    left, changed = Rig(program, engine), Rig(program, engine)
    w5 = left.machine.w[5]
    left.machine.run(5000)
    while changed.machine.cycle < left.machine.cycle:
        changed.machine.peripherals.adc.set_input(2, 100)
        changed.machine.run(1)
    assert left.machine.cycle == changed.machine.cycle
    assert left.machine.w[5] == changed.machine.w[5]
    assert left.machine.w[5] - w5 > 8


def test_uart_bytes_written_by_polling_follow_without_gaps(engine):
    """§10.1: bytes written by polling UTXBF follow without gaps: frames start every 1280 Tcy on the bit clock that
    UARTEN started."""
    rig = Rig(
        """
        mov #7, w0 | mov w0, {U1BRG}
        enable: bset {U1MODE}, #15 | bset {U1STA}, #10 | mov #0x41, w1 | mov #8, w2
        next: btsc {U1STA}, #9 | bra next | mov w1, {U1TXREG} | inc w1, w1 | dec w2, w2 | bra nz, next
        wait: btss {U1STA}, #8 | bra wait
        end: bra end
        """.format(**A),
        engine,
    )
    sent = []
    rig.machine.uart[1].on_byte = lambda byte, start: sent.append((byte, start))
    rig.note("enable")
    rig.note("end", stop=True)
    rig.machine.run(20_000)
    clock = rig.first("enable") + 1
    assert sent == [(0x41 + n, clock + 128 + 1280 * n) for n in range(8)]


def test_change_notice_wakes_from_sleep_once_the_oscillator_runs(engine):
    """§3, §6.2, §17: an edge on CN13 = RD4 wakes the CPU from Sleep and RCON.SLEEP is set. The oscillator starts in
    1,024 periods of 7.3728 MHz and locks in 20 us: 2,048 + 295 Tcy."""
    rig = Rig(
        """
        bset {CNEN1}, #13 | bset {IEC0}, #15 | pwrsav #0 | mov #1, w1
        end: bra end
        """.format(**A),
        engine,
        w1=0,
    )
    rig.at(5000, lambda: rig.machine.pins.set("RD4", 1))
    rig.note("end", stop=True)
    rig.machine.state.sr = 0xE0  # CPU priority 7: execution continues after PWRSAV
    rig.machine.run(20_000)
    assert rig.machine.w[1] == 1
    assert 5000 + 2343 < rig.machine.cycle < 5020 + 2343
    assert rig.machine.peek("RCON") & 8


def test_watchdog_wakes_from_idle_and_the_program_goes_on(engine):
    """§4: the watchdog wakes the CPU from Idle after 2 ms at 14.7456 MHz and sets WDTO without a reset."""
    rig = Rig("pwrsav #1\nmov #1, w1\nend: bra end", engine, w1=0)
    rig.machine.program.put(0xF80000, 0xFFE6)
    rig.machine.program.put(0xF80002, 0x8000)
    rig.machine.peripherals.oscillator.power_up(power_on=True)
    rig.note("end", stop=True)
    rig.machine.run(100_000)
    assert rig.machine.w[1] == 1
    assert 29_491 <= rig.machine.cycle <= 29_500
    assert rig.machine.peek("RCON") & 0x1C == 0x14


def test_sleep_stops_timers_and_idle_does_not(engine):
    """§17: timer 2 counts during Idle and stops during Sleep."""
    counts = []
    for mode in (0, 1):
        rig = Rig(
            f"""
            bset {A["T2CON"]}, #15
            bset {A["CNEN1"]}, #13
            bset {A["IEC0"]}, #15
            pwrsav #{mode}
            mov {A["TMR2"]}, w1
            end: bra end
            """,
            engine,
        )
        rig.at(5000, lambda rig=rig: rig.machine.pins.set("RD4", 1))
        rig.note("end", stop=True)
        rig.machine.state.sr = 0xE0
        rig.machine.run(20_000)
        counts.append(rig.machine.w[1])
    assert counts[0] < 20
    assert 4990 < counts[1] < 5020


def test_eeprom_write_goes_on_while_the_program_counts_and_interrupts_at_its_end(engine):
    """§16: during an EEPROM write the program runs on; after 2 ms NVMIF interrupts, and TBLRDL reads the word back."""
    rig = Rig(
        """
        mov #0x7F, w0 | mov w0, {TBLPAG} | mov #0xF010, w1 | mov #0xBEEF, w2 | tblwtl w2, [w1]
        mov #0x4004, w0 | mov w0, {NVMCON} | mov #0x55, w0 | mov w0, {NVMKEY} | mov #0xAA, w0
        mov w0, {NVMKEY}
        start: bset {NVMCON}, #15 | nop | nop | clr w3
        wait: inc w3, w3 | btsc {NVMCON}, #15 | bra wait
        end: tblrdl [w1], w4 | bra end
        """.format(**A),
        engine,
    )
    rig.machine.program.put(0xF80000, 0xFFE6)
    rig.machine.peripherals.oscillator.power_up(power_on=True)
    rig.note("start")
    rig.note("end", stop=True)
    rig.machine.run(100_000)
    assert 29_491 < rig.machine.cycle - rig.first("start") < 29_500
    assert rig.machine.peek("IFS0") & 1 << 12
    assert rig.machine.w[3] > 7000
    rig.machine.step()
    assert rig.machine.w[4] == 0xBEEF


def test_an_interrupt_between_the_keys_breaks_the_sequence(engine):
    """§16: if the handler of T1 runs between the keys 0x55 and 0xAA, no write starts."""
    rig = Rig(
        """
        mov #0x4044, w0 | mov w0, {NVMCON} | mov #0xAA, w1 | mov #0x55, w0
        first: mov w0, {NVMKEY} | mov w1, {NVMKEY} | bset {NVMCON}, #15 | nop
        end: bra end
        handler: bclr {IFS0}, #3 | retfie
        """.format(**A),
        engine,
    )
    rig.vector(VECTORS[11].ivt, "handler")
    rig.interrupt_at(4)
    rig.note("end", stop=True)
    rig.machine.run(1000)
    assert not rig.machine.peek("NVMCON") & 0x8000


def test_reset_instruction_keeps_rcon_and_brings_the_devices_down(engine):
    """epuck.md §2: RESET keeps POR, which software has cleared, sets SWR, and resets the devices."""
    rig = Rig(
        """
        btss {RCON}, #0 | bra second | bclr {RCON}, #0 | mov #0x8000, w0 | mov w0, {T1CON} | reset
        second: mov {RCON}, w1 | mov {T1CON}, w2
        end: bra end
        """.format(**A),
        engine,
    )
    rig.machine.program.put_flash(0, [0x040000 | START, 0])
    rig.note("end", stop=True)
    rig.machine.run(1000)
    assert rig.machine.w[1] & 0x41 == 0x40
    assert rig.machine.w[2] == 0


def test_i2c_polled_write_takes_the_bus_time(engine):
    """§11: a polled write takes 59 Tbrg of 75.5 Tcy, plus the polls: start 2 Tbrg, three bytes of 18, stop 3."""
    rig = Rig(
        """
        mov #150, w0 | mov w0, {I2CBRG} | bset {I2CCON}, #15
        begin: bset {I2CCON}, #0
        start: btsc {I2CCON}, #0 | bra start | mov #0xDC, w0 | rcall send | mov #0x1D, w0 | rcall send
        mov #0x70, w0 | rcall send | bset {I2CCON}, #2
        stop: btsc {I2CCON}, #2 | bra stop
        end: bra end
        send: mov w0, {I2CTRN}
        busy: btsc {I2CSTAT}, #14 | bra busy | return
        """.format(**A),
        engine,
    )
    taken = []

    class Device:
        def start(self, read, cycle):
            return True

        def write(self, byte, cycle):
            taken.append(byte)
            return True

        def stop(self, cycle):
            taken.append("stop")

        def stretch(self, cycle):
            return 0

    rig.machine.peripherals.i2c.wire.devices[0x6E] = Device()
    rig.note("begin")
    rig.note("end", stop=True)
    rig.machine.run(20_000)
    assert taken == [0x1D, 0x70, "stop"]
    bus_time = 151 + 3 * 1359 + 226
    assert bus_time < rig.first("end") - rig.first("begin") < bus_time + 60


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "chip"), [(0, "dsPIC30F6014A"), (2, "dsPIC30F6014A"), (100, "dsPIC30F0000")])
@pytest.mark.parametrize("other", ENGINES[1:])
def test_engines_agree_on_programs_that_access_device_registers(seed, chip, other):
    """engines.md §4: programs that access device registers give the same bytes in the same cycle in every engine.

    `tests/fuzz/emulator/fuzz_devices.py` runs more seeds.
    """
    assert difference(seed, other, chip=CHIPS[chip]) is None
