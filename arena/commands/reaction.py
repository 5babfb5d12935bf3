"""`arena reaction`: measure the time from a camera frame to the new wheel speed, and count missed frames.

The measurement is defined in experiment-contract.md §4.
"""

from __future__ import annotations

import argparse
from functools import partial
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

import emu
from arena.camera.appearance import COLOURS, NOTHING, OBJECT, ROBOT
from arena.commands.options.arguments import count, count_or_none
from arena.robots.epuck import SELECTOR
from arena.robots.images import image_for
from arena.scene.loader import FCY
from arena.trial.strict_json import json_text
from emu.boards.epuck.board import Epuck
from emu.host.errors import CommandParser

SPEED_WORDS: Final = {"openswarm": "stepper_left", "bare": "left.0"}
"""Word of each application that holds the speed of the left wheel.

The compiler splits a structure without pointers to it into one symbol per member."""
POLL_TCY: Final = 74
"""Cycles between two reads of the word: 5 µs."""
OK_AT_TCY: Final = FCY
"""Cycle at which the remote control's key is pressed."""
FRAME_TCY: Final = 1000
"""Cycles between two checks for the last line of a frame; shorter than the capture of a line."""
_ROWS: Final = 480


def parser() -> argparse.ArgumentParser:
    """Return the parser of the command's options."""
    command = CommandParser(
        description="measure the time from the last line of a frame to the new wheel speed, and missed frames",
        epilog="example: arena reaction --brain openswarm --brain bare --frames 300",
    )
    command.add_argument(
        "--brain", action="append", help="openswarm, bare, or an ELF file; repeatable (default: openswarm and bare)"
    )
    command.add_argument("--word", metavar="SYMBOL", help="word that holds the left wheel's speed, for other firmware")
    command.add_argument("--controller", default="A", choices=sorted(SELECTOR), help="table of speeds (default A)")
    command.add_argument("--frames", type=count, default=300, metavar="N", help="frames to measure (default 300)")
    command.add_argument("--seed", type=count_or_none, default=1, help="seed of the pictures (default 1)")
    command.add_argument("--json", action="store_true", help="print JSON")
    return command


class AlternatingPicture:
    """Picture in the colour of an object, a robot or the wall; the colour changes before every frame."""

    def __init__(self, seed: int) -> None:
        self._rng = np.random.default_rng(seed)
        self._last_row = _ROWS
        self.kind = NOTHING
        self.frames = 0
        """Number of frames of which at least one line was read."""
        self.lines: list[int] = []
        """Cycles of the rising edges of HREF for the lines read of the present frame."""

    def pixels(self, y: int, columns: NDArray[np.intp], cycle: int) -> NDArray[np.uint8]:
        """Return the pixels of line `y`; a callback for `Camera.sample`."""
        if y <= self._last_row:
            others = [kind for kind in (NOTHING, OBJECT, ROBOT) if kind != self.kind]
            self.kind = others[int(self._rng.integers(2))]
            self.frames += 1
            self.lines = []
        self._last_row = y
        self.lines.append(cycle)
        return np.tile(COLOURS[self.kind], (len(columns), 1))


def reaction(image: Path, word: str, selector: int, frames: int, seed: int) -> dict[str, Any]:
    """Return latencies in µs from the rising HREF of the last line to the change of `word`, and missed frames.

    Raises emu.LoadError for an unusable image, ValueError if `word` does not exist or never changes.
    """
    machine = emu.load(image, board=partial(Epuck, camera="PO6030K", selector=selector, seed=seed))
    machine.board.remote.press("ok", cycle=OK_AT_TCY)
    show = AlternatingPicture(seed)
    machine.board.camera.show_pixels(show.pixels)
    try:
        machine.peek(word)
    except (KeyError, ValueError) as error:
        raise ValueError(f"{image}: cannot read the word {word!r}: {error}") from None
    _run_until(machine, 2 * OK_AT_TCY)
    frame_tcy = machine.board.camera.scan.timing.frame_tcy
    begin, first = machine.cycle, show.frames
    times = np.array(_latencies(machine, show, word, begin + frames * frame_tcy))
    if not len(times):
        raise ValueError(f"{image}: {word} never changes")
    sent = (machine.cycle - begin) // frame_tcy
    return {
        "changes": len(times),
        "median_us": float(np.median(times)),
        "p99_us": float(np.quantile(times, 0.99)),
        "max_us": float(times.max()),
        "min_us": float(times.min()),
        "frames_sent": sent,
        "frames_missed": max(sent - (show.frames - first), 0),
    }


def _latencies(machine: emu.Machine, show: AlternatingPicture, word: str, end: int) -> list[float]:
    """Run to cycle `end`; return the time in µs from the last line of a frame to each change of `word`."""
    found: list[float] = []
    lines = 0
    while machine.cycle < end:
        frame = show.frames
        while machine.cycle < end and (show.frames == frame or len(show.lines) < lines):
            _run_until(machine, machine.cycle + FRAME_TCY)
        before = machine.peek(word)
        while machine.cycle < end and machine.peek(word) == before:
            _run_until(machine, machine.cycle + POLL_TCY)
        if machine.cycle < end:
            found.append((machine.cycle - show.lines[-1]) / FCY * 1e6)
            lines = len(show.lines)
    return found


def _run_until(machine: emu.Machine, cycle: int) -> None:
    stop = machine.run_until(cycle)
    if stop is not None:
        raise ValueError(f"the firmware stopped: {stop.reason} at {stop.pc:#08x}: {stop.detail}")


def run(options: argparse.Namespace) -> int:
    """Print a table of latencies per brain. Raises ValueError, LoadError."""
    selector = 0 if options.controller == "A" else 1
    results = {}
    for brain in options.brain or list(SPEED_WORDS):
        image, word = image_for(brain), options.word or SPEED_WORDS.get(brain)
        if image is None:
            raise ValueError(f"--brain {brain} has no firmware")
        if word is None:
            raise ValueError(f"--brain {brain}: name the word that holds the left wheel's speed with --word")
        results[Path(brain).stem] = reaction(image, word, selector, options.frames, options.seed)
    if options.json:
        print(json_text(results))
        return 0
    print("| | changes | median | 99 % | least | most | frames missed |\n|---|---|---|---|---|---|---|")
    for name, one in results.items():
        times = " | ".join(f"{one[key]:.0f} µs" for key in ("median_us", "p99_us", "min_us", "max_us"))
        print(f"| {name} | {one['changes']} | {times} | {one['frames_missed']} of {one['frames_sent']} |")
    return 0
