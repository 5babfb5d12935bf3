"""SECURITY.md: each sentence and each input names tests that exist, its limits are those of the code; tests of inputs
without a module."""

from __future__ import annotations

import ast
import re
import tomllib
from functools import cache
from importlib import import_module
from pathlib import Path

import pytest

import emu.cli
from emu.avr.image import MAX_OCTETS, load_avr_image
from emu.image.model import LoadError
from toolchain.cli import main
from toolchain.elf.archive import ArchiveMember, archive_bytes

ROOT = Path(__file__).resolve().parents[1]


UNITS = {"": 1, " s": 1, " KiB": 1 << 10, " MiB": 1 << 20, " GiB": 1 << 30}


def table(heading: str) -> list[str]:
    """Return the rows of the table below a heading."""
    text = (ROOT / "SECURITY.md").read_text().partition(f"{heading}\n")[2].partition("\n## ")[0]
    return [line for line in text.splitlines() if line.startswith("| ")][1:]


def named_tests() -> list[tuple[str, str]]:
    """Return file and function of the tests in the table "Inputs and outcomes"."""
    rows = table("## Inputs and outcomes")
    found = [re.fullmatch(r".*\| `([\w/]+\.py)::(\w+)` \|", row) for row in rows]
    assert all(found), [row for row, match in zip(rows, found, strict=True) if not match]
    return [(match[1], match[2]) for match in found if match]


@cache
def functions_of(file: str) -> frozenset[str]:
    """Return the names of the test functions of a file."""
    tree = ast.parse((ROOT / "tests" / file).read_text())
    return frozenset(node.name for node in tree.body if isinstance(node, ast.FunctionDef))


def test_every_line_of_the_table_names_a_test():
    named = named_tests()
    assert len(named) > 20
    assert len(set(named)) == len(named)
    assert [f"{file}::{name}" for file, name in named if name not in functions_of(file)] == []


def sentences(text: str) -> list[str]:
    """Return the sentences of a cell or a paragraph, which end with a full stop or a semicolon, without marks."""
    return [one.strip(" .;") for one in re.split(r"(?<=[.;]) ", " ".join(text.replace("**", "").split()))]


def claims(text: str) -> dict[str, list[str]]:
    """Return the sentences of SECURITY.md that need a test, by input or section."""
    begin, _, rest = text.partition("\n## ")
    rows = [line.strip("| ").split(" | ") for line in begin.splitlines() if line.startswith("| ")][1:]
    found = {cells[0]: [one for cell in cells[1:] for one in sentences(cell)] for cells in rows}
    paragraph = rest.partition("\n## Limits\n\n")[2].partition("\n\n|")[0]
    return found | {"Limits": sentences(paragraph)}


def test_every_sentence_has_a_test():
    """`security_claims.toml` names the tests behind each sentence, and no sentence that is not in SECURITY.md."""
    known = tomllib.loads((ROOT / "tests" / "security_claims.toml").read_text())
    found = claims((ROOT / "SECURITY.md").read_text())
    assert known.keys() == found.keys()
    assert [(name, one) for name in known for one in {*known[name]} ^ {*found[name]}] == []
    named = [test for one in known.values() for tests in one.values() for test in tests]
    assert all(tests for one in known.values() for tests in one.values())
    assert [one for one in named if one.partition("::")[2] not in functions_of(one.partition("::")[0])] == []


def test_a_new_sentence_is_found():
    """A sentence that is added to a cell of the table or to the paragraph of limits is one that needs a test."""
    text = (ROOT / "SECURITY.md").read_text()
    before, after = claims(text), claims(text.replace(" |\n", "; new |\n").replace("--minutes`.", "--minutes`. new."))
    assert before.keys() == after.keys()
    assert all(sorted(after[name]) == sorted([*before[name], "new"]) for name in before)


def test_the_limits_are_those_of_the_code():
    rows = table("## Limits")
    assert len(rows) > 15
    for row in rows:
        limit = re.fullmatch(r"\| [^|]+ \| ([\d,]+)( s| [KMG]iB|) \| `([\w.]+)\.(\w+)` \|", row)
        assert limit, row
        number, unit, module, name = limit.groups()
        assert getattr(import_module(module), name) == int(number.replace(",", "")) * UNITS[unit], row


