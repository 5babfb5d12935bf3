/* SPDX-License-Identifier: MIT */
/* Fibers on ucontext, with the annotations the address sanitizer needs to follow a stack change. */
#include "fiber.h"

#include <stdlib.h>
#include <sys/mman.h>

#ifdef __SANITIZE_ADDRESS__
#include <sanitizer/common_interface_defs.h>
#else
static void __sanitizer_start_switch_fiber(void **save, const void *bottom, size_t size)
{
    (void)save, (void)bottom, (void)size;
}
static void __sanitizer_finish_switch_fiber(void *save, const void **bottom, size_t *size)
{
    (void)save, (void)bottom, (void)size;
}
#endif

static fiber *left; /* fiber left by the last switch, for fiber_arrived */

static void make_context(fiber *f, void (*entry)(void))
{
    if (getcontext(&f->context) != 0) {
        abort();
    }
    f->context.uc_stack.ss_sp = f->stack;
    f->context.uc_stack.ss_size = f->stack_bytes;
    f->context.uc_link = NULL;
    makecontext(&f->context, entry, 0);
}

fiber *fiber_new(size_t stack_bytes, void (*entry)(void))
{
    size_t guard = 4096;
    fiber *f = calloc(1, sizeof *f);
    char *memory = mmap(NULL, stack_bytes + guard, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    if (f == NULL || memory == MAP_FAILED || mprotect(memory, guard, PROT_NONE) != 0) {
        free(f);
        return NULL;
    }
    f->mapped_bytes = stack_bytes + guard;
    f->stack = memory + guard;
    f->stack_bytes = stack_bytes;
    make_context(f, entry);
    return f;
}

void fiber_free(fiber *f)
{
    munmap((char *)f->stack + f->stack_bytes - f->mapped_bytes, f->mapped_bytes);
    free(f);
}

void fiber_arrived(fiber *self, fiber *from)
{
    const void *bottom = NULL;
    size_t size = 0;
    __sanitizer_finish_switch_fiber(self->fake_stack, &bottom, &size);
    if (from != NULL && from->stack == NULL) {
        from->stack = (void *)(size_t)bottom;
        from->stack_bytes = size;
    }
}

void fiber_switch(fiber *from, fiber *to)
{
    left = from;
    __sanitizer_start_switch_fiber(&from->fake_stack, to->stack, to->stack_bytes);
    swapcontext(&from->context, &to->context);
    fiber_arrived(from, left);
}

void fiber_leave(fiber *to)
{
    left = NULL;
    __sanitizer_start_switch_fiber(NULL, to->stack, to->stack_bytes);
    setcontext(&to->context);
    abort();
}
