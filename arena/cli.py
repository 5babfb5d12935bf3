"""The command line: `python -m arena COMMAND`; each command is a module of `commands/`.

Exit status: 0 done; 1 a robot's firmware stopped in a trial; 2 bad input; 130 interrupted (finished trials are kept).
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable, Sequence

import emu
from arena.commands import compare, experiment, plot, reaction, replay, report, run, sensitivity, sweep
from arena.record import RecordError
from arena.scene import SceneError, load_scene, scenes

FAULT, BAD_INPUT, INTERRUPTED = 1, 2, 130
COMMANDS: dict[str, tuple[Callable[[], argparse.ArgumentParser], Callable[[argparse.Namespace], int]]] = {
    "run": (run.parser, run.run),
    "experiment": (experiment.parser, experiment.run),
    "sweep": (sweep.parser, sweep.run),
    "sensitivity": (sensitivity.parser, sensitivity.run),
    "compare": (compare.parser, compare.run),
    "plot": (plot.parser, plot.run),
    "report": (report.parser, report.run),
    "reaction": (reaction.parser, reaction.run),
    "replay": (replay.parser, replay.run),
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; the process's exit status."""
    parser = argparse.ArgumentParser(
        prog="arena",
        description="Robots with real firmware in a simulated arena.",
        epilog="example: arena run clustering --brain scripted --trials 4 --minutes 10 --out results/scripted-A",
    )
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)
    for name, (make, _) in COMMANDS.items():
        one = make()
        commands.add_parser(name, parents=[one], help=one.description, description=one.description, epilog=one.epilog,
                            formatter_class=argparse.RawDescriptionHelpFormatter, add_help=False)  # fmt: skip
    commands.add_parser("scenes", help="list the scenes that come along")
    options = parser.parse_args(arguments)
    try:
        if options.command == "scenes":
            for name in scenes():
                print(f"{name:20} {load_scene(name).description}")
            status = 0
        else:
            status = COMMANDS[options.command][1](options)
        sys.stdout.flush()
        return status
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # nobody reads any more: not our failure
        return 0
    except (SceneError, RecordError, emu.LoadError, ValueError, OSError) as error:
        print(f"arena: {error}", file=sys.stderr)
        return BAD_INPUT
    except KeyboardInterrupt:
        print("arena: interrupted; finished trials are kept, the same command goes on", file=sys.stderr)
        return INTERRUPTED
