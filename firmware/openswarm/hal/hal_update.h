/* SPDX-License-Identifier: MIT */
/* Lower layer of programs that come as updates: contract here, code in board/<robot>/update. Three slots of rows that keep
 * what is written without power: two stores, and the slot a program is linked for. A flag word per store. Nothing is buffered:
 * when a function returns, its cells are written; power may fail at any moment in it. */
#ifndef HAL_UPDATE_H
#define HAL_UPDATE_H

#include <stdint.h>

enum {
    HAL_UPDATE_ROW = 96,  /* bytes */
    HAL_UPDATE_ROWS = 32, /* of a program; a store has one more, the first */
    HAL_UPDATE_STORES = 2,
    HAL_UPDATE_RUN = HAL_UPDATE_STORES /* number of the third slot */
};

void hal_update_read(uint8_t slot, uint8_t row, uint8_t *bytes);
void hal_update_erase(uint8_t slot, uint8_t row); /* afterwards all bits read 1 */
void hal_update_write(uint8_t slot, uint8_t row, const uint8_t *bytes); /* into an erased row */
uint16_t hal_update_flags(uint8_t store);
void hal_update_clear(uint8_t store, uint16_t bits); /* makes bits of the flags 0; the others cannot change */
void hal_update_renew(uint8_t store);                /* makes all flags 1 */
void hal_update_run(void);                           /* calls the first word of HAL_UPDATE_RUN */

#endif
