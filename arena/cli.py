"""Command line `python -m arena COMMAND`; each command is a module of `commands/`, which is imported when it runs.

Exit statuses are those of `emu.host.exit_status`. Status 1 means that a robot had a fault: its firmware stopped, loops
in a trap handler, or is silent. Finished trials are kept.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from importlib import import_module
from typing import Any, Final

from arena.commands import COMMANDS
from emu.host.completion import SHELLS, script
from emu.host.completion import description as completion_description
from emu.host.errors import JSON, CommandParser, report_error
from emu.host.exit_status import BAD_INPUT, CANNOT_CONTINUE, DONE, INTERRUPTED, ignore_unread_output
from emu.host.top_level import answer, listing

_USAGE: Final = """usage: arena COMMAND [options]

Run experiments with robots that execute real firmware in a simulated arena.

{commands}

example: arena run clustering --brain scripted --trials 4 --minutes 10 --out results/scripted-A
`arena COMMAND --help` explains a command; `arena --version` prints the version."""
Command = tuple[argparse.ArgumentParser, Callable[[argparse.Namespace], Any]]
"""Option parser of a command, and the function that runs it and returns the exit status."""


@ignore_unread_output
def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return the exit status of the process."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    status = answer("arena", words, COMMANDS, lambda: _USAGE.format(commands=listing(COMMANDS)))
    if status is not None:
        return status
    parser, run = command(words[0])
    try:
        options = parser.parse_args(words[1:])
    except SystemExit as ended:  # --help, or an error that argparse has printed
        return ended.code if isinstance(ended.code, int) else BAD_INPUT
    return _call(run, options, JSON in words[1:])


def command(name: str) -> Command:
    """Import a command and return its option parser and its function."""
    run: Callable[[argparse.Namespace], Any]
    if name == "scenes":
        parser, run = CommandParser(description=COMMANDS[name], epilog="example: arena scenes"), _list_scenes
    elif name == "completion":
        parser = CommandParser(description=completion_description("arena"))
        parser.epilog = "example: arena completion bash"
        parser.add_argument("shell", choices=SHELLS)
        run = _print_completion
    else:
        module = import_module(f"arena.commands.{'bundle' if name == 'verify' else name}")
        parser = module.verify_parser() if name == "verify" else module.parser()
        run = module.verify if name == "verify" else module.run
    parser.prog, parser.formatter_class = f"arena {name}", argparse.RawDescriptionHelpFormatter
    return parser, run


def _call(run: Callable[[argparse.Namespace], Any], options: argparse.Namespace, as_json: bool) -> int:
    """Run a command and return its exit status; `report_error` reports its errors."""
    from arena.campaign.cluster import ClusterLostError
    from arena.scene.loader import SceneError
    from arena.trial.record import FolderInUseError, RecordError
    from emu.image.model import LoadError

    try:
        return int(run(options))
    except BrokenPipeError:
        raise
    except (FolderInUseError, ClusterLostError) as error:
        message = f"arena: {error}; finished trials are kept; run the same command to continue"
        return report_error(message, CANNOT_CONTINUE, as_json)
    except (SceneError, RecordError, LoadError, ValueError, OSError) as error:
        return report_error(f"arena: {error}", BAD_INPUT, as_json)
    except MemoryError:
        return report_error("arena: out of memory: an input is too large", BAD_INPUT, as_json)
    except KeyboardInterrupt:
        message = "arena: interrupted; finished trials are kept; run the same command to continue"
        return report_error(message, INTERRUPTED, as_json)


def _list_scenes(_options: argparse.Namespace) -> int:
    from arena.scene.loader import load_scene, scenes

    for name in scenes():
        print(f"{name:20} {load_scene(name).description}")
    return DONE


def _print_completion(options: argparse.Namespace) -> int:
    print(script("arena", {name: (command(name)[0], text) for name, text in COMMANDS.items()}, options.shell))
    return DONE
