/* SPDX-License-Identifier: MIT */
/* Lower layer of authenticated updates: contract; implemented in board/<robot>/update_auth. */
#ifndef HAL_UPDATE_AUTH_H
#define HAL_UPDATE_AUTH_H

#include <stdint.h>

enum { HAL_UPDATE_KEY = 16 /* bytes */, HAL_UPDATE_CELLS = 4 };

void hal_update_key(uint8_t *key); /* all bits 1: none was provisioned */
/* Non-volatile words. A write erases to 0xFFFF first; if power fails meanwhile, any bits may be 1 that were not in both
 * values. */
uint16_t hal_update_cell(uint8_t cell);
void hal_update_set_cell(uint8_t cell, uint16_t value);

#endif
