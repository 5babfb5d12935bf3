"""Waveform files as stimulus: conversion of CSV and VCD files to stimulus events.

CSV   a header line with column names, then one line per time: `time` in s, then pins and uart1, uart2 (a byte, 0 to
      255). An empty cell changes nothing.
VCD   one-bit wires whose names begin with a pin name (`RB3`, `RC1_front`), in any scope. Other variables and the
      values x and z are ignored. `emu run --vcd` writes such files.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Iterator
from contextlib import suppress
from fractions import Fraction
from io import BytesIO, StringIO

from emu.peripherals.pins import parse_pin

UARTS = ("uart1", "uart2")
TIME_PATTERN = re.compile(
    r"\s*\+?(?:(?:\d{1,18}(?:\.\d{0,40})?|\.\d{1,40})(?:[eE][-+]?\d{1,2})?|\d{1,18}/\d{1,18})\s*", re.ASCII
)
"""Syntax of a time. The exponent is limited because 1e999999999 would take hours to compute."""
StimulusLine = tuple[int, Fraction, list[str]]
"""Line number in the file, time in s, and the words of an event as in a stimulus script."""


class WaveformError(ValueError):
    """Invalid waveform file: the line number, and what was expected there."""

    def __init__(self, line: int, expected: str) -> None:
        super().__init__(expected)
        self.line = line


def parse_time(text: str) -> Fraction:
    """Return the exact value of a written time; -1 for invalid text or a time of 10^18 or more."""
    if TIME_PATTERN.fullmatch(text):
        with suppress(ZeroDivisionError):
            time = Fraction(text)
            return time if time < 10**18 else Fraction(-1)
    return Fraction(-1)


def _rows(text: str) -> Iterator[tuple[int, list[str]]]:
    """Yield the line number and the cells of each row. Raises WaveformError."""
    rows = csv.reader(StringIO(text), skipinitialspace=True)
    try:
        for row in rows:
            yield rows.line_num, row
    except csv.Error as error:
        raise WaveformError(rows.line_num, str(error)) from None


def read_csv(text: str) -> Iterator[StimulusLine]:
    """Yield the events of a CSV file. Raises WaveformError."""
    rows = _rows(text)
    _, names = next(rows, (1, []))
    if not names or names[0] != "time" or len(names) < 2:
        raise WaveformError(1, "expected column names: time, then pins, uart1 or uart2")
    for name in names[1:]:
        if name not in UARTS:
            _pin(name, 1)
    for line, row in rows:
        if not row:
            continue
        if len(row) != len(names):
            raise WaveformError(line, f"expected {len(names)} cells, found {len(row)}")
        time = parse_time(row[0])
        if time < 0:
            raise WaveformError(line, f"expected a time in s, not {row[0]!r}")
        for name, cell in zip(names[1:], row[1:], strict=True):
            if cell and name in UARTS:
                if not cell.isdecimal() or int(cell) > 255:
                    raise WaveformError(line, f"{name}: expected a byte, 0 to 255, not {cell!r}")
                yield line, time, [name, repr(chr(int(cell)))]
            elif cell:
                if cell not in ("0", "1"):
                    raise WaveformError(line, f"{name}: a level is 0 or 1, not {cell!r}")
                yield line, time, ["pin", name, cell]


def read_vcd(data: bytes) -> Iterator[StimulusLine]:
    """Yield the events of a VCD file. Raises WaveformError."""
    from vcd.common import Timescale
    from vcd.reader import TokenKind, VCDParseError, tokenize

    scale, now, pins = Fraction(1, 10**9), 0, {}
    try:
        for token in tokenize(BytesIO(data)):
            line = token.span.start.line
            if token.kind is TokenKind.TIMESCALE:
                assert isinstance(token.timescale, Timescale)
                scale = int(token.timescale.magnitude) * _unit(token.timescale.unit.value)
            elif token.kind is TokenKind.VAR and token.var.size == 1:
                name = re.match(r"R[A-G]\d+(?=_|$)", token.var.reference)
                if name is not None:
                    pins[token.var.id_code] = _pin(name[0], line)
            elif token.kind is TokenKind.CHANGE_TIME:
                now = token.time_change
            elif token.kind is TokenKind.CHANGE_SCALAR:
                level = token.scalar_change.value
                if token.scalar_change.id_code in pins and level in ("0", "1"):
                    yield line, now * scale, ["pin", pins[token.scalar_change.id_code], level]
    except VCDParseError as error:
        raise WaveformError(error.loc.line, f"expected a VCD file: {error}") from None
    if not pins:
        raise WaveformError(1, "expected a VCD file with one-bit wires named after pins, such as RB3")


def _unit(name: str) -> Fraction:
    return Fraction(1, 10 ** (3 * ("s", "ms", "us", "ns", "ps", "fs").index(name)))


def _pin(name: str, line: int) -> str:
    try:
        parse_pin(name)
    except (ValueError, LookupError) as error:
        raise WaveformError(line, str(error)) from None
    return name
