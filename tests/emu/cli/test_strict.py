"""Strict mode reports invalid accesses that the hardware permits, and accepts correct programs."""

from __future__ import annotations

import pytest

import emu
from emu.cli import main
from toolchain.driver import driver

MISTAKES = {
    "int *volatile p; int main(void) { *p = 5; return 0; }": "null pointer: writing 2 bytes at 0x0000",
    "char *volatile p; int main(void) { return p[3]; }": "null pointer: reading 1 byte at 0x0003",
    "struct s { int a[20], b; } *volatile p; int main(void) { p->b = 1; return 0; }": "writing 2 bytes at 0x0028",
    "int f(int n) { int a[4]; if (n) { a[2] = 1; } return a[2]; } volatile int z; int main(void) { return f(z); }":
        "uninitialised read of 2 bytes",
    "int f(void) { volatile int a[8]; a[7] = 1; return a[7]; } int g(void) { volatile int b[8]; return b[7]; }"
    "int main(void) { f(); return g(); }": "uninitialised read of 2 bytes",
    "int kept __attribute__((persistent)); int main(void) { return kept; }":
        "uninitialised read of 2 bytes at 0x0802 (kept)",
}  # fmt: skip
CORRECT = """
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
struct thing { int a; char c; long l; } things[3], copy;
static int compare(const void *a, const void *b) { return *(const int *)a - *(const int *)b; }
int __attribute__((noinline)) sum(int n, ...)
{
    __builtin_va_list l; int s = 0;
    __builtin_va_start(l, n); while (n--) { s += __builtin_va_arg(l, int); } __builtin_va_end(l);
    return s;
}
int main(void)
{
    int v[5] = {3, 1, 2, 5, 4}; char text[40]; struct thing t = {1, 'c', 2};
    qsort(v, 5, sizeof v[0], compare);
    things[1] = t; copy = things[1]; memcpy(&things[2], &copy, sizeof copy);
    snprintf(text, sizeof text, "%d %ld %s %c", v[4], things[2].l, "x", things[2].c);
    puts(text);
    return sum(3, 1, 2, 3) + (int)strlen(text);
}
"""


@pytest.fixture
def build(tmp_path):
    def make(source, *options):
        path, image = tmp_path / "p.c", tmp_path / "p.elf"
        path.write_text(source)
        assert driver.main(["-g", *(options or ["-O0"]), str(path), "-o", str(image)]) == 0
        return str(image)

    return make


@pytest.mark.parametrize(("source", "cause"), MISTAKES.items())
def test_a_mistake_is_a_fault_in_strict_mode_only(build, source, cause):
    path = build(source)
    assert emu.load(path).run(seconds=0.1).reason == "halt"
    stop = emu.load(path, strict=True).run(seconds=0.1)
    assert stop.reason == "fault"
    assert cause in stop.fault.cause
    assert stop.fault.function in ("main", "f", "g")
    assert stop.fault.branches
    assert main(["run", path, "--strict"]) == 1


@pytest.mark.parametrize("level", ["-O0", "-O1", "-O2", "-Os"])
def test_a_correct_program_runs_as_without_strict_mode(build, level):
    path = build(CORRECT, level)
    plain, strict = emu.load(path), emu.load(path, strict=True)
    expected = plain.run(seconds=0.1)
    assert expected.reason == "halt"
    assert strict.run(seconds=0.1) == expected
    assert plain.w[0] == strict.w[0] == 13


def test_a_poke_initialises_memory(build):
    path = build("int kept __attribute__((persistent)); int main(void) { return kept; }")
    machine = emu.load(path, strict=True)
    machine.poke("kept", 7)
    assert machine.run(seconds=0.1).reason == "halt"
    assert machine.w[0] == 7


def test_strict_mode_uses_the_plain_engine(build):
    path = build("int main(void) { return 0; }")
    assert emu.load(path, strict=True).engine == "plain"
    with pytest.raises(ValueError, match="plain"):
        emu.load(path, strict=True, engine="jit")
    assert main(["run", path, "--strict", "--engine", "jit"]) == 2
