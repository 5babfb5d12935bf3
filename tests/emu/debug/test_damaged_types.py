"""Values of types from damaged debug information: an error fails one request and not the session."""

from __future__ import annotations

import pytest

from emu.dap.server import REQUEST_ERRORS
from emu.debug.dwarf.types import Member, Type, decode

INT = Type("signed", "int", 2)
FLOAT = Type("float", "float", 4)


@pytest.mark.parametrize(
    ("kind", "data"),
    [
        (FLOAT, b""),
        (INT, b"\x01"),
        (Type("struct", "s", 4, members=(Member("f", FLOAT, 100),)), bytes(4)),
        (Type("signed", "int", 1280), bytes(1280)),
    ],
)
def test_a_type_beyond_its_data_is_an_error_of_the_request(kind: Type, data: bytes) -> None:
    """Members outside of their struct, and numbers of absurd size, are errors that the debug server reports."""
    with pytest.raises(ValueError, match="the debug information is damaged") as error:
        decode(kind, data)
    assert isinstance(error.value, REQUEST_ERRORS)


def test_whole_values_are_decoded() -> None:
    """A value is decoded from data that are longer than its type."""
    assert decode(INT, b"\xfe\xff\x00") == -2 & 0xFFFF or decode(INT, b"\xfe\xff\x00") == -2
    assert decode(FLOAT, b"\0\0\x80\x3f\0") == 1.0
