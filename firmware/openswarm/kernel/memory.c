/* SPDX-License-Identifier: MIT */
/* Heap allocator. Blocks have no header, because the kernel knows the size of what it frees; every call is bounded.
 *
 *      os_memory       reserve_begin   reserve_end
 *      | kernel stack | blocks, holes | the reserve | blocks, holes |
 *
 * The reserve is one free block. ISRs allocate messages from its lower end. Every other free block is a hole in a tree,
 * which requires the slice lock. Adjacent free blocks are always merged, and no hole is smaller than a tree node, so no
 * byte is lost.
 *
 * The tree is a radix priority search tree: a trie on addresses and a heap on sizes. A node of level n is the
 * largest hole of an address range of SPAN / 2^n bytes; its children lie in the halves of that range. Two holes are
 * at least two smallest blocks apart. Paths are therefore short, and every search, insertion and removal is bounded
 * for any history. docs/design/allocator.md has the reasons and the figures. */
#include "kernel.h"

LINKS_IN_RAM();

typedef struct hole hole;
struct hole { /* start of a free block; the block's last HEAP_STEP bytes repeat its size */
    hole *side[2];
    uint16 size;
};

enum { /* address bit that distinguishes the halves of the whole memory */
    TOP_BIT = sizeof os_memory > 0x8000 ? 0x8000 : sizeof os_memory > 0x4000 ? 0x4000
            : sizeof os_memory > 0x2000 ? 0x2000 : sizeof os_memory > 0x1000 ? 0x1000
            : sizeof os_memory > 0x0800 ? 0x0800 : sizeof os_memory > 0x0400 ? 0x0400 : 0x0200
};

#define BEGIN (os_memory.bytes + SYS_KERNEL_STACK)
#define END (os_memory.bytes + sizeof os_memory.bytes)

typedef char kernel_stack_is_whole_steps[SYS_KERNEL_STACK % HEAP_STEP == 0 ? 1 : -1];

os_memory_space os_memory;

static uint8 *reserve_begin, *reserve_end; /* devices locked */
static hole *holes;       /* root of the tree, whose leaves are no_hole; slice locked */
static hole no_hole;      /* sentinel of size 0 */
static uint8 *free_run, *free_run_end; /* adjacent blocks freed last, not yet in the tree; slice locked */

void heap_init(void)
{
    stack_paint(os_memory.bytes, BEGIN);
    reserve_begin = BEGIN;
    reserve_end = END;
    holes = no_hole.side[0] = no_hole.side[1] = &no_hole;
}

static uint16 round_up(uint16 size)
{
    return (uint16)((size + (HEAP_STEP - 1u)) & ~(HEAP_STEP - 1u));
}

/* Updates the peak use. Called before the use decreases and when the statistics are read, not on each allocation. */
HAL_OUTLINE void heap_update_peak(void)
{
    uint16 used = HAL_LOAD(os_statistics.heap_used);
    if (used > os_statistics.heap_peak) {
        os_statistics.heap_peak = used;
    }
}

/* Terms of loop bounds. PATH: nodes of a path; a memory twice as large has one more (docs/design/allocator.md).
 * RUNS: runs merged when a block is freed: its own and perhaps the run before it. PATHS: nodes searched and removed
 * meanwhile, with one more path if the reserve is swapped. */
#if SYS_KERNEL_STACK + SYS_HEAP > 0x1000
#define PATH min(11, h)
#else
#define PATH min(10, h)
#endif
#define RUNS min(2, 1 + j)
#define PATHS (2 * RUNS + min(1, x)) * PATH

/* ---- The tree: slice locked ----------------------------------------------------------------------------------- */

static HAL_INLINE uint16 offset_of(const void *at)
{
    return (uint16)((const uint8 *)at - os_memory.bytes);
}

/* Where a hole that ends at `end` stores its size. */
static HAL_INLINE uint16 *trailing_size(uint8 *end)
{
    return (uint16 *)(void *)(end - HEAP_STEP);
}

/* Returns the link to the hole that begins at an address, or a link to no_hole. */
BOUNDS_AT("for (uint16 bit", loop PATH, share coalesce_free_run 2 * PATH, share heap_free PATHS);
static HAL_OUTLINE hole **find_hole(uintptr_t at)
{
    hole **link = &holes;
    uint16 offset = (uint16)(at - (uintptr_t)os_memory.bytes);
    for (uint16 bit = TOP_BIT; *link != &no_hole && (uintptr_t)*link != at; bit >>= 1) {
        link = offset & bit ? &(*link)->side[1] : &(*link)->side[0];
    }
    return link;
}

/* Inserts a hole from the root downwards: on each level the larger hole is kept, the smaller one descends into its
 * half. */
LOOPS_OF(insert_hole, PATH - 1);
static HAL_OUTLINE void insert_hole(void *at, uint16 size)
{
    hole *h = at, **link = &holes;
    uint16 bit = TOP_BIT;
    h->size = size;
    *trailing_size((uint8 *)at + size) = size;
    do {
        hole *larger = *link;
        if (larger->size < h->size) {
            *link = h;
            h->side[0] = larger->side[0];
            h->side[1] = larger->side[1];
            h = larger;
            larger = *link;
        }
        link = offset_of(h) & bit ? &larger->side[1] : &larger->side[0];
        bit >>= 1;
    } while (h != &no_hole);
}

/* Removes a hole from the tree: the larger of its two children moves up, and so on downwards. */
/* The caller's search for the hole and this loop together follow one path from the root to a leaf. */
BOUNDS_AT("while (left != right)", loop PATH - 1, share heap_alloc_lasting PATH,
          share coalesce_free_run 2 * PATH, share heap_free PATHS);
