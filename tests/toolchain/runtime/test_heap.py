"""The heap on the emulator: alignment; blocks never overlap, and freed memory becomes available."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.toolchain.c_programs import build, run

ALIGNED_PROGRAM = r"""
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
static unsigned char *block[12];
static unsigned size[12];
int main(void)
{
    static const unsigned refused[][2] = {{0, 8}, {24, 8}, {0x8000, 8}, {16, 0xFFF0}};
    for (unsigned i = 0; i < 4; i++) {
        void *volatile memory = aligned_alloc(refused[i][0], refused[i][1]);
        if (memory)
            return 1;
    }
    void *volatile all = malloc(800);
    free(all);
    srand(3);
    for (unsigned round = 0; round < 300; round++) {
        unsigned i = (unsigned)rand() % 12, alignment = 1u << rand() % 7;
        for (unsigned k = 0; block[i] && k < size[i]; k++)
            if (block[i][k] != i)
                return 2;
        free(block[i]);
        size[i] = (unsigned)rand() % 40;
        block[i] = rand() % 4 ? aligned_alloc(alignment, size[i]) : malloc(size[i]);
        if (!block[i])
            continue;
        if (rand() % 4 == 0) {
            unsigned char *moved = realloc(block[i], size[i] += 10);
            if (!moved)
                return 3;
            block[i] = moved;
        } else if ((uintptr_t)block[i] & 1)
            return 4;
        memset(block[i], (int)i, size[i]);
    }
    for (unsigned bits = 1; bits < 9; bits++) {
        void *volatile memory = aligned_alloc(1u << bits, 10);
        if (!memory || (uintptr_t)memory & ((1u << bits) - 1))
            return 5;
        free(memory);
    }
    for (unsigned i = 0; i < 12; i++)
        free(block[i]);
    void *volatile again = malloc(800);
    return again == all ? 0 : 6; /* all of it joins again */
}
"""


@pytest.mark.parametrize("level", ["-O0", "-Os"])
def test_aligned_blocks(level: str, tmp_path: Path) -> None:
    """Aligned allocation (C11 7.22.3.1) works, and the bytes before an aligned block can be allocated."""
    (tmp_path / "a.c").write_text(ALIGNED_PROGRAM)
    built = build([tmp_path / "a.c"], tmp_path / "a.elf", level, "-Wall", "-Wl,--heap=2000")
    assert built.status == 0, built.messages
    ran = run(tmp_path / "a.elf", engine="auto")
    assert ran.status == 0, ran
