"""Calling convention between C and assembly on the emulator: one check per rule of abi-elf.md §2.

`calls.c` checks the rules in order; its exit status is the number of the first violated rule.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.toolchain.c_programs import build, run

FOLDER = Path(__file__).parent


@pytest.mark.parametrize("level", ["-O0", "-O1", "-Os", "-O2"])
def test_c_and_assembly_agree_on_every_rule(level: str, tmp_path: Path) -> None:
    """C and assembly agree on every rule of abi-elf.md §2.1-2.4.

    The rules concern argument registers, back-fill, the stack, structs, varargs, results and preserved registers.
    """
    image = tmp_path / "calls.elf"
    built = build([FOLDER / "calls.c", FOLDER / "probe.s"], image, level)
    assert built.status == 0, built.messages
    ran = run(image, 200_000, engine="auto")
    assert (ran.status, ran.why) == (0, "")
