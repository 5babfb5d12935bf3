"""Code written from rules that have an `if` (flowrules.py): a rule is read once for each way through it.

At a condition that is only known when the code runs the reading is given up; both branches are opened, and in each the
rule is read anew up to the next such condition. What a rule puts is written at the end of a way.
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


class _Parts(Exception):
    """Ways part here."""

    def __init__(self, condition: Any) -> None:
        super().__init__()
        self.condition: Final = condition


class RulePaths(ABC):
    """Reads rules way by way; subclasses write the code. `known`: what stands at places already."""

    def __init__(self, known: Mapping[Cell, Any]) -> None:
        self._known: dict[Cell, Any] = dict(known)
        self._puts: Final[dict[Cell, Any]] = {}
        self._turns: Iterator[bool] = iter(())

    def each(self, rule: Callable[[Any], R], end: Callable[[R], None], turns: tuple[bool, ...] = ()) -> None:
        """Write `rule(reader)`; end(what it returned) writes what follows on each way."""
        self._puts.clear()
        self._turns = iter(turns)
        try:
            result = rule(self)
        except _Parts as parts:
            known = self._known
            for turn in self.branches(parts.condition):
                self._known = dict(known)
                self.each(rule, end, (*turns, turn))
            return
        for place, value in self._puts.items():
            self.store(place, value)
        end(result)

    def all(self, rule: Callable[[Any], object]) -> None:
        """Write a rule that has no ways."""
        self.each(rule, lambda _result: None)

    def get(self, place: Cell) -> Any:
        """Loaded once on each way."""
        if place not in self._known:
            self._known[place] = self.load(place)
        return self._known[place]

    def put(self, place: Cell, value: Any) -> None:
        """At the end of the way."""
        self._puts[place] = value

    def is_true(self, condition: Any) -> bool:
        """Which way this is."""
        if isinstance(condition, int):
            return bool(condition)
        for turn in self._turns:
            return turn
        raise _Parts(condition)

    @abstractmethod
    def load(self, place: Cell) -> Any:
        """The number at a place."""

    @abstractmethod
    def store(self, place: Cell, value: Any) -> None:
        """Write it."""

    @abstractmethod
    def branches(self, condition: Any) -> Iterator[bool]:
        """Open the branch for True, then that for False."""


class PythonRulePaths(RulePaths):
    """Writes Python on the record's views `u16`, `u64`, ... `emit` takes a line."""

    def __init__(
        self, emit: Callable[[str], None], known: Mapping[Cell, Number], kept: tuple[Cell, Expr] | None = None
    ) -> None:
        """`kept`: a name that holds what a place does, before and behind the rule."""
        super().__init__(known if kept is None else {**known, kept[0]: kept[1]})
        self._emit: Final = emit
        self._kept: Final = kept
        self._indent = ""

    def line(self, text: str) -> None:
        """One statement on the present way."""
        self._emit(self._indent + text)

    def load(self, place: Cell) -> Expr:
        """Under a name of its own."""
        name = f"p{place.offset:x}"
        self.line(f"{name} = u{place.bits}[{place.index}]")
        return Expr(name, 0, (1 << place.bits) - 1, atom=True)

    def store(self, place: Cell, value: Number) -> None:
        """An assignment."""
        name = f"{self._kept[1]} = " if self._kept is not None and self._kept[0] == place else ""
        self.line(f"{name}u{place.bits}[{place.index}] = {value & (1 << place.bits) - 1}")

    def select(self, condition: Number, a: Number, b: Number) -> Number:
        """Choice."""
        return choose(condition, a, b)

    def branches(self, condition: Number) -> Iterator[bool]:
        """if and else."""
        outer = self._indent
        for head, turn in ((f"if {condition}:", True), ("else:", False)):
            self._indent = outer
            self.line(head)
            self._indent = outer + "    "
            yield turn
        self._indent = outer


@lru_cache(maxsize=4096)
def compiled(text: str) -> CodeType:
    """The code of one function's text, shared by all machines of the process."""
    return compile(text, "<specialised>", "exec")


def function_of(record: Record, rule: Callable[..., R], operands: Any, *parameters: str) -> Callable[..., R]:
    """rule(reader, places, *parameters) as a Python function of its parameters, ints from 0 on, on `record`."""
    views = {"u16": record.u16, "u64": record.u64}
    lines = [f"def run({', '.join(parameters + tuple(f'{name}={name}' for name in views))}):"]
    values = [Expr(name, 0, LIMIT, atom=True) for name in parameters]
    ways = PythonRulePaths(lambda line: lines.append("    " + line), {})
    ways.each(lambda m: rule(m, operands, *values), lambda result: ways.line(f"return {result}"))
    namespace: dict[str, Any] = dict(views)
    exec(compiled("\n".join(lines)), namespace)
    function: Callable[..., R] = namespace["run"]
    return function
