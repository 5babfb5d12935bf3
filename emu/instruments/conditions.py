"""Runs until a C condition holds, with the condition compiled to native code where possible.

Input: a machine, its inspector, a condition. Output: the stop. A condition at a place is the filter of a hook
(emu/debug/expressions/condition_filters.py). A condition without a place is compared after each store to its variables.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from emu.debug.dwarf.location import Unavailable
from emu.debug.expressions.condition_filters import filter_of
from emu.debug.expressions.expression import ExpressionError, evaluate, number_of
from emu.dspic30f.change_log import Entries, WatchedNumber
from emu.instruments.changes import is_in_ram, log_changes

if TYPE_CHECKING:
    from emu.debug.frame import Frame
    from emu.debug.inspector import Inspector
    from emu.machine.machine import Machine
    from emu.machine.stops import Stop
    from emu.system.hook_filters import Filter


def run_to_place(machine: Machine, inspector: Inspector, address: int, condition: str, limit: int) -> Stop:
    """Run to the next arrival at a program address at which `condition` holds, at most to cycle `limit`.

    Raises `ExpressionError`, a ValueError, for a condition that is invalid there.
    """

    def holds() -> bool:
        frames = inspector.frames()
        return _holds(inspector, condition, frames[0] if frames else None)

    return machine.run_to(address, limit, holds, filter_of(inspector, condition, address))


def run_until(machine: Machine, inspector: Inspector, condition: str, limit: int) -> Stop:
    """Run to the first instruction after which `condition` holds, at most to cycle `limit`.

    It may name what is known everywhere: globals and registers, but no locals. Raises `ExpressionError`, a ValueError,
    for an invalid condition.
    """

    def holds() -> bool:
        return _holds(inspector, condition, None)

    holds()
    found = filter_of(inspector, condition)
    if found is None or not all(one.base is None and is_in_ram(machine, one.address, one.size) for one in found):
        return machine.step_until(holds, limit)
    stop = machine.step_until(holds, min(limit, machine.cycle + 1))
    if stop.reason != "limit" or machine.cycle >= limit:
        return stop
    return _run_until_change(machine, found, holds, limit)


def _holds(inspector: Inspector, condition: str, frame: Frame | None) -> bool:
    """Whether a condition holds in a frame. Raises ExpressionError, also for a variable that has no value there."""
    try:
        return bool(number_of(evaluate(inspector, condition, frame)))
    except Unavailable as error:
        raise ExpressionError(f"{condition!r}: {error}") from None


def _run_until_change(machine: Machine, filter_: Filter, holds: Callable[[], bool], limit: int) -> Stop:
    """Run to the first change after which a condition on variables holds, at most to cycle `limit`."""
    is_met = False

    def look(_changes: Entries) -> None:
        nonlocal is_met
        if not is_met and holds():
            is_met = True
            machine.interrupt()

    watched = dict.fromkeys(WatchedNumber(one.address, one.size) for one in filter_)
    end = log_changes(machine, tuple(watched), look, filter_)
    try:
        stop = machine.advance(limit)
    finally:
        end()
    if is_met and (stop is None or stop.reason == "interrupted"):
        return machine.stopped("until")
    return stop or machine.stopped("limit")
