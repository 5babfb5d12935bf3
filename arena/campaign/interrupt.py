"""Handler of SIGINT whose exception cannot be lost in a destructor.

Python discards an exception that is raised in a destructor, and pymunk frees a space in one. A Ctrl-C at that moment
would have no effect, so the handler also stores that SIGINT has arrived, for the next check.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType


@contextmanager
def kept_interrupts() -> Iterator[Callable[[], None]]:
    """Yield a function that raises KeyboardInterrupt if a SIGINT arrived before and its exception was lost.

    A process that ignores or handles SIGINT keeps its handler, and so does a thread other than the main one."""
    has_arrived = False

    def on_signal(_number: int, _frame: FrameType | None) -> None:
        nonlocal has_arrived
        has_arrived = True
        raise KeyboardInterrupt

    def check() -> None:
        if has_arrived:
            raise KeyboardInterrupt

    if (threading.current_thread() is not threading.main_thread()
            or signal.getsignal(signal.SIGINT) is not signal.default_int_handler):  # fmt: skip
        yield check
        return
    signal.signal(signal.SIGINT, on_signal)
    try:
        yield check
        check()
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)
