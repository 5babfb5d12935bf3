/* All dynamic memory: bounded, deterministic, without headers, because the kernel knows the size of what it frees.
 *
 *      os_memory                brk                 top                       end
 *      | kernel stack | small blocks |   untouched   | large blocks: threads |
 *
 * Small blocks are cut upwards from brk and go back to a free list of exactly their size: O(1), safe in ISRs. Large
 * blocks are cut downwards from top, kept in an address-ordered, coalescing first-fit list; no ISR touches it. */
#include "kernel.h"

typedef struct block block;
struct block { /* what a free block holds */
    block *next;
    uint16 size; /* large blocks only */
};

#define END (os_memory.bytes + sizeof os_memory.bytes)

os_memory_space os_memory;

static block *small[HEAP_CLASSES];
static block large; /* in front of the lowest large block */
static uint8 *brk, *top;

void heap_init(void)
{
    stack_paint(os_memory.bytes, SYS_KERNEL_STACK);
    brk = os_memory.bytes + SYS_KERNEL_STACK;
    top = END;
}

static uint16 round_up(uint16 size)
{
    return (uint16)((size + (HEAP_STEP - 1u)) & ~(HEAP_STEP - 1u));
}

/* Where the list of a size begins: list n holds blocks of (n + 1) * HEAP_STEP bytes, and a list head is HEAP_STEP
 * long. */
static block **list_of(uint16 size)
{
    return (block **)(void *)((uint8 *)small + size - HEAP_STEP);
}

/* The peak is the largest extent; it is noted before the extent shrinks and when somebody asks, not on each taking. */
void heap_note_peak(void)
{
    uint16 extent = (uint16)(SYS_HEAP - (top - brk));
    if (extent > os_statistics.heap_peak) {
        os_statistics.heap_peak = extent;
    }
}

static bool is_small(uint16 size)
{
    return size <= HEAP_CLASSES * HEAP_STEP;
}

/* Devices locked. */
static HAL_INLINE void push_small(void *freed, uint16 size)
{
    block *b = freed;
    b->next = *list_of(size);
    *list_of(size) = b;
}

/* From a larger free block. At most HEAP_CLASSES short locks. */
static void *split_small(uint16 size)
{
    block *b = NULL;
    for (uint16 rest = HEAP_STEP; b == NULL && is_small((uint16)(size + rest)); rest += HEAP_STEP) {
        block **list = list_of((uint16)(size + rest));
        hal_lock_state lock = hal_lock_devices();
        b = *list;
        if (b != NULL) {
            *list = b->next;
            push_small((uint8 *)b + size, rest);
            os_statistics.heap_used += size;
        }
        hal_unlock(lock);
    }
    return b;
}

/* When memory is short, brk moves down over the free small blocks that touch it, so that memory once used for one size
 * serves another. ISRs never give, so a list may be taken apart while they find it empty. At most f rounds for f free
 * small blocks; NULL: brk did not move. */
static HAL_OUTLINE uint8 *shrink_small(void)
{
    uint8 *lowest = NULL;
    uint16 size = 0;
    heap_note_peak();
    while (is_small(size += HEAP_STEP)) {
        uint16 from = size;
        block *next;
        hal_lock_state lock = hal_lock_devices();
        block *b = *list_of(from);
        *list_of(from) = NULL;
        hal_unlock(lock);
        for (; b != NULL; b = next) {
            next = b->next;
            lock = hal_lock_devices();
            if ((uint8 *)b + from == brk) {
                brk = (uint8 *)b;
                lowest = brk;
                size = 0; /* look at all again */
            } else {
                push_small(b, from);
            }
            hal_unlock(lock);
        }
    }
    return lowest;
}

/* Large blocks are cut at their end, or taken whole. */
static void *take_listed(uint16 size)
{
    block *b, *before = &large;
    for (; (b = before->next) != NULL; before = b) {
        if (b->size == size) {
            before->next = b->next;
        } else if (b->size < size + sizeof *b) {
            continue;
        }
        b->size -= size;
        return (uint8 *)b + b->size;
    }
    return NULL;
}

static void *take_large(uint16 size)
{
    void *b = take_listed(size);
    hal_lock_state lock = hal_lock_devices();
    if (b != NULL || (uint16)(top - brk) >= size) {
        os_statistics.heap_used += size;
        if (b == NULL) {
            top -= size;
            b = top;
        }
    }
    hal_unlock(lock);
    return b;
}

static HAL_OUTLINE void join_next(block *b)
{
    if ((uint8 *)b + b->size == (uint8 *)b->next) {
        b->size += b->next->size;
        b->next = b->next->next;
    }
}

static void give_large(block *freed, uint16 size)
{
    block *below = &large;
    while (below->next != NULL && below->next < freed) {
        below = below->next;
    }
    freed->size = size;
    freed->next = below->next;
    below->next = freed;
    join_next(freed);
    join_next(below);
    if ((uint8 *)large.next == top) {
        heap_note_peak();
        top += large.next->size; /* one store, read by ISRs */
        large.next = large.next->next;
    }
}

static HAL_OUTLINE void *take_slowly(uint16 size)
{
    void *taken = is_small(size) ? split_small(size) : take_large(size);
    if (taken == NULL && !hal_in_isr() && shrink_small() != NULL) {
        taken = heap_take(size); /* not deeper: brk is as low as it goes */
    }
    return taken;
}

void *heap_take(uint16 size)
{
    void *taken = NULL;
    if (HAL_ALLOCATION_FAILS()) {
        return NULL;
    }
    size = round_up(size);
    if (is_small(size)) { /* from its list, or from the untouched memory */
        block **list = list_of(size);
        hal_lock_state lock = hal_lock_devices();
        taken = *list;
        if (taken != NULL) {
            *list = (*list)->next;
            os_statistics.heap_used += size;
        } else if ((uint16)(top - brk) >= size) {
            taken = brk;
            brk += size;
            os_statistics.heap_used += size;
        }
        hal_unlock(lock);
    }
    return taken != NULL ? taken : take_slowly(size);
}

void heap_give(void *freed, uint16 size)
{
    size = round_up(size);
    if (!is_small(size)) {
        give_large(freed, size);
    }
    hal_lock_state lock = hal_lock_devices();
    if (is_small(size)) {
        push_small(freed, size);
    }
    os_statistics.heap_used -= size;
    hal_unlock(lock);
}
