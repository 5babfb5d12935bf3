/* SPDX-License-Identifier: MIT */
/* Keeps an image out of the slots: the linker puts all of it below, and says so when there is no room. Nothing of this is
 * loaded, so what is in flash stays. */
#include "update_slots.h"

    .section .update_slots, code, address(UPDATE_SLOTS), noload, keep
    .space UPDATE_SLOTS_END - UPDATE_SLOTS
