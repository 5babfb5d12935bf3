"""A trial with a debugger on one of its robots, in a process of its own that can be copied: the moments of it.

In: a plan, messages of the Debug Adapter Protocol on a line. Out: answers and, between them, lines to copies of this
process, asleep at moments to which the whole trial can go back (moments.py). Whoever holds the other end
(debugsession.py) keeps them; a copy that is woken goes on with what the session has left to it, and this process ends.
"""

from __future__ import annotations

import os
import signal
import socket
from collections import deque
from contextlib import suppress
from pathlib import Path
from queue import SimpleQueue
from typing import Any, Final

from arena.campaign.campaign import Plan, run_one
from arena.debug.controlled_robot import AnewError, Debugged
from arena.scene.loader import FCY
from arena.trial.checkpoints import CAN_COPY, Copies, GoneError, Line
from emu.dap.server import Server
from emu.dap.wire import Message
from emu.debug.environment import WokenError
from emu.machine.machine import Machine

NEAR: Final = FCY // 10
"""Cycles before the time to which the trial goes back: a moment is kept there, so that the next step back is quick."""
OF_ONE_ROBOT: Final = ("board", "selector", "camera", "engine", "strict")
"""Launch arguments that `emu debug` has and a trial has not."""


class _Inbox(SimpleQueue[Message | None]):
    """Messages that come along a line."""

    def __init__(self, line: Line) -> None:
        self.line = line
        self.taken = 0
        """Messages that have been taken out so far."""
        self._untaken: deque[Message | None] = deque()

    def empty(self) -> bool:
        return not self._untaken and not self.line.is_ready(0)

    def get(self, block: bool = True, timeout: float | None = None) -> Message | None:
        if self.empty():
            self.line.send(("waits", self.taken))
        message: Message | None = self._untaken.popleft() if self._untaken else self.line.receive()[0]
        self.taken += 1
        return message

    def decision(self) -> Any:
        """What is told next that is no message; those wait."""
        while not isinstance(told := self.line.receive()[0], tuple):
            self._untaken.append(told)
        return told

    def left(self) -> list[Message | None]:
        """Those that wait."""
        return [*self._untaken]


class _Channel:
    """What the server talks over."""

    def __init__(self, line: Line) -> None:
        self.inbox: Final = _Inbox(line)

    def send(self, message: Message) -> None:
        """To the client."""
        self.inbox.line.send(("says", message))


class Kept(Debugged):
    """Robot number `robot` of a trial, debugged by who is at the other end of `line`."""

    def __init__(self, robot: int, line: Line, is_recorded: bool, every_s: float) -> None:
        super().__init__(robot, lambda _debugged: self._serve(), keeps=is_recorded)
        self.channel: Final = _Channel(line)
        self._every: Final = every_s * FCY
        self._copies: Final = Copies()
        self._kept_at: int | None = None
        """Cycle of the robot at the last moment that was kept."""

    def tell(self, *what: Any, end: Line | None = None) -> None:
        """To the other end. Raises GoneError."""
        self.channel.inbox.line.send(what, end)

    def _serve(self) -> bool:
        self.tell("ready")
        server = Server(self.channel, self._launched, self.record)
        server.serve()
        self.tell("left")
        return self.keeps and not server.ends_all

    def _launched(self, arguments: dict[str, Any]) -> Machine:
        for name in OF_ONE_ROBOT:
            if name in arguments:
                raise ValueError(f"`{name}` is for a robot alone; in a swarm the scene says it: --set KEY=VALUE")
        return self.machine

    @property
    def keeps_moments(self) -> bool:
        """As `Around.keeps_moments`."""
        return CAN_COPY

    def pass_by(self, near: int | None = None) -> None:
        """As `Around.pass_by`. Once the trial is over nothing more is kept: its end is near."""
        cycle, last = self.machine.cycle, self._kept_at
        is_due = last is None or cycle - last >= self._every
        if near is not None and last is not None and not is_due:
            is_due = near - cycle <= NEAR < (cycle - last) // 2
        if is_due and CAN_COPY and not self.is_over:
            self._kept_at = cycle
            self._keep()

    def anew(self, cycle: int, left: Any) -> Machine:
        """A copy of this process takes over, if there is one; otherwise the trial begins again."""
        inbox = self.channel.inbox
        self.tell("back", cycle, inbox.taken)
        (is_woken,) = inbox.decision()
        if is_woken:
            self.tell("leaves", left, inbox.left())
            os._exit(0)
        self._kept_at = None
        return super().anew(cycle, left)

    def _keep(self) -> None:
        """Copy this process. In the copy, sleep until it is told to copy itself or go on: then WokenError is raised."""
        line, is_copy = self._copied()
        if not is_copy:
            if line is not None:
                self.tell("kept", self.machine.cycle, end=line)
                line.drop()
            return
        assert line is not None
        self.channel.inbox.line.drop()
        try:
            while True:
                word, *told = line.receive()[0]
                if word == "go on":
                    break
                again, is_copy = self._copied()
                if is_copy:
                    assert again is not None
                    line.drop()
                    line = again
                    continue
                line.send(again is not None, again)
                if again is not None:
                    again.drop()
        except GoneError:
            os._exit(0)  # nobody will go back to here; what this process would clean up is not its own
        left, self.channel.inbox.taken = told
        self.channel.inbox.line = line
        raise WokenError(left)

    def _copied(self) -> tuple[Line | None, bool]:
        try:
            return self._copies.make()
        except OSError:
            return None, False


def serve(end: socket.socket, plan: Plan, robot: int, folder: Path, is_recorded: bool, every_s: float) -> None:
    """Run `plan`'s trial into `folder`, one of its robots in the hands of who is at the other end of a line. The last
    that is told is what it raised, or that it is over."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for who debugs
    debugged = Kept(robot, Line(end), is_recorded, every_s)
    with suppress(GoneError):
        try:
            debugged.tell("over", *_ran(debugged, plan, folder))
        except GoneError:
            raise
        except Exception as error:
            debugged.tell("failed", error)
    os._exit(0)  # what a copy would clean up is not its own


def _ran(debugged: Kept, plan: Plan, folder: Path) -> tuple[bool, bool]:
    """Run it until it is over and the debugger has left; whether something happened to a robot, and whether the
    debugger has ever had its own."""

    def progress(_trial: int, _seconds: float) -> None:
        if debugged.is_left:
            debugged.tell("lives")  # to notice that nobody waits for it any more

    while True:
        try:
            done = run_one(plan, 1, folder, progress, meet=debugged.meet)
            debugged.tell("recorded", done)
            return bool(done.faults), debugged.over()
        except AnewError:
            continue
