/* SPDX-License-Identifier: MIT */
/* Sizes on a host. Thread stacks are host stacks of HOST_STACK bytes outside the heap; the stack that the
 * kernel's heap holds for a thread is not used. */
#ifndef HAL_LIMITS_H
#define HAL_LIMITS_H

#define HAL_KERNEL_STACK 64
#define HAL_STACK_GUARD 0
#define HAL_HEAP 16384
#define HAL_DEFAULT_STACK 384
#define HAL_MINIMUM_STACK 384
#define HOST_STACK (256 * 1024)

#endif
