"""Devices of the ATmega328P against the times and rules of its data sheet (avr.md §3)."""

from __future__ import annotations

import re
import subprocess
from itertools import pairwise
from pathlib import Path

from emu.avr.core.addresses import ADDRESSES
from emu.avr.machine import VECTORS, Atmega328p
from emu.boards.kilobot.swarm import KilobotSetup, KilobotSwarm
from tests.emu.avr.conftest import Build, Machine, needs

PORTB = 0x25
AIN0, AIN1 = 9, 10
END = "cli(); sleep_mode(); for (;;) ;"


def test_addresses_and_vectors_are_those_of_the_compiler(tmp_path: Path) -> None:
    """Every register and every vector has the address that avr-libc's header of the ATmega328P gives it."""
    needs("avr-gcc")
    source = tmp_path / "names.c"
    names = [*ADDRESSES, *(f"{name}_vect_num" for name in VECTORS[1:])]
    source.write_text("#include <avr/io.h>\n" + "".join(f'"{name}" {name}\n' for name in names))
    command = ["avr-gcc", "-mmcu=atmega328p", "-E", "-P", str(source)]
    text = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    found = {name: sum(int(number, 0) for number in re.findall(r"\b(?:0x[0-9a-fA-F]+|[0-9]+)\b", value))
             for name, value in re.findall(r'^"(\w+)" (.*)$', text, re.MULTILINE)}  # fmt: skip
    assert found == ADDRESSES | {f"{name}_vect_num": n for n, name in enumerate(VECTORS) if n}


def run(machine: Machine, body: str, globals_: str = "") -> Atmega328p:
    """Run a program whose main has the given body, to its halt."""
    m = machine(f"{globals_}\nint main(void) {{ {body} {END} }}")
    assert m.run_until(2_000_000) == "halt"
    return m


def test_prescaler_runs_freely(machine: Machine) -> None:
    """Timer 0 counts at multiples of 64 cycles after the prescaler's reset, whenever it is started."""
    for delay in (0, 40):
        m = machine(f"""int main(void) {{ GTCCR = 1; asm volatile(".rept {delay}\\n nop\\n .endr"); TCCR0B = 3;
            while (!TCNT0) ; PORTB = 1; {END} }}""")
        m.watch([PORTB])
        assert m.run_until(10_000) == "halt"
        reset = m.state.prescaler_start[0]
        assert reset > 0
        assert m.changes[0].cycle - reset in range(64, 64 + 8), delay


def test_compare_flag_and_period(machine: Machine) -> None:
    """In CTC mode the period is OCR + 1 ticks, and the flag rises when the count leaves OCR."""
    m = run(machine, """
        OCR0A = 49; TCCR0A = 2; TCCR0B = 1;
        while (!(TIFR0 & 2)) ; first = TCNT0; TIFR0 = 2;
        for (uint8_t n = 0; n < 100; n++) { if (TCNT0 > most) most = TCNT0; }
        overflow = TIFR0 & 1;""", "volatile uint8_t first, most, overflow;")  # fmt: skip
    assert m.peek("most") <= 49
    assert m.peek("first") < 10
    assert m.peek("overflow") == 0


def test_phase_correct_pwm_has_510_ticks(machine: Machine) -> None:
    """Timer 2 of the motors overflows every 510 ticks of 8 cycles, and takes a new duty at TOP."""
    m = machine("""
        volatile uint8_t n;
        ISR(TIMER2_OVF_vect) { PORTB = ++n; }
        int main(void) { TCCR2A = 0xA1; TCCR2B = 2; OCR2A = 100; TIMSK2 = 1; sei(); for (;;) ; }""")
    m.watch([PORTB])
    m.run_until(30_000)
    times = [change.cycle for change in m.changes]
    assert len(times) >= 6
    assert {b - a for a, b in pairwise(times)} <= set(range(4080 - 2, 4080 + 3))
    assert times[5] - times[0] in range(5 * 4080 - 2, 5 * 4080 + 3)
    assert m.state.timer_compare[4] == 100


def test_a_new_top_takes_effect_while_the_timer_turns(machine: Machine) -> None:
    """A timer whose TOP falls from 200 to 20 at its peak counts down from 200; its next period has 40 ticks."""
    m = machine("""
        volatile uint8_t n;
        ISR(TIMER0_OVF_vect) { PORTB = ++n; if (n == 2) OCR0A = 20; }
        int main(void) { OCR0A = 200; TCCR0A = 1; TCCR0B = 0x0A; TIMSK0 = 1; sei(); for (;;) ; }""")
    m.watch([PORTB])
    m.run_until(20_000)
    periods = [round((b.cycle - a.cycle) / 8) for a, b in pairwise(m.changes)]
    assert periods[:4] == [400, 400, 40, 40]


