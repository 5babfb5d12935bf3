"""Functions of libpic30.h that read flash and EEPROM and program them, on the emulated chip.

Constants and results are those of Microchip's "16-Bit Language Tools Libraries", chapter 4.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.toolchain.c_programs import build, run

PROGRAM = r"""
#include <xc.h>
#include <libpic30.h>
#include <string.h>

int _EEDATA(32) row[16] = {1, 2, 3};
int __attribute__((space(eedata))) other = 77;
const char __attribute__((space(prog))) text[] = "flash text";
int __attribute__((space(prog), aligned(_FLASH_PAGE * 2))) page[_FLASH_PAGE];
long words[_FLASH_ROW];
int halves[_FLASH_ROW];

#define CHECK(condition) do { if (!(condition)) return __LINE__; } while (0)

static int eeprom(void)
{
    _prog_addressT at, next;
    int ram[16];
    _init_prog_address(at, row);
    next = _memcpy_p2d16(ram, at, _EE_ROW);
    CHECK(next == at + 32 && ram[0] == 1 && ram[2] == 3 && ram[3] == 0);
    _erase_eedata(at, _EE_ROW);
    CHECK(NVMCONbits.WR == 1);
    _wait_eedata();
    _memcpy_p2d16(ram, at, _EE_ROW);
    CHECK(ram[0] == -1 && ram[15] == -1);
    for (int k = 0; k < 16; k++)
        ram[k] = k * 100;
    _write_eedata_row(at, ram);
    _wait_eedata();
    _erase_eedata(at + 4, _EE_WORD);
    _wait_eedata();
    _write_eedata_word(at + 4, -5);
    _wait_eedata();
    memset(ram, 0, sizeof ram);
    _memcpy_p2d16(ram, at, _EE_ROW);
    for (int k = 0; k < 16; k++)
        CHECK(ram[k] == (k == 2 ? -5 : k * 100));
    _init_prog_address(next, row[3]);
    CHECK(next == at + 6);
    _init_prog_address(at, other);
    _memcpy_p2d16(ram, at, 2);
    CHECK(ram[0] == 77);
    _erase_eedata_all();
    _wait_eedata();
    _memcpy_p2d16(ram, at, 2);
    CHECK(ram[0] == -1);
    return 0;
}

static int flash(void)
{
    _prog_addressT at, next;
    char copy[20] = {0};
    unsigned char bytes[3 * _FLASH_ROW];
    int read[_FLASH_ROW];
    _init_prog_address(at, text);
    CHECK(_strncpy_p2d16(copy, at, sizeof copy) == at + 12 && strcmp(copy, "flash text") == 0);
    memset(copy, 0, sizeof copy);
    next = _memcpy_p2d16(copy, at, 4);
    CHECK(_memcpy_p2d16(copy + 4, next, 5) == at + 10 && strcmp(copy, "flash tex") == 0);
    _init_prog_address(at, page);
    for (int k = 0; k < _FLASH_ROW; k++)
        words[k] = 0x120000 + k * 257L, halves[k] = k * 3;
    _erase_flash(at);
    _write_flash24(at, words);
    CHECK(_memcpy_p2d24(bytes, at, sizeof bytes) == at + 64);
    for (int k = 0; k < _FLASH_ROW; k++)
        CHECK((bytes[3 * k] | (long)bytes[3 * k + 1] << 8 | (long)bytes[3 * k + 2] << 16) == words[k]);
    CHECK(_strncpy_p2d24(copy, at, sizeof copy) == at + 2 && copy[0] == 0);
    _erase_flash(at);
    _write_flash16(at, halves);
    _memcpy_p2d16(read, at, sizeof read);
    CHECK(memcmp(read, halves, sizeof read) == 0);
    return 0;
}

int main(void)
{
    TBLPAG = 0x12;
    int line = eeprom();
    if (line == 0)
        line = flash();
    if (line == 0 && TBLPAG != 0x12)
        line = 1;
    return line;
}
"""


@pytest.mark.parametrize("level", ["-O0", "-Os"])
def test_eeprom_and_flash_are_read_and_programmed(level: str, tmp_path: Path) -> None:
    """Each function has its documented effect and leaves TBLPAG; the exit status is the line of a failed check."""
    (tmp_path / "main.c").write_text(PROGRAM)
    built = build([tmp_path / "main.c"], tmp_path / "main.elf", level, "-Wall", "-Wextra", "-Werror")
    assert built.status == 0, built.messages
    ran = run(tmp_path / "main.elf")
    assert (ran.status, ran.why) == (0, "")
