"""Response times and stack of programs with late responses and deep nesting never exceed their bounds."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import pytest

from tests.fuzz.compiler.fuzz_bounds import ENOUGH, INTERRUPTED, Held
from tests.fuzz.programs import c_interrupts
from tests.toolchain.bounds.responses import Watched, watched
from tests.toolchain.c_programs import build
from toolchain.bounds.interference import BoundsReport, report_of
from toolchain.bounds.program import Program
from toolchain.cli import main
from toolchain.elf.read import read_executable

DEVICES = """
#include <dspic30f6014a.h>
#include <bounds.h>
const unsigned constant[4] __attribute__((used)) = {0, 0};
volatile unsigned first, second, out;
INTERRUPT_LEVEL(T1, %d); INTERRUPT_LEVEL(T2, %d);
__attribute__((used, noinline)) void begin(void)
{
    IPC0bits.T1IP = %d; IPC1bits.T2IP = %d;
    PR1 = first; PR2 = second; TMR1 = 0; TMR2 = 0;
    IFS0bits.T1IF = 0; IFS0bits.T2IF = 0;
    IEC0bits.T1IE = 1; IEC0bits.T2IE = 1;
    T1CONbits.TON = 1; T2CONbits.TON = 1;
}
__attribute__((noinline, used)) void nothing(void) {}
"""
HEAD = "    .text\n    .global _main, __T1Interrupt, __T2Interrupt, __MathError\n_main:\n    call _begin\n"
T1 = "__T1Interrupt: bclr.b 0x84,#3\n retfie\n"
T2 = "__T2Interrupt: bclr.b 0x84,#6\n retfie\n"
SLOW = "__T2Interrupt: bclr.b 0x84,#6\n repeat #300\n nop\n retfie\n"
LOOP = "1: nop\n bra 1b\n"
PROGRAMS = {
    "an instruction of seven cycles": (
        "mov #_constant,w1\n1: mov w1,w2\n btss [w2],#0\n goto 2f\n2: nop\n bra 1b\n" + T1 + T2, 5, 1),
    "DISI on the faster of two ways": (
        "1: btss 0x106,#0\n bra 2f\n repeat #300\n nop\n disi #2\n bra 3f\n2: disi #200\n3: repeat #240\n nop\n"
        " bra 1b\n" + T1 + T2, 4, 4),
    "IPL raised in the last cycle of DISI": (
        "mov #0xe0,w1\n1: disi #13\n repeat #11\n nop\n mov w1,0x42\n repeat #100\n nop\n clr 0x42\n repeat #90\n nop\n"
        " bra 1b\n" + T1 + T2, 5, 2),
    "DISI that outlasts its handler": (LOOP + T1 + "__T2Interrupt: bclr.b 0x84,#6\n disi #500\n retfie\n", 5, 2),
    "DISI that outlasts its handler, and then IPL 7": (
        "mov #0xe0,w1\n1: mov w1,0x42\n repeat #400\n nop\n clr 0x42\n repeat #290\n nop\n bra 1b\n" + T1
        + "__T2Interrupt: bclr.b 0x84,#6\n disi #300\n retfie\n", 5, 2),
    "its own DISI": (LOOP + "__T1Interrupt: bclr.b 0x84,#3\n disi #40\n retfie\n" + T2, 4, 2),
    "a store to DISICNT": ("1: mov #500,w0\n mov w0,0x52\n repeat #600\n nop\n bra 1b\n" + T1 + T2, 5, 2),
    "DISICNT put back": (
        "1: push 0x52\n disi #1000\n repeat #200\n nop\n pop 0x52\n repeat #90\n nop\n bra 1b\n" + T1 + T2, 5, 2),
    "SR put back": ("1: push 0x42\n bset 0x42,#7\n repeat #200\n nop\n pop 0x42\n bra 1b\n" + T1 + T2, 4, 2),
    "NSTDIS": ("bset.b 0x81,#7\n" + LOOP + T1 + SLOW, 5, 2),
    "IPL raised in a handler": (
        LOOP + T1 + "__T2Interrupt: bclr.b 0x84,#6\n bset 0x42,#7\n repeat #300\n nop\n bclr 0x42,#7\n retfie\n", 4, 2),
    "IPL lowered in a handler": (
        LOOP + "__T1Interrupt: bclr.b 0x84,#3\n bclr 0x42,#7\n nop\n push.d w0\n push.d w0\n repeat #30\n nop\n"
        " sub #8,w15\n retfie\n__T2Interrupt: bclr.b 0x84,#6\n push.d w0\n push.d w0\n push.d w0\n nop\n sub #12,w15\n"
        " retfie\n", 4, 2),
    "one handler of two interrupts": (
        LOOP + ".global __T3Interrupt\n__T3Interrupt:bclr.b 0x84,#7\n retfie\n__T1Interrupt:\n__T2Interrupt:\n"
        " repeat #30\n nop\n bclr.b 0x84,#6\n bclr.b 0x84,#3\n retfie\n", 5, 2),
    "a trap that comes back": (
        "1: clr w3\n repeat #17\n div.u w0,w3\n nop\n nop\n bra 1b\n" + T1 + T2 + "__MathError: bclr.b 0x80,#4\n"
        " repeat #300\n nop\n retfie\n", 5, 2),
    "RETFIE of a function": (
        "1: bset 0x42,#7\n rcall 2f\n repeat #200\n nop\n bclr 0x42,#7\n bra 1b\n2: retfie\n" + T1 + T2, 4, 2),
    "Idle": (
        "1: bset 0x42,#7\n repeat #50\n nop\n pwrsav #1\n repeat #60\n nop\n bclr 0x42,#7\n bra 1b\n" + T1 + T2, 4, 2),
}  # fmt: skip
"""Test programs by name: code of main after `begin`, handlers, and interrupt levels of T1 and T2."""
PHASES = [{"first": 160 + k, "second": 60_000 if k % 2 else 150 + k * 11 % 600} for k in range(0, 420, 6)]
PHASES += [{"first": 425 + k, "second": 400 + k} for k in range(0, 60, 4)]
CYCLES = 1_200


def images(folder: Path, text: str, annotated: tuple[int, int], actual: tuple[int, int]) -> Path:
    """Build a program whose two interrupts have the annotated and the actual levels; return the image's path."""
    (folder / "p.s").write_text(HEAD + text)
    (folder / "c.c").write_text(DEVICES % (*annotated, *actual))
    built = build([folder / "p.s", folder / "c.c"], folder / "p.elf", "-Os", "-g", "-fno-lto")
    assert built.status == 0, built.messages
    return folder / "p.elf"


