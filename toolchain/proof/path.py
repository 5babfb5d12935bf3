"""One path of a function: its observable events, and its conditions."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

from toolchain.ir.model import ParameterAttributes, Value
from toolchain.proof.asm_statements import Shape
from toolchain.proof.memory import SymbolicMemory
from toolchain.proof.terms import Term


@dataclass
class Event:
    """An observable event: a volatile access, a call, or an assembly statement.

    kind   read, write, call or asm
    value  the value read or written; for a call its result; for assembly its outputs
    """

    kind: str
    address: Any = None
    """16-bit term of an access or a call through a pointer; name of a direct call; text of an assembly statement."""
    size: int = 0
    value: Any = None
    arguments: list[tuple[Value, Any, ParameterAttributes]] = field(default_factory=list)
    named_arguments: int | None = None
    memory: SymbolicMemory | None = None
    """Memory at the event, None if stores may be moved across it; calls and compiler barriers forbid that."""
    movable_stores: tuple[tuple[Term, Term], ...] = ()
    """Stores, by address and value, that may be executed before or after the event."""
    aligned: bool = False
    """Whether the words of an access are at even addresses."""
    shape: Shape | None = None
    """Constraints of an assembly statement, whose inputs are in `arguments`."""
    is_tail_call: bool = False
    """Whether a call does not access the caller's variables."""
    memory_after: Any = None
    """Unknown array of the memory after the event, if the event lets other code write."""


@dataclass
class Path:
    """A path of the source up to the current instruction."""

    memory: SymbolicMemory
    values: dict[int, Any] = field(default_factory=dict)
    branch_conditions: list[Term] = field(default_factory=list)
    """Conditions of the branches taken."""
    assumptions: list[Term] = field(default_factory=list)
    """Assumptions that exclude undefined behaviour."""
    preferences: list[Term] = field(default_factory=list)
    """Conditions preferred for readable counterexamples, such as pointers into RAM."""
    events: list[Event] = field(default_factory=list)
    visits: dict[str, int] = field(default_factory=dict)
    forks: dict[str, int] = field(default_factory=dict)
    behind_barrier: bool = False
    """Whether the last point that stores may not cross was a compiler barrier."""
    pending_stores: list[tuple[Term, Term]] = field(default_factory=list)
    """Stores since that point, as (address, value)."""
    movable_events: list[tuple[int, SymbolicMemory]] = field(default_factory=list)
    """Events since that point: (number of the event, memory at the event)."""
    result: Any = None
    end_kind: str = ""
    """Kind of the path's end: ret, unreachable, or loop (at a loop head)."""
    head: str = ""
    """Loop head at which the path ends."""
    loop_visits: list[tuple[str, dict[int, Any], int]] = field(default_factory=list)
    """Visits of watched blocks: block, all values, and number of preceding events."""

    def copy(self) -> Path:
        """Return an independent copy."""
        return Path(
            self.memory.copy(), dict(self.values), [*self.branch_conditions], [*self.assumptions], [*self.preferences],
            [*self.events], dict(self.visits), dict(self.forks), self.behind_barrier, [*self.pending_stores],
            [*self.movable_events], loop_visits=[*self.loop_visits],
        )  # fmt: skip

    def write(self, address: Term, value: Term) -> None:
        """Execute a store, which may move between the previous and the next barrier."""
        self.memory.write(address, value)
        self.pending_stores.append((address, value))

    def record_event(self, event: Event) -> None:
        """Record an event that stores may cross."""
        self.movable_events.append((len(self.events), self.memory.copy()))
        self.events.append(event)

    def fix_store_order(self, barrier: bool) -> None:
        """Record a point that no store may cross.

        If this point or the previous one is a compiler barrier, memory is known at the events between both points:
        stores before the previous point have been executed, stores after this one have not.
        """
        if barrier or self.behind_barrier:
            for number, memory in self.movable_events:
                self.events[number] = replace(
                    self.events[number], memory=memory, movable_stores=tuple(self.pending_stores)
                )
        self.behind_barrier = barrier
        self.pending_stores, self.movable_events = [], []

    @property
    def conditions(self) -> list[Term]:
        """All conditions of the path."""
        return self.branch_conditions + self.assumptions
