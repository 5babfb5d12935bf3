/* SPDX-License-Identifier: MIT */
/* Self-programming of the dsPIC30F6014A's flash. Rows of 32 instructions, 64 program addresses, are erased to FFFFFF
 * and programmed whole. Each operation takes 2 ms (typically), in which the CPU stalls and interrupts wait. Callers
 * disable interrupts, because none may occur between the writes of the key. Functions are inlined, so that a boot
 * loader fits into its rows. */
#ifndef FLASH_CELLS_H
#define FLASH_CELLS_H

#include <p30F6014A.h>
#include <stdbool.h>
#include <stdint.h>

enum { FLASH_ROW_BYTES = 96, FLASH_ROW_UNITS = 64 };
enum { FLASH_ERASE_ROW = 0x4041, FLASH_PROGRAM_ROW = 0x4001, EEPROM_ERASE_WORD = 0x4044, EEPROM_PROGRAM_WORD = 0x4004 };

#define FLASH_INLINE static inline __attribute__((always_inline))

FLASH_INLINE void flash_begin(uint16_t operation)
{
    NVMCON = operation;
    __builtin_write_NVM();
}

FLASH_INLINE void flash_wait(void)
{
    while (NVMCONbits.WR) {
    }
}

FLASH_INLINE void flash_operate(uint16_t operation)
{
    flash_begin(operation);
    flash_wait();
}

/* Writes a row to the latches that FLASH_PROGRAM_ROW programs. Every table write also selects the row. */
FLASH_INLINE void flash_latch_row(uint16_t offset, const uint8_t *bytes)
{
    for (uint16_t end = (uint16_t)(offset + FLASH_ROW_UNITS); offset != end; offset += 2, bytes += 3) {
        __builtin_tblwtl(offset, bytes[0] | (uint16_t)bytes[1] << 8);
        __builtin_tblwth(offset, bytes[2]);
    }
}

/* `page` and `offset` are the program address of a row. `bytes`: three for each instruction, the lowest first. */
FLASH_INLINE void flash_write_row(uint16_t page, uint16_t offset, const uint8_t *bytes)
{
    TBLPAG = page;
    __builtin_tblwtl(offset, 0);
    flash_operate(FLASH_ERASE_ROW);
    flash_latch_row(offset, bytes);
    flash_operate(FLASH_PROGRAM_ROW);
}

FLASH_INLINE bool flash_row_holds(uint16_t page, uint16_t offset, const uint8_t *bytes)
{
    TBLPAG = page;
    for (uint16_t end = offset + FLASH_ROW_UNITS; offset != end; offset += 2, bytes += 3) {
        uint16_t low = __builtin_tblrdl(offset);
        if ((uint8_t)low != bytes[0] || low >> 8 != bytes[1] || (uint8_t)__builtin_tblrdh(offset) != bytes[2]) {
            return false;
        }
    }
    return true;
}

#endif
