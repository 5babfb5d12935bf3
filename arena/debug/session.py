"""A debugged trial as seen by who debugs: its process, the moments of it that are kept, and the messages in between.

Back means: wake the copy of the process that sleeps at the latest moment before, tell it what the session has left, and
talk to it from now on. Without one the trial begins again from its seed, where it is.
"""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from threading import Lock, Thread
from typing import Any, Final

from arena.campaign.campaign import Done, Plan
from arena.debug.server import serve
from arena.scene.loader import FCY
from arena.trial.checkpoints import EVERY_S, PATIENCE_S, GoneError, Moment, Moments, context, line
from arena.trial.record import RecordError
from emu.dap.wire import Channel, Message, Wire

LOOK_S: Final = 0.05
"""For which what the trial says is waited for before it is looked whether the user wants it to stand."""


class Session:
    """`plan`'s trial, recorded in `folder` if `is_recorded`, when its `robot` has got power; or it is over. A
    moment is kept every so many simulated seconds. `close` ends it.

    Raises what making the trial raises: SceneError, emu.LoadError, ValueError for a robot without firmware.
    """

    def __init__(self, plan: Plan, robot: int, folder: Path, is_recorded: bool, every_s: float = EVERY_S) -> None:
        self._lock: Final = Lock()
        self._moments: Final = Moments()
        self._line, there = line()
        arguments = there.end, plan, robot, folder, is_recorded, every_s
        self._process: Final = context().Process(target=serve, args=arguments, daemon=True)
        self._process.start()
        there.drop()
        self._sent = 0
        """Messages of the client so far."""
        self.done: Done | None = None
        """The trial, once it was over for the first time."""
        self.is_over = self.is_left = False
        """The trial has ended for good; nobody debugs it any more."""
        self.has_fault = self.had_robot = False
        """Something happened to a robot; the debugger has had its own."""
        try:
            while not self.is_over and self.hear() != ("ready",):
                pass
        except BaseException:
            self.close()
            raise

    def tell(self, message: Message | None) -> None:
        """What the client says; None if it has gone."""
        with self._lock, suppress(GoneError):
            self._line.send(message)
            self._sent += 1

    def hear(self) -> tuple[Any, ...]:
        """What the trial tells next: a word and what belongs to it. Raises what has ended it, RecordError if its
        process was killed."""
        try:
            told, end = self._line.receive()
            match told:
                case ("kept", cycle):
                    assert end is not None
                    self._moments.add(Moment(cycle, cycle / FCY, end))
                case ("back", cycle, taken):
                    self._back(cycle, taken)
                case ("recorded", done):
                    self.done = self.done or done
                case ("left",):
                    self.is_left = True
                case ("over", has_fault, had_robot):
                    self.is_left = self.is_over = True
                    self.has_fault, self.had_robot = has_fault, had_robot
                case ("failed", error):
                    self.is_left = self.is_over = True
                    raise error
        except GoneError:
            raise RecordError("the process of the trial has ended before it was told to") from None
        return tuple(told)

    def attend(self, wire: Wire) -> None:
        """Carry messages between a client and the trial until the client has left."""

        def carry() -> None:
            while (message := wire.inbox.get()) is not None:
                self.tell(message)
            self.tell(None)

        Thread(target=carry, daemon=True).start()
        while not self.is_left:
            word, *told = self.hear()
            if word == "says":
                wire.send(told[0])

    def finish(self) -> None:
        """Let the trial go on to its end without a debugger."""
        while not self.is_over:
            self.hear()

    def close(self) -> None:
        """End the trial."""
        self._moments.forget(-1)
        self._line.close()
        self._process.join(PATIENCE_S)

    @property
    def process_id(self) -> int:
        """Of the process in which the trial began; it ends when a copy of it takes over."""
        assert self._process.pid is not None
        return self._process.pid

    @property
    def kept(self) -> int:
        """Moments that can be gone back to at once."""
        return len(self._moments)

    def has_taken(self, count: int) -> bool:
        """Whether that is how many messages it was sent."""
        return count == self._sent

    def is_ready(self, wait: float) -> bool:
        """Whether it has something to tell, or has so within so many seconds."""
        return self._line.is_ready(wait)

    def _back(self, cycle: int, taken: int) -> None:
        """It is to go on from a moment before `cycle`, having taken so many messages."""
        self._moments.forget(cycle)
        while (moment := self._moments.before(cycle)) is not None:
            self._moments.pop(moment)
            with suppress(GoneError):
                moment.line.send(("copy",))
                again = moment.line.receive()[1]
                if again is not None:
                    self._moments.add(moment._replace(line=again))
                break
        with self._lock:
            self._line.send((moment is not None,))
            if moment is None:
                return
            (_, left, untaken), _ = self._line.receive()
            gone, self._line = self._line, moment.line
            self._line.send(("go on", left, taken))
            for message in untaken:
                self._line.send(message)
        gone.close()


class Remote:
    """The server of a session's trial, for a client here that waits for its answers (`emu.prompt`)."""

    def __init__(self, session: Session, client: Channel) -> None:
        self._session: Final = session
        self._client: Final = client

    @property
    def is_over(self) -> bool:
        """The client has left."""
        return self._session.is_left

    def answer(self, message: Message) -> None:
        """Respond to one request; comes back when the machine stands again. What the client puts into its inbox
        meanwhile is sent too."""
        session, inbox = self._session, self._client.inbox
        session.tell(message)
        while not session.is_left:
            if not session.is_ready(LOOK_S):
                while not inbox.empty():
                    session.tell(inbox.get())
                continue
            word, *told = session.hear()
            if word == "says":
                self._client.send(told[0])
            elif word == "waits" and session.has_taken(told[0]):
                return

    def leave(self) -> None:
        """It gives the robot back by itself."""
