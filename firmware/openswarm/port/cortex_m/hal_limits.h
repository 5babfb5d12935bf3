/* SPDX-License-Identifier: MIT */
/* Sizes on a Cortex-M4F, bytes. Also read by switch.S and the boards' linker scripts. */
#ifndef HAL_LIMITS_H
#define HAL_LIMITS_H

#define HAL_KERNEL_STACK 1024  /* main stack pointer: handlers, interrupts, scheduler; its lowest 32 are guarded */
#define HAL_HEAP 32768
#define HAL_DEFAULT_STACK 384
#define HAL_MINIMUM_STACK 256  /* guard up to 60, preempted 72, and a kernel call; 136 more for a thread that uses the FPU */
#define HAL_STACK_GUARD 60     /* 32 read-only, at a multiple of 32 */

#endif
