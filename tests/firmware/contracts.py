"""Who may call what, read from the contract lines of the public headers (openswarm.h explains them)."""

from __future__ import annotations

import re
from pathlib import Path

HEADERS = Path(__file__).resolve().parents[2] / "firmware" / "openswarm" / "include"
CONTRACT = re.compile(r"/\* (M?T?H?I?)( \(PID 0 only\)| with SYS_PERIODIC)?(?= \||\.| \*/)")
CALL = re.compile(r"^[a-z][\w \*]*?\b(Sys_\w+)\(", re.M)


def callers(header: str) -> dict[str, str]:
    """Function -> letters of those who may call it: M main before the start, T threads, H handlers, I interrupts.

    A contract holds for the declarations behind its comment, up to the next comment with a contract or an empty line;
    one behind a declaration on the same line holds for that alone.
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


def legal_in_interrupts() -> set[str]:
    """Calls that an interrupt may make, of the kernel and of the standard devices."""
    both = callers("openswarm.h") | callers("openswarm_io.h")
    return {name for name, letters in both.items() if "I" in letters}


def refused_in_interrupts() -> set[str]:
    """Calls of the kernel that it refuses to an interrupt; those of main alone are made once."""
    return {name for name, letters in callers("openswarm.h").items() if "I" not in letters and letters != "M"}
