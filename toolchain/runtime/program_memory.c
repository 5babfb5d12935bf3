/* SPDX-License-Identifier: MIT */
/* Reading flash and EEPROM by table reads, and programming them (libpic30.h; dspic30f6014a.md §16). TBLPAG is restored.
 * Two NOPs follow the start of an operation. Flash operations stall the CPU; EEPROM operations end when WR reads 0. */
#include <dspic30f6014a.h>
#include <libpic30.h>

#define ERASE_FLASH_ROW 0x4041
#define PROGRAM_FLASH_ROW 0x4001
#define ERASE_EEDATA_WORD 0x4044
#define ERASE_EEDATA_ROW 0x4045
#define ERASE_EEDATA_ALL 0x4046
#define PROGRAM_EEDATA_WORD 0x4004
#define PROGRAM_EEDATA_ROW 0x4005
#define LAST_EEDATA_WORD 0x7FFFFE /* of every chip */
#define UNLOCK_CYCLES 8 /* DISI: no interrupt of level 1 to 6 between the keys and WR */

static inline unsigned page_of(_prog_addressT address) { return (unsigned)(address >> 16); }

static void start(unsigned operation)
{
    NVMCON = operation;
    __builtin_disi(UNLOCK_CYCLES);
    __builtin_write_NVM();
}

/* Copy `length` bytes, `width` bytes (2 or 3) from each address; stop after a NUL if `text`. */
static _prog_addressT copy(char *to, _prog_addressT from, unsigned length, unsigned width, int text)
{
    unsigned page = TBLPAG;
    unsigned within = width;
    while (length-- != 0) {
        if (within == width) {
            within = 0;
            TBLPAG = page_of(from);
            from += 2;
        }
        unsigned offset = (unsigned)from - 2;
        char byte = (char)(within == 0 ? __builtin_tblrdl(offset) & 0xFF
                           : within == 1 ? __builtin_tblrdl(offset) >> 8 : __builtin_tblrdh(offset));
        within++;
        *to++ = byte;
        if (text && byte == 0)
            break;
    }
    TBLPAG = page;
    return from;
}

_prog_addressT _memcpy_p2d16(void *destination, _prog_addressT source, unsigned int bytes)
{
    return copy(destination, source, bytes, 2, 0);
}

_prog_addressT _memcpy_p2d24(void *destination, _prog_addressT source, unsigned int bytes)
{
    return copy(destination, source, bytes, 3, 0);
}

_prog_addressT _strncpy_p2d16(char *destination, _prog_addressT source, unsigned int bytes)
{
    return copy(destination, source, bytes, 2, 1);
}

_prog_addressT _strncpy_p2d24(char *destination, _prog_addressT source, unsigned int bytes)
{
    return copy(destination, source, bytes, 3, 1);
}

/* Start an operation at an address. A table write fills one latch and sets NVMADRU:NVMADR. */
static void start_at(_prog_addressT address, unsigned operation, unsigned latch)
{
    unsigned page = TBLPAG;
    TBLPAG = page_of(address);
    __builtin_tblwtl((unsigned)address, latch);
    TBLPAG = page;
    start(operation);
}

void _erase_eedata(_prog_addressT destination, int bytes)
{
    start_at(destination, bytes == _EE_ROW ? ERASE_EEDATA_ROW : ERASE_EEDATA_WORD, 0xFFFF);
}

void _erase_eedata_all(void)
{
    start_at(LAST_EEDATA_WORD, ERASE_EEDATA_ALL, 0xFFFF);
}

void _wait_eedata(void)
{
    while (NVMCONbits.WR) {
    }
}

void _write_eedata_word(_prog_addressT destination, int word)
{
    start_at(destination, PROGRAM_EEDATA_WORD, (unsigned)word);
}

void _write_eedata_row(_prog_addressT destination, const void *source)
{
    const unsigned *word = source;
    unsigned page = TBLPAG;
    TBLPAG = page_of(destination);
    for (unsigned k = 0; k < _EE_ROW; k += 2)
        __builtin_tblwtl((unsigned)destination + k, *word++);
    TBLPAG = page;
    start(PROGRAM_EEDATA_ROW);
}

void _erase_flash(_prog_addressT destination)
{
    start_at(destination, ERASE_FLASH_ROW, 0xFFFF);
}

void _write_flash16(_prog_addressT destination, const int *source)
{
    unsigned page = TBLPAG;
    TBLPAG = page_of(destination);
    for (unsigned k = 0; k < 2 * _FLASH_ROW; k += 2)
        __builtin_tblwtl((unsigned)destination + k, (unsigned)*source++);
    TBLPAG = page;
    start(PROGRAM_FLASH_ROW);
}

void _write_flash24(_prog_addressT destination, const long *source)
{
    unsigned page = TBLPAG;
    TBLPAG = page_of(destination);
    for (unsigned k = 0; k < 2 * _FLASH_ROW; k += 2, source++) {
        __builtin_tblwtl((unsigned)destination + k, (unsigned)*source);
        __builtin_tblwth((unsigned)destination + k, (unsigned)(*source >> 16));
    }
    TBLPAG = page;
    start(PROGRAM_FLASH_ROW);
}
