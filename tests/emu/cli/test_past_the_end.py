"""Fault report of a program that runs past the end of its code."""

from __future__ import annotations

from pathlib import Path

import emu

SOURCE = """
        .global __reset
        .text
__reset: mov #0x800, w0
        mov #0x1234, w1
        mov w1, [w0]
        nop
"""
FLASH_END = 0x018000


def test_no_jump_is_blamed_when_execution_runs_through_erased_flash(tmp_path: Path) -> None:
    """If execution runs through erased flash, the fault is the fetch beyond flash, and no jump is named as its cause,
    because the last branch led into the program."""
    source = tmp_path / "off.s"
    source.write_text(SOURCE)
    image = emu.build(source, flags=("-nostdlib", "-nostartfiles"), output=tmp_path / "off.elf")
    stop = emu.load(image, engine="plain", board=None).run(cycles=200_000)
    assert stop.fault is not None
    assert "jump to" not in stop.fault.cause
    assert stop.fault.cause.startswith("address error trap")
    assert stop.fault.pc >= FLASH_END - 2
