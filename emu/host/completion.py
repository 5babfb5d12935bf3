"""Shell completion scripts for a program's commands and options; shtab generates them from the option parsers."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from typing import Final

SHELLS: Final = ("bash", "zsh", "tcsh")


def description(program: str) -> str:
    """Return the help text of a program's `completion` command."""
    return f"""\
Print a completion script for a shell.

    bash   {program} completion bash > ~/.local/share/bash-completion/completions/{program}
    zsh    {program} completion zsh > "${{fpath[1]}}/_{program}"
    tcsh   {program} completion tcsh > ~/.{program}.completion.tcsh     and source it

Exit status: 0 printed, 2 bad input."""


def script(program: str, commands: Mapping[str, tuple[argparse.ArgumentParser, str]], shell: str) -> str:
    """Return the completion script for one of SHELLS. `commands` maps names to a parser and a help line."""
    import shtab

    top = argparse.ArgumentParser(program)
    top.add_argument("--version", action="store_true", help="print the version")
    below = top.add_subparsers(parser_class=argparse.ArgumentParser)
    for name, (one, text) in commands.items():
        below.add_parser(name, parents=[one], add_help=False, help=text)
    return str(shtab.complete(top, shell=shell))
