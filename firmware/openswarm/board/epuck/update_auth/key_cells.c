/* SPDX-License-Identifier: MIT */
/* The key in flash (key_slot.h) and the version floor in four words of the data EEPROM, above the flags of the stores. */
#include "../flash/flash_cells.h"
#include "hal_update_auth.h"
#include "key_slot.h"

enum { ALL_LEVELS = 0xE0 /* IPL in SR */, EEPROM_PAGE = 0x7F, CELLS = 0xFFF8 };

void hal_update_key(uint8_t *key)
{
    TBLPAG = UPDATE_KEY >> 16;
    for (uint16_t offset = UPDATE_KEY & 0xFFFF; offset != (UPDATE_KEY & 0xFFFF) + HAL_UPDATE_KEY; offset += 2) {
        uint16_t low = __builtin_tblrdl(offset);
        *key++ = (uint8_t)low;
        *key++ = (uint8_t)(low >> 8);
    }
}

uint16_t hal_update_cell(uint8_t cell)
{
    TBLPAG = EEPROM_PAGE;
    return __builtin_tblrdl((uint16_t)(CELLS + 2u * cell));
}

/* No interrupt may occur between the writes of the key of NVM. */
static void write(uint8_t cell, uint16_t value, uint16_t operation)
{
    uint16_t level = SR & ALL_LEVELS;
    TBLPAG = EEPROM_PAGE;
    SR |= ALL_LEVELS;
    __builtin_tblwtl((uint16_t)(CELLS + 2u * cell), value);
    flash_begin(operation);
    SR = (SR & (uint16_t)~ALL_LEVELS) | level;
    flash_wait();
}

void hal_update_set_cell(uint8_t cell, uint16_t value)
{
    write(cell, 0, EEPROM_ERASE_WORD);
    write(cell, value, EEPROM_PROGRAM_WORD);
}
