"""What makes a shell complete the commands of a program and their options, written by shtab from their parsers."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from typing import Final

SHELLS: Final = ("bash", "zsh", "tcsh")


def description(program: str) -> str:
    """Help text of the command `completion` of a program."""
    return f"""\
Print a completion script for a shell.

    bash   {program} completion bash > ~/.local/share/bash-completion/completions/{program}
    zsh    {program} completion zsh > "${{fpath[1]}}/_{program}"
    tcsh   {program} completion tcsh > ~/.{program}.completion.tcsh     and source it

Exit status: 0 printed, 2 bad input."""


def script(program: str, commands: Mapping[str, tuple[argparse.ArgumentParser, str]], shell: str) -> str:
    """The script for one of SHELLS. `commands` has a parser and a line of help by name."""
    import shtab

    top = argparse.ArgumentParser(program)
    top.add_argument("--version", action="store_true", help="tell the version")
    below = top.add_subparsers(parser_class=argparse.ArgumentParser)
    for name, (one, text) in commands.items():
        below.add_parser(name, parents=[one], add_help=False, help=text)
    return str(shtab.complete(top, shell=shell))
