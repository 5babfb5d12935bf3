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
static block *large;
static uint8 *brk, *top;

void heap_init(void)
{
    for (uint16 i = 0; i < HEAP_CLASSES; i++) {
        small[i] = NULL;
    }
    large = NULL;
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
    uint16 extent = (uint16)(brk - os_memory.bytes - SYS_KERNEL_STACK + (END - top));
    if (extent > os_statistics.heap_peak) {
        os_statistics.heap_peak = extent;
    }
}

/* Devices locked. */
static void push_small(void *freed, uint16 size)
{
    block *b = freed;
    b->next = *list_of(size);
    *list_of(size) = b;
}

/* From the list of the size, or from the untouched memory between small and large blocks. */
static HAL_INLINE void *take_small(uint16 size)
{
    block **list = list_of(size);
    hal_lock_state lock = hal_lock_devices();
    block *b = *list;
    if (b != NULL) {
        *list = b->next;
        os_statistics.heap_used += size;
    } else if ((uint16)(top - brk) >= size) {
        b = (block *)(void *)brk;
        brk += size;
        os_statistics.heap_used += size;
    }
    hal_unlock(lock);
    return b;
}

/* Nothing of this size is left and nothing is untouched: cut a larger free block. At most HEAP_CLASSES short locks. */
static void *split_small(uint16 size)
{
    for (uint16 bigger = (uint16)(size + HEAP_STEP); bigger <= HEAP_CLASSES * HEAP_STEP; bigger += HEAP_STEP) {
        hal_lock_state lock = hal_lock_devices();
        block *b = *list_of(bigger);
        if (b != NULL) {
            *list_of(bigger) = b->next;
            push_small((uint8 *)b + size, (uint16)(bigger - size));
            os_statistics.heap_used += size;
        }
        hal_unlock(lock);
        if (b != NULL) {
            return b;
        }
    }
    return NULL;
}

/* Takes the block that ends at brk out of the list of its size, if it is there. ISRs never give, so the list may be
 * taken apart while they find it empty. */
static block *unlink_last(uint16 size)
{
    hal_lock_state lock = hal_lock_devices();
    block *first = *list_of(size);
    *list_of(size) = NULL;
    hal_unlock(lock);
    block **link = &first;
    while (*link != NULL && (uint8 *)*link + size != brk) {
        link = &(*link)->next;
    }
    block *last = *link;
    if (last != NULL) {
        *link = last->next;
    }
    *list_of(size) = first;
    return last;
}

/* Slow path when memory is short: moves brk down over every free block that touches it, so that memory once used for
 * one size serves another. At most f * f / 2 steps for f free small blocks; slice locked. */
static void shrink_small(void)
{
    uint16 size = HEAP_STEP;
    heap_note_peak();
    while (size <= HEAP_CLASSES * HEAP_STEP) {
        block *last = unlink_last(size);
        if (last == NULL) {
            size = (uint16)(size + HEAP_STEP);
            continue;
        }
        hal_lock_state lock = hal_lock_devices();
        if ((uint8 *)last + size == brk) {
            brk = (uint8 *)last;
        } else { /* an ISR has moved it meanwhile */
            push_small(last, size);
        }
        hal_unlock(lock);
        size = HEAP_STEP;
    }
}

static bool lower_top(uint16 size)
{
    hal_lock_state lock = hal_lock_devices();
    bool fits = (uint16)(top - brk) >= size;
    if (fits) {
        top -= size;
    }
    hal_unlock(lock);
    return fits;
}

static void *take_large(uint16 size)
{
    for (block **link = &large; *link != NULL; link = &(*link)->next) {
        block *b = *link;
        if (b->size == size) {
            *link = b->next;
            return b;
        }
        if (b->size >= size + sizeof(block)) {
            b->size -= size;
            return (uint8 *)b + b->size;
        }
    }
    if (!lower_top(size)) {
        shrink_small();
        if (!lower_top(size)) {
            return NULL;
        }
    }
    return top;
}

static void give_large(uint8 *freed, uint16 size)
{
    block *b = (block *)freed;
    block **link = &large;
    block *below = NULL;
    while (*link != NULL && (uint8 *)*link < freed) {
        below = *link;
        link = &below->next;
    }
    b->size = size;
    b->next = *link;
    *link = b;
    if (b->next != NULL && freed + size == (uint8 *)b->next) {
        b->size += b->next->size;
        b->next = b->next->next;
    }
    if (below != NULL && (uint8 *)below + below->size == freed) {
        below->size += b->size;
        below->next = b->next;
    }
    if ((uint8 *)large == top) {
        uint16 lowest = large->size;
        heap_note_peak();
        large = large->next;
        hal_lock_state lock = hal_lock_devices();
        top += lowest;
        hal_unlock(lock);
    }
}

static HAL_OUTLINE void *take_slowly(uint16 size)
{
    void *taken;
    if (size > HEAP_CLASSES * HEAP_STEP) {
        taken = hal_in_isr() ? NULL : take_large(size);
        if (taken != NULL) {
            hal_lock_state lock = hal_lock_devices();
            os_statistics.heap_used += size;
            hal_unlock(lock);
        }
        return taken;
    }
    taken = split_small(size);
    if (taken == NULL && !hal_in_isr()) {
        shrink_small();
        taken = take_small(size);
    }
    return taken;
}

void *heap_take(uint16 size)
{
    if (HAL_ALLOCATION_FAILS()) {
        return NULL;
    }
    size = round_up(size);
    void *taken = size <= HEAP_CLASSES * HEAP_STEP ? take_small(size) : NULL;
    return taken != NULL ? taken : take_slowly(size);
}

void heap_give(void *freed, uint16 size)
{
    size = round_up(size);
    bool is_large = size > HEAP_CLASSES * HEAP_STEP;
    if (is_large) {
        give_large(freed, size);
    }
    hal_lock_state lock = hal_lock_devices();
    if (!is_large) {
        push_small(freed, size);
    }
    os_statistics.heap_used -= size;
    hal_unlock(lock);
}
