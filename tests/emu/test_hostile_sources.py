"""Source files that an image names: devices, pipes and links to them are not read."""

from __future__ import annotations

import io
import os
from pathlib import Path

import pytest

import emu.cli
import toolchain.cli
from emu.host.sources import MAX_SOURCE_OCTETS, source_lines

PROGRAM = "int total;\nint main(void)\n{\n    for (;;) total++;\n}\n"


@pytest.fixture(params=["device", "pipe", "link"])
def endless(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    """Return a path whose reading never ends."""
    if not Path("/dev/zero").exists():
        pytest.skip("needs /dev/zero and named pipes")
    path = tmp_path / "endless.c"
    if request.param == "pipe":
        os.mkfifo(path)
    elif request.param == "link":
        path.symlink_to("/dev/zero")
    return Path("/dev/zero") if request.param == "device" else path


def test_an_image_that_names_an_endless_source_is_shown_without_it(
    endless: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Coverage with its pages, disassembly with sources, and a debug session end as they do without the source."""
    source, image = tmp_path / "main.c", str(tmp_path / "main.elf")
    source.write_text(f'#line 1 "{endless}"\n{PROGRAM}')
    assert toolchain.cli.main(["cc", "-g", "-Os", str(source), "-o", image]) == 0
    assert emu.cli.main(["coverage", image, "--seconds", "0.0001", "--html", str(tmp_path / "pages")]) == 0
    assert emu.cli.main(["disasm", image, "--source"]) == 0
    assert toolchain.cli.main(["objdump", "-S", image]) == 0
    monkeypatch.setattr("sys.stdin", io.StringIO("break main\nrun\nlist\n"))
    capsys.readouterr()
    assert emu.cli.main(["debug", "--tui", image, "--board", "none", "--seconds", "0.001"]) == 2
    assert "is no regular file" in capsys.readouterr().err


def test_sources_are_read_up_to_a_limit(tmp_path: Path) -> None:
    path = tmp_path / "main.c"
    path.write_bytes(b"one\r\n\xfftwo")
    assert source_lines(path) == ["one", "\N{REPLACEMENT CHARACTER}two"]
    with path.open("wb") as file:
        file.truncate(MAX_SOURCE_OCTETS + 1)
    with pytest.raises(OSError, match="is larger than 16 MiB"):
        source_lines(path)
