"""VCD file of changes in cycles: the header by pyvcd, the changes by vcd_text.c.

Input: variables, then changes in any order. Output: the text of the changes, sorted by cycle and variable. Each time is
computed from the cycle and the initial clock, rounded to 1 ps, so rounding errors do not accumulate.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from fractions import Fraction
from functools import cache
from pathlib import Path
from typing import Any, Final, TextIO

import numpy as np
import numpy.typing as npt

from emu.native_library import ADDRESS, INT, functions

PICOSECONDS: Final = 10**12
_VARIABLE: Final = np.dtype([("is_scalar", "u1"), ("length", "u1"), ("name", "S6")])
_CHANGE: Final = np.dtype([("time", "<u8"), ("variable", "<u8"), ("value", "<u8")])
_TEXT_BYTES: Final = 1 << 20
"""Size of the buffer for text."""

Numbers = npt.NDArray[np.uint64]


@cache
def _code() -> Callable[..., int]:
    signature = (INT, (ADDRESS, ADDRESS, ADDRESS, ADDRESS, INT, INT, ADDRESS, INT, ADDRESS))
    return functions(Path(__file__).with_name("vcd_text.c"), {"vcd_text": signature})["vcd_text"]


class VcdFile:
    """Writes a VCD file to `stream` that begins at `cycle` (Tcy) of a machine with `hz` cycles per second."""

    def __init__(self, stream: TextIO, hz: Fraction, cycle: int) -> None:
        from vcd import VCDWriter

        self._stream: Final = stream
        self._numerator, self._denominator = (Fraction(PICOSECONDS) / hz).as_integer_ratio()
        begin = int(self._times(np.array([cycle], dtype=np.uint64))[0])
        self._writer: Final[Any] = VCDWriter(stream, timescale="1 ps", date="", version="emu", init_timestamp=begin)
        self._variables: Final[list[Any]] = []
        self._last: Final = np.array([begin], dtype=np.uint64)
        """The last time that is written, in ps."""
        self._table: npt.NDArray[Any] = np.zeros(0)
        self._seen: Numbers = np.zeros(0, dtype=np.uint64)
        """The variables for vcd_text.c, and their last values; empty until the header is written."""
        self._pending: list[tuple[int, int, int]] = []
        self._arrays: list[Numbers] = []
        """Changes that are not yet written: cycle, variable and value, one by one and as arrays of three rows."""
        self._text: Final = np.zeros(_TEXT_BYTES, dtype=np.uint8)
        self._has_failed = False
        """Whether a write has failed, for example on a full disk. Nothing is written after it."""

    def register(self, scope: str, name: str, kind: str, size: int, value: int = 0) -> int:
        """Return the number of a new variable of `size` bits. `kind` is its type in the file, `value` its first value.

        All variables are registered before the first `write`.
        """
        self._variables.append(self._writer.register_var(scope, name, kind, size=size, init=value))
        return len(self._variables) - 1

    def add(self, cycle: int, variable: int, value: int) -> None:
        """Add a change."""
        self._pending.append((cycle, variable, value))

    def add_all(self, cycles: Numbers, variables: Numbers, values: Numbers) -> None:
        """Add changes. The arrays are copied."""
        self._arrays.append(np.array([cycles, variables, values], dtype=np.uint64))

    @property
    def pending(self) -> int:
        """Number of changes that were added one by one and are not yet written."""
        return len(self._pending)

    def write(self, until: int) -> None:
        """Write all changes up to cycle `until`. Raises OSError."""
        if self._has_failed:
            return
        rows = self._collected()
        cycles, variables, values = rows[:, np.lexsort((rows[1], rows[0]))]
        ready = int(np.searchsorted(cycles, until, side="right"))
        if ready < len(cycles):
            self.add_all(cycles[ready:], variables[ready:], values[ready:])
        changes = np.empty(ready, dtype=_CHANGE)
        changes["time"] = self._times(cycles[:ready])
        changes["variable"], changes["value"] = variables[:ready], values[:ready]
        try:
            if not len(self._table):
                self._begin()
            self._write_changes(changes)
        except OSError:
            self._has_failed = True
            raise

    def _collected(self) -> Numbers:
        """Return the pending changes as an array of three rows, and forget them."""
        rows = np.array(self._pending, dtype=np.uint64).reshape(-1, 3).T
        found = np.concatenate([*self._arrays, rows], axis=1)
        self._arrays.clear()
        self._pending.clear()
        return found

    def _begin(self) -> None:
        """Write the header."""
        from vcd.writer import ScalarVariable

        self._writer.flush()
        rows = [(isinstance(one, ScalarVariable), len(one.ident), one.ident) for one in self._variables]
        self._table = np.array(rows, dtype=_VARIABLE)
        self._seen = np.array([one.value for one in self._variables], dtype=np.uint64)

    def _write_changes(self, changes: npt.NDArray[np.void]) -> None:
        at, used, text = 0, ctypes.c_int64(), self._text
        places = [int(one.ctypes.data) for one in (self._table, self._seen, self._last, changes)]
        while at < len(changes):
            at = _code()(*places, at, len(changes), int(text.ctypes.data), len(text), ctypes.addressof(used))
            self._stream.write(text[: used.value].tobytes().decode("ascii"))

    def close(self, cycle: int) -> None:
        """Write all changes up to `cycle`, the end of the run. After a failed write, do nothing. Raises OSError."""
        if self._has_failed:
            return
        self.write(cycle)
        end = int(self._times(np.array([cycle], dtype=np.uint64))[0])
        if end != self._last[0]:
            self._stream.write(f"#{end}\n")
        self._writer.close()

    def _times(self, cycles: Numbers) -> Numbers:
        """Return cycles as times in ps, rounded half to even."""
        whole, rest = np.divmod(cycles, np.uint64(self._denominator))
        product = rest.astype(object if self._numerator * self._denominator >> 62 else np.uint64) * self._numerator
        part, rest = (product // self._denominator).astype(np.uint64), 2 * (product % self._denominator)
        times = whole * np.uint64(self._numerator) + part
        rounded: Numbers = times + ((rest > self._denominator) | ((rest == self._denominator) & (times % 2 == 1)))
        return rounded