def test_sixteen_bits_in_two_halves(machine: Machine) -> None:
    """The high byte of timer 1 is latched with the low one, and written before it."""
    m = run(machine, """
        TCNT1 = 0x01FF; TCCR1B = 1; got = TCNT1; again = TCNT1; TCCR1B = 0; TCNT1 = 0xABCD; last = TCNT1;""",
        "volatile uint16_t got, again, last;")  # fmt: skip
    assert m.peek("got", 2) in range(0x200, 0x206)
    assert m.peek("again", 2) - m.peek("got", 2) in range(4, 10)
    assert m.peek("last", 2) == 0xABCD


def test_a_capture_has_the_cycle_of_the_edge(machine: Machine) -> None:
    """The comparator's edge is captured in its cycle, whatever the CPU does."""
    m = machine("volatile uint16_t at; int main(void) { TCNT1 = 0; TCCR1B = 0x41; ACSR = 4;"
                " while (!(TIFR1 & 0x20)) ; at = ICR1; cli(); sleep_mode(); for (;;) ; }")  # fmt: skip
    m.set_analog(0, AIN1, 500_000)
    while m.peek(0x81) != 0x41:
        m.step()
    started = m.cycle
    m.set_analog(1_000, AIN0, 900_000)
    assert m.run_until(100_000) == "halt"
    assert m.peek("at", 2) == 1_000 - started


def test_conversions_take_25_and_13_clocks(machine: Machine) -> None:
    """The first conversion takes 25 clocks of the converter, later ones 13; the result is that of the voltage."""
    m = machine("""
        volatile uint16_t first, second;
        int main(void) {
            ADMUX = 3; ADCSRA = 0xC3; while (ADCSRA & 0x40) ; PORTB = 1; first = ADC;
            ADCSRA |= 0x40; while (ADCSRA & 0x40) ; PORTB = 2; second = ADC;
            cli(); sleep_mode(); for (;;) ;
        }""")
    m.state.aref_uv = 3_000_000
    m.watch([PORTB, 0x7A])
    m.set_analog(0, 3, 1_500_000)
    assert m.run_until(10_000) == "halt"
    starts = [change.cycle for change in m.changes if change.register == 0x7A and change.value & 0x40]
    ends = [change.cycle for change in m.changes if change.register == PORTB]
    assert ends[0] - starts[0] in range(25 * 8, 25 * 8 + 16)
    assert ends[1] - starts[1] in range(13 * 8, 13 * 8 + 16)
    assert (m.peek("first", 2), m.peek("second", 2)) == (512, 512)


def test_the_comparator_starts_a_conversion(machine: Machine) -> None:
    """A rising ACI starts one conversion; another one needs the flag cleared first."""
    m = machine("""
        volatile uint16_t got[3];
        int main(void) {
            ADMUX = 0; ADCSRB = 1; ADCSRA = 0xA3; ACSR = 3;
            while (!(ADCSRA & 0x10)) ; got[0] = ADC; ADCSRA |= 0x10;
            TCCR0B = 3; while (TCNT0 < 20) ;
            got[1] = ADCSRA & 0x10; ACSR |= 0x10;
            while (!(ADCSRA & 0x10)) ; got[2] = ADC;
            cli(); sleep_mode(); for (;;) ;
        }""")
    m.state.aref_uv = 1_024_000
    m.set_analog(0, AIN1, 500_000)
    for cycle, level in ((1_000, 100_000), (1_900, 200_000), (4_000, 300_000)):
        m.set_analog(cycle, 0, level)
        m.set_analog(cycle, AIN0, 900_000)
        m.set_analog(cycle + 9, AIN0, 0)
    assert m.run_until(100_000) == "halt"
    got = m.peek_bytes("got", 6)
    assert (got[0], got[2] & 0x10, got[4] | got[5] << 8) == (100, 0, 300)


def test_eeprom(machine: Machine) -> None:
    """A write of EEPE within four cycles after EEMPE writes a byte in 26,368 cycles; a later one has no effect.

    The byte survives a reset.
    """
    m = run(machine, """
        EEAR = 5; EEDR = 0x5A; EECR |= 4; EECR |= 2; TCCR1B = 1; while (EECR & 2) ; took = TCNT1;
        EEAR = 6; EEDR = 0x77; EECR |= 2;
        EEAR = 5; EECR |= 1; got = EEDR;""", "volatile uint8_t got; volatile uint16_t took;")  # fmt: skip
    assert m.peek("got") == 0x5A
    assert (m.state.eeprom[5], m.state.eeprom[6]) == (0x5A, 0xFF)
    assert m.peek("took", 2) in range(26_350, 26_380)


def test_uart(machine: Machine) -> None:
    """A frame of 10 bits at 38,400 baud takes 2,080 cycles; received bytes wait in a buffer of two."""
    m = run(machine, """
        UBRR0 = 25; UCSR0A = 2; UCSR0B = 0x18; UDR0 = 'a'; UDR0 = 'b'; UDR0 = 'x';
        while (!(UCSR0A & 0x40)) ;
        got[0] = UDR0; got[1] = UDR0; left = UCSR0A;""", "volatile uint8_t got[2], left;")  # fmt: skip
    sent = [change for change in m.changes if change.register == 0xC6]
    assert [chr(change.value) for change in sent] == ["a", "b"]
    assert sent[1].cycle - sent[0].cycle == 10 * 26 * 8


