"""`python -m toolchain COMMAND`: finds the command and turns bad input into messages and exit status 2.

A command is a module with `main(arguments) -> exit status`, imported only when it is asked for.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from importlib import import_module

from toolchain.errors import ToolError

EXIT_BAD_INPUT = 2

COMMANDS: dict[str, tuple[str, str]] = {
    "cc": ("toolchain.driver", "compile, assemble and link C and assembly, gcc-like"),
    "as": ("toolchain.commands.assembler", "assemble one file (pic30-as syntax)"),
    "ld": ("toolchain.commands.linker", "link objects and libraries to ELF or Intel HEX"),
    "ar": ("toolchain.commands.archiver", "make, list and extract static libraries"),
    "objdump": ("toolchain.commands.objdump", "show headers, symbols, disassembly with source"),
    "size": ("toolchain.commands.size", "show flash and RAM use"),
    "nm": ("toolchain.commands.names", "list symbols with addresses and sizes"),
    "hex": ("toolchain.commands.hex", "convert an ELF executable to Intel HEX"),
    "stack": ("toolchain.commands.stack", "worst-case stack use from the call graph"),
}

USAGE = """usage: python -m toolchain COMMAND [options]

{commands}

example: python -m toolchain cc -Os main.c -o firmware.elf
`python -m toolchain COMMAND --help` explains a command."""


def _usage() -> str:
    return USAGE.format(commands="\n".join(f"  {name:8} {text}" for name, (_, text) in COMMANDS.items()))


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit status: 0 done, 1 C errors, 2 bad input or usage."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    if not words or words[0] in ("-h", "--help"):
        print(_usage())
        return 0 if words else EXIT_BAD_INPUT
    if words[0] not in COMMANDS:
        print(f"toolchain: unknown command {words[0]!r}; known: {', '.join(COMMANDS)}", file=sys.stderr)
        return EXIT_BAD_INPUT
    try:
        status = import_module(COMMANDS[words[0]][0]).main(words[1:])
        sys.stdout.flush()
        return int(status or 0)
    except ToolError as error:
        print(error, file=sys.stderr)
        return EXIT_BAD_INPUT
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except KeyboardInterrupt:
        return 130
