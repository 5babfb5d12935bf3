/* SPDX-License-Identifier: MIT */
/* Reserves the slots and the RAM of programs: the linker places the image around them and reports a lack of room. The
 * sections are not loaded, so that the contents of flash stay. */
#include "update_slots.h"

    .section .update_run, code, address(UPDATE_RUN), noload, keep
    .space UPDATE_RUN_END - UPDATE_RUN

    .section .update_stores, code, address(UPDATE_STORES), noload, keep
    .space UPDATE_STORES_END - UPDATE_STORES

    .section .update_ram, address(UPDATE_RAM), persist, keep
    .space UPDATE_RAM_BYTES
