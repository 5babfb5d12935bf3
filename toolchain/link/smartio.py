"""Symbols of XC16 for formatted input and output (abi-elf.md §2.8, "Smart-io").

XC16 encodes the conversions of a literal format in the function's name.  `__dsnprintf_cdnopuxX` is snprintf with the
conversions c, d, n, o, p, u, x, X; the `d` after `__` means 64-bit `double`, its absence 32-bit.  The functions of the
run-time library support all conversions, so each such name is resolved to the plain function.
"""

from __future__ import annotations

import re

from toolchain.errors import ToolError

_NAME = re.compile(r"__(d?)(v?(?:f|s|sn)?printf|v?(?:f|s)?scanf)_(0|[aAcdeEfFgGnopsuxX]+)")
_FLOATING = frozenset("aAeEfFgG")


def plain_name(name: str, where: str) -> str:
    """Return the symbol of the plain function for a smart-io name, else `name`. `where` names the object in errors.

    Raises ToolError for a call with 32-bit doubles, which the library does not support.
    """
    found = _NAME.fullmatch(name)
    if found is None:
        return name
    wide, function, letters = found.groups()
    if not wide and _FLOATING & set(letters):
        raise ToolError(
            f"{where}: error: it calls {function} with 32-bit doubles ({name}), the library's have 64 bits: "
            f"compile it with -fno-short-double"
        )
    return "_" + function
