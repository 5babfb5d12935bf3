"""A trial in a process of its own, told by others what to do, and the moments of it that are kept to go back to.

In: a plan, a seed, and what is asked for (`ask` from any thread): methods of `InHand`. Back means: wake the copy of the
process that sleeps at the latest moment before, and let it do again what is missing; without one, from the seed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from threading import Lock
from typing import Any, Final, NamedTuple

from arena.campaign.campaign import Plan
from arena.studio.session import RefusedError, serve
from arena.trial.checkpoints import PATIENCE_S, GoneError, Line, Moment, Moments, context, line


class Call(NamedTuple):
    """A method of `InHand` that is wanted, and its arguments."""

    name: str
    arguments: tuple[Any, ...] = ()
    named: Mapping[str, Any] = {}


class Reply(NamedTuple):
    """What came of some calls, and when that was."""

    results: list[Any]
    end: Line | None
    tick: int
    seconds: float
    may_keep: bool


class Studio:
    """`plan`'s trial number `seed`, standing at its beginning. `close` ends it.

    Raises what making the trial raises: SceneError, emu.LoadError.
    """

    def __init__(self, plan: Plan, seed: int) -> None:
        self._lock: Final = Lock()
        self._moments: Final = Moments()
        self._line, there = line()
        self._process: Final = context().Process(target=serve, args=(there.end, plan, seed), daemon=True)
        self._process.start()
        there.drop()
        self._heard(self._line)

    def ask(self, name: str, *arguments: Any, **named: Any) -> Any:
        """The result of a method of `InHand`, at the next moment at which the world stands between two quanta, or one
        of its robots at a breakpoint. Raises what it raises, RefusedError if the studio is closed."""
        return self.ask_all(Call(name, arguments, named))[0]

    def ask_all(self, *calls: Call) -> list[Any]:
        """The results of some, between which nothing else happens."""
        with self._lock:
            try:
                reply = (calls[0].name == "back" and self._woken(calls)) or self._told(self._line, calls)
                if reply.may_keep and self._moments.is_due(reply.seconds):
                    self._keep()
            except GoneError:
                raise RefusedError("the studio is closed") from None
            return reply.results

    def close(self) -> None:
        """End the trial."""
        with self._lock:
            self._moments.forget(-1)
            self._line.close()
            self._process.join(PATIENCE_S)

    @property
    def kept(self) -> int:
        """Moments that can be gone back to at once."""
        return len(self._moments)

    def _told(self, to: Line, calls: Sequence[Call]) -> Reply:
        to.send([tuple(call) for call in calls])
        return self._heard(to)

    def _heard(self, whom: Line) -> Reply:
        (error, *about), end = whom.receive()
        if error is not None:
            raise error
        return Reply(about[0], end, *about[1])

    def _keep(self) -> None:
        reply = self._told(self._line, [Call("keep")])
        if reply.end is not None:
            self._moments.add(Moment(reply.tick, reply.seconds, reply.end))

    def _woken(self, calls: Sequence[Call]) -> Reply | None:
        """What comes of calls that begin with `back`, if a moment before is kept; none: they are yet to be done."""
        goal = (*calls[0].arguments, *calls[0].named.values())[0]
        (state,) = self._told(self._line, [Call("leave", (goal,))]).results
        if state is None:
            return None  # it is yet to come
        self._moments.forget(goal)
        while (moment := self._moments.before(goal)) is not None:
            self._moments.pop(moment)
            with suppress(GoneError):
                again = self._told(moment.line, [Call("keep", (state,))])
                break
        else:
            return None
        left, self._line = self._line, moment.line
        left.close()
        if again.end is not None:
            self._moments.add(moment._replace(line=again.end))
        reply = self._told(self._line, calls[1:])
        return reply._replace(results=[None, *reply.results])
