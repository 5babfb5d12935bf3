"""malloc without a heap: a warning when linking, and a null pointer that the program can test."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.toolchain.c_programs import build, run

PROGRAM = "#include <stdlib.h>\nint main(void) { char *p = malloc(10); if (!p) return 7; free(p); return 0; }\n"


@pytest.mark.parametrize("level", ["-O0", "-Os"])
def test_malloc_without_a_heap_fails_with_a_warning(level: str, tmp_path: Path) -> None:
    (tmp_path / "a.c").write_text(PROGRAM)
    built = build([tmp_path / "a.c"], tmp_path / "a.elf", level)
    assert built.status == 0
    assert "warning: malloc always fails, because there is no heap (called at a.c:(" in built.messages
    assert "link with -Wl,--heap=BYTES" in built.messages
    assert run(tmp_path / "a.elf").status == 7


def test_there_is_no_warning_with_a_heap_or_with_another_malloc(tmp_path: Path) -> None:
    (tmp_path / "a.c").write_text(PROGRAM)
    assert build([tmp_path / "a.c"], tmp_path / "a.elf", "-Os", "-Wl,--heap=64").messages == ""
    own = "static char room[64]; void *malloc(unsigned size) { return room; } void free(void *p) {}\n"
    (tmp_path / "b.c").write_text(own)
    assert build([tmp_path / "a.c", tmp_path / "b.c"], tmp_path / "b.elf", "-Os", "-w").messages == ""
