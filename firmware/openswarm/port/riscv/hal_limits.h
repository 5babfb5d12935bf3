/* SPDX-License-Identifier: MIT */
/* Sizes on a RV32IMAC, bytes. Also read by switch.S. */
#ifndef HAL_LIMITS_H
#define HAL_LIMITS_H

#define HAL_KERNEL_STACK 1024  /* handlers, interrupts, scheduler */
#define HAL_HEAP 32768
#define HAL_DEFAULT_STACK 512
#define HAL_MINIMUM_STACK 320  /* preempted 128, and a kernel call */
#define HAL_STACK_GUARD 4      /* the lowest word: if its paint is overwritten at a switch, the stack has overflowed */

#endif
