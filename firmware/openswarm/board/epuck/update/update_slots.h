/* SPDX-License-Identifier: MIT */
/* Addresses of the run slot and the stores. For C and assembly; openswarm/flashing/program.py repeats the run slot. */
#ifndef UPDATE_SLOTS_H
#define UPDATE_SLOTS_H

/* Below 010000, so that pointers reach its functions; before it the calls that the firmware offers to programs. */
#define UPDATE_CALLS 0x00F780
#define UPDATE_RUN 0x00F800
#define UPDATE_RUN_END 0x010000

/* Both stores, and behind them the boot loader of apps/boot, up to the end of flash. */
#define UPDATE_STORES 0x016800
#define UPDATE_STORES_END 0x018000

/* RAM of the program that runs. Near, so that its code is short. */
#define UPDATE_RAM 0x0800
#define UPDATE_RAM_BYTES 512

/* The low half of the word at UPDATE_CALLS: the mark, and in its low byte how many calls are offered. */
#define UPDATE_CALLS_MARK 0xA700

#endif
