"""The AVR core: programs in lock step with simavr, interrupts, sleep, faults, snapshots."""

from __future__ import annotations

from pathlib import Path

import pytest

from emu.avr.core.state import Avr
from emu.avr.image import AvrImage
from emu.avr.machine import Atmega328p
from tests.emu.avr.conftest import Machine, compiled
from tests.emu.avr.oracle import Pair

PROGRAMS = Path(__file__).with_name("programs.c")
LEVELS = ("-Os", "-O2", "-O3", "-O1")
STEPS = 40_000


def flash(*words: int) -> AvrImage:
    """Return an image that starts with the given words."""
    content = b"".join(word.to_bytes(2, "little") for word in words)
    return AvrImage("words", content + b"\xff" * (0x8000 - len(content)), len(content), {})


@pytest.mark.slow
@pytest.mark.parametrize("program", range(10))
def test_programs_run_as_in_simavr(pair: Pair, program: int, tmp_path: Path) -> None:
    """Ten programs at four optimisation levels run in lock step: registers, SREG, PC and cycles after every step."""
    image = compiled(PROGRAMS, tmp_path / "program.elf", LEVELS[program % 4], f"-DPROGRAM={program}")
    pair.load(image.flash)
    assert pair.lockstep(STEPS) == ""


# ---- Interrupts and sleep --------------------------------------------------------------------------------------------


def test_an_interrupt_takes_four_cycles(machine: Machine) -> None:
    """The CPU enters an interrupt in 4 cycles; one instruction runs after SEI (avr.md §1)."""
    m = machine("""
        ISR(INT0_vect, ISR_NAKED) { asm volatile("in r24, 0x3f\\n reti"); }
        int main(void) {
            EICRA = 3; EIMSK = 1; EIFR = 1;
            asm volatile("ldi r24, 0\\n ldi r25, 0\\n sbi 5, 0\\n 1: sei\\n inc r25\\n inc r25\\n inc r25\\n cli\\n");
            for (;;) ;
        }""")
    m.watch([0x25])
    while not m.changes:
        m.step()
    m.set_pins(m.cycle, 2, 0xFF, 4)
    assert m.image.flash[m.pc : m.pc + 2] == b"\x78\x94"  # sei
    m.step()
    assert m.state.data[25] == 0
    before = m.cycle
    m.step()
    assert (m.state.data[25], m.cycle) == (1, before + 1)
    m.step()
    assert m.cycle == before + 1 + 4, "the entry"
    m.step()  # JMP in the vector table
    assert m.cycle == before + 1 + 4 + 3
    m.step()
    assert m.state.data[24] & 0x80 == 0, "I is cleared"


def test_sleep_ends_with_the_timer(machine: Machine) -> None:
    """A CPU in Idle wakes at timer 0's compare match; the time until then counts as sleep."""
    m = machine("""
        volatile uint8_t ticks;
        ISR(TIMER0_COMPA_vect) { ticks++; }
        int main(void) {
            OCR0A = 124; TCCR0A = 2; TCCR0B = 3; TIMSK0 = 2; sei();
            while (ticks < 8) sleep_mode();
            cli(); return 0;
        }""")
    assert m.run_until(1_000_000) == "halt"
    assert 8 * 8_000 <= m.state.halted_at <= 8 * 8_000 + 300
    assert m.state.slept > 60_000


def test_power_down_stops_the_timers(machine: Machine) -> None:
    """In power-down the watchdog wakes the CPU, and timer 1 has not counted meanwhile."""
    m = machine("""
        #include <avr/wdt.h>
        volatile uint16_t before, after;
        ISR(WDT_vect) { after = TCNT1; }
        int main(void) {
            TCCR1B = 1; WDTCSR = 1 << WDCE | 1 << WDE; WDTCSR = 1 << WDIE;
            set_sleep_mode(SLEEP_MODE_PWR_DOWN); sei();
            before = TCNT1; sleep_mode();
            cli(); return 0;
        }""")
    assert m.run_until(1_000_000) == "halt"
    assert m.state.halted_at > 128_000  # 16 ms
    assert 0 < m.peek("after", 2) - m.peek("before", 2) < 100


def test_power_down_suspends_a_timer_interrupt(machine: Machine) -> None:
    """An interrupt of timer 0 that was due during power-down is delayed by the duration of the sleep."""
    m = machine("""
        ISR(WDT_vect) { }
        ISR(TIMER0_COMPA_vect) { PORTB = 1; }
        int main(void) {
            OCR0A = 99; TCCR0B = 5; TIMSK0 = 2; WDTCSR = 1 << WDCE | 1 << WDE; WDTCSR = 1 << WDIE;
            set_sleep_mode(SLEEP_MODE_PWR_DOWN); sei(); sleep_mode();
            WDTCSR = 1 << WDCE | 1 << WDE; WDTCSR = 0;
            for (;;) ;
        }""")
    m.watch([0x25])
    m.run_until(1_000_000)
    assert m.state.slept > 127_000
    assert [0 <= change.cycle - m.state.slept - 100 * 1024 < 100 for change in m.changes] == [True]


