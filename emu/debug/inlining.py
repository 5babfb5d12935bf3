"""Functions without code of their own: where the compiler inlined them.

Input: debug information. Output: the functions that contain a copy, and a message that says what to do.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from emu.debug.dwarf.units import DebugInfo, Scope

MOST_SHOWN: Final = 4
"""Maximum number of functions that a message names."""
REMEDY: Final = "add __attribute__((noinline)) or build with -fno-inline-functions"


def address_of(debug: DebugInfo, name: str) -> int | None:
    """Return the address of a function's out-of-line copy, by the C name; None if there is none."""
    return next((one.ranges[0][0] for one in debug.functions if one.name == name), None)


def inlined_into(debug: DebugInfo, name: str) -> list[str]:
    """Return the names of the functions into which a function was inlined, in order of address."""
    return list(dict.fromkeys(one.name for one in debug.functions if any(copy.name == name for copy in _copies(one))))


def inlined_entries(debug: DebugInfo, name: str) -> tuple[int, ...]:
    """Return the first program address of each copy of a function that was inlined, ascending.

    A copy without code has no address.
    """
    copies = (copy for one in debug.functions for copy in _copies(one) if copy.name == name)
    return tuple(sorted(copy.ranges[0][0] for copy in copies if copy.ranges))


def inlined_at(debug: DebugInfo, pc: int) -> set[Scope]:
    """Return the copies of inlined functions that contain the instruction at `pc`."""
    function = debug.function(pc)
    return set() if function is None else {scope for scope in function.chain(pc) if scope.kind == "inlined"}


def _copies(scope: Scope) -> Iterator[Scope]:
    """Yield all inlined scopes inside a scope."""
    for inner in scope.inner:
        if inner.kind == "inlined":
            yield inner
        yield from _copies(inner)


def missing_function(debug: DebugInfo, name: str) -> str:
    """Return why a function has no code of its own: `inlined into main; add ...`; empty if it was not inlined."""
    places = inlined_into(debug, name)
    if not places:
        return ""
    more = f" and {len(places) - MOST_SHOWN} more" if len(places) > MOST_SHOWN else ""
    return f"inlined into {', '.join(places[:MOST_SHOWN])}{more}; {REMEDY}"
