"""`emu profile`: print the CPU load in percent from exact cycles, by function, interrupt level and named group."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path
from typing import Any, Final

from emu.boards import BOARDS
from emu.commands import kilobot_board
from emu.commands.board_options import add_board_options, board_of, set_up
from emu.commands.image_option import add_chip_option, image_of
from emu.host.command import CommandError, Parser, count, seconds
from emu.host.exit_status import DONE, FAULT
from emu.host.files import atomic_text_file
from emu.image.model import Image
from emu.profile import callgrind
from emu.profile.cycle_shares import CodeLocation, Profile, Profiler
from emu.profile.timelines import perfetto, speedscope
from emu.profile.tracks import Tracks

DESCRIPTION: Final = """\
Run a firmware image and print the CPU share of each function and interrupt level.

Every cycle is counted, without sampling: the shares and the idle time add up to 100 %. Interrupt entry counts for the
handler. --group sums code by function or source file (shell patterns) under a given name; inlined code keeps its file:

    --group "capture=__T[45]Interrupt" --group "vision=*/line_of_sight.c"

--callgrind is for callgrind_annotate and KCachegrind: cycles by line, calls with their inclusive cycles.
--speedscope and --perfetto are timelines: threads, interrupt levels, calls. None of them attributes time in interrupts,
sleep or other threads to a function.

--lines adds source lines, from the image's DWARF. With --board kilobot, an ATmega328P runs an image of avr-gcc:

    emu profile firmware.elf --board kilobot --seconds 5 --lines 20

It has no interrupt levels and no timelines, and --callgrind has no calls.

