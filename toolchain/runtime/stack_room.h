/* SPDX-License-Identifier: MIT */
/* Stack check for arrays of variable length: -fstack-check probes a frame at function entry, without the sizes of these
 * arrays. */
#ifndef STACK_ROOM_H
#define STACK_ROOM_H

#include <stdint.h>

#ifdef __dsPIC30F__
/* Trap, with W15 still within the limit, if the stack has no room for this number of bytes. The CPU may execute two more
 * instructions after the read, which are harmless. */
#define STACK_ROOM(bytes)                                                                         \
    do {                                                                                          \
        uint16_t room_ = (uint16_t)(((bytes) + 1u) & ~1u);                                        \
        __asm__ volatile("mov [w15+%0],%0\n\tnop\n\tnop" : "+r"(room_) : : "memory");             \
    } while (0)
#else
#define STACK_ROOM(bytes) ((void)0)
#endif

#endif
