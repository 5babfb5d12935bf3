"""Command `c++`: the compiler driver, with .c and .h files compiled as C++."""

from __future__ import annotations

from toolchain.driver import driver


def main(arguments: list[str]) -> int:
    """Run the driver; return its exit status.  Raises ToolError."""
    return driver.main(arguments, cxx=True)
