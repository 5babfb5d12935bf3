"""Commands for breakpoints, watchpoints and log messages."""

from __future__ import annotations

import re
from typing import Final

from emu.prompt.client import CommandRefusedError
from emu.prompt.command_table import command
from emu.prompt.session import DebugSession

IF: Final = re.compile(r"(?:^|\s+)if\s+")


def _break(session: DebugSession, text: str, is_temporary: bool, **more: str) -> None:
    location, condition, *_ = [*IF.split(text, maxsplit=1), ""]
    kind, row = session.location(location.strip())
    row |= more | ({"condition": condition} if condition else {})
    session.write(f"breakpoint {session.breakpoints.add(kind, row, location.strip(), is_temporary)}")


@command("break LOCATION [if CONDITION]", "stop at FUNCTION, LINE, FILE:LINE or *ADDRESS", "b")
def break_(session: DebugSession, text: str) -> None:
    _break(session, text, is_temporary=False)


@command("tbreak LOCATION [if CONDITION]", "stop there once", "tb")
def tbreak_(session: DebugSession, text: str) -> None:
    _break(session, text, is_temporary=True)


@command("log LOCATION TEXT", "print TEXT with the values of {expressions} there, and continue", "dprintf")
def log_(session: DebugSession, text: str) -> None:
    location, _, message = text.partition(" ")
    if not message:
        raise CommandRefusedError("expected LOCATION TEXT")
    _break(session, location, is_temporary=False, logMessage=message.strip())


def _watch(session: DebugSession, text: str, access: str) -> None:
    location, condition, *_ = [*IF.split(text, maxsplit=1), ""]
    session.evaluate(location)
    frame = {"frameId": session.frame["id"]} if session.frame is not None else {}
    found = session.client.ask("dataBreakpointInfo", name=location, **frame)
    if found["dataId"] is None:
        raise CommandRefusedError(f"{location}: {found['description']}")
    row = {"dataId": found["dataId"], "accessType": access} | ({"condition": condition} if condition else {})
    session.write(f"watchpoint {session.breakpoints.add('data', row, found['description'])}")


@command("watch PLACE [if CONDITION]", "stop at a write to PLACE")
def watch_(session: DebugSession, text: str) -> None:
    _watch(session, text, "write")


@command("rwatch PLACE [if CONDITION]", "stop at a read of PLACE")
def rwatch_(session: DebugSession, text: str) -> None:
    _watch(session, text, "read")


@command("awatch PLACE [if CONDITION]", "stop at a read or a write of PLACE")
def awatch_(session: DebugSession, text: str) -> None:
    _watch(session, text, "readWrite")


def _change_attribute(session: DebugSession, text: str, name: str) -> None:
    number, _, value = text.partition(" ")
    point = session.breakpoints.find(number)
    before = dict(point.row)
    point.row[name] = value.strip()
    session.breakpoints.send([point.list])
    if not point.facts["verified"]:
        problem, point.row = point.facts["message"], before
        session.breakpoints.send([point.list])
        raise CommandRefusedError(problem)
    session.write(f"breakpoint {point}")


@command("condition NUMBER [EXPRESSION]", "set or remove the condition of a breakpoint", "cond")
def condition_(session: DebugSession, text: str) -> None:
    _change_attribute(session, text, "condition")


@command("hits NUMBER [N, >=N, %N, ...]", "stop only at the given hits of a breakpoint", "ignore")
def hits_(session: DebugSession, text: str) -> None:
    _change_attribute(session, text, "hitCondition")


def _switch(session: DebugSession, text: str, is_enabled: bool) -> None:
    chosen = [session.breakpoints.find(one) for one in text.split()] or list(session.breakpoints.all)
    for one in chosen:
        one.is_enabled = is_enabled
    session.breakpoints.send(one.list for one in chosen)


@command("enable [NUMBER ...]", "enable breakpoints (default: all)")
def enable_(session: DebugSession, text: str) -> None:
    _switch(session, text, True)


@command("disable [NUMBER ...]", "disable breakpoints (default: all)")
def disable_(session: DebugSession, text: str) -> None:
    _switch(session, text, False)


@command("delete [NUMBER ...]", "delete breakpoints (default: all)", "d")
def delete_(session: DebugSession, text: str) -> None:
    session.breakpoints.delete([session.breakpoints.find(one) for one in text.split()] or list(session.breakpoints.all))
