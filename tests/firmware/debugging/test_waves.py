"""Waveform files (VCD) are cycle-accurate; an independent VCD reader parses them."""

from __future__ import annotations

import json
from fractions import Fraction
from functools import partial
from pathlib import Path

import pytest

import emu
from emu.boards.epuck.board import Epuck
from emu.cli import main
from tests.firmware.conftest import TARGET_APPS, Build
from tests.firmware.drivers.test_drivers_on_target import START
from tests.vcd_reader import VCDVCD

FCY = 14_745_600


def picoseconds(cycle: int) -> int:
    """Convert cycles of the e-puck to picoseconds: a cycle is 10^10 / 147456 ps."""
    return round(Fraction(cycle * 10**10, 147_456))


def changes(path: Path) -> dict[str, list[tuple[int, str]]]:
    read = VCDVCD(str(path))
    return {name: read[name].tv for name in read.signals}


def test_every_edge_of_the_steppers_is_there_to_the_cycle(image: Build, tmp_path: Path) -> None:
    path, wave = image("clustering"), tmp_path / "out.vcd"
    assert main(["run", str(path), "--selector", str(START), "--seconds", "0.6", "--vcd", str(wave)]) == 0
    machine = emu.load(path, board=partial(Epuck, selector=START))
    edges: dict[int, list[tuple[int, int]]] = {bit: [] for bit in range(8)}
    for bit in range(8):
        machine.pins.watch(f"RD{bit}", lambda cycle, _changed, levels, b=bit: edges[b].append((cycle, levels >> b & 1)))
    machine.run(cycles=FCY * 6 // 10)
    read = changes(wave)
    assert sum(map(len, edges.values())) > 100
    for bit in range(8):
        seen = [(time, int(value)) for time, value in read[f"pins.RD{bit}_{('left', 'right')[bit // 4]}_coil{bit % 4}"]]
        assert seen[1:] == [(picoseconds(cycle), level) for cycle, level in edges[bit]]


def test_bytes_and_their_bits_are_there(image: Build, tmp_path: Path) -> None:
    wave = tmp_path / "out.vcd"
    assert main(["run", str(image("hello")), "--seconds", "0.05", "--vcd", str(wave)]) == 0
    read = changes(wave)
    said = [int(value, 2) for _, value in read["uart1.tx"][1:]]
    count = int(read["uart1.tx_count"][-1][1], 2)
    assert count == len(b"hello, swarm\r\n")
    wire = read["pins.RF3"]

    def level(time: int) -> int:
        return int([value for at, value in wire if at <= time][-1])

    bit = picoseconds(128)
    decoded, at = bytearray(), 0
    while start := next((time for time, value in wire if time > at and value == "0"), 0):
        decoded.append(sum(level(start + bit * n + bit // 2 + bit) << n for n in range(8)))
        at = start + 9 * bit
    assert decoded == b"hello, swarm\r\n"
    assert [byte for byte, before in zip(decoded, b"\0" + decoded, strict=False) if byte != before] == said


def test_threads_priorities_and_variables_are_watched(image: Build, tmp_path: Path) -> None:
    path, wave = image("culprit", TARGET_APPS), tmp_path / "out.vcd"
    plain = emu.load(path)
    watch = "ipl,thread,asleep,clock_phase"
    assert main(["run", str(path), "--seconds", "0.02", "--vcd", str(wave), "--vcd-watch", watch]) == 0
    read = changes(wave)
    assert {int(value, 2) for _, value in read["cpu.thread"]} == {0, 1, 2}
    assert {int(value, 2) for _, value in read["cpu.ipl"]} >= {0, 1, 4}
    assert {value for _, value in read["cpu.asleep"]} == {"0", "1"}
    phases = [(time, int(value, 2)) for time, value in read["variables.clock_phase"]]
    ticks: list[int] = []
    plain.hook_pc("cpu_clock_isr", lambda: ticks.append(plain.cycle))
    plain.run(cycles=FCY // 50)
    changed = [time for time, _ in phases if time > picoseconds(ticks[0])]
    # each tick adds its fraction of a cycle to clock_phase and subtracts whole cycles
    latest = [max(tick for tick in ticks if picoseconds(tick) < time) for time in changed]
    assert sorted(set(latest)) == ticks
    assert all(time - picoseconds(tick) < picoseconds(60) for time, tick in zip(changed, latest, strict=True))


@pytest.mark.slow
def test_recording_changes_nothing_and_is_refused_in_words(
    image: Build, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = str(image("hello"))
    for extra in (["--vcd-watch", "nobody"], ["--vcd-watch", "os_statistics"]):
        assert main(["run", path, "--vcd", str(tmp_path / "x.vcd"), *extra]) == 2
        assert not (tmp_path / "x.vcd").exists()
    assert main(["run", path, "--vcd-watch", "ipl"]) == 2
    capsys.readouterr()
    for extra in ([], ["--vcd", str(tmp_path / "a.vcd")], ["--vcd", str(tmp_path / "b.vcd"), "--vcd-watch", "ipl"]):
        assert main(["run", path, "--seconds", "0.02", "--json", *extra]) == 0
    lines = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    facts = [{key: line[key] for key in ("cycles", "pc", "uart1", "reason")} for line in lines]
    assert facts[0] == facts[1] == facts[2]
