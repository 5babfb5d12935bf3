"""The command line `openswarm`. A command is a module of `commands/` with `parser()` and `run(options) -> exit status`,
imported only when it is asked for."""

from __future__ import annotations

import sys
from argparse import ArgumentParser, Namespace
from collections.abc import Sequence
from importlib import import_module
from importlib.metadata import version
from typing import Final, Protocol, cast

from emu.host.exit_status import BAD_INPUT, DONE, INTERRUPTED, ignore_unread_output

COMMANDS: Final = {
    "new": "set up a project: Makefile, CMake, main.c, a test, settings for VS Code",
    "doctor": "tell what is installed, what is missing and what that disables",
    "program": "build a program that robots take while they run",
    "flash": "write an image into a robot through its boot loader",
    "clean": "empty the cache",
    "path": "print where the kernel, CMake's toolchain file, the cache or Python are",
    "completion": "print what makes a shell complete these commands and their options",
}
_USAGE: Final = """usage: openswarm COMMAND [options]

{commands}

The others are `toolchain` (compiler, assembler, linker), `emu` (emulator) and `arena` (several robots in a world).

example: openswarm new myrobot
`openswarm COMMAND --help` explains a command; `openswarm --version` tells the version."""


class Command(Protocol):
    """What a module of `commands/` has."""

    @staticmethod
    def parser() -> ArgumentParser:
        """Its options."""

    @staticmethod
    def run(options: Namespace) -> int:
        """Do it. Raises ValueError or OSError for what the caller can mend."""


def command(name: str) -> Command:
    """The module of a command."""
    return cast(Command, import_module(f"openswarm.commands.{name}"))


@ignore_unread_output
def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; returns the exit status."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    try:
        return _answer(words)
    except BrokenPipeError:
        raise
    except (ValueError, OSError) as error:
        print(f"openswarm {words[0]}: {error}", file=sys.stderr)
        return BAD_INPUT
    except KeyboardInterrupt:
        return INTERRUPTED


def _answer(words: list[str]) -> int:
    if not words or words[0] in ("-h", "--help"):
        width = max(map(len, COMMANDS))
        print(_USAGE.format(commands="\n".join(f"  {name:{width}}  {text}" for name, text in COMMANDS.items())))
        return DONE if words else BAD_INPUT
    if words == ["--version"]:
        print(f"openswarm {version('openswarm')}")
        return DONE
    if words[0] not in COMMANDS:
        print(f"openswarm: unknown command {words[0]!r}; known are {', '.join(COMMANDS)}", file=sys.stderr)
        return BAD_INPUT
    module = command(words[0])
    return module.run(module.parser().parse_args(words[1:]))
