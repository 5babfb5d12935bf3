"""`python -m toolchain COMMAND`: runs a command and reports bad input as messages with exit status 2.

A command is a module with `main(arguments) -> exit status`, which is imported when the command runs.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path

from emu.host.errors import JSON, report_error
from emu.host.exit_status import BAD_INPUT, DONE, INTERRUPTED, ignore_unread_output
from emu.host.top_level import answer
from toolchain.errors import ToolError

COMMANDS: dict[str, tuple[str, str]] = {
    "cc": ("toolchain.driver.driver", "compile, assemble and link C and assembly, gcc-like"),
    "c++": ("toolchain.commands.cxx", "the same for freestanding C++17"),
    "as": ("toolchain.commands.assembler", "assemble one file (pic30-as syntax)"),
    "ld": ("toolchain.commands.linker", "link objects and libraries to ELF or Intel HEX"),
    "ar": ("toolchain.commands.archiver", "make, list and extract static libraries"),
    "objdump": ("toolchain.commands.objdump", "show headers, symbols, disassembly with source"),
    "size": ("toolchain.commands.size", "show flash and RAM use"),
    "nm": ("toolchain.commands.nm", "list symbols with addresses and sizes"),
    "hex": ("toolchain.commands.hex", "convert an ELF executable to Intel HEX"),
    "bounds": ("toolchain.commands.bounds", "worst-case time, stack and interrupt response"),
    "prove": ("toolchain.commands.prove", "prove that machine code does what the IR says"),
    "completion": ("toolchain.commands.completion", "print a completion script for the shell"),
}

USAGE = """usage: python -m toolchain COMMAND [options]

{commands}

example: python -m toolchain cc -Os main.c -o firmware.elf
`python -m toolchain COMMAND --help` explains a command; `--version` prints the version. The first eight commands
are also installed as programs: dspic-cc, dspic-as, dspic-ld, dspic-ar ..."""


XC16_PROGRAMS = {"gcc": "cc", "cc": "cc", "bin2hex": "hex", "g++": "c++"}
"""Commands by the names of XC16's programs without `xc16-`; the others have the same names."""


def _usage() -> str:
    return USAGE.format(commands="\n".join(f"  {name:10} {text}" for name, (_, text) in COMMANDS.items()))


@ignore_unread_output
def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit status: 0 success, 1 errors in C sources, 2 bad input or usage."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    status = answer("toolchain", words, COMMANDS, _usage)
    if status is not None:
        return status
    try:
        return int(import_module(COMMANDS[words[0]][0]).main(words[1:]) or DONE)
    except ToolError as error:
        return report_error(str(error), BAD_INPUT, JSON in words)
    except MemoryError:
        return report_error(f"toolchain {words[0]}: out of memory: an input is too large", BAD_INPUT, JSON in words)
    except KeyboardInterrupt:
        return INTERRUPTED


@ignore_unread_output
def by_name() -> int:
    """Run the command that the program's name contains, such as `ar` of `dspic-ar rcs x.a y.o`.

    `dspic-ranlib` is `ar s`. The output of `--version` starts like that of the GNU tool, as configure scripts expect.
    """
    name = Path(sys.argv[0]).stem.removeprefix("dspic-")
    words = sys.argv[1:]
    if name.startswith(("xc16-", "pic30-")):
        name = XC16_PROGRAMS.get(name.partition("-")[2], name.partition("-")[2])
        words = ["--xc16-defaults", *words] if name == "cc" and "--version" not in words else words
    if name != "cc" and words == ["--version"]:
        from importlib.metadata import version  # imported only here: it takes as long as a short run

        print(f"dspic-{name} (openswarm) {version('openswarm')}")
        return DONE
    return main(["ar", "s", *words] if name == "ranlib" and "--help" not in words else [name, *words])
