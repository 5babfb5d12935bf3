"""Studio of a scene with Kilobots: exact rewinds, the state of a robot, breakpoints, a refused command."""

from __future__ import annotations

from pathlib import Path

import pytest

from arena.campaign.campaign import Plan, controllers_of
from arena.scene.loader import scene_of
from arena.studio.errors import CommandRefusedError
from arena.trial.trial import run_trial
from tests.arena.debug.test_attach import attached_client
from tests.arena.studio.test_studio import do, studio_of, wait_for_state
from tests.emu.avr.conftest import compiled

PROGRAM = """
#include <avr/io.h>
unsigned int counter;
int main(void) { DDRB = 1; for (;;) { counter++; PORTB ^= 1; __builtin_avr_delay_cycles(8000); } }
"""


TALKERS = """
#include <avr/io.h>
#include <avr/interrupt.h>
volatile unsigned int got;
void __attribute__((noinline)) heard(void) { got++; }
ISR(ANALOG_COMP_vect) { heard(); }
int main(void)
{
    DDRB = 1, DIDR1 = 3, ACSR = 1 << ACIE | 1 << ACIS1 | 1 << ACIS0;
    sei();
    for (;;) { PORTB |= 1; __builtin_avr_delay_cycles(7); PORTB &= ~1; __builtin_avr_delay_cycles(300000); }
}
"""


def plan_of(folder: Path, program: str) -> Plan:
    """Return the plan of a pair of Kilobots with a program in C."""
    (folder / "program.c").write_text(program)
    compiled(folder / "program.c", folder / "program.elf", "-Os")
    scene = scene_of({"name": "pair", "clock": {"quantum_ms": 10.0}, "robots": [
        {"kind": "kilobot", "image": "program.elf", "place": "poses", "poses": [[50, 50], [55, 50]]}]})  # fmt: skip
    return Plan(scene, "program", "A", None, 1, 2.0, 1, images=(("program.elf", folder / "program.elf"),))


def test_a_kilobot_in_the_studio(tmp_path: Path) -> None:
    """A rewound trial repeats its state; registers and variables are shown; Bluetooth is refused."""
    with studio_of(plan_of(tmp_path, PROGRAM)) as studio:
        do(studio, "step", 40)
        digest, lines = studio.ask("digest"), studio.ask("inspect", 1)["lines"]
        assert any("main" in line and "program.c:4" in line for line in lines[:1])
        assert 350 < int(next(line for line in lines if line.startswith("counter ")).split()[1]) <= 400
        do(studio, "step", 20)
        assert studio.ask("digest") != digest
        do(studio, "rewind", 40)
        assert studio.ask("digest") == digest
        with pytest.raises(CommandRefusedError, match="robot 0 is a kilobot: it has no Bluetooth"):
            studio.ask("send", 0, "x")


def test_breakpoints_of_a_kilobot(tmp_path: Path) -> None:
    """A breakpoint of a Kilobot pauses the whole world at each call; the record is unaffected, a rewind keeps it."""
    plan = plan_of(tmp_path, TALKERS)
    with controllers_of(plan, 1) as (controllers, channel):
        whole = run_trial(plan.scene, 1, controllers, 2.0, channel=channel, experiment=plan.loaded_experiment)
    with studio_of(plan) as studio:
        do(studio, "step", 20)
        with pytest.raises(CommandRefusedError, match="robot 0: the image has no function 'no_such_function'"):
            studio.ask("toggle_breakpoint", 0, "no_such_function")
        for robot in (1, 0):
            studio.ask("toggle_breakpoint", robot, "heard")
        found = []
        for _ in range(4):
            studio.ask("run", 1000.0)
            now = wait_for_state(studio, "at a breakpoint")
            lines = studio.ask("inspect", int(now["hit"].split()[1]))["lines"]
            assert "heard" in lines[0]
            assert "program.c:5" in lines[0]
            found.append((now["hit"], lines[1], lines[-1]))
        assert {hit for hit, _, _ in found} == {"robot 0 is at heard", "robot 1 is at heard"}
        assert len(set(found)) == 4, "each call stops once"
        with pytest.raises(CommandRefusedError, match="run the trial first"):
            studio.ask("step", 1)
        studio.ask("toggle_breakpoint", 0, "heard")
        studio.ask("toggle_breakpoint", 1, "heard")
        studio.ask("run", 1000.0)
        wait_for_state(studio, "over")
        assert studio.ask("trial").columns == whole.rows.columns
        studio.ask("toggle_breakpoint", 1, "heard")
        assert do(studio, "rewind", 0)["breakpoints"] == ["1 heard"]
        studio.ask("run", 1000.0)
        assert wait_for_state(studio, "at a breakpoint")["hit"] == "robot 1 is at heard"


def test_breakpoints_and_a_debugger(tmp_path: Path) -> None:
    """While a debugger has a Kilobot, breakpoints of the page stop it and other robots, as without the debugger."""
    with studio_of(plan_of(tmp_path, TALKERS)) as studio:
        do(studio, "step", 20)
        studio.ask("toggle_breakpoint", 0, "heard")
        client = attached_client(studio, 0)
        studio.ask("toggle_breakpoint", 1, "heard")
        client.send("continue", threadId=1)
        hits = []
        for _ in range(4):
            hits.append(wait_for_state(studio, "at a breakpoint")["hit"])
            studio.ask("run", 1000.0)
        assert set(hits) == {"robot 0 is at heard", "robot 1 is at heard"}
        client.send("disconnect")
        while (now := studio.ask("status"))["debugger"] is not None:
            if now["hit"]:
                studio.ask("run", 1000.0)
        assert wait_for_state(studio)["state"] == "paused"
        studio.ask("run", 1000.0)
        assert wait_for_state(studio, "at a breakpoint")["state"] == "at a breakpoint", "also without the debugger"
