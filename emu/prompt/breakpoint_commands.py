"""Commands for breakpoints, watchpoints and log messages."""

from __future__ import annotations

import re
from typing import Final

from emu.prompt.client import RefusedError
from emu.prompt.session import Session
from emu.prompt.table import command

IF: Final = re.compile(r"(?:^|\s+)if\s+")


def _break(session: Session, text: str, is_temporary: bool, **more: str) -> None:
    place, condition, *_ = [*IF.split(text, maxsplit=1), ""]
    kind, row = session.place(place.strip())
    row |= more | ({"condition": condition} if condition else {})
    session.write(f"breakpoint {session.points.add(kind, row, place.strip(), is_temporary)}")


@command("break LOCATION [if CONDITION]", "stop at FUNCTION, LINE, FILE:LINE or *ADDRESS", "b")
def break_(session: Session, text: str) -> None:
    _break(session, text, is_temporary=False)


@command("tbreak LOCATION [if CONDITION]", "the same, once", "tb")
def tbreak_(session: Session, text: str) -> None:
    _break(session, text, is_temporary=True)


@command("log LOCATION TEXT", "print TEXT with the values of {expressions} there, and go on", "dprintf")
def log_(session: Session, text: str) -> None:
    place, _, message = text.partition(" ")
    if not message:
        raise RefusedError("expected LOCATION TEXT")
    _break(session, place, is_temporary=False, logMessage=message.strip())


def _watch(session: Session, text: str, access: str) -> None:
    place, condition, *_ = [*IF.split(text, maxsplit=1), ""]
    session.evaluated(place)
    frame = {"frameId": session.frame["id"]} if session.frame is not None else {}
    found = session.client.ask("dataBreakpointInfo", name=place, **frame)
    if found["dataId"] is None:
        raise RefusedError(f"{place}: {found['description']}")
    row = {"dataId": found["dataId"], "accessType": access} | ({"condition": condition} if condition else {})
    session.write(f"watchpoint {session.points.add('data', row, found['description'])}")


@command("watch PLACE [if CONDITION]", "stop when something writes to it")
def watch_(session: Session, text: str) -> None:
    _watch(session, text, "write")


@command("rwatch PLACE [if CONDITION]", "stop when something reads it")
def rwatch_(session: Session, text: str) -> None:
    _watch(session, text, "read")


@command("awatch PLACE [if CONDITION]", "stop at either")
def awatch_(session: Session, text: str) -> None:
    _watch(session, text, "readWrite")


def _amend(session: Session, text: str, name: str) -> None:
    number, _, value = text.partition(" ")
    point = session.points.numbered(number)
    before = dict(point.row)
    point.row[name] = value.strip()
    session.points.tell([point.list])
    if not point.facts["verified"]:
        problem, point.row = point.facts["message"], before
        session.points.tell([point.list])
        raise RefusedError(problem)
    session.write(f"breakpoint {point}")


@command("condition NUMBER [EXPRESSION]", "stop there only if it is true; without one, always", "cond")
def condition_(session: Session, text: str) -> None:
    _amend(session, text, "condition")


@command("hits NUMBER [N, >=N, %N, ...]", "stop there only at those of its hits", "ignore")
def hits_(session: Session, text: str) -> None:
    _amend(session, text, "hitCondition")


def _switch(session: Session, text: str, is_on: bool) -> None:
    chosen = [session.points.numbered(one) for one in text.split()] or list(session.points.all)
    for one in chosen:
        one.is_on = is_on
    session.points.tell(one.list for one in chosen)


@command("enable [NUMBER ...]", "let breakpoints stop again, all without a number")
def enable_(session: Session, text: str) -> None:
    _switch(session, text, True)


@command("disable [NUMBER ...]", "let them pass")
def disable_(session: Session, text: str) -> None:
    _switch(session, text, False)


@command("delete [NUMBER ...]", "forget them", "d")
def delete_(session: Session, text: str) -> None:
    session.points.drop([session.points.numbered(one) for one in text.split()] or list(session.points.all))
