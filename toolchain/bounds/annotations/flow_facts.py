"""Flow facts: statements of annotations about loops, calls and stack switches, as queries of the abstract execution."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Final

from toolchain.bounds.abstract.state import AbstractState
from toolchain.bounds.graph import FunctionGraph, Loop

VARIABLE_FRAME: Final = "allocates an unknown number of bytes on the stack (alloca, array of variable length)"
STACK_GROWS: Final = "the stack grows in this loop"
UNKNOWN_RETURN: Final = "returns to an unknown address (longjmp, stack switch)"
UNBALANCED_RETURN: Final = "returns with another stack depth than at its entry"
UNBOUNDED_LOOP: Final = "this loop has no known bound"
LONG_LOOP: Final = "this loop has more than 5,000 iterations; annotate their number (LOOP_BOUND)"
MERGED_LOOPS: Final = "this loop has several back edges: it may be two loops of the source (ONE_LOOP)"
BUDGET_EXCEEDED: Final = "too many paths: the analysis stopped; bound its loops"
CALLS_TOO_DEEP: Final = "calls are nested more than 480 deep"
DO_LOOP_CUT_SHORT: Final = "ends a DO loop early (CORCON.EDT) that begins elsewhere"
DO_REGISTER_WRITTEN: Final = "writes a register of the DO loop it is in (DCOUNT, DOSTART, DOEND)"
STACK_POINTER_OVERWRITTEN: Final = "may store to W15 through an unknown address, after which the stack is unknown"
JUMP_PAST_TABLE: Final = "this jump may lead past the end of its table of BRA or RETLW"
WAITS_FOR_INTERRUPT: Final = "waits for an interrupt (PWRSAV) for an unknown time"
CLOCK_STOPPED: Final = "stops the clock (PWRSAV #0): the waiting time and the oscillator start-up time are unknown"
DO_LOOPS_TOO_DEEP: Final = "a third nested DO loop: only two have registers (isa.md §7.6)"
SPECIAL_ADDRESSING: Final = "enables modulo or bit-reversed addressing, which is not analysed"
IRREGULAR_DO_LOOP: Final = "a DO loop is entered by a branch, or a DO loop within it is left by a branch"
DO_LOOP_ENDS_WITH_JUMP: Final = "a DO loop ends with a branch, call or return"
NOT_ANALYSED: Final = "the annotation file states only the stack depth of the called function"
JUMP_WITHOUT_TABLE: Final = "no table of BRA or RETLW follows this jump"
STACK_STILL_BOUNDED: Final = frozenset(
    (UNBOUNDED_LOOP, LONG_LOOP, MERGED_LOOPS, WAITS_FOR_INTERRUPT, CLOCK_STOPPED, NOT_ANALYSED)
)
"""Reasons that leave the stack bounded: the loop has been executed until its state reached a fixpoint."""


@dataclass(slots=True)
class FlowFacts:
    """Queries of the abstract execution about annotations; the defaults are those of a program without annotations."""

    loop_bound: Callable[[FunctionGraph, Loop], int | None] = lambda _code, _loop: None
    """Greatest number of iterations of a loop per entry, not counting the first."""
    total_iterations: Callable[[FunctionGraph, Loop], int | None] = lambda _code, _loop: None
    """Greatest number of iterations of a loop over all its entries."""
    shared_iterations: Callable[[FunctionGraph, Loop], dict[int, tuple[str, int]]] = lambda _code, _loop: {}
    """By function: annotation text common to several loops, and the iterations that they share in one call of it."""
    sharing_scopes: frozenset[int] = frozenset()
    """Functions that shared loop bounds and call counts refer to."""
    merged_loops: Callable[[FunctionGraph], set[int]] = lambda _code: set()
    """Heads of loops that are merged with the enclosing loop."""
    call_targets: Callable[[int, AbstractState], list[int] | None] = lambda _pc, _state: None
    """Targets of a call through a pointer with an unknown value."""
    is_single_loop: Callable[[FunctionGraph, Loop], bool] = lambda _code, _loop: True
    """Whether a loop is a single loop of the source, so that its annotations apply."""
    call_counts: Callable[[int, int], dict[int, tuple[str, int]]] = lambda _pc, _target: {}
    """By function: source call of the call at an address, and how often one call of the function makes it."""
    is_never_called: Callable[[int, int], bool] = lambda _pc, _target: False
    """Whether the call of a function at an address is excluded."""
    excluded: frozenset[int] = frozenset()
    """Functions that are assumed not to be called: paths into them are ignored."""
    recursion_depths: Mapping[int, int] = field(default_factory=dict)
    """By function: greatest number of simultaneous activations."""
    stack_depths: Mapping[int, int] = field(default_factory=dict)
    """By function that is not analysed: bytes of stack that it and its callees use."""
    resume_points: Callable[[], list[int]] = list
    """Functions in which execution continues after a switch to the stack of another thread."""
    switches_stack: Callable[[int], bool] = lambda _entry: False
    """Whether a function that returns with an unknown W15 has switched stacks."""
    return_level: Callable[[int], int | None] = lambda _entry: None
    """CPU priority at which a function that switches stacks returns, None for other functions."""