def test_sleep_without_interrupts_halts(machine: Machine) -> None:
    """With interrupts off nothing wakes the CPU: the run ends where it sleeps."""
    m = machine("int main(void) { cli(); sleep_mode(); PORTB = 1; for (;;) ; }")
    assert m.run_until(10_000_000) == "halt"
    assert m.cycle < 1_000
    assert m.peek(0x25) == 0


def test_the_watchdog_resets(machine: Machine) -> None:
    """A watchdog that is not restarted resets the chip: MCUSR has the cause, and RAM is unchanged."""
    m = machine("""
        #include <avr/wdt.h>
        uint8_t starts __attribute__((section(".noinit")));
        int main(void) {
            if (MCUSR & 1 << WDRF) { MCUSR = 0; wdt_disable(); cli(); sleep_mode(); }
            starts = 77; wdt_enable(WDTO_15MS); for (;;) ;
        }""")
    assert m.run_until(1_000_000) == "halt"
    assert (m.state.resets, m.peek("starts")) == (1, 77)
    assert 128_000 <= m.cycle < 129_000


# ---- Faults ----------------------------------------------------------------------------------------------------------


def test_faults() -> None:
    """Illegal words, accesses beyond RAM and flash, and stacks outside RAM stop the machine at their instruction."""
    sts, lds, push, nop = 0x9200, 0x9000, 0x920F, 0
    ldi_z = (0xE0F0 | 0x800, 0xE0E0)  # ldi r31, 0x80; ldi r30, 0
    for words, pc, text in (
        ((nop, 0x9419), 2, "illegal instruction 0x9419"),
        ((sts, 0x0900), 0, "store to 0x0900, behind the end of RAM"),
        ((nop, lds, 0xFFFF), 2, "load from 0xffff, behind the end of RAM"),
        ((0x9508,), 0, "stack pointer 0x0900 is outside RAM"),
        ((0xE000, 0xBF0E, push), 4, "stack pointer 0x00ff is outside RAM"),
        ((*ldi_z, 0x95C8), 4, "read of flash at 0x8000, behind its end"),
        ((0x940C, 0x3FFF), 0x8000, "execution ran past the end of flash"),
    ):
        m = Atmega328p(flash(*words))
        assert m.run_until(100) == "fault", text
        assert m.fault is not None
        assert (m.fault.pc, m.fault.message[: len(text)]) == (pc, text)
        assert m.run_until(200) == "fault", "a fault is final"


def test_a_jump_behind_the_boot_section_reaches_it() -> None:
    """ICALL to word 0x7000 lands in erased flash at byte 0x6000, and runs into the boot section (kilobot.md §1)."""
    words = [0xE0E0, 0xE7F0, 0x9509]  # r30 = 0, r31 = 0x70, icall
    content = bytearray(flash(*words).flash)
    content[0x7000:0x7004] = b"\x0a\xe4\xff\xcf"  # ldi r16, 0x4a; rjmp .-2
    m = Atmega328p(AvrImage("boot", bytes(content), 8, {}))
    assert m.run_until(10_000) == "halt"
    assert m.state.data[16] == 0x4A
    assert m.state.halted_at == 2 + 3 + 0x800 + 1 + 2


# ---- Snapshots -------------------------------------------------------------------------------------------------------


def test_a_snapshot_is_the_whole_machine(machine: Machine) -> None:
    """From a snapshot a machine repeats its run to the byte, however the run is cut."""
    m = machine("""
        volatile uint32_t total;
        ISR(TIMER0_OVF_vect) { total += TCNT1; PORTB ^= 1; }
        int main(void) { TCCR1B = 1; TCCR0B = 1; TIMSK0 = 1; sei(); for (;;) total = total * 5 + 1; }""")
    m.run_until(20_000)
    state = m.snapshot()
    m.run_until(90_000)
    first = m.snapshot()
    m.restore(state)
    for cycle in range(20_000, 90_000, 777):
        m.run_until(cycle)
    m.run_until(90_000)
    again = m.snapshot()
    goals = range(getattr(Avr, "until").offset, getattr(Avr, "next_due").offset)  # noqa: B009
    assert first[: goals.start] == again[: goals.start]
    assert first[goals.stop :] == again[goals.stop :]
    with pytest.raises(ValueError, match="no snapshot"):
        m.restore(b"")
