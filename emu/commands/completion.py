"""`emu completion`: print a shell completion script for the commands and their options."""

from __future__ import annotations

import argparse
from importlib import import_module

from emu.commands import COMMANDS
from emu.host.command import Parser
from emu.host.completion import SHELLS, description, script
from emu.host.exit_status import DONE


def parser() -> Parser:
    made = Parser("completion", description("emu"), "emu completion bash")
    made.add_argument("shell", choices=SHELLS, help="which shell")
    return made


def run(options: argparse.Namespace) -> int:
    """Print the completion script and return 0."""
    commands = {name: (import_module(f"emu.commands.{name}").parser(), text) for name, text in COMMANDS.items()}
    print(script("emu", commands, options.shell))
    return DONE
