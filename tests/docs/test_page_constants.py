"""Numbers on pages for users equal the constants of the code that they describe."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from arena.infrared.channel import GAP_S
from arena.robots.user_controller import DEFAULT_PERIOD_S
from arena.scene import dimensions
from arena.scene.schema import Clock, Kilobots
from emu.boards.epuck import stimulus
from emu.debug.history import PERIOD
from openswarm.flashing import loaders, program
from openswarm.testing import artefacts

ROOT = Path(__file__).resolve().parents[2]
FIRMWARE = ROOT / "firmware" / "openswarm"
TCY_PER_S = 14_745_600
"""Instruction cycles of the e-puck in a second (dspic30f6014a.md §3)."""


def constant(path: str, name: str) -> int:
    """Return a constant of a C header: an enumerator, or a macro."""
    text = (FIRMWARE / path).read_text(encoding="utf-8")
    found = re.search(rf"\b{name}\b(?: =)? (0x[0-9A-Fa-f]+|[0-9]+)\b", text)
    assert found is not None, f"{path}: {name}"
    return int(found[1], 0)


ROW = constant("hal/hal_update.h", "HAL_UPDATE_ROW")
ROWS = constant("hal/hal_update.h", "HAL_UPDATE_ROWS")
GUARD = constant("port/dspic30f/hal_limits.h", "HAL_STACK_GUARD")
STACK = constant("port/dspic30f/hal_limits.h", "HAL_DEFAULT_STACK")
MESSAGE = constant("include/openswarm_infrared.h", "SYS_MESSAGE_BYTES")
REMOTE = constant("include/openswarm_remote.h", "SYS_REMOTE_BYTES")
NUMBER = constant("io/infrared/infrared_parts.h", "NUMBER_MASK")
NEIGHBOURS = constant("include/openswarm_infrared.h", "SYS_NEIGHBOURS")
QUEUE = constant("include/openswarm_infrared.h", "SYS_INFRARED_QUEUE")
LIFETIME_MS = constant("include/openswarm_infrared.h", "SYS_NEIGHBOUR_LIFETIME")
WORDS = {4: "four", 7: "seven", 8: "eight", 10: "ten"}
TINYBLD = loaders.LOADERS[0x71]
RUN_AT, _, RUN_FOR = Kilobots().overhead.split()

SENTENCES = [
    ("docs/debugging.md", f"stores a state every {1000 * PERIOD / TCY_PER_S:.0f} ms of simulated time"),
    ("docs/testing.md", f"a waveform of the last {artefacts.STRETCH_MS} ms"),
    ("docs/robot.md", f"raw value with the emitter off, 0-{stimulus.LARGEST_COUNT}"),
    ("docs/robot.md", f"acceleration in g, -{stimulus.MOST_G} to {stimulus.MOST_G}"),
    ("docs/robot.md", f"at most {stimulus.MOST_CLOCKS:,})"),
    ("docs/flashing.md", f"{loaders.BAUD:,} baud"),
    ("docs/flashing.md", f"occupies words {TINYBLD.entry:06X} and up"),
    ("docs/programs.md", f"of up to {ROW * ROWS:,} bytes"),
    ("docs/programs.md", f"{ROW * ROWS:,} bytes of flash from {program.SLOT.start:06X}"),
    ("docs/programs.md", f"{program.ROWS} rows of {loaders.ROW_WORDS} instructions"),
    ("docs/openswarm-program.md", f"guard of {GUARD} bytes"),
    ("docs/openswarm-program.md", f"{STACK - GUARD} bytes fit a stack of {STACK}"),
    ("docs/swarm.md", f"messages of up to {WORDS[MESSAGE]} bytes"),
    ("docs/swarm.md", f"A payload has at most {WORDS[REMOTE]} bytes"),
    ("docs/swarm.md", f"at most {WORDS[NEIGHBOURS]} neighbours"),
    ("docs/swarm.md", f"up to {WORDS[QUEUE]} frames may wait"),
    ("docs/swarm.md", f"{WORDS[LIFETIME_MS // 1000]} seconds after its last frame"),
    ("docs/swarm.md", f"if that is 1 to {NUMBER}"),
    ("docs/scenes.md", f"{DEFAULT_PERIOD_S:g} if missing"),
    ("docs/scenes.md", f"in cm/s, at most {dimensions.WHEEL_SPEED:g}"),
    ("docs/scenes.md", f"less than {1000 * GAP_S:g} ms between them"),
    ("docs/own-experiment.md", f"one number per sample, every {Clock().sample_s:g} s"),
    ("docs/kilobots.md", f"the default is RUN from {RUN_AT} s to {float(RUN_AT) + float(RUN_FOR):g} s"),
    ("docs/kilobots.md", f"has bodies of {20 * dimensions.KILOBOT_RADIUS:g} mm"),
]


@pytest.mark.parametrize(("page", "sentence"), SENTENCES)
def test_a_page_states_the_constant(page: str, sentence: str) -> None:
    text = " ".join((ROOT / page).read_text(encoding="utf-8").split())
    assert sentence in text
