"""Command `completion`: shell completion scripts for the commands and their options."""

from __future__ import annotations

import argparse
import re
from importlib import import_module

from emu.host.completion import SHELLS, description, script
from toolchain.commands.parser import parser


def options_of() -> argparse.ArgumentParser:
    """Return the argument parser of the command."""
    p = parser("completion", description("toolchain"), "python -m toolchain completion bash")
    p.add_argument("shell", choices=SHELLS, help="which shell")
    return p


def main(arguments: list[str]) -> int:
    """Print the script; return 0."""
    from toolchain.cli import COMMANDS

    options = options_of().parse_args(arguments)
    commands = {}
    for name, (module, text) in COMMANDS.items():
        commands[name] = (_compiler() if name in ("cc", "c++") else import_module(module).options_of(), text)
    print(script("toolchain", commands, options.shell))
    return 0


def _compiler() -> argparse.ArgumentParser:
    """Return a parser with the options in the compiler's help text; the compiler has its own gcc-like parser."""
    from toolchain.frontend.options import HELP

    made = argparse.ArgumentParser(add_help=False)
    for line in HELP.splitlines():
        left = re.split(r"\s{2,}", line.strip())[0] if line.startswith("  -") else ""
        for word in dict.fromkeys(re.findall(r"(?<!\S)--?[A-Za-z][\w-]*=?", left)):
            made.add_argument(word.rstrip("="), action="store_true")
    made.add_argument("files", nargs="*")
    return made