static HAL_OUTLINE hole *remove_hole(hole **link)
{
    hole *removed = *link, *left = removed->side[0], *right = removed->side[1];
    while (left != right) { /* until both are no_hole */
        hole *next;
        if (left->size >= right->size) {
            *link = left;
            link = &left->side[0];
            next = left->side[1];
            left->side[1] = right;
            left = left->side[0];
            right = next;
        } else {
            *link = right;
            link = &right->side[1];
            next = right->side[0];
            right->side[0] = left;
            right = right->side[1];
            left = next;
        }
    }
    *link = &no_hole;
    return removed;
}

/* ---- The reserve ------------------------------------------------------------------------------------------------ */

static HAL_INLINE uint16 reserve_size(void)
{
    return (uint16)(reserve_end - HAL_LOAD(reserve_begin));
}

/* Merges the free run with the holes on both sides or with the reserve. Slice locked. */
/* Starting a thread frees no block (unless hal_stack_init() may fail): it merges only a run that is already pending. */
BOUNDS_AT("find_hole((uintptr_t)begin", often find_hole heap_free RUNS, often find_hole process.c / start min(1, j));
BOUNDS_AT("remove_hole(link)", often remove_hole heap_free RUNS, often remove_hole process.c / start min(1, j));
BOUNDS_AT("find_hole((uintptr_t)end)", often find_hole heap_free RUNS, often remove_hole heap_free RUNS,
          often find_hole process.c / start min(1, j), often remove_hole process.c / start min(1, j));
BOUNDS_AT("insert_hole(begin", often insert_hole heap_free RUNS, often insert_hole process.c / start min(1, j));
static HAL_OUTLINE void coalesce_free_run(void)
{
    uint8 *begin = free_run, *end = free_run_end;
    bool is_hole = false;
    if (begin == end) {
        return;
    }
    free_run = free_run_end;
    /* The word in front of the run is the size of a hole only if the tree has a hole of that size there. */
    hole **link = find_hole((uintptr_t)begin - *trailing_size(begin));
    if ((uint8 *)*link + (*link)->size == begin) {
        begin = (uint8 *)remove_hole(link);
    }
    end += remove_hole(find_hole((uintptr_t)end))->size; /* no_hole: 0 */
    hal_lock_state lock = hal_lock_devices();
    if (end == reserve_begin) {
        reserve_begin = begin;
    } else if (begin == reserve_end) {
        reserve_end = end;
    } else {
        is_hole = true;
    }
    hal_unlock(lock);
    if (is_hole) {
        insert_hole(begin, (uint16)(end - begin));
    }
}

/* Swaps the reserve with the largest hole if the hole is larger; returns whether it did. Slice locked. */
BOUNDS_AT("remove_hole(&holes)", if remove_hole min(1, x));
static HAL_OUTLINE uint16 swap_reserve(void)
{
    if (holes->size <= reserve_size()) {
        return 0;
    }
    hole *h = remove_hole(&holes);
    hal_lock_state lock = hal_lock_devices();
    uint8 *from = reserve_begin, *to = reserve_end;
    reserve_begin = (uint8 *)h;
    reserve_end = (uint8 *)h + h->size;
    hal_unlock(lock);
    if (from != to) {
        insert_hole(from, (uint16)(to - from));
    }
    return 1;
}

void heap_coalesce(void)
{
    coalesce_free_run();
    swap_reserve();
}

/* ---- Allocation ------------------------------------------------------------------------------------------------- */

/* Allocates from the reserve, but never leaves a remainder too small for a hole. */
BOUNDS_AT("swap_reserve()", loop 1); /* after one swap the reserve is the largest free block */
void *heap_alloc(uint16 size)
{
    if (HAL_ALLOCATION_FAILS()) {
        return NULL;
    }
    size = round_up(size);
    do {
        hal_lock_state lock = hal_lock_devices();
        uint8 *block = reserve_begin, *rest = block + size;
        if (HAL_LIKELY(reserve_end - rest >= (ptrdiff_t)sizeof(hole)) || rest == reserve_end) {
            reserve_begin = rest;
            os_statistics.heap_used += size;
            hal_unlock(lock);
            return block;
        }
        hal_unlock(lock);
    } while (!hal_in_isr() && swap_reserve());
    return NULL;
}

/* Allocates from the lowest sufficient hole on the leftmost path of the tree, else from the reserve. */
BOUNDS_AT("while (", loop PATH, share heap_alloc_lasting PATH);
void *heap_alloc_lasting(uint16 size)
{
    hole **link = NULL, **next = &holes;
    while ((*next)->size >= size + sizeof(hole)) {
        link = next;
        next = &(*link)->side[0];
    }
    if (link == NULL) {
        return heap_alloc(size);
    }
    if (HAL_ALLOCATION_FAILS()) {
        return NULL;
    }
    HAL_ADD(os_statistics, heap_used, size);
    hole *h = remove_hole(link);
    uint16 rest = (uint16)(h->size - size);
    insert_hole(h, rest);
    return (uint8 *)h + rest;
}

void heap_free_deferred(void *freed, uint16 size)
{
    size = round_up(size);
    heap_update_peak();
    HAL_ADD(os_statistics, heap_used, -size);
    if (freed != free_run_end) {
        coalesce_free_run();
        free_run = freed;
    }
    free_run_end = (uint8 *)freed + size;
}

void heap_free(void *freed, uint16 size)
{
    heap_free_deferred(freed, size);
    heap_coalesce();
}
