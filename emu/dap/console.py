"""Console commands that begin with a slash: time, threads, running to a cycle and rewinding."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from emu.dap.debuggee import Debuggee, StopEvent
from emu.debug.dwarf.location import address_of
from emu.debug.expressions.expression import evaluate
from emu.debug.threads import Thread
from emu.debug.value import Value

COMMANDS: Final = {
    "time": "              show cycle, seconds, and the distance to the present",
    "goto": " CYCLE        go to a cycle of the recording, or run on to a later one",
    "cycle": " [N]         run for N cycles (default 1), at least to the end of an instruction",
    "lastwrite": " PLACE   go back to the last instruction that changed PLACE",
    "reverse-step": "      go back to the previous line, also of a called function",
    "reverse-finish": "    go back to the call of this function, or to before the interrupt",
    "threads": "           show the threads of OpenSwarm with stack use",
    "world": "             show the state of the trial around the robot",
}
HELP: Final = "an expression of C; NAME = VALUE; or\n" + "".join(f"/{word}{text}\n" for word, text in COMMANDS.items())


def console_command(target: Debuggee, text: str) -> str | Callable[[], StopEvent]:
    """Return a command's output, or the function that runs or rewinds the machine for it.

    Raises ValueError, ExpressionError.
    """
    word, _, rest = text.partition(" ")
    machine, history = target.machine, target.history
    if word == "time":
        past = f", {history.end - machine.cycle:,} before the present" if history.is_past else ""
        return f"cycle {machine.cycle:,}, {machine.seconds:.9f} s{past}"
    if word == "threads":
        return "\n".join(f"{one}: {one.state}{_stack(one)}" for one in target.threads()) or "there are no threads"
    if word == "goto":
        cycle = _count(rest)
        return lambda: target.goto(cycle)
    if word == "cycle":
        count = _count(rest or "1")
        return lambda: target.goto(machine.cycle + count)
    if word == "reverse-step":
        return target.reverse_step_into
    if word == "reverse-finish":
        return target.reverse_finish
    if word == "lastwrite":
        frames = target.frames()
        place = evaluate(target.inspector, rest, frames[0] if frames else None)
        at = address_of(place.pieces) if isinstance(place, Value) else None
        if at is None or not isinstance(place, Value):
            raise ValueError(f"{rest} is not in memory")
        size = place.type.bytes
        machine.peek_bytes(at, size)  # raises ValueError for a range that is not all in memory
        return lambda: _last_write(target, at, size)
    return HELP


def _stack(thread: Thread) -> str:
    """Return a thread's stack use as text; empty if the thread has no stack of its own."""
    if thread.stack is None or thread.used is None:
        return ""
    return f", stack {thread.used} of {thread.stack[1] - thread.stack[0]} bytes used"


def _count(text: str) -> int:
    try:
        return int(text.replace(",", ""), 0)
    except ValueError:
        raise ValueError(f"expected a number of cycles, not {text!r}") from None


def _last_write(target: Debuggee, address: int, size: int) -> StopEvent:
    found = target.history.last_write(address, size)
    if found is None:
        return StopEvent("goto", "no instruction of the recording has changed it")
    return StopEvent(
        "goto", f"last write: {found.old.hex()} -> {found.new.hex()} at {target.inspector.where(found.pc)}"
    )
