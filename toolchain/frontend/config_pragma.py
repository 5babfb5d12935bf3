"""XC16's `#pragma config SETTING = VALUE, ...`: settings become definitions of configuration words.

The chip's tables define fields, positions and words. The device header defines the names of values as macros: 16-bit
masks with ones outside of their field (dspic30f6014a.md §2). The input is preprocessed C with line markers; the output
has definitions of the words at its end instead of the pragmas.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Callable, Iterable
from functools import cache, partial
from pathlib import Path

from emu.chips import chip_named
from emu.chips.chip import Chip
from toolchain.errors import ToolError

PRESENT = b"#pragma config"
"""Part of clang's warning about unknown pragmas for a source that needs `rewrite`."""

IN_SOURCE = re.compile(rb"^[ \t]*#[ \t]*pragma[ \t]+config\b", re.MULTILINE)
_PRAGMA = re.compile(r"^[ \t]*#[ \t]*pragma[ \t]+config\b(.*)$", re.MULTILINE)
_MARKER = re.compile(r'^# (\d+) "((?:[^"\\]|\\.)*)".*$', re.MULTILINE)
_HEADER = Path(__file__).parents[1] / "include" / "dspic_compiler.h"
_MACRO = re.compile(r"^#define (\w+) 0x([0-9A-F]{4})$", re.MULTILINE)
_PRAGMA_VALUES = {"NONE": 0xFFFF}  # reserved brown-out voltage in XC16; a macro of that name could conflict
_SETTING = re.compile(r"\s*(\w+)\s*=\s*(\w+)\s*")
# Settings whose name in MPLAB X differs from the field's name: their word and fields.
_SETTINGS = {
    "FOSFPR": ("FOSC", ("FOS", "FPR")), "FCKSMEN": ("FOSC", ("FCKSM",)), "WDT": ("FWDT", ("FWDTEN",)),
    "BODENV": ("FBORPOR", ("BORV",)), "MCLRE": ("FBORPOR", ("MCLREN",)), "GCP": ("FGS", ("GSS",)),
}  # fmt: skip


def settings(chip: Chip) -> dict[str, tuple[str, int]]:
    """Name of the configuration word and mask of the bits of each setting, by name of the setting."""
    known = {}
    for word in chip.config.values():
        for field, (lsb, width) in word.fields.items():
            known[field] = (word.name, ((1 << width) - 1) << lsb)
    for name, (register, fields) in _SETTINGS.items():
        if name not in known and known.keys() >= set(fields):
            known[name] = (register, sum(known[field][1] for field in fields))
    return known


def values() -> dict[str, int]:
    """Mask of each named value of device header and XC16, with zeros for the bits that it clears."""
    return _PRAGMA_VALUES | {name: int(number, 16) for name, number in _MACRO.findall(_HEADER.read_text())}


@cache
def rewriter(chip_name: str) -> Callable[[str], str]:
    """`rewrite` for a chip."""
    return partial(rewrite, chip=chip_named(chip_name))


def rewrite(text: str, chip: Chip) -> str:
    """`text` with definitions instead of configuration pragmas. Raises ToolError that lists all wrong settings."""
    known, codes = settings(chip), values()
    words: dict[str, int] = {}
    findings: list[str] = []
    given: dict[str, tuple[str, str]] = {}
    for pragma in _PRAGMA.finditer(text):
        for setting in pragma[1].split(","):
            position = _source_position(text, pragma.start())
            finding = _apply(setting, known, codes, words) or _contradiction(setting, position, given)
            if finding:
                findings.append(f"{position}: error: {finding}")
    if findings:
        raise ToolError.of(findings)
    definitions = [
        f'__attribute__((__used__, __section__("__{name}.sec"))) static const unsigned short '
        f"__dspic_pragma_{name} = 0x{value:04X};"
        for name, value in sorted(words.items())
    ]
    return "\n".join([_PRAGMA.sub("", text), *definitions, ""])


def _apply(setting: str, known: dict[str, tuple[str, int]], codes: dict[str, int], words: dict[str, int]) -> str:
    """Apply one setting to `words`; return an error message or ""."""
    found = _SETTING.fullmatch(setting)
    if found is None:
        return f"#pragma config expects SETTING = VALUE, found '{setting.strip()}'"
    name, value = found[1], found[2]
    if name not in known:
        return f"#pragma config: no setting '{name}' on this device{_hint(name, known)}"
    register, mask = known[name]
    if value in codes:
        bits = codes[value]
    else:
        try:
            bits = int(value, 0)
        except ValueError:
            return f"#pragma config: '{value}' is not a value of {name}{_hint(value, codes)}"
        bits = bits * (mask & -mask) | ~mask
    words[register] = words.get(register, 0xFFFF) & ~mask & 0xFFFF | bits & mask
    return ""


def _contradiction(setting: str, position: str, given: dict[str, tuple[str, str]]) -> str:
    """Record a setting; return an error message if an earlier one has another value, else ""."""
    name, _, value = (word.strip() for word in setting.partition("="))
    before, earlier = given.setdefault(name, (value, position))
    return "" if before == value else f"#pragma config {name} = {value}, but {name} = {before} at {earlier}"


def _hint(word: str, candidates: Iterable[str]) -> str:
    close = difflib.get_close_matches(word, list(candidates), 3)
    return f" (did you mean {', '.join(close)}?)" if close else ""


def _source_position(text: str, at: int) -> str:
    """FILE:LINE of an offset, from the last line marker before it."""
    markers = list(_MARKER.finditer(text, 0, at))
    if not markers:
        return f"<source>:{text.count(chr(10), 0, at) + 1}"
    marker = markers[-1]
    return f"{marker[2]}:{int(marker[1]) + text.count(chr(10), marker.end() + 1, at)}"
