/* SPDX-License-Identifier: MIT */
/* Sizes on the dsPIC30F6014A, bytes. Also read by switch.S. */
#ifndef HAL_LIMITS_H
#define HAL_LIMITS_H

#ifdef __OPTIMIZE__
#define HAL_KERNEL_STACK 224
#else /* -O0: every function keeps all values in its frame */
#define HAL_KERNEL_STACK 384
#endif
#define HAL_HEAP 3072
#define HAL_DEFAULT_STACK 128
#define HAL_MINIMUM_STACK 112 /* exit 4, preempted 42, camera 4, guard 12, and a kernel call; SYS_DSP needs 28 more */
/* Bytes above a stack limit. A frame of up to 8 bytes without probe, two more instructions and the trap itself may
 * write 12 bytes at the end of the stack and 8 into the PCB (kernel.h). */
#define HAL_STACK_GUARD 12
/* The same at the end of the kernel stack, which no PCB follows, and the address of that limit. */
#define HAL_KERNEL_STACK_GUARD 20
#define HAL_KERNEL_STACK_LIMIT HAL_KERNEL_STACK-HAL_KERNEL_STACK_GUARD-2
/* Maximum need of a kernel function on the caller's stack; checked at its first lock, before it changes anything. */
#define HAL_CALL_DEPTH 40

#endif
