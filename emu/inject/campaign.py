"""Campaign files in TOML: run, faults and detection patterns. Errors are reported with file and line.

seed = 1                      # determines the faults
trials = 400
[run]
seconds = 1.0                 # duration whose output is compared
start = 0.1                   # earliest time of a fault (default 0)
selector = 0                  # of the robot (default 0)
hang = 2.0                    # incomplete output after this multiple of `seconds` counts as a hang (default 2)
[input]                       # bytes for the UARTs (default none), each with its time in s
uart1 = [[0.2, "go\\r"], [0.5, "stop\\r"]]
[detect]
uart1 = ["assert", "trap"]    # regular expressions of messages about a detected fault (default none)
[faults]                      # weights of the kinds, whole numbers
ram = 4
register = 2
flash = 1
skip = 2
uart = 1
sensor = 1
brownout = 1
"""

from __future__ import annotations

import hashlib
import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from emu.host.files import read_file
from emu.inject.faults import KINDS

UARTS: Final = ("uart1", "uart2")
LONGEST_SECONDS: Final = 3600
"""Maximum simulated time of a trial."""
SHOWN_BITS: Final = 64
"""Longest integer that an error message repeats."""
_KEYS: Final[dict[str, tuple[str, ...]]] = {
    "": ("seed", "trials", "run", "input", "detect", "faults"),
    "run": ("seconds", "start", "selector", "hang"),
    "input": UARTS,
    "detect": UARTS,
    "faults": KINDS,
}


class CampaignError(ValueError):
    """Invalid campaign file. The message names the file, the line and what was expected."""


@dataclass(frozen=True)
class Campaign:
    """Content of a campaign file. Times are in s."""

    seed: int
    trials: int
    seconds: float
    start: float
    selector: int
    hang: float
    input: Mapping[int, tuple[tuple[float, bytes], ...]]
    detect: Mapping[int, tuple[str, ...]]
    faults: Mapping[str, int]
    fingerprint: str
    """SHA-256 of the file's text."""


class _Reader:
    def __init__(self, name: str, text: str) -> None:
        self.name, self.text = name, text
        try:
            self.data = tomllib.loads(text)
        except tomllib.TOMLDecodeError as error:
            line = re.search(r"at line (\d+)", str(error))
            where = line[1] if line is not None else len(text.splitlines())
            raise CampaignError(f"{name}:{where}: {error}") from None
        except (RecursionError, ValueError) as error:  # nested too deeply, an integer of too many digits
            raise CampaignError(f"{name}: {error}") from None

    def fail(self, section: str, key: str, expected: str) -> CampaignError:
        """Return an error that names the line of a key, or of its section if the key is missing."""
        here, found = "", 0
        for number, line in enumerate(self.text.splitlines(), 1):
            if match := re.match(r"\s*\[([^\]]+)\]", line):
                here = match[1].strip()
                found = number if here == (section or key) else found
            elif here == section and re.match(rf"\s*[\"']?{re.escape(key)}[\"']?\s*=", line):
                return CampaignError(f"{self.name}:{number}: {expected}")
        return CampaignError(f"{self.name}:{found or 1}: {expected}")

    def check_keys(self) -> None:
        for section, keys in _KEYS.items():
            table = self.section(section)
            for key in table:
                if key not in keys:
                    raise self.fail(section, key, f"unknown key {key!r}; expected {', '.join(keys)}")

    def section(self, name: str) -> dict[str, Any]:
        table = self.data.get(name, {}) if name else self.data
        if not isinstance(table, dict):
            raise self.fail("", name, f"expected a table [{name}]")
        return table

    def number(self, section: str, key: str, kind: type, default: Any, least: float, most: float) -> Any:
        value = self.section(section).get(key, default)
        fits = isinstance(value, int | float if kind is float else int) and not isinstance(value, bool)
        if not fits or not least <= value <= most:
            what = "a number" if kind is float else "a whole number"
            is_long = isinstance(value, int) and value.bit_length() > SHOWN_BITS
            found = f"one of {value.bit_length()} bits" if is_long else repr(value)
            raise self.fail(section, key, f"{key}: expected {what} from {least:g} to {most:g}, not {found}")
        return kind(value)


def read(path: Path) -> Campaign:
    """Read a campaign file. Raises CampaignError, OSError."""
    try:
        text = read_file(path).decode()
    except UnicodeDecodeError as error:
        raise CampaignError(f"{path}: expected UTF-8: {error}") from None
    reader = _Reader(str(path), text)
    reader.check_keys()
    faults = {kind: reader.number("faults", kind, int, 0, 0, 1_000_000) for kind in KINDS}
    if not any(faults.values()):
        raise reader.fail("", "faults", "expected a share above 0 for a kind of fault")
    seconds = reader.number("run", "seconds", float, None, 0.001, LONGEST_SECONDS)
    start = reader.number("run", "start", float, 0.0, 0, LONGEST_SECONDS)
    if start >= seconds:
        raise reader.fail("run", "start", f"start: expected a time before {seconds:g} s, not {start:g}")
    return Campaign(
        seed=reader.number("", "seed", int, 1, 0, (1 << 63) - 1),
        trials=reader.number("", "trials", int, None, 1, 10_000_000),
        seconds=seconds,
        start=start,
        selector=reader.number("run", "selector", int, 0, 0, 15),
        hang=reader.number("run", "hang", float, 2.0, 1, 100),
        input={n: _timed_input(reader, f"uart{n}") for n in (1, 2)},
        detect={n: _patterns(reader, f"uart{n}") for n in (1, 2)},
        faults=faults,
        fingerprint=hashlib.sha256(text.encode()).hexdigest(),
    )


def _timed_input(reader: _Reader, key: str) -> tuple[tuple[float, bytes], ...]:
    expected = f'{key}: expected a list of [seconds, "text"] in the order of time'
    found: list[tuple[float, bytes]] = []
    for one in _list_value(reader, "input", key):
        is_pair = isinstance(one, list) and len(one) == 2
        if not is_pair or not isinstance(one[0], int | float) or not isinstance(one[1], str):
            raise reader.fail("input", key, expected)
        if not (found[-1][0] if found else 0) <= one[0] <= LONGEST_SECONDS:
            raise reader.fail("input", key, f"{expected}, from 0 to {LONGEST_SECONDS} s")
        try:
            found.append((float(one[0]), one[1].encode("latin-1")))
        except UnicodeEncodeError:
            raise reader.fail("input", key, f"{key}: expected characters up to \\u00ff") from None
    return tuple(found)


def _patterns(reader: _Reader, key: str) -> tuple[str, ...]:
    found = _list_value(reader, "detect", key)
    for one in found:
        try:
            re.compile(one.encode("latin-1"))
        except (AttributeError, UnicodeEncodeError, re.error) as error:
            raise reader.fail("detect", key, f"{key}: expected regular expressions: {error}") from None
    return tuple(found)


def _list_value(reader: _Reader, section: str, key: str) -> list[Any]:
    value = reader.section(section).get(key, [])
    if not isinstance(value, list):
        raise reader.fail(section, key, f"{key}: expected a list")
    return value