def analyse(image: Path, function: str = "main") -> BoundsReport:
    """Return the report of `bounds` on an image."""
    executable = read_executable(image.read_bytes(), str(image))
    return report_of(Program(executable), [function])


def compare(seen: Watched, report: BoundsReport) -> None:
    """Assert that no observation exceeds its bound, and that every interrupt occurred."""
    said = {one.name.removeprefix("_"): one for one in report.responses}
    for name, one in seen.handlers.items():
        assert one.times
        cycles = said[name].cycles
        assert cycles is not None
        assert one.late <= cycles, name
    stack = report.stacks["main"]
    assert stack is not None
    assert seen.stack <= stack


@pytest.mark.slow
@pytest.mark.parametrize("name", PROGRAMS)
def test_no_response_and_no_stack_is_above_its_bound(tmp_path: Path, name: str) -> None:
    """No response and no stack depth exceeds its bound; the higher interrupt comes close to its response bound.

    Both interrupts occur at many phases.
    """
    text, *levels = PROGRAMS[name]
    image = images(tmp_path, text, (levels[0], levels[1]), (levels[0], levels[1]))
    seen, report = watched(image, ["T1Interrupt", "T2Interrupt"], PHASES, CYCLES), analyse(image)
    compare(seen, report)
    (high,) = (one for one in report.responses if one.name == "_T1Interrupt")
    assert high.cycles is not None
    assert high.cycles <= 1.3 * seen.handlers["T1Interrupt"].late + 50


