"""Text of large objects: the first numbers, then dots."""

from __future__ import annotations

from emu.debug.dwarf.types import MAX_SHOWN_NUMBERS, UNSIGNED, Member, Type, text_of

ROW = Type("array", size=40, count=20, target=UNSIGNED[2])
GRID = Type("array", size=800, count=20, target=ROW)


def test_a_row_shows_sixteen_elements() -> None:
    assert text_of(ROW, list(range(20))) == "{" + ", ".join(map(str, range(16))) + ", ...}"


def test_an_array_of_arrays_shows_a_limited_number_of_numbers() -> None:
    text = text_of(GRID, [[7] * 20 for _ in range(20)])
    assert text.count("7") == MAX_SHOWN_NUMBERS
    assert text.endswith("...}, ...}")


def test_a_struct_with_many_members_is_cut_too() -> None:
    names = [f"m{number}" for number in range(100)]
    kind = Type("struct", size=200, members=tuple(Member(name, UNSIGNED[2], 2 * n) for n, name in enumerate(names)))
    text = text_of(kind, dict.fromkeys(names, 1))
    assert text.count("= 1") == MAX_SHOWN_NUMBERS
    assert text.endswith(", ...}")


def test_a_small_object_is_complete() -> None:
    kind = Type("struct", size=4, members=(Member("a", UNSIGNED[2], 0), Member("b", UNSIGNED[2], 2)))
    assert text_of(kind, {"a": 1, "b": 2}) == "{a = 1, b = 2}"
