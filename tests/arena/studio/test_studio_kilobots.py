"""Studio of a scene with Kilobots: exact rewinds, the state of a robot, and commands that a Kilobot does not take."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from arena.campaign.campaign import Plan
from arena.scene.loader import scene_of
from arena.studio.session import CommandRefusedError
from tests.arena.studio.test_studio import do, studio_of
from tests.emu.avr.conftest import compiled

PROGRAM = """
#include <avr/io.h>
unsigned int counter;
int main(void) { DDRB = 1; for (;;) { counter++; PORTB ^= 1; __builtin_avr_delay_cycles(8000); } }
"""


def test_a_kilobot_in_the_studio(tmp_path: Path) -> None:
    """A rewound trial repeats its state; registers and variables are shown; Bluetooth and breakpoints are refused."""
    (tmp_path / "program.c").write_text(PROGRAM)
    compiled(tmp_path / "program.c", tmp_path / "program.elf", "-Os")
    scene = scene_of({"name": "pair", "clock": {"quantum_ms": 10.0}, "robots": [
        {"kind": "kilobot", "image": "program.elf", "place": "poses", "poses": [[50, 50], [55, 50]]}]})  # fmt: skip
    plan = Plan(scene, "program", "A", None, 1, 2.0, 1, images=(("program.elf", tmp_path / "program.elf"),))
    with studio_of(plan) as studio:
        do(studio, "step", 40)
        digest, lines = studio.ask("digest"), studio.ask("inspect", 1)["lines"]
        assert any("main" in line and "program.c:4" in line for line in lines[:1])
        assert 350 < int(next(line for line in lines if line.startswith("counter ")).split()[1]) <= 400
        do(studio, "step", 20)
        assert studio.ask("digest") != digest
        do(studio, "rewind", 40)
        assert studio.ask("digest") == digest
        refused: list[tuple[str, str, tuple[Any, ...]]] = [
            ("no Bluetooth", "send", (0, "x")),
            ("attach a debugger", "toggle_breakpoint", (1, "main")),
        ]
        for words, name, arguments in refused:
            with pytest.raises(CommandRefusedError, match=f"robot [01] is a kilobot: .*{words}"):
                studio.ask(name, *arguments)
