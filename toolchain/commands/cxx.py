"""`c++`: the driver, for which .c and .h files are C++ as well."""

from __future__ import annotations

from toolchain.driver import driver


def main(arguments: list[str]) -> int:
    """Exit status as for `cc`. Raises ToolError as `cc` does."""
    return driver.main(arguments, cxx=True)
