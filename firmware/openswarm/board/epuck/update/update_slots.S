/* SPDX-License-Identifier: MIT */
/* Keeps an image out of the slots and of the RAM of programs: the linker puts everything beside them, and says so when there
 * is no room. Nothing of this is loaded, so what is in flash stays. */
#include "update_slots.h"

    .section .update_run, code, address(UPDATE_RUN), noload, keep
    .space UPDATE_RUN_END - UPDATE_RUN

    .section .update_stores, code, address(UPDATE_STORES), noload, keep
    .space UPDATE_STORES_END - UPDATE_STORES

    .section .update_ram, address(UPDATE_RAM), persist, keep
    .space UPDATE_RAM_BYTES
