"""Results of a measurement of cycles: the operations of an application's run, with all occurrences."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Final

from emu.host.result_tables import data_frame, html_table
from emu.kernel_metrics.observation import ExecutionLog

if TYPE_CHECKING:
    from emu.machine.stops import Stop

P99: Final = 99


@dataclass(slots=True, repr=False)
class Operation:
    """All occurrences of one operation in Tcy."""

    name: str
    all: list[int] = field(default_factory=list)
    undisturbed: list[int] = field(default_factory=list)
    """Occurrences without the entry of an exception."""
    longest: Counter[int] = field(default_factory=Counter)
    """Cycles of the longest undisturbed occurrence by instruction address."""
    shortest: Counter[int] = field(default_factory=Counter)
    """Cycles of the shortest undisturbed occurrence by instruction address."""
    extremes: tuple[int, int] | None = None
    """Least and most cycles of an undisturbed occurrence, None without one."""

    def add(self, begin: int, end: int, stolen: int, log: ExecutionLog | None) -> None:
        """Add an occurrence. `log` is given if no exception was entered."""
        value = end - begin - stolen
        self.all.append(value)
        if log is None or stolen:
            return
        self.undisturbed.append(value)
        least, most = self.extremes or (value + 1, value - 1)
        if value < least:
            self.shortest = log.cycles(begin, end)
        if value > most:
            self.longest = log.cycles(begin, end)
        self.extremes = min(least, value), max(most, value)

    def __repr__(self) -> str:
        return f"<{self.name[:120]}: {len(self.all)} times>"

    def statistics(self) -> dict[str, int]:
        """Return count, min, median, p99 and max in Tcy (nearest rank), and the same of undisturbed occurrences."""
        calm = sorted(self.undisturbed)
        found = {"count": len(self.all), **_ranks(sorted(self.all)), "undisturbed": len(calm)}
        if calm:
            found |= {f"undisturbed_{name}": value for name, value in _ranks(calm).items()}
        return found


def _ranks(values: Sequence[int]) -> dict[str, int]:
    """Return min, median, p99 and max of sorted values, by nearest rank."""
    count = len(values)
    return {
        "min": values[0], "median": values[(count - 1) // 2], "p99": values[-(-P99 * count // 100) - 1],
        "max": values[-1],
    }  # fmt: skip


@dataclass(slots=True)
class ApplicationCycles:
    """Cycles of each kernel operation in one run of an application."""

    seconds: float
    operations: dict[str, Operation]
    stop: Stop | None = None

    def __repr__(self) -> str:
        return f"<cycles of {len(self.operations)} operations in {self.seconds:g} s>"

    def rows(self) -> list[dict[str, object]]:
        """Return one row per operation: name, count, min, median, p99 and max in Tcy."""
        return [{"operation": name, **one.statistics()} for name, one in self.operations.items()]

    def frame(self) -> Any:
        """Return `rows` as a pandas DataFrame. Raises ModuleNotFoundError without pandas."""
        return data_frame(self.rows())

    def _repr_html_(self) -> str:
        return html_table(self.rows(), repr(self)[1:-1])
