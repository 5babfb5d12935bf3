/* SPDX-License-Identifier: MIT */
/* Jump table through which programs that arrive as updates call the kernel of any image. */
#include "update_slots.h"

    .macro offered name
    goto _\name
    .set calls, calls + 1
    .endm

    .section .update_calls, code, address(UPDATE_CALLS), keep
    .set calls, 0
    .pword  UPDATE_CALLS_MARK + offers, 0
    .include "update_calls.inc"
    .equ offers, calls
