"""Idle and Sleep: passing of time while the CPU is stopped, and wake-up (isa.md §11)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum, auto
from typing import Final

from emu.dspic30f.exceptions.interrupts import Exceptions
from emu.dspic30f.state.state import RUN, SLEEP, State
from emu.system.events import NEVER, Events
from emu.system.rules import Rule

NO_RULE: Final = Rule(None)
DRAIN_CYCLES: Final = 1_000_000
"""Cycles that devices run after the CPU stops without an enabled wake-up source, so that transmitters can drain.

If an event is due later than that, the run ends after exactly these cycles, in slices of any length."""


class Sleeping(Enum):
    """Result of `PowerSaving.pass_time`.

    - ENDED: the CPU runs.
    - GOES_ON: the CPU still sleeps at the limit.
    - FOR_EVER: no source can wake the CPU.
    """

    ENDED = auto()
    GOES_ON = auto()
    FOR_EVER = auto()


@dataclass(slots=True)
class PowerSignals:
    """Signals between the core and the rest of the machine, which the machine connects."""

    clear_watchdog: Callable[[], None] = lambda: None
    power: Callable[[int, int], None] = lambda mode, cycle: None
    """power(mode, cycle): the CPU stops (IDLE, SLEEP) or runs again (RUN) in `cycle`."""
    idle_rule: Rule = NO_RULE
    clrwdt_rule: Rule = NO_RULE
    """Rule for CLRWDT; `idle_rule` is the rule for PWRSAV #1."""
    can_wake: Callable[[], bool] = lambda: False
    """Whether the watchdog can wake a sleeping CPU."""
    restart: Callable[[], int] = lambda: 0
    """Start-up time of the oscillator after Sleep, in Tcy."""
    interrupted: Callable[[], bool] = lambda: False
    """Whether the run must end now even though the CPU may be asleep."""


class PowerSaving:
    """Idle and Sleep of one CPU."""

    def __init__(self, state: State, events: Events, exceptions: Exceptions) -> None:
        self._state: Final = state
        self._events: Final = events
        self._exceptions: Final = exceptions
        self._slept: Final = state.record.reserve("cpu.slept", "Q").index
        self.signals: Final = PowerSignals()

    def stop(self, mode: int, cycle: int) -> None:
        """Stop the CPU after PWRSAV executed in `cycle`. `mode` is IDLE or SLEEP."""
        self._events.arrive(cycle)
        self._state.mode = mode
        self._state.record.u64[self._slept] = cycle
        self.signals.power(mode, cycle + 1)
        self._events.kick()

    def wake(self) -> None:
        """Leave Idle, or Sleep once the oscillator has started, and continue execution."""
        if self._state.mode != RUN:
            if self._state.mode == SLEEP:
                self._state.cycle += self.signals.restart()
            self._state.mode = RUN
            self.signals.power(RUN, self._state.cycle)
            self._events.kick()

    def pass_time(self, limit: int) -> Sleeping:
        """Let time pass until a request wakes the CPU, at most until `limit`.

        UNVERIFIED: the cycle in which the waking flag becomes 1 counts as an instruction's cycle.
        """
        state, events = self._state, self._events
        while True:
            if events.deadline <= state.cycle:
                events.settle(state.cycle)
                since = self._exceptions.waking()
                if since is not None:
                    state.cycle = max(state.cycle, since + 1)
                    self.wake()
                if state.mode == RUN:
                    return Sleeping.ENDED
            if self.signals.interrupted():
                return Sleeping.GOES_ON
            due = events.deadline
            if due < limit:
                due = events.next_due()
            drained = state.record.u64[self._slept] + DRAIN_CYCLES
            is_final = drained < due < NEVER and drained < limit and self._is_final()
            if is_final:
                state.cycle = max(state.cycle, drained)
            if is_final or due == NEVER:
                events.settle(state.cycle)
                return Sleeping.FOR_EVER
            state.cycle = max(state.cycle, min(due, limit))
            if limit <= due:
                return Sleeping.GOES_ON

    def _is_final(self) -> bool:
        """Whether no enabled source can wake the CPU any more."""
        return not self._exceptions.has_enabled_interrupt() and not self.signals.can_wake()
