"""What one way through a function shows the world, and what must hold on it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

from toolchain.ir.model import ParameterAttributes, Value
from toolchain.proof.asm_statements import Shape
from toolchain.proof.memory import Memory
from toolchain.proof.terms import Term


@dataclass
class Event:
    """What the world sees: a volatile access, a call, an assembly statement.

    `kind` read, write, call or asm. `value` is what was read or written, of a call what it gives back, by words.
    """

    kind: str
    address: Any = None
    """Of an access or a call through a pointer a 16-bit term; of another call its name; of assembly its text."""
    size: int = 0
    value: Any = None
    arguments: list[tuple[Value, Any, ParameterAttributes]] = field(default_factory=list)
    named: int | None = None
    memory: Memory | None = None
    """What must have been written before: of a call, and next to a barrier of the compiler."""
    loose: tuple[tuple[Term, Term], ...] = ()
    """Stores, by address and value, that may stand before or behind it."""
    even: bool = False
    """Of an access: words of it lie at even addresses."""
    shape: Shape | None = None
    """Of an assembly statement: its constraints. Its arguments are the inputs."""
    tail: bool = False
    """Of a call: it does not use the caller's variables."""
    after: Any = None
    """The array behind it, where others may have written."""


@dataclass
class Path:
    """One way through the function, up to now."""

    memory: Memory
    values: dict[int, Any] = field(default_factory=dict)
    taken: list[Term] = field(default_factory=list)
    """Conditions of its branches."""
    assumed: list[Term] = field(default_factory=list)
    """What must hold for it to mean anything."""
    preferred: list[Term] = field(default_factory=list)
    """What would be usual for it: pointers lead into RAM. An example of an input shows more so."""
    events: list[Event] = field(default_factory=list)
    visits: dict[str, int] = field(default_factory=dict)
    forks: dict[str, int] = field(default_factory=dict)
    behind_barrier: bool = False
    """Whether a barrier of the compiler was the last that stores may not be moved over,"""
    stored: list[tuple[Term, Term]] = field(default_factory=list)
    """the stores since,"""
    passed: list[tuple[int, Memory]] = field(default_factory=list)
    """and the events since, by number, with memory then."""
    result: Any = None
    ended: str = ""
    """ret, unreachable, or loop: at the first block of one,"""
    head: str = ""
    """which is this."""
    heads: list[tuple[str, dict[int, Any], int]] = field(default_factory=list)
    """First blocks of loops that it came through, with all values and the number of events then."""

    def copy(self) -> Path:
        """An independent path."""
        return Path(self.memory.copy(), dict(self.values), [*self.taken], [*self.assumed], [*self.preferred],
                    [*self.events], dict(self.visits), dict(self.forks),
                    self.behind_barrier, [*self.stored], [*self.passed], heads=[*self.heads])  # fmt: skip

    def write(self, address: Term, value: Term) -> None:
        """A store that may be moved as far as the next barrier."""
        self.memory.write(address, value)
        self.stored.append((address, value))

    def show(self, event: Event) -> None:
        """An event that stores may be moved over."""
        self.passed.append((len(self.events), self.memory.copy()))
        self.events.append(event)

    def part(self, barrier: bool) -> None:
        """No store is moved over this place. Between two of them of which one is a barrier, what stands beyond must
        have been written at every event, or must not."""
        if barrier or self.behind_barrier:
            for number, memory in self.passed:
                self.events[number] = replace(self.events[number], memory=memory, loose=tuple(self.stored))
        self.behind_barrier = barrier
        self.stored, self.passed = [], []

    @property
    def known(self) -> list[Term]:
        """All that holds on it."""
        return self.taken + self.assumed