def test_uart_receives(machine: Machine) -> None:
    """Two bytes are buffered, a third one is lost and sets the overrun flag."""
    m = machine(f"""volatile uint8_t got[2], flags; int main(void) {{
        UCSR0B = 0x10; TCCR1B = 1; while (TCNT1 < 500) ; flags = UCSR0A; got[0] = UDR0; got[1] = UDR0; {END} }}""")
    for n, octet in enumerate(b"xyz"):
        m.receive(200 + n, octet)
    assert m.run_until(10_000) == "halt"
    assert m.peek_bytes("got", 2) == b"xy"
    assert m.peek("flags") & 0x88 == 0x88


def test_pins(machine: Machine) -> None:
    """An output is seen at PINx one cycle late; a one at PINx toggles; SBI clears one flag; inputs have pull-ups."""
    m = run(machine, """
        DDRB = 1; PORTB = 0x10;
        asm volatile("sbi 5, 0\\n in %0, 3\\n in %1, 3" : "=r"(a), "=r"(b));
        early = a; late = b; PINB = 1; toggled = PORTB;
        PCICR = 0; PCMSK0 = 1; PCMSK1 = 0; PINB = 1; PCMSK1 = 1; DDRC = 1; PORTC = 1;
        flags = PCIFR; asm volatile("sbi 0x1b, 0"); rest = PCIFR;""",
        "uint8_t a, b; volatile uint8_t early, late, toggled, flags, rest;")  # fmt: skip
    assert (m.peek("early") & 1, m.peek("late") & 0x11) == (0, 0x11)
    assert m.peek("toggled") == 0x10
    assert (m.peek("flags"), m.peek("rest")) == (3, 2)


def test_flash_is_programmed(machine: Machine) -> None:
    """Code in the boot section erases and writes a page; elsewhere SPM does nothing."""
    body = """
        #include <avr/boot.h>
        #define PAGE 0x3000
        static void WRITE write(void) {
            boot_page_erase(PAGE); boot_spm_busy_wait();
            for (uint8_t n = 0; n < 128; n += 2) boot_page_fill(PAGE + n, 0xA500 + n);
            boot_page_write(PAGE); boot_spm_busy_wait(); boot_rww_enable();
        }
        int main(void) { write(); cli(); sleep_mode(); for (;;) ; }"""
    boot = machine(body.replace("WRITE", '__attribute__((section(".boot"), noinline))'),
                   "-Os", "-Wl,--section-start=.boot=0x7000")  # fmt: skip
    assert boot.run_until(1_000_000) == "halt"
    page = bytes(boot.state.flash[0x3000:0x3080])
    assert page == b"".join(bytes([n, 0xA5]) for n in range(0, 128, 2))
    assert boot.state.halted_at > 2 * 36_000
    plain = machine(body.replace("WRITE", "__attribute__((noinline))"))
    plain.run_until(1_000_000)
    assert bytes(plain.state.flash[0x3000:0x3080]) == b"\xff" * 128


def test_the_watchdog_resets_within_an_instruction(machine: Machine) -> None:
    """If the time-out comes while STS writes a register, the program starts again at its reset vector."""
    for nops in range(4):
        m = machine(f"""
            #include <avr/wdt.h>
            static uint8_t starts __attribute__((section(".noinit")));
            int main(void) {{
                starts = MCUSR & 8 ? starts + 1 : 0;
                MCUSR = 0;
                asm volatile(".rept {nops}\\n nop\\n .endr");
                wdt_enable(WDTO_15MS);
                for (;;) OCR2A = 5;
            }}""")
        m.run_until(300_000)
        assert (m.state.resets, m.peek("starts")) == (2, 2), nops


def test_a_reset_switches_the_emitters_off(build: Build) -> None:
    """The reset makes the pins inputs, so the light of the next start is another pulse."""
    image = build("""
        #include <avr/wdt.h>
        int main(void) { MCUSR = 0; wdt_enable(WDTO_15MS); DDRB = 1; PORTB = 1; for (;;) ; }""")
    swarm = KilobotSwarm([KilobotSetup(image)])
    swarm.run(0.1)
    assert swarm.robots[0].state.resets == 6
    assert swarm.pulses_sent(0) == 7


def test_the_signature_is_read_within_four_cycles(machine: Machine) -> None:
    """LPM reads the signature directly after the write of SPMCSR, and flash later."""
    m = run(machine, """
        first = boot_signature_byte_get(0), third = boot_signature_byte_get(4);
        SPMCSR = 1 << SIGRD | 1;
        asm volatile(".rept 10\\n nop\\n .endr");
        late = pgm_read_byte(text);""", """
        #include <avr/boot.h>
        #include <avr/pgmspace.h>
        static const char text[] PROGMEM = "U";
        volatile uint8_t first, third, late;""")  # fmt: skip
    assert [m.peek(name) for name in ("first", "third", "late")] == [0x1E, 0x0F, ord("U")]
