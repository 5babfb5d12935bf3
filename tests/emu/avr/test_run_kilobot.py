"""`emu run --board kilobot`: reports, JSON, faults with function and line, refusals."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import pytest

from emu.boards.kilobot.messages import Message, PulseDecoder, crc16, frame, pulses_of
from emu.boards.kilobot.observer import led_of
from emu.cli import main
from tests.emu.avr.conftest import Build
from tests.json_schemas import validated

BLINK = """
#include <util/delay.h>
int main(void) {
    DDRD |= 1 << 5 | 1 << 4; _delay_ms(10);
    DDRD &= ~(1 << 4); DDRC |= 1 << 3; _delay_ms(10);
    TCCR2A = 0xA1; TCCR2B = 2; DDRB |= 8; DDRD |= 8; OCR2A = 70; OCR2B = 65; _delay_ms(10);
    UBRR0 = 25; UCSR0A = 2; UCSR0B = 8;
    for (const char *at = "hello\\n"; *at; at++) { while (!(UCSR0A & 0x20)) ; UDR0 = *at; }
    while (!(UCSR0A & 0x40)) ;
    cli(); sleep_mode(); for (;;) ;
}
"""
FAULT = """
static void __attribute__((noinline)) spoil(volatile uint8_t *at)
{
    *at = 1;
}
int main(void) { spoil((volatile uint8_t *)0x900); for (;;) ; }
"""


def test_reports(build: Build, capsys: pytest.CaptureFixture[str]) -> None:
    """LED, motors and UART are reported with their times; the run ends where the program sleeps forever."""
    image = build(BLINK)
    assert main(["run", image.path, "--board", "kilobot", "--ohc", "none"]) == 0
    printed = capsys.readouterr()
    lines = [line.split(" ", 1) for line in printed.out.splitlines()]
    assert [text for _, text in lines] == [
        "led red=3 green=0 blue=0",
        "led red=1 green=1 blue=0",
        "motors left=70 right=65",
        "uart text=hello",
    ]
    times = [float(at) for at, _ in lines]
    assert times == sorted(times)
    assert 0.0199 < times[2] < 0.0202
    assert printed.err.startswith("halt at 0x")
    assert "(main+" in printed.err


RESETS = """
#include <avr/wdt.h>
static uint8_t count __attribute__((section(".noinit")));
int main(void) {
    uint8_t cause = MCUSR;
    MCUSR = 0;
    wdt_disable();
    count = cause & 8 ? count + 1 : 0;
    if (count < 2) { wdt_enable(WDTO_15MS); for (;;) ; }
    cli(); sleep_mode(); for (;;) ;
}
"""


def test_only_resets_are_reported_as_resets(build: Build, capsys: pytest.CaptureFixture[str]) -> None:
    """Two bites of the watchdog are reported; a program that clears MCUSR causes no report."""
    assert main(["run", build(RESETS).path, "--board", "kilobot", "--ohc", "none"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split(" ", 1)[1] for line in lines] == ["reset cause=watchdog"] * 2
    assert float(lines[0].split()[0]) > 0.015


def test_json(build: Build, capsys: pytest.CaptureFixture[str]) -> None:
    """--json prints the same results as data, with reason and status of the limit that ended the run."""
    image = build(BLINK)
    assert main(["run", image.path, "--board", "kilobot", "--json", "--cycles", "100000", "--exit-code"]) == 124
    report = validated("emu", "run-kilobot", capsys.readouterr().out)
    assert (report["reason"], report["status"], report["engine"]) == ("limit", 124, "avr")
    assert [led["red"] for led in report["led"]] == [3, 1]
    assert report["cycles"] >= 100_000
    assert report["motors"] == []


def test_a_fault_names_function_and_line(build: Build, capsys: pytest.CaptureFixture[str]) -> None:
    """A store beyond RAM ends the run with status 1 and the place of the instruction."""
    image = build(FAULT)
    assert main(["run", image.path, "--board", "kilobot"]) == 1
    printed = capsys.readouterr().err
    assert "fault: store to 0x0900, behind the end of RAM at 0x8ff" in printed
    line = (Path(image.path).with_name("program.c")).read_text().splitlines().index("    *at = 1;") + 1
    assert "(spoil" in printed
    assert f"program.c:{line})" in printed


MISTAKES = {
    "interrupt TIMER1_OVF has no handler": "int main(void) { TCCR1B = 1; TIMSK1 = 1; sei(); for (;;) PORTC = 1; }",
    "belongs to the call at 0x": "void (*volatile f)(void) = (void (*)(void))0x3f00; int main(void) { f(); }",
    "stack overflow: at 0x": """
        volatile uint8_t data[1900];
        int deep(int n) { volatile char frame[20]; frame[n % 20] = n; return n ? deep(n - 1) + frame[3] : data[9]; }
        int main(void) { data[0] = deep(12); cli(); sleep_mode(); for (;;) ; }""",
}


@pytest.mark.parametrize("text", MISTAKES)
def test_mistakes_are_named(build: Build, capsys: pytest.CaptureFixture[str], text: str) -> None:
    """An interrupt without handler, a call of a wild pointer and a stack in the variables are named with a place."""
    image = build(MISTAKES[text])
    status = main(["run", image.path, "--board", "kilobot", "--ohc", "none", "--cycles", "200000"])
    printed = capsys.readouterr().err
    assert text in printed
    assert status == (0 if "overflow" in text else 1)
    assert "program.c:" in printed


def test_a_jump_to_the_start_is_reported(build: Build, capsys: pytest.CaptureFixture[str]) -> None:
    """A program that jumps to address 0 starts again without a reset: one report, not one at its first start."""
    image = build("""
        static uint8_t starts __attribute__((section(".noinit")));
        int main(void) {
            starts = PORTC ? starts + 1 : 0; PORTC = 1;
            if (starts < 1) asm volatile("jmp 0");
            cli(); sleep_mode(); for (;;) ;
        }""")
    assert main(["run", image.path, "--board", "kilobot", "--ohc", "none"]) == 0
    assert [line.split(" ", 1)[1] for line in capsys.readouterr().out.splitlines()] == ["reset cause=jump"]


def test_refusals(build: Build, capsys: pytest.CaptureFixture[str]) -> None:
    """Options of the e-puck, options of the Kilobot without it, and other files are refused in one line."""
    image = build(BLINK)
    for words, text in (
        ([image.path, "--board", "kilobot", "--selector", "3"], "--selector does not apply to --board kilobot"),
        ([image.path, "--ohc", "run"], "--ohc needs --board kilobot"),
        ([__file__, "--board", "kilobot"], "is neither ELF nor Intel HEX"),
    ):
        assert main(["run", *words]) == 2
        assert text in capsys.readouterr().err


# ---- Messages --------------------------------------------------------------------------------------------------------


def test_frames_have_the_published_times() -> None:
    """13 bytes of 10 bits take 34,968 ticks; zeros need 38 pulses or a few more for the CRC (kilobot.md §2)."""
    pulses = list(pulses_of(frame(Message(bytes(9), 0))))
    assert pulses[:3] == [0, 2_420, 2_706]
    assert pulses[-1] - pulses[2] == 12 * 2_430 + 11 * 282
    assert 13 * 2 <= len(pulses) <= 13 * 2 + 16


def test_messages_are_decoded() -> None:
    """A decoder reads the pulses of a frame, each off by up to 100 ticks; a missing one gives a wrong CRC."""
    message = Message(bytes([0, 255, 0x55, 0xAA, 1, 128, 7, 8, 9]), 0x88)
    pulses = list(pulses_of(frame(message), 1_000))
    for shift in (0, 100, -100):
        decoder = PulseDecoder()
        found = [decoder.pulse(at + (shift if n % 3 else 0)) for n, at in enumerate(pulses)]
        assert [one for one in found if one] == [message]
    decoder = PulseDecoder()
    bits = [n for n, (a, b) in enumerate(pairwise(pulses)) if b - a == 270][1]
    found = [decoder.pulse(at) for n, at in enumerate(pulses) if n != bits]
    assert [one.is_whole for one in found if one] == [False]


def test_crc() -> None:
    """The CRC is CRC-16/MCRF4XX, whose check value is 0x6F91."""
    assert crc16(b"123456789") == 0x6F91


def test_led() -> None:
    """A pin lights if it is an output that is low: the direction register decides the colour (kilobot.md §1)."""
    assert led_of({0x2A: 0x30}) == (3, 0, 0)
    assert led_of({0x27: 0x3C}) == (0, 3, 3)
    assert led_of({0x27: 0x28, 0x28: 0x20}) == (0, 1, 0)
