"""`bounds` on valid code that it cannot follow, and on images whose debug information is damaged."""

from __future__ import annotations

import random
from pathlib import Path

import pytest
from elftools.elf.elffile import ELFFile

from toolchain.bounds.abstract.values import interval
from toolchain.cli import main

SHIFT = """    .text
    .global _shift
_shift:
    sftac A, w0
    return
    .global _main
_main:
    mov 0x1000, w0
    rcall _shift
    return
"""
SOURCE = """typedef int (*handler)(int, long);
struct pair { int a; handler f; } pairs[3];
int main(void) { return pairs[1].f ? pairs[1].f(1, 2) : pairs[0].a; }
"""


def test_a_shift_by_a_number_from_memory_has_a_bound(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A shift by an unknown count has a bound, although a negative count shifts in the other direction."""
    source, image = tmp_path / "shift.s", tmp_path / "shift.elf"
    source.write_text(SHIFT)
    assert main(["as", str(source), "-o", str(tmp_path / "shift.o")]) == 0
    assert main(["cc", str(tmp_path / "shift.o"), "-o", str(image)]) == 0
    assert main(["bounds", str(image)]) == 0
    assert "main" in capsys.readouterr().out


def test_a_path_into_data_ends_there(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A function that runs into words that are no instructions has no bound, and the report names the place."""
    source, image = tmp_path / "falls.s", tmp_path / "falls.elf"
    source.write_text("    .text\n    .global _main\n_main:\n    clr w0\n    .pword 0x0AFFF6\n    return\n")
    assert main(["as", str(source), "-o", str(tmp_path / "falls.o")]) == 0
    assert main(["cc", str(tmp_path / "falls.o"), "-o", str(image)]) == 0
    assert main(["bounds", str(image)]) == 0
    assert "_main+0x2: no instruction is here" in capsys.readouterr().out


@pytest.mark.parametrize("counts", [(-5, 3), (-9, -2), (0, 4), (2, 20)])
@pytest.mark.parametrize("values", [(-7, 5), (3, 9), (6, 6)])
def test_a_shift_contains_all_results(counts: tuple[int, int], values: tuple[int, int]) -> None:
    """The result of a shift contains each value shifted by each count of 0 or more."""
    for left in (False, True):
        value, count = interval(*values), interval(*counts)
        found = value << count if left else value >> count
        lo, hi = (found, found) if isinstance(found, int) else (found.lo, found.hi)
        for one in range(values[0], values[1] + 1):
            for by in range(max(counts[0], 0), counts[1] + 1):
                assert lo <= (one << by if left else one >> by) <= hi


@pytest.fixture(scope="module")
def image(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """Return an image with debug information."""
    folder = tmp_path_factory.mktemp("image")
    (folder / "main.c").write_text(SOURCE)
    assert main(["cc", "-g", str(folder / "main.c"), "-o", str(folder / "main.elf")]) == 0
    return (folder / "main.elf").read_bytes()


def with_damage(image: bytes, folder: Path, name: str, change: dict[int, int]) -> Path:
    """Write the image with some octets of a section changed."""
    path = folder / "damaged.elf"
    path.write_bytes(image)
    with path.open("rb") as file:
        section = ELFFile(file).get_section_by_name(name)
        begin, size = section["sh_offset"], section["sh_size"]
    octets = bytearray(image)
    for offset, value in change.items():
        octets[begin + offset % size] = value
    path.write_bytes(octets)
    return path


def test_debug_information_without_abbreviations_is_one_line(
    image: bytes, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The reader's exception becomes one line and status 2."""
    path = with_damage(image, tmp_path, ".debug_abbrev", dict.fromkeys(range(4), 0))
    assert main(["bounds", str(path)]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert "debug information is damaged" in error


@pytest.mark.parametrize("name", [".debug_info", ".debug_abbrev"])
def test_random_damage_never_ends_in_an_exception(image: bytes, tmp_path: Path, name: str) -> None:
    """Twenty images with three changed octets each are analysed or refused."""
    draw = random.Random(name)
    found = set()
    for _ in range(20):
        change = {draw.randrange(1 << 16): draw.randrange(256) for _ in range(3)}
        found.add(main(["bounds", str(with_damage(image, tmp_path, name, change))]))
    assert found <= {0, 2}
    assert 2 in found
