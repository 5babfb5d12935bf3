/* SPDX-License-Identifier: MIT */
/* Where updates run and are kept, and behind them the boot loader of apps/boot, up to the end of flash. For C and assembly. */
#ifndef UPDATE_SLOTS_H
#define UPDATE_SLOTS_H

#define UPDATE_SLOTS 0x016000
#define UPDATE_SLOTS_END 0x018000

#endif
