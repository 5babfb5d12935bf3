/* SPDX-License-Identifier: MIT */
/* Arrays of variable length on a stack with a limit: -fstack-check tests a frame before it is entered, without their
 * sizes. */
#ifndef STACK_ROOM_H
#define STACK_ROOM_H

#include <stdint.h>

#ifdef __dsPIC30F__
/* Traps here, with W15 still within the limit, if the stack has no room for so many bytes. The two instructions that may
 * run after the read are harmless. */
#define STACK_ROOM(bytes)                                                                         \
    do {                                                                                          \
        uint16_t room_ = (uint16_t)(((bytes) + 1u) & ~1u);                                        \
        __asm__ volatile("mov [w15+%0],%0\n\tnop\n\tnop" : "+r"(room_) : : "memory");             \
    } while (0)
#else
#define STACK_ROOM(bytes) ((void)0)
#endif

#endif
