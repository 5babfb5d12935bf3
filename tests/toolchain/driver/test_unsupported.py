"""Unsupported constructs are errors that name the construct and its source position."""

from __future__ import annotations

import pytest

from tests.toolchain.compiled import assembly
from toolchain.ir.model import UnsupportedError

CASES = [
    ("void (__builtin_disi)(unsigned); void f(unsigned n){\n (__builtin_disi)(n); }", "__builtin_disi", 2),
    ("void __builtin_frobnicate(void); void f(void){\n __builtin_frobnicate(); }", "__builtin_frobnicate", 2),
]


@pytest.mark.parametrize(("source", "what", "line"), CASES)
def test_unsupported_constructs_name_themselves_and_their_line(source: str, what: str, line: int) -> None:
    """The message for an unsupported construct names the construct and its line (engines.md §5)."""
    with pytest.raises(UnsupportedError) as caught:
        assembly(source, debug=True)
    assert what in str(caught.value)
    assert str(caught.value).split(": ")[0].endswith(f"unit.c:{line}")


def test_without_debug_information_the_function_is_named() -> None:
    """Without debug information the message for an unsupported construct names the function instead of a line."""
    with pytest.raises(UnsupportedError, match="in function 'f'"):
        assembly(CASES[0][0])
