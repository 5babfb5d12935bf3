"""The board `kilobot` of `emu run`, `emu profile` and `emu debug`: an ATmega328P with its own engine."""

from __future__ import annotations

import argparse
import json
import sys
from typing import TYPE_CHECKING, Final

from emu.boards.kilobot.messages import MOST_UID, TYPES
from emu.host.command import CommandError, Parser
from emu.host.exit_status import DONE, FAULT, FAULT_AS_STATUS, INTERRUPTED, LIMIT_AS_STATUS

if TYPE_CHECKING:
    from emu.debug.avr.machine import DebuggedKilobot
    from emu.profile.cycle_shares import CodeLocations, Profile

BOARD: Final = "kilobot"
OWN: Final = ("ohc", "uid")
"""Options of the Kilobot alone."""
SHARED: Final = ("image", "board", "seconds", "cycles", "json", "exit_code", "cache", "skip", "group", "top", "lines",
                 "callgrind", "tui")  # fmt: skip
"""Options of the commands that apply to a Kilobot, too."""


def add_options(made: Parser) -> None:
    """Add the options of the Kilobot to a command's parser."""
    made.add_argument("--ohc", choices=("none", *TYPES), help="kilobot: overhead controller's message (default run)")
    made.add_argument("--uid", metavar="N", type=_uid, help="kilobot: its UID, 0 to 65535 (default 0)")


def _uid(text: str) -> int:
    if not text.isdecimal() or int(text) > MOST_UID:
        raise argparse.ArgumentTypeError(f"a UID is a number from 0 to {MOST_UID}, not {text!r}")
    return int(text)


def refuse_options(options: argparse.Namespace) -> None:
    """Raise CommandError if an option of the Kilobot was given for another board."""
    for name in OWN:
        if getattr(options, name) is not None:
            raise CommandError(f"--{name} needs --board {BOARD}")


def refuse_other_options(options: argparse.Namespace, made: Parser) -> None:
    """Raise CommandError for an option of the parser `made` that does not apply to a Kilobot."""
    given = vars(options)
    for name in sorted(given.keys() - {*OWN, *SHARED}):
        if given[name] != made.get_default(name):
            raise CommandError(f"--{name.replace('_', '-')} does not apply to --board {BOARD}")


def profile_of(options: argparse.Namespace, made: Parser) -> tuple[Profile, CodeLocations]:
    """Run an image on a Kilobot for `emu profile` and return its profile, and the places of its code.

    Raises CommandError for an option of the parser `made` that does not apply, LoadError for an unreadable image.
    """
    refuse_other_options(options, made)
    from emu.avr.image import load_avr_image
    from emu.avr.machine import HZ
    from emu.boards.kilobot.single import SingleKilobot
    from emu.profile.cycle_shares import CodeLocations
    from emu.profile.kilobot import profile_kilobot

    image = load_avr_image(options.image)
    robot = SingleKilobot(image, uid=options.uid or 0, command=options.ohc or "run")
    skip = int(options.skip * HZ)
    return profile_kilobot(robot, skip + max(1, int(options.seconds * HZ)), skip), CodeLocations(image)


def debugged(options: argparse.Namespace, made: Parser) -> DebuggedKilobot:
    """Return a Kilobot at power-on for `emu debug --tui`. Raises as `profile_of`."""
    refuse_other_options(options, made)
    return debugged_image(options.tui, options.uid or 0, options.ohc or "run")


def debugged_image(path: str, uid: int = 0, command: str = "run") -> DebuggedKilobot:
    """Return a Kilobot at power-on with an image, for the debugger. Raises LoadError."""
    from emu.avr.image import load_avr_image
    from emu.boards.kilobot.single import SingleKilobot
    from emu.debug.avr.machine import DebuggedKilobot

    return DebuggedKilobot(SingleKilobot(load_avr_image(path), uid=uid, command=command))


def run(options: argparse.Namespace, made: Parser) -> int:
    """Run an image on a Kilobot and return the exit status that `emu run` documents.

    Raises CommandError for an option of the parser `made` that does not apply, LoadError for an unreadable image.
    """
    refuse_other_options(options, made)
    from emu.run.kilobot_session import run_kilobot

    done = run_kilobot(options.image, seconds=options.seconds, cycles=options.cycles,
                       command=options.ohc or "run", uid=options.uid or 0, show=not options.json)  # fmt: skip
    for text in done.notes:
        print(f"emu run: note: {text}", file=sys.stderr)
    status = FAULT if done.reason == "fault" else DONE
    if options.exit_code:
        statuses = {"fault": FAULT_AS_STATUS, "halt": DONE, "interrupted": INTERRUPTED}
        status = statuses.get(done.reason, LIMIT_AS_STATUS)
    if options.json:
        print(json.dumps(done.facts() | {"status": status}))
        return status
    if done.fault is not None:
        print(f"emu run: fault: {done.fault.message}", file=sys.stderr)
    print(
        f"{done.reason} at {done.image.place(done.pc)} after {done.cycles:,} cycles, {done.seconds:.6f} s simulated,"
        f" {done.seconds / done.host_seconds if done.host_seconds else 0:.3g} x real time",
        file=sys.stderr,
    )
    return status
