"""Waiting loops are skipped exactly: the run in one call is the run in pieces too short for any skipping."""

from __future__ import annotations

from typing import Any

import pytest

from emu.avr.core.state import FIELDS
from emu.avr.machine import Atmega328p
from emu.boards.kilobot.swarm import KilobotSetup, KilobotSwarm
from tests.emu.avr.conftest import Build

PIECE = 3
"""Cycles of a call that is too short for skipping: an iteration of the shortest loop takes as many."""
SEARCH = {"until", "deadline", "next_due", "skipped", "touched", "counts_until", "tracing", "round", "resting",
          "log_cycle", "log_register", "log_value"}  # fmt: skip
"""Fields of the state that control native calls and the search for repeating iterations; not compared."""

POLLING = """
    volatile uint8_t ticks; uint8_t last, rounds;
    ISR(TIMER0_OVF_vect) { ticks++; }
    int main(void) {
        TCCR0B = 2; TIMSK0 = 1; OCR2A = 5; sei();
        for (;;) {
            if (ticks != last) { last = ticks; PORTB ^= 1; }
            DDRD = 0x10; OCR2A = 5; rounds = (rounds + 1) & 3;
        }
    }"""
COUNTDOWNS = """
    #include <util/delay.h>
    volatile uint8_t n;
    ISR(TIMER0_OVF_vect) { PORTB ^= 2; }
    int main(void) {
        TCCR0B = 1; TIMSK0 = 1; sei();
        for (;;) {
            _delay_us(20); PORTC ^= 1; _delay_us(900); PORTC ^= 2; _delay_us(5000); PORTC ^= 4;
            asm volatile("ldi r24, 0\\n 1: sbiw r24, 1\\n brne 1b" ::: "r24", "r25");
            asm volatile("ldi r24, 1\\n 1: dec r24\\n brne 1b" ::: "r24");
            asm volatile("ldi r24, 5\\n ldi r25, 1\\n 1: subi r24, 1\\n sbci r25, 0\\n brne 1b" ::: "r24", "r25");
            PORTC ^= SREG >> 1 & 8;
        }
    }"""
DESCENDING = """
    int main(void) {
        for (;;) {
            asm volatile("ldi r18, 200\\n ldi r25, 40\\n ldi r24, 0\\n"
                         "1: subi r18, 1\\n sbci r25, 0\\n sbci r24, 0\\n brne 1b"
                         ::: "r18", "r24", "r25");
            PORTC ^= 1;
        }
    }"""
FLAG = """
    volatile uint8_t ticks, last;
    ISR(TIMER0_OVF_vect) { ticks++; PORTB ^= 1; }
    int main(void) {
        TCCR0B = 2; TIMSK0 = 1; sei();
        for (;;) { while (ticks == last) asm volatile(".rept NOPS\\n nop\\n .endr"); last = ticks; PORTC++; }
    }"""
CLOCKED = """
    volatile uint16_t seen;
    int main(void) { TCCR1B = 1; for (;;) { seen = TCNT1; if (seen > 60000) PORTB ^= 1; } }"""


def state_of(m: Atmega328p) -> dict[str, Any]:
    found = {}
    for name, _, count in FIELDS:
        if name not in SEARCH and not name.startswith("trace_"):
            value = getattr(m.state, name)
            found[name] = value if count == 1 else list(value)
    return found


@pytest.mark.parametrize(("text", "least"), [(POLLING, 0.8), (COUNTDOWNS, 0.8), (DESCENDING, 0.8), (CLOCKED, 0.0)])
def test_skipping_is_exact(build: Build, text: str, least: float) -> None:
    """Registers, RAM, devices, cycles and pin changes are the same with and without skipping.

    `least` is the part of the cycles that must be skipped; a loop that reads a running counter is not skipped at all.
    """
    image = build(text)
    whole, pieces = Atmega328p(image), Atmega328p(image)
    for m in (whole, pieces):
        m.watch([0x25, 0x28])
    for end in (50_000, 90_001, 170_000):
        whole.run_until(end)
        while pieces.cycle < end:
            pieces.run_until(min(pieces.cycle + PIECE, end))
        assert state_of(whole) == state_of(pieces)
    assert whole.changes == pieces.changes
    assert len(whole.changes) >= 2
    assert whole.state.skipped >= least * 170_000
    assert (whole.state.skipped == 0) == (least == 0)
    assert pieces.state.skipped <= 0.4 * 170_000


