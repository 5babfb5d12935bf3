"""Commands of a debug console that begin with a slash: time, threads, going somewhere else in time."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from emu.dap.debuggee import Debuggee, Halt
from emu.debug.dwarf.location import address_of
from emu.debug.expressions.expression import evaluate
from emu.debug.inspector import Value
from emu.debug.threads import Thread

WORDS: Final = {
    "time": "              cycle, seconds, how far in the past",
    "goto": " CYCLE        go to a cycle of the recording, or run on to one behind it",
    "cycle": " [N]         run for N cycles, one if N is left out; an instruction is not divided",
    "lastwrite": " PLACE   go back to the instruction that changed a place last",
    "reverse-step": "      go back to the line before, also to the last of a function that has come back",
    "reverse-finish": "    go back to the call of this function, or to before the interrupt",
    "threads": "           OpenSwarm's threads with stack use",
    "world": "             what is around the machine: the other robots of a trial, at this very time",
}
HELP: Final = "an expression of C; NAME = VALUE; or\n" + "".join(f"/{word}{text}\n" for word, text in WORDS.items())


def command(target: Debuggee, text: str) -> str | Callable[[], Halt]:
    """What a command says, or how the machine is to move. Raises ValueError, ExpressionError."""
    word, _, rest = text.partition(" ")
    machine, history = target.machine, target.history
    if word == "time":
        past = f", {history.end - machine.cycle:,} before the present" if history.is_past else ""
        return f"cycle {machine.cycle:,}, {machine.seconds:.9f} s{past}"
    if word == "threads":
        return "\n".join(f"{one}: {one.state}{_stack(one)}" for one in target.threads()) or "there are no threads"
    if word == "goto":
        cycle = _count(rest)
        return lambda: target.go_to(cycle)
    if word == "cycle":
        count = _count(rest or "1")
        return lambda: target.go_to(machine.cycle + count)
    if word == "reverse-step":
        return target.back_into
    if word == "reverse-finish":
        return target.back_out
    if word == "lastwrite":
        frames = target.frames()
        place = evaluate(target.inspector, rest, frames[0] if frames else None)
        at = address_of(place.pieces) if isinstance(place, Value) else None
        if at is None or not isinstance(place, Value):
            raise ValueError(f"{rest} is not in memory")
        size = place.type.bytes
        return lambda: _last_write(target, at, size)
    return HELP


def _stack(thread: Thread) -> str:
    """Its use, if it has a stack of its own."""
    if thread.stack is None or thread.used is None:
        return ""
    return f", stack {thread.used} of {thread.stack[1] - thread.stack[0]} bytes used"


def _count(text: str) -> int:
    try:
        return int(text.replace(",", ""), 0)
    except ValueError:
        raise ValueError(f"expected a number of cycles, not {text!r}") from None


def _last_write(target: Debuggee, address: int, size: int) -> Halt:
    found = target.history.last_write(address, size)
    if found is None:
        return Halt("goto", "nothing has changed it since the recording began")
    return Halt("goto", f"last write: {found.old.hex()} -> {found.new.hex()} at {target.inspector.where(found.pc)}")
