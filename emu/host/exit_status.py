"""Exit statuses of all commands of the project, and the handling of closed output streams.

The module imports nothing of the project. `table()` is the table in the documentation. 124 and 130 follow `timeout` of
GNU coreutils and the shells.
"""

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
    FAULT: "the examined object is faulty: a fault of the firmware, a robot with a fault in `arena`, errors in the C "
    "source, a number over its baseline or limit, a required component that `openswarm doctor` does not find, "
    "a robot that does not answer `openswarm flash` or rejects a row",
    BAD_INPUT: "bad input or usage, or an extra that is not installed; the message says what was expected",
    CANNOT_CONTINUE: "`arena`: cluster lost, or folder in use by another run; finished trials are kept",
    LIMIT_AS_STATUS: "`emu run --exit-code`: the limit was reached before the firmware ended",
    FAULT_AS_STATUS: "`emu run --exit-code`: a fault of the firmware",
    BAD_INPUT_AS_STATUS: "`emu run --exit-code`: bad input or usage",
    INTERRUPTED: "interrupted from the keyboard",
}


def table() -> str:
    """Return every status with its meaning, as a table in Markdown."""
    rows = [f"| {status} | {meaning} |" for status, meaning in MEANING.items()]
    return "\n".join(["| status | meaning |", "|---:|---|", *rows])


def _open_standard() -> None:
    """Open the null device for each closed standard stream (`<&-`).

    Otherwise Python would set the stream to None, and the next file opened would get its descriptor.
    """
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, mode, encoding="utf-8"))  # noqa: SIM115


def _drop_output() -> None:
    """Discard buffered standard output, which Python would otherwise flush at exit."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def ignore_unread_output(main: Callable[P, int]) -> Callable[P, int]:
    """Wrap a command's `main`: a closed output pipe (`| head`) is no error, a full disk is reported in one line.

    The wrapper flushes standard output, because a write error may appear only when Python flushes it after `main` or
    `--help`.
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
