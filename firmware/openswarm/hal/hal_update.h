/* SPDX-License-Identifier: MIT */
/* Lower layer of updates: contract; implemented in board/<robot>/update. Three slots of rows in non-volatile memory:
 * two stores, and the run slot that programs are linked for; one flag word per store. Writes are synchronous: when a
 * function returns, its cells are written. Power may fail at any moment. */
#ifndef HAL_UPDATE_H
#define HAL_UPDATE_H

#include <stdint.h>

enum {
    HAL_UPDATE_ROW = 96,  /* bytes */
    HAL_UPDATE_ROWS = 32, /* rows of a program; a store has one more, its head */
    HAL_UPDATE_STORES = 2,
    HAL_UPDATE_RUN = HAL_UPDATE_STORES /* number of the third slot */
};

void hal_update_read(uint8_t slot, uint8_t row, uint8_t *bytes);
void hal_update_erase(uint8_t slot, uint8_t row); /* afterwards all bits read 1 */
void hal_update_write(uint8_t slot, uint8_t row, const uint8_t *bytes); /* into an erased row */
uint16_t hal_update_flags(uint8_t store);
void hal_update_clear(uint8_t store, uint16_t bits); /* clears flag bits; the other bits cannot change */
void hal_update_renew(uint8_t store);                /* sets all flags to 1 */
void hal_update_run(void);                           /* calls the first word of HAL_UPDATE_RUN */

#endif
