"""Permitted contexts of each call, parsed from the contract lines of the public headers (defined in openswarm.h)."""

from __future__ import annotations

import re
from pathlib import Path

HEADERS = Path(__file__).resolve().parents[2] / "firmware" / "openswarm" / "include"
CONTRACT = re.compile(r"/\* (M?T?H?I?)( \(PID 0 only\)| with SYS_PERIODIC)?(?= \||\.| \*/)")
CALL = re.compile(r"^[a-z][\w \*]*?\b(Sys_\w+)\(", re.M)


def callers(header: str) -> dict[str, str]:
    """Return the permitted contexts of each function of a header.

    Letters: M main before the start, T threads, H handlers, I interrupts.

    A contract comment holds for the declarations that follow it, up to the next contract or an empty line. A
    contract on the line of a declaration holds for that declaration only.
    """
    found: dict[str, str] = {}
    inherited = ""
    for line in (HEADERS / header).read_text().splitlines():
        contract, call = CONTRACT.search(line), CALL.match(line)
        if not line.strip():
            inherited = ""
        if contract and not call:
            inherited = contract[1]
        if call:
            letters = contract[1] if contract else inherited
            if letters:
                found[call[1]] = letters
    return found


def numbers(header: str) -> dict[str, tuple[str, int]]:
    """Return the cycles field and the stack bytes of the contract line of each function of a header that has both."""
    found = {}
    for comment, declarations in re.findall(r"/\*(.*?)\*/((?:(?!/\*|\n\n).)*)", (HEADERS / header).read_text(), re.S):
        fields = [field.strip() for field in re.sub(r"\s+\*?\s*", " ", comment).split("|")]
        if len(fields) > 4 and fields[3].isdecimal():
            found |= dict.fromkeys(CALL.findall(declarations), (fields[2], int(fields[3])))
    return found


def legal_in_interrupts() -> set[str]:
    """Return the names of kernel and device calls that an interrupt may make."""
    both = callers("openswarm.h") | callers("openswarm_io.h")
    return {name for name, letters in both.items() if "I" in letters}


def refused_in_interrupts() -> set[str]:
    """Return the names of kernel calls that the kernel refuses in an interrupt, except calls that only main may
    make."""
    return {name for name, letters in callers("openswarm.h").items() if "I" not in letters and letters != "M"}
