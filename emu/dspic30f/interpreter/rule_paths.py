"""Code generation from flow rules with branches (flow_rules.py): a rule is evaluated once for each path through it.

At a condition that is known only at run time, the evaluation stops and both branches are opened. In each branch the
rule is evaluated again, up to the next such condition. Values stored by a rule are written at the end of a path.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping
from functools import lru_cache
from types import CodeType
from typing import Any, Final, TypeVar

from emu.dspic30f.interpreter.expressions import LIMIT, Expr, Number, choose
from emu.system.record import Record
from emu.system.rules import Cell

R = TypeVar("R")


class _Fork(Exception):
    """Raised where the path forks, at a condition that is known only at run time."""

    def __init__(self, condition: Any) -> None:
        super().__init__()
        self.condition: Final = condition


class RulePaths(ABC):
    """Evaluates a rule path by path; subclasses emit the code. `known` maps cells to values known in advance."""

    def __init__(self, known: Mapping[Cell, Any]) -> None:
        self._known: dict[Cell, Any] = dict(known)
        self._puts: Final[dict[Cell, Any]] = {}
        self._decisions: Iterator[bool] = iter(())

    def each(self, rule: Callable[[Any], R], end: Callable[[R], None], decisions: tuple[bool, ...] = ()) -> None:
        """Emit `rule(self)` for each path. `end(result)` emits the code that follows the rule on that path."""
        self._puts.clear()
        self._decisions = iter(decisions)
        try:
            result = rule(self)
        except _Fork as fork:
            known = self._known
            for decision in self.branches(fork.condition):
                self._known = dict(known)
                self.each(rule, end, (*decisions, decision))
            return
        for cell, value in self._puts.items():
            self.store(cell, value)
        end(result)

    def all(self, rule: Callable[[Any], object]) -> None:
        """Emit a rule without branches."""
        self.each(rule, lambda _result: None)

    def get(self, cell: Cell) -> Any:
        """Return the value of a cell. Each path loads a cell at most once."""
        if cell not in self._known:
            self._known[cell] = self.load(cell)
        return self._known[cell]

    def put(self, cell: Cell, value: Any) -> None:
        """Store a value at the end of the path."""
        self._puts[cell] = value

    def is_true(self, condition: Any) -> bool:
        """Return the current path's decision at this condition."""
        if isinstance(condition, int):
            return bool(condition)
        for decision in self._decisions:
            return decision
        raise _Fork(condition)

    @abstractmethod
    def load(self, cell: Cell) -> Any:
        """Emit a load of a cell."""

    @abstractmethod
    def store(self, cell: Cell, value: Any) -> None:
        """Emit a store to a cell."""

    @abstractmethod
    def branches(self, condition: Any) -> Iterator[bool]:
        """Open the branch for True, yield True, then the same for False."""


class PythonRulePaths(RulePaths):
    """Emits Python statements that use the record's views `u16`, `u64`, ... `emit` receives one line."""

    def __init__(self, emit: Callable[[str], None]) -> None:
        super().__init__({})
        self._emit: Final = emit
        self._indent = ""

    def line(self, text: str) -> None:
        """Emit one statement on the current path."""
        self._emit(self._indent + text)

    def load(self, cell: Cell) -> Expr:
        """Emit a load into a variable."""
        name = f"p{cell.offset:x}"
        self.line(f"{name} = u{cell.bits}[{cell.index}]")
        return Expr(name, 0, (1 << cell.bits) - 1, atom=True)

    def store(self, cell: Cell, value: Number) -> None:
        """Emit an assignment."""
        self.line(f"u{cell.bits}[{cell.index}] = {value & (1 << cell.bits) - 1}")

    def select(self, condition: Number, a: Number, b: Number) -> Number:
        """Return a conditional expression."""
        return choose(condition, a, b)

    def branches(self, condition: Number) -> Iterator[bool]:
        """Emit `if` and `else`."""
        outer = self._indent
        for head, decision in ((f"if {condition}:", True), ("else:", False)):
            self._indent = outer
            self.line(head)
            self._indent = outer + "    "
            yield decision
        self._indent = outer


@lru_cache(maxsize=4096)
def code_of(text: str) -> CodeType:
    """Return the compiled text of a function, which all machines of the process share."""
    return compile(text, "<flow rule>", "exec")


def function_of(record: Record, rule: Callable[..., R], operands: Any, *parameters: str) -> Callable[..., R]:
    """Return rule(builder, operands, *parameters) as a Python function of `parameters`, which are ints >= 0."""
    views = {"u16": record.u16, "u64": record.u64}
    lines = [f"def run({', '.join(parameters + tuple(f'{name}={name}' for name in views))}):"]
    values = [Expr(name, 0, LIMIT, atom=True) for name in parameters]
    paths = PythonRulePaths(lambda line: lines.append("    " + line))
    paths.each(lambda m: rule(m, operands, *values), lambda result: paths.line(f"return {result}"))
    namespace: dict[str, Any] = dict(views)
    exec(code_of("\n".join(lines)), namespace)
    function: Callable[..., R] = namespace["run"]
    return function