@pytest.mark.parametrize("name", ["../out", "/tmp/out", "folder/out", ".."])
def test_members_of_archives_stay_in_the_folder(name, tmp_path, monkeypatch, capsys):
    """`ar x` refuses a member with a folder in its name before it writes any member."""
    inside = tmp_path / "inside"
    inside.mkdir()
    monkeypatch.chdir(inside)
    archive = tmp_path / "hostile.a"
    archive.write_bytes(archive_bytes([ArchiveMember("fine.o", b"1"), ArchiveMember(name, b"2")]))
    assert main(["ar", "x", str(archive)]) == 2
    assert "is not a plain file name" in capsys.readouterr().err
    assert sorted(path.name for path in tmp_path.rglob("*")) == ["hostile.a", "inside"]


def test_lines_of_any_regular_file_are_shown_as_a_source(tmp_path, capsys):
    """The listing of an image shows a file that its debug information names, whatever the file is."""
    secret = tmp_path / "secret.txt"
    secret.write_text("first\nof another person\n")
    source, image = tmp_path / "main.c", str(tmp_path / "main.elf")
    source.write_text(f'#line 2 "{secret}"\nint main(void) {{ for (;;) {{ }} }}\n')
    assert main(["cc", "-g", "-Os", str(source), "-o", image]) == 0
    assert emu.cli.main(["disasm", image, "--source"]) == 0
    assert "of another person" in capsys.readouterr().out


def test_a_source_includes_any_file(tmp_path, capsys):
    (tmp_path / "folder").mkdir()
    (tmp_path / "folder" / "secret.txt").write_text("int secret = 4711;\n")
    (tmp_path / "main.c").write_text(f'#include "{tmp_path}/folder/secret.txt"\n')
    assert main(["cc", "-E", str(tmp_path / "main.c")]) == 0
    assert "secret = 4711" in capsys.readouterr().out


def test_large_avr_images_are_refused(tmp_path):
    """A file above 16 MiB is refused although its beginning is valid."""
    image = tmp_path / "main.hex"
    image.write_text(":02000000FFCF30\n:00000001FF\n")
    load_avr_image(str(image))
    with image.open("r+b") as file:
        file.truncate(MAX_OCTETS + 1)
    with pytest.raises(LoadError, match="MiB"):
        load_avr_image(str(image))


def hex_of(words: list[int]) -> str:
    """Return an Intel HEX file of a program for the ATmega328P."""
    body = b"".join(word.to_bytes(2, "little") for word in words)
    record = bytes([len(body), 0, 0, 0]) + body
    return f":{record.hex()}{-sum(record) & 0xFF:02x}\n:00000001FF\n".upper()


LDI_R30, LDI_R31, ST_Z, LD_Z, RJMP_BACK = 0xE0E0, 0xE0F9, 0x8300, 0x8100, 0xCFFF
"""ldi r30, 0; ldi r31, 9; st Z, r16; ld r16, Z; rjmp to itself. The RAM ends at 0x8ff."""


@pytest.mark.parametrize(("access", "what"), [(ST_Z, "store to"), (LD_Z, "load from")])
def test_an_avr_program_reaches_nothing_of_the_host(tmp_path, access, what, capsys):
    """An access behind the last address of the chip's RAM is a fault of the firmware."""
    image = tmp_path / "main.hex"
    image.write_text(hex_of([LDI_R30, LDI_R31, access, RJMP_BACK]))
    assert emu.cli.main(["run", str(image), "--board", "kilobot", "--cycles", "100"]) == 1
    assert f"fault: {what} 0x0900, behind the end of RAM" in capsys.readouterr().err


@pytest.mark.parametrize("limit", [("--cycles", "80000"), ("--seconds", "0.01")])
def test_an_endless_avr_program_ends_at_its_limit(tmp_path, limit, capsys):
    image = tmp_path / "main.hex"
    image.write_text(hex_of([RJMP_BACK]))
    assert emu.cli.main(["run", str(image), "--board", "kilobot", *limit]) == 0
    assert "after 80000 cycles" in capsys.readouterr().err.replace(",", "")
