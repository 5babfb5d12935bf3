"""Arrivals of the program at functions and labels: counted, and logged with numbers, in native code where possible.

    >>> import emu
    >>> machine = emu.load("firmware.elf")
    >>> with emu.Arrivals(machine, "twice", values=["count", "W0"]) as arrivals:
    ...     stop = machine.run(seconds=0.002)
    >>> arrivals.counts
    {'twice': 2648}
    >>> arrivals.all()[0]
    Arrival(cycle=371, place='twice', values=(1, 65436))

Input: a machine, places, and names of numbers. The recording does not change the run.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from emu.debug import symbolic
from emu.debug.dwarf.types import UNSIGNED, Type, decode
from emu.debug.inspector import Inspector
from emu.host.result_tables import data_frame
from emu.instruments.changes import is_in_ram
from emu.system.arrivals import ArrivalLog, LoggedNumber

if TYPE_CHECKING:
    from types import TracebackType

    from emu.machine.machine import Machine
    from emu.machine.state_access import NameOrAddress

W_REGISTERS: Final = [f"W{number}" for number in range(16)]
W_REGISTERS_END: Final = 0x20
"""Data address after W15 (isa.md §2.1)."""


class Arrival(NamedTuple):
    """Arrival at a place, before its instruction runs.

    `values` are the recorded numbers. `cycle`, in Tcy, is the one in which the instruction starts.
    """

    cycle: int
    place: NameOrAddress
    values: tuple[Any, ...]


class Arrivals:
    """Recording of the arrivals of `machine` at `places` until `close`, or the end of a `with` block.

    `values` names variables in RAM and W registers, whose values each entry contains. An address stands for two bytes.
    Without `log`, arrivals are only counted. Replayed cycles are not recorded. Native code records one such recording
    at a time; a second one, and places that have other hooks, call Python, with the same result.
    Raises KeyError for an unknown name, ValueError for a value that is not a number in RAM or in W registers.
    """

    def __init__(
        self, machine: Machine, *places: NameOrAddress, values: Sequence[NameOrAddress] = (), log: bool = True
    ) -> None:
        addresses = [machine.program_address(place) for place in places]
        found = [_number(machine, value) for value in values]
        self._places: Final = places
        self._names: Final = [str(value) for value in values]
        self._types: Final = [kind for _, kind in found]
        self._log: Final = ArrivalLog(machine.record, len(places), tuple(one for one, _ in found), log)
        self._removals: Final = [
            machine.hook_pc(address, hook) for address, hook in zip(addresses, self._log.hooks, strict=True)
        ]

    @property
    def counts(self) -> dict[NameOrAddress, int]:
        """Number of arrivals by place."""
        return dict(zip(self._places, self._log.counts, strict=True))

    def all(self) -> list[Arrival]:
        """Return all logged arrivals in order."""
        return [
            Arrival(cycle, self._places[place], tuple(map(_decoded, self._types, values)))
            for cycle, place, *values in self._log.entries()
        ]

    def frame(self) -> Any:
        """Return the log as a pandas DataFrame, one column per value. Raises ModuleNotFoundError without pandas."""
        columns = ("cycle", "place", *self._names)
        return data_frame([dict(zip(columns, (one.cycle, one.place, *one.values), strict=True)) for one in self.all()])

    def close(self) -> None:
        """End the recording. Counts and log remain."""
        for remove in self._removals:
            remove()

    def __enter__(self) -> Arrivals:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, where: TracebackType | None
    ) -> None:
        self.close()


def _decoded(kind: Type, number: int) -> Any:
    """Return the value of an object from its bytes as an unsigned number."""
    return decode(kind, number.to_bytes(kind.bytes, "little"))


def _number(machine: Machine, value: NameOrAddress) -> tuple[LoggedNumber, Type]:
    """Return the place and the type of a named number. A register or an address stands for an unsigned word."""
    if isinstance(value, str) and value.upper() not in W_REGISTERS:
        found = symbolic.variable(Inspector(machine), value)
        address, kind = found.address if found.bits is None and found.type.is_number else None, found.type
        size = kind.bytes
    else:
        address, size, kind = machine.address_of(value), 2, UNSIGNED[2]
    if address is None or not (is_in_ram(machine, address, size) or 0 <= address <= W_REGISTERS_END - size):
        raise ValueError(f"{value!r} is not a number in RAM or in W registers")
    return LoggedNumber(address, size), kind
