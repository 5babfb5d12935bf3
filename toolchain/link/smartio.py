"""Names that XC16's compiler gives calls of formatted input and output (abi-elf.md §2.8, "Smart-io").

`__dsnprintf_cdnopuxX` is snprintf called with a literal format that holds such conversions, from a file whose `double`
has 64 bits; without the `d`, 32 bits. Our functions know every conversion, so all of them mean the plain function.
"""

from __future__ import annotations

import re

from toolchain.errors import ToolError

_NAME = re.compile(r"__(d?)(v?(?:f|s|sn)?printf|v?(?:f|s)?scanf)_(0|[aAcdeEfFgGnopsuxX]+)")
_FLOATING = frozenset("aAeEfFgG")


def plain_name(name: str, where: str) -> str:
    """The function's own symbol for one of these names, else `name`; `where` names the object in errors.

    Raises ToolError for a call that passes 32-bit doubles, which the library does not take.
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