Exit status: 0 done, 1 firmware fault (the counts are printed), 2 bad input."""


def parser() -> Parser:
    example = "emu profile firmware.elf --selector 8 --camera room.png --skip 1 --seconds 2 --group 'capture=__T[45]*'"
    made = Parser("profile", DESCRIPTION, example)
    made.add_argument("image", metavar="IMAGE", help="ELF executable")
    add_chip_option(made)
    made.add_argument(
        "--skip", metavar="S", type=seconds, default=Fraction(0), help="simulated time to skip first (default 0)"
    )
    made.add_argument("--seconds", metavar="S", type=seconds, default=Fraction(1), help="simulated time (default 1)")
    made.add_argument("--group", metavar="NAME=PATTERN,...", action="append", default=[], type=_group, help="see above")
    made.add_argument("--top", metavar="N", type=count, default=20, help="functions to print (default 20; 0: all)")
    made.add_argument("--lines", metavar="N", type=count, default=0, help="source lines to print (default none)")
    made.add_argument("--callgrind", metavar="FILE", help="write calls and lines in Callgrind's format")
    made.add_argument("--speedscope", metavar="FILE", help="write a timeline for speedscope")
    made.add_argument("--perfetto", metavar="FILE", help="write a timeline for Perfetto (Trace Event Format)")
    made.add_argument("--json", action="store_true", help="print one JSON object: cycles and percent")
    add_board_options(made, (*BOARDS, kilobot_board.BOARD))
    kilobot_board.add_options(made)
    return made


def _group(text: str) -> tuple[str, list[str]]:
    name, _, patterns = text.partition("=")
    if not name or not patterns:
        raise argparse.ArgumentTypeError(f"expected NAME=PATTERN,PATTERN..., not {text!r}")
    return name, patterns.split(",")


def run(options: argparse.Namespace) -> int:
    """Run the command. Return the exit status as listed in DESCRIPTION."""
    if options.board == kilobot_board.BOARD:
        profile, locations = kilobot_board.profile_of(options, parser())
        _check_groups(profile, options.group)
        if options.callgrind:
            _write_callgrind(profile, options, locations.at)
        return _finish(profile, options)
    kilobot_board.refuse_options(options)
    from emu.api import Machine

    image = image_of(options)
    machine = Machine(image.chip, board=board_of(options))
    machine.load(image)
    set_up(machine, options)
    skip = int(options.skip * machine.hz)
    profiler = Profiler(machine, image, timed=bool(options.speedscope or options.perfetto))
    profile = profiler.run(skip + machine.cycles_in(options.seconds), skip)
    _check_groups(profile, options.group)
    _write(profile, profiler, image, options)
    return _finish(profile, options)


def _finish(profile: Profile, options: argparse.Namespace) -> int:
    """Print the profile and the fault that ended the run, if any. Return the exit status."""
    fault = profile.stop.fault if profile.stop is not None else None
    if options.json:
        facts = _facts(profile, options.group) | ({"fault": fault.facts()} if fault is not None else {})
        print(json.dumps(facts, indent=2))
    else:
        _print(profile, options)
    if fault is not None:
        print(f"emu profile: {fault.report()}", file=sys.stderr)
        return FAULT
    return DONE


def _write(profile: Profile, profiler: Profiler, image: Image, options: argparse.Namespace) -> None:
    """Write the files that the options request."""
    if options.callgrind:
        _write_callgrind(profile, options, profiler.location)
    if not (options.speedscope or options.perfetto):
        return
    tracks = Tracks(profile.events, lambda pc: profiler.location(pc)[0], profile.start, profile.end, profile.entry)
    name = Path(image.path).name
    if options.speedscope:
        with atomic_text_file(options.speedscope) as stream:
            stream.writelines(speedscope(tracks, profiler.location, name, profile.start, profile.end))
    if options.perfetto:
        with atomic_text_file(options.perfetto) as stream:
            stream.writelines(perfetto(tracks, profiler.location, name, float(profiler.hz), profiler.inside))


def _write_callgrind(profile: Profile, options: argparse.Namespace, location_of: Callable[[int], CodeLocation]) -> None:
    with atomic_text_file(options.callgrind) as stream:
        stream.writelines(f"{line}\n" for line in callgrind.lines(profile, str(options.image), location_of))


def _check_groups(profile: Profile, groups: list[tuple[str, list[str]]]) -> None:
    """Reject group patterns without a match, which are usually misspelled. Raises CommandError."""
    for name, patterns in groups:
        for pattern in patterns:
            if not profile.matched(pattern):
                raise CommandError(f"--group {name}: no executed function or file matches {pattern!r}")


def _percent(profile: Profile, cycles: int) -> float:
    return 100 * cycles / profile.cycles if profile.cycles else 0.0


def _facts(profile: Profile, groups: list[tuple[str, list[str]]]) -> dict[str, Any]:
    def share(cycles: int) -> dict[str, Any]:
        return {"cycles": cycles, "percent": _percent(profile, cycles)}

    return {
        "cycles": profile.cycles,
        "idle": share(profile.idle),
        "busy": share(profile.busy),
        "groups": {name: share(profile.group(patterns)) for name, patterns in groups},
        "levels": {str(level): share(cycles) for level, cycles in sorted(profile.levels.items())},
        "files": {name: share(cycles) for name, cycles in profile.files.most_common()},
        "functions": {name: share(cycles) for name, cycles in profile.functions.most_common()},
        "lines": {name: share(cycles) for name, cycles in profile.lines.most_common()},
    }


def _print(profile: Profile, options: argparse.Namespace) -> None:
    def line(name: str, cycles: int) -> None:
        print(f"{name:32} {cycles:14,} cycles {_percent(profile, cycles):9.4f} %")

    line("all", profile.cycles)
    line("idle", profile.idle)
    line("busy", profile.busy)
    for name, patterns in options.group:
        line(name, profile.group(patterns))
    print()
    for level, cycles in sorted(profile.levels.items()):
        line(f"level {level}", cycles)
    if profile.levels:
        print()
    for name, cycles in profile.functions.most_common(options.top or None):
        line(name, cycles)
    if options.lines:
        print()
    for name, cycles in profile.lines.most_common(options.lines):
        line(name, cycles)