@pytest.mark.parametrize("nops", range(1, 5))
def test_interrupts_come_at_their_cycle(build: Build, nops: int) -> None:
    """An interrupt that is due exactly at the end of the skipped rounds is served there, not an instruction later."""
    image = build(FLAG.replace("NOPS", str(nops)))
    whole, pieces = Atmega328p(image), Atmega328p(image)
    for m in (whole, pieces):
        m.watch([0x25, 0x28])
    whole.run_until(90_000)
    while pieces.cycle < 90_000:
        pieces.run_until(pieces.cycle + PIECE)
    assert whole.changes == [change for change in pieces.changes if change.cycle <= whole.cycle]
    assert whole.state.skipped > 45_000


def test_waiting_robots_are_not_run_in_turns(build: Build) -> None:
    """Robots in a delay or in an endless loop pass their time at once, although any of them could send light."""
    delays = build("#include <util/delay.h>\nint main(void) { for (;;) { _delay_ms(50); PORTC ^= 1; } }")
    robots = [KilobotSetup(delays, x=40 * n, on_at=0.001 * n, clock=1 + 0.002 * n) for n in range(3)]
    with KilobotSwarm(robots) as swarm:
        swarm.run(0.2)
        assert all(robot.state.skipped > 0.999 * robot.cycle for robot in swarm.robots)
        assert all(robot.peek(0x28) == 1 for robot in swarm.robots)
    ended = build("int main(void) { TCCR0B = 5; TIMSK0 = 1; sei(); for (;;) ; } ISR(TIMER0_OVF_vect) { PORTC++; }")
    with KilobotSwarm([KilobotSetup(ended, x=40 * n) for n in range(3)]) as swarm:
        swarm.run(0.2)
        assert all(robot.state.skipped > 0.999 * robot.cycle for robot in swarm.robots)
        assert all(robot.peek(0x28) == 6 for robot in swarm.robots)


def test_a_delay_does_not_stop_the_search(build: Build) -> None:
    """A delay that never repeats exactly does not count as a failed search: the loop after it is skipped at once."""
    m = Atmega328p(build("""
        #include <util/delay.h>
        volatile uint8_t ticks, seen; volatile uint16_t ms;
        ISR(TIMER0_OVF_vect) { ticks++; }
        int main(void) {
            TCCR0B = 5; TIMSK0 = 1; sei();
            for (;;) {
                for (ms = 0; ms < 500; ms++) _delay_ms(1);
                for (seen = ticks; (uint8_t)(ticks - seen) < 4; ) ;
            }
        }"""))  # fmt: skip
    m.run_until(12_000_000)
    assert m.state.skipped > 0.99 * m.cycle


def test_a_fed_watchdog_does_not_bite(build: Build) -> None:
    """A waiting loop that resets the watchdog in each iteration is not skipped up to the time-out."""
    m = Atmega328p(build("""
        #include <avr/wdt.h>
        volatile uint8_t flag;
        int main(void) { MCUSR = 0; wdt_enable(WDTO_15MS); while (!flag) wdt_reset(); for (;;) ; }"""))  # fmt: skip
    m.run_until(1_000_000)
    assert m.state.resets == 0


def test_a_poke_ends_a_waiting_loop(build: Build) -> None:
    """After `poke_bytes` the loop is executed again, although no event is due."""
    m = Atmega328p(build("volatile uint8_t flag; int main(void) { while (!flag) ; PORTB = 1; for (;;) PORTC = 1; }"))
    m.run_until(500_000)
    m.poke_bytes("flag", b"\1")
    m.run_until(501_000)
    assert m.peek(0x25) == 1


def test_a_pin_is_read_late_once(build: Build) -> None:
    """A loop whose first iteration reads the level before a change ends in the second one.

    The change of an emitter ends the native call, so the search for a repeating iteration begins directly after it.
    """
    image = build("""
        int main(void) {
            DDRB = 1;
            asm volatile("ldi r25, 0\\n 1: dec r25\\n brne 1b\\n ldi r24, 0\\n sbi 5, 0\\n"
                         "1: in r24, 3\\n sbrs r24, 0\\n rjmp 1b" ::: "r24", "r25");
            PORTC = 1;
            for (;;) ;
        }""")
    swarm = KilobotSwarm([KilobotSetup(image)])
    swarm.run(0.01)
    assert swarm.robots[0].peek(0x28) == 1
