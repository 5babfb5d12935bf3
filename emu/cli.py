"""Command line `python -m emu COMMAND`: dispatches to a command and reports its errors as one line and an exit status.

Input: arguments. Output: an exit status. A command is a module of `emu.commands`. It is listed in COMMANDS, imported on
demand, and has `parser() -> Parser` and `run(options) -> int`. Only `emu debug --tui` has colours, at a terminal
without NO_COLOR.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib import import_module
from typing import Final

from emu.commands import COMMANDS
from emu.host.command import CommandError, Parser
from emu.host.errors import JSON, report_error
from emu.host.exit_status import BAD_INPUT, BAD_INPUT_AS_STATUS, DONE, ignore_unread_output
from emu.host.top_level import answer, listing

_USAGE: Final = """usage: emu COMMAND [options]

{commands}

example: emu run firmware.elf --seconds 5
`emu COMMAND --help` explains a command; `emu --version` prints the version."""


@ignore_unread_output
def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return the exit status."""
    return _answer(list(sys.argv[1:] if arguments is None else arguments))


def _answer(words: list[str]) -> int:
    status = answer("emu", words, COMMANDS, lambda: _USAGE.format(commands=listing(COMMANDS)))
    return _call(words[0], words[1:]) if status is None else status


def _call(name: str, rest: list[str]) -> int:
    """Parse the options and run a command; `report_error` reports its errors."""
    from emu.image.model import LoadError

    bad_input = BAD_INPUT_AS_STATUS if "--exit-code" in rest else BAD_INPUT
    as_json = JSON in rest
    command = import_module(f"emu.commands.{name}")
    parser: Parser = command.parser()
    options = parser.parse_args(rest)
    try:
        status: int = command.run(options)
    except (LoadError, CommandError) as error:
        return report_error(f"emu {name}: {error}", bad_input, as_json)
    except BrokenPipeError:
        raise
    except OSError as error:
        where = f"{error.filename}: " if error.filename else ""
        return report_error(f"emu {name}: {where}{error.strerror}", bad_input, as_json)
    except MemoryError:
        return report_error(f"emu {name}: out of memory: an input is too large", bad_input, as_json)
    except KeyboardInterrupt:
        return DONE
    return status
