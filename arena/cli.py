"""Command line `python -m arena COMMAND`; each command is a module of `commands/`.

Exit statuses are those of `emu.host.exit_status`. Status 1 means that a robot had a fault: its firmware stopped, loops
in a trap handler, or is silent. Finished trials are kept.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from importlib.metadata import version

import emu
from arena.campaign.cluster import ClusterLostError
from arena.commands import (
    bundle,
    channel,
    compare,
    debug,
    experiment,
    figures,
    plot,
    reaction,
    replay,
    report,
    run,
    sensitivity,
    studio,
    sweep,
)
from arena.scene.loader import SceneError, load_scene, scenes
from arena.trial.record import FolderInUseError, RecordError
from emu.host.completion import SHELLS, script
from emu.host.completion import description as completion_description
from emu.host.exit_status import BAD_INPUT, CANNOT_CONTINUE, DONE, INTERRUPTED, ignore_unread_output

COMMANDS: dict[str, tuple[Callable[[], argparse.ArgumentParser], Callable[[argparse.Namespace], int]]] = {
    "run": (run.parser, run.run),
    "debug": (debug.parser, debug.run),
    "experiment": (experiment.parser, experiment.run),
    "sweep": (sweep.parser, sweep.run),
    "sensitivity": (sensitivity.parser, sensitivity.run),
    "compare": (compare.parser, compare.run),
    "plot": (plot.parser, plot.run),
    "figures": (figures.parser, figures.run),
    "report": (report.parser, report.run),
    "bundle": (bundle.parser, bundle.run),
    "verify": (bundle.verify_parser, bundle.verify),
    "channel": (channel.parser, channel.run),
    "reaction": (reaction.parser, reaction.run),
    "replay": (replay.parser, replay.run),
    "studio": (studio.parser, studio.run),
}


@ignore_unread_output
def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return the exit status of the process."""
    parser, commands = _parser()
    try:
        options = parser.parse_args(arguments)
    except SystemExit as ended:  # --help, or an error that argparse has printed
        return ended.code if isinstance(ended.code, int) else BAD_INPUT
    try:
        if options.command == "scenes":
            for name in scenes():
                print(f"{name:20} {load_scene(name).description}")
            return DONE
        if options.command == "completion":
            descriptions = {name: (one, one.description or "") for name, one in commands.items()}
            print(script("arena", descriptions, options.shell))
            return DONE
        return COMMANDS[options.command][1](options)
    except BrokenPipeError:
        raise
    except (FolderInUseError, ClusterLostError) as error:
        print(f"arena: {error}; finished trials are kept; run the same command to continue", file=sys.stderr)
        return CANNOT_CONTINUE
    except (SceneError, RecordError, emu.LoadError, ValueError, OSError) as error:
        print(f"arena: {error}", file=sys.stderr)
        return BAD_INPUT
    except MemoryError:
        print("arena: out of memory: an input is too large", file=sys.stderr)
        return BAD_INPUT
    except KeyboardInterrupt:
        print("arena: interrupted; finished trials are kept; run the same command to continue", file=sys.stderr)
        return INTERRUPTED


def _parser() -> tuple[argparse.ArgumentParser, dict[str, argparse.ArgumentParser]]:
    """Return the parser of the command line, and the parsers of its commands by name."""
    parser = argparse.ArgumentParser(
        prog="arena",
        description="Run experiments with robots that execute real firmware in a simulated arena.",
        epilog="example: arena run clustering --brain scripted --trials 4 --minutes 10 --out results/scripted-A",
    )
    parser.add_argument("--version", action="version", version=f"arena {version('openswarm')}")
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)
    for name, (make, _) in COMMANDS.items():
        one = make()
        about = str(one.description).partition("\n")[0]
        commands.add_parser(name, parents=[one], help=about, description=one.description, epilog=one.epilog,
                            formatter_class=argparse.RawDescriptionHelpFormatter, add_help=False)  # fmt: skip
    commands.add_parser("scenes", help="list the built-in scenes")
    shells = commands.add_parser("completion", help="print a completion script for a shell",
                                 description=completion_description("arena"), epilog="example: arena completion bash",
                                 formatter_class=argparse.RawDescriptionHelpFormatter)  # fmt: skip
    shells.add_argument("shell", choices=SHELLS)
    return parser, commands.choices
