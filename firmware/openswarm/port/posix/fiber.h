/* SPDX-License-Identifier: MIT */
/* Fibers: execution contexts with host stacks of their own, known to the address sanitizer. */
#ifndef FIBER_H
#define FIBER_H

#include <stddef.h>
#include <ucontext.h>

typedef struct fiber {
    ucontext_t context;
    void *stack;        /* lowest address; set at the first switch for the stack on which the program began */
    size_t stack_bytes;
    void *fake_stack;   /* the sanitizer's */
    size_t mapped_bytes;
} fiber;

fiber *fiber_new(size_t stack_bytes, void (*entry)(void)); /* NULL: no memory */
void fiber_free(fiber *f);
void fiber_switch(fiber *from, fiber *to);       /* from is resumed by a later switch */
void fiber_leave(fiber *to) __attribute__((noreturn)); /* switches; the running fiber never runs again */
void fiber_arrived(fiber *self, fiber *from);    /* to be called first in every entry function; from may be NULL */

#endif
