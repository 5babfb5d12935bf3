"""`openswarm completion`: prints the shell completion script for the project's commands and their options."""

from __future__ import annotations

import argparse

from emu.host.completion import SHELLS, description, script
from emu.host.exit_status import DONE
from openswarm.commands import made_parser


def parser() -> argparse.ArgumentParser:
    """Return the parser of the command's options."""
    made = made_parser("completion", description("openswarm"), "openswarm completion bash")
    made.add_argument("shell", choices=SHELLS, help="which shell")
    return made


def run(options: argparse.Namespace) -> int:
    """Print the completion script; return exit status 0."""
    from openswarm.cli import COMMANDS, command

    print(script("openswarm", {name: (command(name).parser(), text) for name, text in COMMANDS.items()}, options.shell))
    return DONE
