/* SPDX-License-Identifier: MIT */
/* Copy this folder to port/<your cpu>/ and adapt it; docs/porting.md explains each step. Unchanged it runs on a host
 * and passes the conformance suite, so that functions can be replaced and tested one by one. */
#ifndef HAL_LIMITS_H
#define HAL_LIMITS_H

#define HAL_KERNEL_STACK 64 /* bytes at the start of os_memory for handlers, ISRs and scheduler */
#define HAL_STACK_GUARD 0
#define HAL_HEAP 16384
#define HAL_DEFAULT_STACK 384
#define HAL_MINIMUM_STACK 384 /* saved registers + interrupt frames + a few bytes of your own */

#endif
