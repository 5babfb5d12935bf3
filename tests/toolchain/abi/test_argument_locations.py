"""Locations of arguments: each row of the table in abi-elf.md §2.2."""

from __future__ import annotations

import pytest

from toolchain.abi.arguments import ArgumentShape, argument_locations, scalar_shape, struct_shape
from toolchain.ir.model import I8, I16, I32, I64, Type


def scalar(bits: int) -> ArgumentShape:
    return scalar_shape({8: I8, 16: I16, 32: I32, 64: I64}[bits])


def struct(*members: Type) -> ArgumentShape:
    return struct_shape(Type("struct", 0, members))


def array(count: int, of: Type) -> Type:
    return Type("array", 0, (of,), count)


INT, LONG, LLONG = scalar(16), scalar(32), scalar(64)
ROWS: list[tuple[str, list[ArgumentShape], list[object]]] = [
    ("ten ints", [INT] * 10, [0, 1, 2, 3, 4, 5, 6, 7, "stack 6", "stack 8"]),
    ("int long int long int int int", [INT, LONG, INT, LONG, INT, INT, INT], [0, 2, 1, 4, 6, 7, "stack 6"]),
    ("int llong int int", [INT, LLONG, INT, INT], [0, 4, 1, 2]),
    ("int int int llong long int", [INT, INT, INT, LLONG, LONG, INT], [0, 1, 2, 4, "stack 8", 3]),
    ("int {int,int} int", [INT, struct(I16, I16), INT], [0, 2, 1]),
    ("int {char[4]} int", [INT, struct(array(4, I8)), INT], [0, 1, 3]),
    ("int {int,int,int} int", [INT, struct(I16, I16, I16), INT], [0, 1, 4]),
    ("int {4 ints} int", [INT, struct(*[I16] * 4), INT], [0, 4, 1]),
    ("{8 ints} int", [struct(*[I16] * 8), INT], [0, "stack 6"]),
    ("{9 ints} int", [struct(*[I16] * 9), INT], ["stack 22", 0]),
    ("float int float double int", [LONG, INT, LONG, LLONG, INT], [0, 2, 4, "stack 12", 3]),
    ("{char;int} is a scalar of 4 bytes", [INT, struct(I8, I16)], [0, 2]),
    ("{int a[4]} is a scalar of 8 bytes", [INT, struct(array(4, I16))], [0, 4]),
    ("one char", [scalar(8)], [0]),
]


@pytest.mark.parametrize(("name", "shapes", "expected"), ROWS, ids=[r[0] for r in ROWS])
def test_arguments_have_the_locations_of_xc16(name: str, shapes: list[ArgumentShape], expected: list[object]) -> None:
    """Arguments have XC16's locations (abi-elf.md §2.2, rules 1-4 and table).

    "stack n": the low end of the argument lies n bytes below W15 at entry.
    """
    places = argument_locations(shapes, False)
    assert [p.register if p.register is not None else f"stack {p.stack}" for p in places] == expected


def test_all_arguments_of_a_variadic_function_with_one_named_are_on_the_stack() -> None:
    """Arguments of f(first, ...) are all on the stack, the first one right below the return address (§2.2, rule 5).

    Source: abi-elf.md.
    """
    places = argument_locations([INT, LONG, scalar(8)], named=1)
    assert [p.register for p in places] == [None] * 3
    assert [p.stack for p in places] == [6, 10, 12]


def test_named_arguments_before_the_last_of_a_variadic_function_are_in_registers() -> None:
    """Named arguments that precede the last named one are in registers: g(int a,long b,int n,...) (abi-elf.md §2.2,
    rule 5)."""
    places = argument_locations([INT, LONG, INT, LONG], named=3)
    assert [p.register for p in places] == [0, 2, None, None]
    assert [p.stack for p in places[2:]] == [6, 10]
