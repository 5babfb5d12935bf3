/* SPDX-License-Identifier: MIT */
/* The jump table through which programs that come as updates call the kernel, wherever it lies in this image. */
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
