"""Commands that run, step or rewind the machine."""

from __future__ import annotations

from emu.prompt.client import CommandRefusedError
from emu.prompt.command_table import command
from emu.prompt.session import DebugSession

BY_INSTRUCTION = {"granularity": "instruction"}


def _count(text: str) -> int:
    if text and (not text.isdecimal() or not int(text)):
        raise CommandRefusedError(f"expected a number of repetitions, not {text!r}")
    return int(text or "1")


def _repeat(session: DebugSession, text: str, request: str, **more: str) -> None:
    """Send a step request repeatedly, until the machine stops for another reason."""
    for _ in range(_count(text)):
        if session.resume(request, **more) != "step":
            return


@command("run", "run from the reset to the next stop", "r")
def run_(session: DebugSession, _text: str) -> None:
    if session.has_run:
        session.resume("restart")
    session.resume("continue")


@command("continue [N]", "continue to the next stop, N times", "c", repeats=True)
def continue_(session: DebugSession, text: str) -> None:
    for _ in range(_count(text)):
        session.resume("continue")
        if session.at_fault:
            return


@command("step [N]", "step to the next line, into functions", "s", repeats=True)
def step_(session: DebugSession, text: str) -> None:
    _repeat(session, text, "stepIn")


@command("next [N]", "step to the next line, over functions", "n", repeats=True)
def next_(session: DebugSession, text: str) -> None:
    _repeat(session, text, "next")


@command("stepi [N]", "step one instruction", "si", repeats=True)
def stepi_(session: DebugSession, text: str) -> None:
    _repeat(session, text, "stepIn", **BY_INSTRUCTION)


@command("nexti [N]", "step one instruction, over calls and interrupts", "ni", repeats=True)
def nexti_(session: DebugSession, text: str) -> None:
    _repeat(session, text, "next", **BY_INSTRUCTION)


@command("finish", "run to the return of this function", "fin", repeats=True)
def finish_(session: DebugSession, _text: str) -> None:
    session.resume("stepOut")


@command("until LOCATION", "run to a location, once", "advance")
def until_(session: DebugSession, text: str) -> None:
    kind, row = session.location(text)
    point = session.breakpoints.add(kind, row, text, is_temporary=True)
    try:
        session.resume("continue")
    finally:
        if point in session.breakpoints.all:
            session.breakpoints.delete([point])


@command("cycle [N]", "run for N cycles (default 1)", repeats=True)
def cycle_(session: DebugSession, text: str) -> None:
    session.run_console_command(f"/cycle {text}".rstrip())


@command("goto CYCLE", "go to a cycle of the recording, or run on to a later one")
def goto_(session: DebugSession, text: str) -> None:
    session.run_console_command(f"/goto {text}")


@command("lastwrite PLACE", "go back to the last instruction that changed PLACE", "lw")
def lastwrite_(session: DebugSession, text: str) -> None:
    session.run_console_command(f"/lastwrite {text}")


@command("reverse-continue", "go back to the last breakpoint, or write to a watchpoint", "rc", repeats=True)
def reverse_continue_(session: DebugSession, _text: str) -> None:
    session.resume("reverseContinue")


@command("reverse-next [N]", "go back to the previous line of this function or its caller", "rn", repeats=True)
def reverse_next_(session: DebugSession, text: str) -> None:
    _repeat(session, text, "stepBack")


@command("reverse-step [N]", "go back to the previous line, also of a called function", "rs", repeats=True)
def reverse_step_(session: DebugSession, text: str) -> None:
    for _ in range(_count(text)):
        session.run_console_command("/reverse-step")


@command("reverse-stepi [N]", "go back by one instruction", "rsi", repeats=True)
def reverse_stepi_(session: DebugSession, text: str) -> None:
    _repeat(session, text, "stepBack", **BY_INSTRUCTION)


@command("reverse-finish", "go back to the call of this function, or to before the interrupt", "rf", repeats=True)
def reverse_finish_(session: DebugSession, _text: str) -> None:
    session.run_console_command("/reverse-finish")


@command("restart", "go back to the start of the recording")
def restart_(session: DebugSession, _text: str) -> None:
    session.resume("restart")


@command("quit", "end the session and the debuggee", "q", "exit")
def quit_(session: DebugSession, _text: str) -> None:
    session.disconnect(terminate_debuggee=True)


@command("detach", "end the session; a recorded trial continues without the debugger")
def detach_(session: DebugSession, _text: str) -> None:
    session.disconnect(terminate_debuggee=False)
