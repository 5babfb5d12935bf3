"""Inline assembly that clobbers W14 in a function whose frame pointer it is."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.toolchain.c_programs import build, run

PROGRAM = """
#define NOINLINE __attribute__((noinline))
NOINLINE int f(int n) { char *p = __builtin_alloca(n); p[0] = 3;
    asm volatile("mov #0x1234,w14" ::: "w14"); return p[0]; }
NOINLINE int g(int n) { volatile char v[n]; v[0] = n; asm volatile("clr w14" ::: "w14"); return v[0]; }
int main(void) { return f(10) * 10 + g(4); }
"""


@pytest.mark.parametrize("level", ["-O0", "-Os"])
def test_the_frame_pointer_is_saved(level: str, tmp_path: Path) -> None:
    (tmp_path / "a.c").write_text(PROGRAM)
    built = build([tmp_path / "a.c"], tmp_path / "a.elf", level, "-fverify-machine")
    assert built.status == 0, built.messages
    assert run(tmp_path / "a.elf").status == 34


def test_assembly_that_uses_the_stack_too_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.c").write_text(PROGRAM.replace("mov #0x1234,w14", "pop w14"))
    built = build([tmp_path / "a.c"], tmp_path / "a.elf", "-O0")
    assert built.status == 2
    reason = "inline assembly clobbers the frame pointer W14 and uses the stack"
    assert f"a.c:4: error: not supported: {reason}" in built.messages