def test_code_that_masks_interrupts_for_ever_has_no_response_bound(tmp_path: Path, capsys) -> None:
    """An endless loop entered at IPL 4 leaves lower interrupts without a response bound; the command names the loop."""
    image = images(tmp_path, "bset 0x42,#7\n" + LOOP + T1 + T2, (4, 5), (4, 5))
    report = analyse(image)
    assert {one.name: one.cycles is None for one in report.responses} == {"_T1Interrupt": True, "_T2Interrupt": False}
    assert main(["bounds", str(image)]) == 0
    assert "p.s:6 (_main+0x6): an endless loop in which levels up to 4 are masked" in capsys.readouterr().out


def test_a_round_of_an_endless_loop_that_may_stay_masked(tmp_path: Path) -> None:
    """If no iteration of an endless loop certainly unmasks interrupts, there is no response bound.

    Here a variable decides.
    """
    text = "1: bset 0x42,#7\n btss _out,#0\n bra 1b\n bclr 0x42,#7\n bra 1b\n"
    assert [one.cycles for one in analyse(images(tmp_path, text + T1 + T2, (4, 4), (4, 4))).responses] == [None, None]


def test_sleep_leaves_no_response(tmp_path: Path, capsys) -> None:
    """Sleep mode leaves no response bound, because the start-up time of the oscillator is unknown."""
    image = images(tmp_path, "1: pwrsav #0\n bra 1b\n" + T1 + T2, (4, 4), (4, 4))
    assert [one.cycles for one in analyse(image).responses] == [None, None]
    assert main(["bounds", str(image)]) == 0
    assert "p.s:5 (_main+0x4): stops the clock (PWRSAV #0)" in capsys.readouterr().out


def test_a_stopped_machine_holds_nothing_back(tmp_path: Path) -> None:
    """A stopped machine delays no response: without an enabled interrupt there is no request."""
    text = (
        "btsc _out,#0\n bra 2f\n" + LOOP + "2: bset 0x42,#7\n clr 0x8c\n clr 0x8e\n clr 0x90\n3: pwrsav #1\n bra 3b\n"
    )
    assert None not in [one.cycles for one in analyse(images(tmp_path, text + T1 + T2, (4, 4), (4, 4))).responses]


def test_a_level_that_contradicts_its_annotation_is_reported(tmp_path: Path) -> None:
    """An actual level above the annotated one is reported.

    T2 is annotated with level 2 and gets 5, so that it delays T1 at level 4.
    """
    image = images(tmp_path, LOOP + T1 + SLOW, (4, 2), (4, 5))
    seen = watched(image, ["T1Interrupt"], PHASES, CYCLES)
    assert seen.handlers["T1Interrupt"].late > 200
    report = analyse(image)
    ((place, why),) = report.contradictions.items()
    assert "c.c:9 " in place
    assert why.endswith("T2: 5")
    assert [one.cycles for one in report.responses] == [None, None]
    assert report.stacks == {"main": None}


def test_main_counts_whatever_is_asked_for(tmp_path: Path) -> None:
    """Code outside the analysed function counts for response bounds: it can delay an interrupt."""
    text = "1: bset 0x42,#7\n repeat #300\n nop\n bclr 0x42,#7\n bra 1b\n"
    image = images(tmp_path, text + T1 + T2, (4, 2), (4, 2))
    compare(watched(image, ["T1Interrupt", "T2Interrupt"], PHASES, CYCLES), analyse(image, "nothing"))


@pytest.mark.parametrize("seed", [3, 15, 461145])
def test_random_programs_answer_within_their_bounds(tmp_path: Path, seed: int) -> None:
    """Random programs with interrupts stay within their response bounds. In the last one a handler runs twice for one
    request: another handler interrupts it before it clears its flag, and then lowers its own priority.

    Sample of tests/fuzz/compiler/fuzz_bounds.py with programs of tests/fuzz/programs/c_interrupts.py.
    """
    held = Held(Counter())
    assert held.examine(seed, tmp_path) == "responses"
    assert held.nested > 1


def test_random_programs_hold_interrupts_back_in_every_way() -> None:
    """A long campaign generates every way of delaying an interrupt; an empty campaign reports all as missing."""
    made: Counter[str] = Counter()
    for seed in range(INTERRUPTED, 6 * ENOUGH, 6):
        made += c_interrupts.Program(seed).kinds
    assert made.keys() == c_interrupts.KINDS
    assert set(Held(Counter(), ENOUGH).missing()) >= c_interrupts.KINDS
