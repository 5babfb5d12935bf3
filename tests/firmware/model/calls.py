"""Model of calls: who may make them, their errors, memory, critical sections."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any

from tests.firmware.model.state import Code, Error, Sizes, State, Thread

SATURATED = 0xFFFF
CALLS: dict[str, str] = {}
"""Every call that the model knows, with the contexts that may make it: main, threads, handlers, interrupts."""


def call(name: str, callers: str, failure: Any = False, blocks: bool = False) -> Callable[..., Any]:
    """Declare a method as a kernel call. From a context that is not in `callers` it is refused and returns `failure`.

    A call that blocks is also refused in a critical section.
    """
    CALLS[name] = callers

    def declare(method: Callable[..., Any]) -> Callable[..., Any]:
        @wraps(method)
        def checked(self: Calls, *arguments: Any) -> Any:
            if self.context not in callers or (blocks and self.depth):
                self.refused = min(self.refused + 1, SATURATED)
                self.fail(Error.CONTEXT)
                return failure
            return method(self, *arguments)

        return checked

    return declare


class Calls:
    """State that decides whether a call is allowed and whether its allocations fail."""

    def __init__(self, sizes: Sizes, code: Code) -> None:
        self.sizes = sizes
        self.system = Thread(0, code, state=State.READY)
        self.running = self.system
        self.started = False
        self.in_kernel = False
        """A handler, condition, cleanup or scheduler runs."""
        self.in_isr = False
        self.depth = 0
        """Nesting of critical sections."""
        self.heap = self.peak = 0
        self.allocations_to_skip = self.allocations_to_fail = 0
        self.refused = 0
        self.handler_error = self.isr_error = Error.OK

    # ---- Contexts and errors ---------------------------------------------------------------------------------------

    @property
    def context(self) -> str:
        """Return M (main before the start), T (thread), H (handler, condition, cleanup) or I (interrupt)."""
        return "I" if self.in_isr else "H" if self.in_kernel else "T" if self.started else "M"

    def fail(self, error: Error) -> bool:
        """Set the caller's last error; all handlers share one, and all ISRs."""
        if self.in_isr:
            self.isr_error = error
        elif self.in_kernel:
            self.handler_error = error
        else:
            self.running.error = error
        return False

    def leave(self, error: Error) -> bool:
        """Return True, or set the last error and return False."""
        return error is Error.OK or self.fail(error)

    @call("Sys_Get_LastError", "MTHI")
    def last_error(self) -> Error:
        return self.isr_error if self.in_isr else self.handler_error if self.in_kernel else self.running.error

    def boundary(self) -> None:
        """Let an interrupt occur here. The steps of a call between two boundaries are atomic."""

    # ---- Memory ----------------------------------------------------------------------------------------------------

    def allocate(self, size: int) -> bool:
        """Take heap memory; False: the program makes this allocation fail."""
        fails = not self.allocations_to_skip and self.allocations_to_fail > 0
        if fails:
            self.allocations_to_fail -= 1
        else:
            self.allocations_to_skip = max(self.allocations_to_skip - 1, 0)
            self.heap += self.sizes.rounded(size)
            self.peak = max(self.peak, self.heap)
        self.boundary()
        return not fails

    def free(self, size: int) -> None:
        self.boundary()
        self.heap -= self.sizes.rounded(size)

    # ---- Critical sections -----------------------------------------------------------------------------------------

    @call("Sys_Start_CriticalSection", "MTHI")
    def start_section(self) -> None:
        self.depth += not self.in_isr  # an interrupt changes no nesting

    @call("Sys_End_CriticalSection", "MTHI")
    def end_section(self) -> None:
        self.depth = max(self.depth - (not self.in_isr), 0)
