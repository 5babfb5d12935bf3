"""Commands that let the machine go: forward, back, to a time."""

from __future__ import annotations

from emu.prompt.client import RefusedError
from emu.prompt.session import Session
from emu.prompt.table import command

FINE = {"granularity": "instruction"}


def _times(text: str) -> int:
    if text and (not text.isdecimal() or not int(text)):
        raise RefusedError(f"expected how many times, not {text!r}")
    return int(text or "1")


def _repeat(session: Session, text: str, request: str, **more: str) -> None:
    """Let it go some times, until something else than a step stops it."""
    for _ in range(_times(text)):
        if session.go(request, **more) != "step":
            return


@command("run", "from the reset, until something stops it", "r")
def run_(session: Session, _text: str) -> None:
    if session.has_gone:
        session.go("restart")
    session.go("continue")


@command("continue [N]", "go on until something stops it, N times", "c", repeats=True)
def continue_(session: Session, text: str) -> None:
    for _ in range(_times(text)):
        session.go("continue")
        if session.at_fault:
            return


@command("step [N]", "to the next line, into functions", "s", repeats=True)
def step_(session: Session, text: str) -> None:
    _repeat(session, text, "stepIn")


@command("next [N]", "to the next line, over functions", "n", repeats=True)
def next_(session: Session, text: str) -> None:
    _repeat(session, text, "next")


@command("stepi [N]", "one instruction", "si", repeats=True)
def stepi_(session: Session, text: str) -> None:
    _repeat(session, text, "stepIn", **FINE)


@command("nexti [N]", "one instruction, calls and interrupts as a whole", "ni", repeats=True)
def nexti_(session: Session, text: str) -> None:
    _repeat(session, text, "next", **FINE)


@command("finish", "to where this function goes back to", "fin", repeats=True)
def finish_(session: Session, _text: str) -> None:
    session.go("stepOut")


@command("until LOCATION", "go on to there, once", "advance")
def until_(session: Session, text: str) -> None:
    kind, row = session.place(text)
    point = session.points.add(kind, row, text, is_temporary=True)
    try:
        session.go("continue")
    finally:
        if point in session.points.all:
            session.points.drop([point])


@command("cycle [N]", "run for N cycles, one without a number", repeats=True)
def cycle_(session: Session, text: str) -> None:
    session.console(f"/cycle {text}".rstrip())


@command("goto CYCLE", "to a cycle of the recording, or on to one behind it")
def goto_(session: Session, text: str) -> None:
    session.console(f"/goto {text}")


@command("lastwrite PLACE", "back to the instruction that changed it last", "lw")
def lastwrite_(session: Session, text: str) -> None:
    session.console(f"/lastwrite {text}")


@command("reverse-continue", "back to the last breakpoint, or write to a watchpoint", "rc", repeats=True)
def reverse_continue_(session: Session, _text: str) -> None:
    session.go("reverseContinue")


@command("reverse-next [N]", "back to the line before, in this function or its caller", "rn", repeats=True)
def reverse_next_(session: Session, text: str) -> None:
    _repeat(session, text, "stepBack")


@command("reverse-step [N]", "back to the line before, into functions from their end", "rs", repeats=True)
def reverse_step_(session: Session, text: str) -> None:
    for _ in range(_times(text)):
        session.console("/reverse-step")


@command("reverse-stepi [N]", "back by one instruction", "rsi", repeats=True)
def reverse_stepi_(session: Session, text: str) -> None:
    _repeat(session, text, "stepBack", **FINE)


@command("reverse-finish", "back to the call of this function, or to before the interrupt", "rf", repeats=True)
def reverse_finish_(session: Session, _text: str) -> None:
    session.console("/reverse-finish")


@command("restart", "back to where the recording began")
def restart_(session: Session, _text: str) -> None:
    session.go("restart")


@command("quit", "end, and what is being debugged with it", "q", "exit")
def quit_(session: Session, _text: str) -> None:
    session.leave(ends_all=True)


@command("detach", "end; a trial that is recorded goes on without the debugger")
def detach_(session: Session, _text: str) -> None:
    session.leave(ends_all=False)
