/* SPDX-License-Identifier: MIT */
/* Rows of updates in flash (update_slots.h), flags in two words of the data EEPROM. */
#include "../flash/flash_cells.h"
#include "hal_update.h"
#include "update_slots.h"

enum {
    ALL_LEVELS = 0xE0, /* IPL in SR */
    RUN_PAGE = (uint32_t)UPDATE_RUN >> 16, /* of program memory */
    STORE_PAGE = UPDATE_STORES >> 16,
    STORE = UPDATE_STORES & 0xFFFF,
    STORE_UNITS = (HAL_UPDATE_ROWS + 1) * FLASH_ROW_UNITS,
    EEPROM_PAGE = 0x7F,
    FLAGS = 0xFFF0
};

/* Sets TBLPAG to the upper half of a row's program address; returns the lower half. */
static uint16_t find_row(uint8_t slot, uint8_t row)
{
    TBLPAG = slot == HAL_UPDATE_RUN ? RUN_PAGE : STORE_PAGE;
    uint16_t base = slot == HAL_UPDATE_RUN ? UPDATE_RUN : (uint16_t)(STORE + slot * (uint16_t)STORE_UNITS);
    return (uint16_t)(base + row * (uint16_t)FLASH_ROW_UNITS);
}

/* Performs an operation on the address and data of the preceding table writes. Flash stalls the CPU meanwhile, EEPROM
 * does not. No interrupt of any level may occur between the writes of the key. */
static void __attribute__((noinline)) operate(uint16_t operation)
{
    uint16_t level = SR & ALL_LEVELS;
    SR |= ALL_LEVELS;
    flash_begin(operation);
    SR = (SR & (uint16_t)~ALL_LEVELS) | level;
    flash_wait();
}

void hal_update_read(uint8_t slot, uint8_t row, uint8_t *bytes)
{
    uint16_t offset = find_row(slot, row);
    for (uint16_t end = (uint16_t)(offset + FLASH_ROW_UNITS); offset != end; offset += 2) {
        uint16_t low = __builtin_tblrdl(offset);
        *bytes++ = (uint8_t)low;
        *bytes++ = (uint8_t)(low >> 8);
        *bytes++ = (uint8_t)__builtin_tblrdh(offset);
    }
}

void hal_update_erase(uint8_t slot, uint8_t row)
{
    __builtin_tblwtl(find_row(slot, row), 0);
    operate(FLASH_ERASE_ROW);
}

void hal_update_write(uint8_t slot, uint8_t row, const uint8_t *bytes)
{
    flash_latch_row(find_row(slot, row), bytes);
    operate(FLASH_PROGRAM_ROW);
}

uint16_t hal_update_flags(uint8_t store)
{
    TBLPAG = EEPROM_PAGE;
    return __builtin_tblrdl((uint16_t)(FLAGS + 2u * store));
}

void hal_update_clear(uint8_t store, uint16_t bits)
{
    TBLPAG = EEPROM_PAGE;
    __builtin_tblwtl((uint16_t)(FLAGS + 2u * store), (uint16_t)~bits);
    operate(EEPROM_PROGRAM_WORD);
}

void hal_update_renew(uint8_t store)
{
    TBLPAG = EEPROM_PAGE;
    __builtin_tblwtl((uint16_t)(FLAGS + 2u * store), 0);
    operate(EEPROM_ERASE_WORD);
}

void hal_update_run(void)
{
    __asm__ volatile("call %0" : : "i"((uint32_t)UPDATE_RUN) : "w0", "w1", "w2", "w3", "w4", "w5", "w6", "w7", "memory");
}
