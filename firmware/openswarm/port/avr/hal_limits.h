/* SPDX-License-Identifier: MIT */
/* Sizes on the ATmega328P (2 kB of RAM), bytes. Also read by switch.S. */
#ifndef HAL_LIMITS_H
#define HAL_LIMITS_H

#ifndef HAL_KERNEL_STACK
#define HAL_KERNEL_STACK 160
#endif
#define HAL_HEAP 1216          /* seven threads of 128 bytes and the devices' events */
#define HAL_DEFAULT_STACK 128
#define HAL_MINIMUM_STACK 80   /* preempted 37, a device interrupt in between 8, and a kernel call */
#define HAL_STACK_GUARD 1      /* the lowest byte: if its paint is overwritten at a switch, the stack has overflowed */

#endif
