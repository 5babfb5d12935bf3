/* SPDX-License-Identifier: MIT */
/* Reserves the row of the key. It is not loaded, so that the key stays when firmware is replaced. */
#include "key_slot.h"

    .section .update_key, code, address(UPDATE_KEY), noload, keep
    .global ___update_key
___update_key:
    .space UPDATE_KEY_END - UPDATE_KEY
