"""`emu completion`: what makes a shell complete the commands and their options, written by shtab from their parsers."""

from __future__ import annotations

import argparse
from importlib import import_module
from typing import Final

from emu.command import EXIT_OK, Parser
from emu.commands import COMMANDS

SHELLS: Final = ("bash", "zsh", "tcsh")
DESCRIPTION: Final = """\
Print a completion script for a shell.

    bash   emu completion bash > ~/.local/share/bash-completion/completions/emu
    zsh    emu completion zsh > "${fpath[1]}/_emu"
    tcsh   emu completion tcsh > ~/.emu.completion.tcsh     and source it

Exit status: 0 printed, 2 bad input."""


def parser() -> Parser:
    made = Parser("completion", DESCRIPTION, "emu completion bash")
    made.add_argument("shell", choices=SHELLS, help="which shell")
    return made


def run(options: argparse.Namespace) -> int:
    """Exit status as DESCRIPTION says."""
    import shtab

    print(shtab.complete(_everything(), shell=options.shell))
    return EXIT_OK


def _everything() -> argparse.ArgumentParser:
    """All commands in one parser, as the library wants to see them."""
    top = argparse.ArgumentParser("emu")
    top.add_argument("--version", action="store_true", help="tell the version")
    commands = top.add_subparsers(parser_class=argparse.ArgumentParser)
    for name, text in COMMANDS.items():
        one: Parser = import_module(f"emu.commands.{name}").parser()
        commands.add_parser(name, parents=[one], add_help=False, help=text)
    return top
