"""`emu debug --tui --board kilobot`: breakpoints, steps, values, call stacks, watchpoints and time travel."""

from __future__ import annotations

import io
from collections.abc import Callable

import pytest

from emu.avr.image import AvrImage
from emu.boards.kilobot.single import SingleKilobot
from emu.cli import main
from emu.debug.avr.history import KilobotHistory
from emu.debug.avr.machine import DebuggedKilobot
from tests.emu.avr.conftest import Build

PROGRAM = """
struct point { int16_t x; uint8_t y; };
volatile uint16_t total;
volatile struct point where = {3, 4};
const __attribute__((section(".progmem.data"))) uint8_t table[2] = {1, 2};
static volatile uint8_t ticks;
ISR(TIMER0_COMPA_vect)
{
    ticks++;
}
static __attribute__((noinline, noclone)) uint16_t add(uint16_t a, uint8_t b)
{
    uint16_t sum = a + b;
    total += sum;
    return sum;
}
int main(void)
{
    OCR0A = 200; TCCR0A = 2; TCCR0B = 2; TIMSK0 = 2;
    UBRR0 = 25; UCSR0A = 2; UCSR0B = 8; UDR0 = 'k';
    sei();
    for (uint16_t i = table[0] - 1;; i++) {
        uint16_t s = add(i, ticks ? 4 : 3);
        where.x = s;
        where.y++;
    }
}
"""
Script = Callable[..., tuple[int, list[str], str]]


@pytest.fixture
def script(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Script:
    """Return a function that runs debugger commands on an image; it returns status, output lines and errors."""

    def run(image: AvrImage, *commands: str, options: tuple[str, ...] = ()) -> tuple[int, list[str], str]:
        monkeypatch.setattr("sys.stdin", io.StringIO("\n".join(commands) + "\n"))
        status = main(["debug", "--tui", image.path, "--board", "kilobot", *options])
        printed = capsys.readouterr()
        return status, printed.out.splitlines(), printed.err

    return run


@pytest.mark.parametrize(
    "flags", [("-O0", "-gdwarf-2"), ("-Os", "-gdwarf-4"), ("-O2", "-gdwarf-3")], ids=lambda flags: "".join(flags)
)
def test_break_print_finish(build: Build, script: Script, flags: tuple[str, ...]) -> None:
    """A conditional breakpoint, parameters in registers or on the stack, statics, the call stack, and the return."""
    status, lines, _ = script(
        build(PROGRAM, *flags), "break add if a == 5", "run", "backtrace", "print a", "print b", "print where.y",
        "up", "print i", "finish",
    )  # fmt: skip
    assert status == 0
    assert "breakpoint 1: add, if a == 5" in lines
    at = next(number for number, line in enumerate(lines) if line.startswith("* #0"))
    assert lines[at].startswith("* #0 add at program.c:")
    assert lines[at + 1].startswith("  #1 main at program.c:")
    assert [line for line in lines if " = " in line and line[0] in "abwi"] == ["a = 5", "b = 3", "where.y = 9", "i = 5"]
    assert lines[-2].startswith("main at program.c:")


def test_steps(build: Build, script: Script) -> None:
    """`next` passes a call, `step` enters it; `stepi`, `disassemble`, `list` and `x` show code and memory."""
    image = build(PROGRAM, "-O0", "-gdwarf-2")
    _, lines, _ = script(
        image, "tbreak add", "run", "finish", "next", "next", "next", "next", "next", "step", "stepi",
        "disassemble add 2", "list", "x/2xb &where", "info registers", "print SP == 0x8ff",
    )  # fmt: skip
    shown = [line.split(None, 2)[2] for line in lines if line.startswith(">   ")]
    assert "        where.x = s;" in ["        " + text.strip() for text in shown]
    assert any("uint16_t sum = a + b;" in text for text in shown)
    assert any("push r28" in line for line in lines)
    assert any(line.startswith("R0=0x") for line in lines)
    assert any(line.startswith("SP 0x08") for line in lines)
    assert lines[-1] == "SP == 0x8ff = 0"


def test_watch_and_back(build: Build, script: Script) -> None:
    """A watchpoint stops after a change; `reverse-continue` goes back to it."""
    status, lines, _ = script(
        build(PROGRAM, "-Os", "-gdwarf-2"), "watch total if total > 10", "run", "print total", "continue",
        "print total", "reverse-continue", "print total", "reverse-stepi", "time",
    )  # fmt: skip
    assert status == 0
    values = [int(line.split("=")[1]) for line in lines if line.startswith("total = ")]
    assert 10 < values[0] < values[1]
    assert values[2] < values[1]
    assert "before the present" in lines[-1]


def test_interrupt_frames_and_uart(build: Build, script: Script) -> None:
    """A handler's call stack leads to the interrupted function; `finish` leaves it; the UART's output is printed."""
    _, lines, _ = script(build(PROGRAM, "-O2", "-gdwarf-2"), "break __vector_14", "run", "backtrace", "finish")
    assert any(line.startswith("* #0 __vector_14 <interrupt> at program.c:") for line in lines)
    at = next(number for number, line in enumerate(lines) if line.startswith("* #0"))
    assert lines[at + 1].lstrip().startswith(("#1 main", "#1 add"))
    assert lines[-2].startswith(("main at", "add at"))
    assert any("k" in line for line in lines)


def test_refusals(build: Build, script: Script, capsys: pytest.CaptureFixture[str]) -> None:
    """What a Kilobot lacks is refused in one line with status 2."""
    image = build(PROGRAM, "-Os", "-gdwarf-2")
    for commands, message in (
        (["rwatch total"], "reads are not observed on this processor"),
        (["watch total", "watch ticks"], "one watchpoint at a time"),
        (["print table"], "in flash"),
        (["set PORTB = 1"], "I/O register"),
        (["break nothing"], "there is no function nothing"),
    ):
        status, _, error = script(image, *commands)
        assert (status, error.count("\n")) == (2, 1)
        assert message in error
    assert script(image, "run", options=("--strict",))[0] == 2
    assert script(image, "run", options=("--seconds", "0.001"))[::2] == (
        2, "emu debug: the limit of 0.001 simulated seconds is reached (--seconds)\n")  # fmt: skip
    assert main(["debug", "--tui", image.path + ".none", "--board", "kilobot"]) == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_a_fault_stops(build: Build, script: Script) -> None:
    """A fault is a stop with its cause and place, and the script's status is 1."""
    image = build("int main(void) { *(volatile uint8_t *)0x900 = 1; for (;;) ; }", "-Os", "-gdwarf-2")
    status, lines, _ = script(image, "run")
    assert status == 1
    assert any(line.startswith("firmware fault: store to 0x0900") for line in lines)


def test_the_past_is_the_same(build: Build) -> None:
    """Seeks and steps back reach the states of the first run, also across messages of the controller."""
    robot = DebuggedKilobot(SingleKilobot(build(PROGRAM, "-Os", "-gdwarf-2")))
    history = KilobotHistory(robot)  # type: ignore[arg-type]
    history.advance(1_590_000)
    seen = {}
    for _ in range(40):
        history.advance(robot.cycle + 617)
        seen[robot.cycle] = (robot.pc, robot.peek_bytes(0, 0x900))
    for cycle in reversed(seen):
        history.seek(cycle)
        assert (robot.pc, robot.peek_bytes(0, 0x900)) == seen[cycle]
    history.seek(history.end)
    before = robot.cycle
    assert history.step_back()
    assert robot.cycle < before
    history.step()
    assert robot.cycle == before
