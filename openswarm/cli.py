"""The command line `openswarm`: finds the command's module, parses its options and runs it.

A command is a module of `commands/` with `parser()` and `run(options) -> exit status`. It is imported only when it
is used.
"""

from __future__ import annotations

import sys
from argparse import ArgumentParser, Namespace
from collections.abc import Sequence
from importlib import import_module
from typing import Final, Protocol, cast

from emu.host.errors import JSON, report_error
from emu.host.exit_status import BAD_INPUT, INTERRUPTED, ignore_unread_output
from emu.host.top_level import answer, listing

COMMANDS: Final = {
    "new": "set up a project: Makefile, CMake, main.c, a test, settings for VS Code",
    "doctor": "list what is installed, what is missing and what that disables",
    "program": "build a program that running robots can receive",
    "flash": "write an image into a robot through its boot loader",
    "clean": "empty the cache",
    "path": "print where the kernel, CMake's toolchain file, the cache or Python are",
    "completion": "print the shell completion of these commands and their options",
}
_USAGE: Final = """usage: openswarm COMMAND [options]

{commands}

The others are `toolchain` (compiler, assembler, linker), `emu` (emulator) and `arena` (several robots in a world).

example: openswarm new myrobot
`openswarm COMMAND --help` explains a command; `openswarm --version` prints the version."""


class Command(Protocol):
    """Interface that each module of `commands/` implements."""

    @staticmethod
    def parser() -> ArgumentParser:
        """Return the parser of the command's options."""

    @staticmethod
    def run(options: Namespace) -> int:
        """Run the command. Raises ValueError or OSError for errors that the user can fix."""


def command(name: str) -> Command:
    """Return the module of a command."""
    return cast(Command, import_module(f"openswarm.commands.{name}"))


@ignore_unread_output
def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return the exit status."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    try:
        return _answer(words)
    except BrokenPipeError:
        raise
    except (ValueError, OSError) as error:
        return report_error(f"openswarm {words[0]}: {error}", BAD_INPUT, JSON in words)
    except KeyboardInterrupt:
        return INTERRUPTED


def _answer(words: list[str]) -> int:
    status = answer("openswarm", words, COMMANDS, lambda: _USAGE.format(commands=listing(COMMANDS)))
    if status is not None:
        return status
    module = command(words[0])
    return module.run(module.parser().parse_args(words[1:]))
