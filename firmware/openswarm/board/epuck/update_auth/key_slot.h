/* SPDX-License-Identifier: MIT */
/* Flash addresses of the key: the row before the program stores, of which eight words hold two bytes each.
 * `openswarm flash` finds it by the symbol ___update_key. */
#ifndef KEY_SLOT_H
#define KEY_SLOT_H

#define UPDATE_KEY 0x0167C0
#define UPDATE_KEY_END 0x016800

#endif
