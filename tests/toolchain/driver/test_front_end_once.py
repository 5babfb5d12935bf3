"""Builds that share one run of the front end (`c_programs.FrontEndOnce`)."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.toolchain.c_programs import FrontEndOnce, build
from toolchain.driver import driver

ONE = "int other(int x);\nint values[3] = {1, 2, 3};\nint main(void) { return other(values[1]); }\n"
TWO = "extern int values[3];\nint other(int x) { return x * values[2] + ADDED; }\n"


def test_images_are_those_of_builds_on_their_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Images built from cached IR equal those of separate builds, at every level, merged and file by file."""
    runs: list[str] = []
    original = driver.front_end
    monkeypatch.setattr(driver, "front_end", lambda o, scratch: runs.append(o.level) or original(o, scratch))
    (tmp_path / "one.c").write_text(ONE)
    (tmp_path / "two.c").write_text(TWO)
    sources = [tmp_path / "one.c", tmp_path / "two.c"]
    once = FrontEndOnce()
    for level in ("-O0", "-Os"):
        images = []
        for alone in ([], ["-fno-lto"]):
            options = [level, *alone, f"-DADDED={len(level)}"]
            for name, front in (("shared", once), ("own", None)):
                built = build(sources, tmp_path / f"{name}.elf", *options, front=front)
                assert built.status == 0, built.messages
            images.append((tmp_path / "own.elf").read_bytes())
            assert (tmp_path / "shared.elf").read_bytes() == images[-1]
        assert level != "-Os" or images[0] != images[1]
    assert runs == ["0", "0", "0", "s", "s", "s"]
    assert build(sources, tmp_path / "x.elf", "-Os", "-DADDED=1", front=once).status == 0
    assert len(runs) == 7
