#include "footprint.h"

#define STOP(name)                                                    \
    __attribute__((noinline, used)) void name(void)                   \
    {                                                                 \
        __asm__ volatile("nop" ::: "memory");                         \
    }

STOP(footprint_begin)
STOP(footprint_empty)
STOP(footprint_built)
STOP(footprint_undone)
