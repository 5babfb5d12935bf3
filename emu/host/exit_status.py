"""The exit statuses of every command of the project, and that a reader who leaves is none of them. A leaf: it imports
nothing of ours; the table in the documents is `table()`. 124 and 130 are what `timeout` of GNU coreutils and shells use
for the same."""

from __future__ import annotations

import errno
import os
import sys
from collections.abc import Callable
from functools import wraps
from typing import Final, ParamSpec

P = ParamSpec("P")

DONE: Final = 0
FAULT: Final = 1
BAD_INPUT: Final = 2
CANNOT_CONTINUE: Final = 3
LIMIT_AS_STATUS: Final = 124
FAULT_AS_STATUS: Final = 125
BAD_INPUT_AS_STATUS: Final = 126
INTERRUPTED: Final = 130

MEANING: Final = {
    DONE: "done; for `emu run` also: the limit of `--seconds` or `--cycles` was reached",
    FAULT: "what was looked at is wrong: a fault of the firmware, a robot that something happened to, errors in the C "
    "source, a number over its baseline or limit, something that `openswarm doctor` misses and that is needed, "
    "a robot that does not answer `openswarm flash` or refuses a row",
    BAD_INPUT: "bad input or usage, or an extra that is not installed; the message says what was expected",
    CANNOT_CONTINUE: "`arena`: cluster lost, or folder in use by another run; finished trials are kept",
    LIMIT_AS_STATUS: "`emu run --exit-code`: the limit was reached before the firmware ended",
    FAULT_AS_STATUS: "`emu run --exit-code`: a fault of the firmware",
    BAD_INPUT_AS_STATUS: "`emu run --exit-code`: bad input or usage",
    INTERRUPTED: "interrupted from the keyboard",
}


def table() -> str:
    """Every status with its meaning, as a table in Markdown."""
    rows = [f"| {status} | {meaning} |" for status, meaning in MEANING.items()]
    return "\n".join(["| status | meaning |", "|---:|---|", *rows])


def _open_standard() -> None:
    """A standard stream that is closed (`<&-`) is as the null device: empty to read, and nobody reads what is written.
    Otherwise Python has None for it, and the next file that is opened its descriptor."""
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, mode, encoding="utf-8"))  # noqa: SIM115


def _drop_output() -> None:
    """What Python still holds for standard output goes nowhere when it ends."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def ignore_unread_output(main: Callable[P, int]) -> Callable[P, int]:
    """Wrap a command line: that nobody reads its output to the end (`| head`) is no failure, and nothing is said of it;
    a full disk under it is one line, and who closed it before wants none.

    What is printed may only be refused when it is flushed, which Python does behind `main`, also behind `--help`.
    """

    @wraps(main)
    def wrapped(*arguments: P.args, **options: P.kwargs) -> int:
        _open_standard()
        try:
            try:
                return main(*arguments, **options)
            finally:
                sys.stdout.flush()
        except BrokenPipeError:
            _drop_output()
            return DONE
        except OSError as error:
            if error.errno != errno.ENOSPC:
                raise
            _drop_output()
            print(f"cannot write: {error.strerror}", file=sys.stderr)
            return BAD_INPUT

    return wrapped
