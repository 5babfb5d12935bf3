"""Interrupts at every instruction of every kernel call, on the ports: target/boundaries.

A sample here; `python -m tests.firmware.test_port_boundaries` goes through all boundaries of the Kilobot.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

import pytest

from firmware.tools.simulated.kilobot import Kilobot
from firmware.tools.simulated.machine import peek
from tests.firmware.conftest import TARGET_APPS
from tests.firmware.test_ports import kilobot, make

INT0, SLICE = 1, 14
"""Vectors: the device's, T0's compare A."""
WAYS = ("device", "slice", "nested")
"""The device; the end of the slice; the end of the slice and up to 44 instructions later the device."""
PRIME = 97
"""Boundaries between two of the sample."""


def check(machine: Kilobot, where: str) -> None:
    failures = peek(machine, "failures")
    assert failures == 0, f"{where}: {failures} failures, the first in line {peek(machine, 'first_failure')} of main.c"


def round_length(machine: Kilobot) -> int:
    """Instructions of a round that nothing disturbs."""
    begin = 0
    for _ in range(2):  # the first one starts threads for the first time
        machine.run_to("round_begin")
        begin = machine.instructions
        machine.run_to("round_end")
    return machine.instructions - begin


def sweep(machine: Kilobot, way: str, stride: int) -> int:
    """One interrupt in each round, `stride` instructions later than in the last; how many rounds."""
    length = round_length(machine)
    rounds = 0
    for boundary in range(1, length, stride):
        machine.run_to("round_begin")
        machine.steps(boundary)
        before = peek(machine, "interrupts")
        if way != "device":
            machine.interrupt(SLICE)
        if way == "nested":
            machine.steps(boundary * 7 % 45)
        if way != "slice":
            machine.interrupt(INT0)
        machine.run_to("round_begin")
        rounds += 1
        where = f"{way}, boundary {boundary} of {length}"
        check(machine, where)
        assert peek(machine, "interrupts") - before == (way != "slice"), f"{where}: the interrupt was lost"
    return rounds


@pytest.mark.parametrize("way", WAYS)
def test_the_kilobot_is_interrupted_everywhere(way: str, tmp_path: Path) -> None:
    """Every 97th boundary; another phase in each way, for the rounds shift against the clock."""
    machine = kilobot(make("kilobot", "boundaries", tmp_path, apps=TARGET_APPS))
    assert sweep(machine, way, PRIME) > 50


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.firmware.test_port_boundaries", description=__doc__)
    parser.add_argument("--stride", type=int, default=1, help="boundaries from one to the next (default 1: all)")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        try:
            image = make("kilobot", "boundaries", Path(folder), apps=TARGET_APPS)
        except pytest.skip.Exception as missing:
            print(missing, file=sys.stderr)
            return 2
        for way in WAYS:
            print(f"{way}: {sweep(Kilobot(image), way, options.stride):,} boundaries, nothing lost")
    return 0


if __name__ == "__main__":
    sys.exit(main())
