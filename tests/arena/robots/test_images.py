"""Images of the project's applications, which `arena` builds before a run."""

from __future__ import annotations

import io
import sys
from pathlib import Path

import pytest

from arena.robots.images import image_for
from emu.host import paths


class Terminal(io.StringIO):
    """A stream that says that it is a terminal."""

    def isatty(self) -> bool:
        """Return True."""
        return True


@pytest.fixture
def firmware(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a folder of firmware with the application `walk` and a Makefile that writes its image."""
    (tmp_path / "apps" / "walk").mkdir(parents=True)
    (tmp_path / "Makefile").write_text("all:\n\tmkdir -p $(OUT)\n\techo image >$(OUT)/firmware.elf\n")
    monkeypatch.setattr(paths, "firmware", lambda: tmp_path)
    return tmp_path


@pytest.mark.parametrize(("stream", "said"), [(Terminal(), "building walk ...\n"), (io.StringIO(), "")])
def test_a_terminal_shows_the_first_build(
    stream: io.StringIO, said: str, firmware: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A terminal gets a line before the first build of an image, and none before later ones; a file gets none."""
    monkeypatch.setattr(sys, "stderr", stream)
    for _ in range(2):
        image = image_for("walk")
        assert image is not None
        assert image.read_text() == "image\n"
        assert stream.getvalue() == said


def test_a_failed_build_is_explained(firmware: Path) -> None:
    """The error contains the command and the messages of make."""
    (firmware / "Makefile").write_text("all:\n\techo wheel missing >&2; false\n")
    with pytest.raises(ValueError, match=r"--brain walk: make -C .* failed:\n.*wheel missing"):
        image_for("walk")
