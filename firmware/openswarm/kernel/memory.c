/* SPDX-License-Identifier: MIT */
/* All dynamic memory: without headers, because the kernel knows the size of what it frees, and in bounded time.
 *
 *      os_memory       low            high                          end
 *      | kernel stack | blocks, holes | the reserve | blocks, holes |
 *
 * The reserve is one free piece that ISRs may cut from as well: messages from its lower end. Every other free piece is a
 * hole, in a tree that only code with the slice locked touches. Neighbouring free pieces are always one; none is smaller
 * than a tree node, so no byte is ever lost.
 *
 * The tree is a trie on addresses and a heap on sizes at once: a node of level n is the largest hole of an address range
 * of SPAN / 2^n bytes, its sides lead into the halves of that range. Two holes lie at least two smallest blocks apart, so
 * paths are short and every search, insertion and removal is bounded, whatever happened before. README.md has the
 * reason for this and the figures. */
#include "kernel.h"

LINKS_IN_RAM();

typedef struct hole hole;
struct hole { /* the beginning of a free piece; its size stands in its last HEAP_STEP bytes once more */
    hole *side[2];
    uint16 size;
};

enum { /* the bit by which the halves of the whole memory differ */
    TOP_BIT = sizeof os_memory > 0x8000 ? 0x8000 : sizeof os_memory > 0x4000 ? 0x4000
            : sizeof os_memory > 0x2000 ? 0x2000 : sizeof os_memory > 0x1000 ? 0x1000
            : sizeof os_memory > 0x0800 ? 0x0800 : sizeof os_memory > 0x0400 ? 0x0400 : 0x0200
};

#define BEGIN (os_memory.bytes + SYS_KERNEL_STACK)
#define END (os_memory.bytes + sizeof os_memory.bytes)

typedef char kernel_stack_is_whole_steps[SYS_KERNEL_STACK % HEAP_STEP == 0 ? 1 : -1];

os_memory_space os_memory;

static uint8 *low, *high; /* the reserve; devices locked */
static hole *holes;       /* slice locked; every path ends at no_hole */
static hole no_hole;      /* of size 0 */
static uint8 *run, *run_end; /* slice locked; given back last, piece after piece, and not yet joined */

void heap_init(void)
{
    stack_paint(os_memory.bytes, BEGIN);
    low = BEGIN;
    high = END;
    holes = no_hole.side[0] = no_hole.side[1] = &no_hole;
}

static uint16 round_up(uint16 size)
{
    return (uint16)((size + (HEAP_STEP - 1u)) & ~(HEAP_STEP - 1u));
}

/* How much is in use, and the most of it: noted before it becomes less and when somebody asks, not on each taking. */
HAL_OUTLINE void heap_note_use(void)
{
    uint16 used = HAL_LOAD(os_statistics.heap_used);
    if (used > os_statistics.heap_peak) {
        os_statistics.heap_peak = used;
    }
}

/* For bounds: nodes of a path, of which a memory twice as large has one more (README.md); runs joined when a piece is given
 * back, itself and perhaps what came before; paths searched and pulled meanwhile, one more where the reserve is exchanged. */
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

static HAL_INLINE uint16 *last_step(uint8 *end)
{
    return (uint16 *)(void *)(end - HEAP_STEP);
}

/* The link to the hole that begins there, or to nothing. */
static HAL_OUTLINE hole **find_hole(uintptr_t at)
{
    hole **link = &holes;
    uint16 offset = (uint16)(at - (uintptr_t)os_memory.bytes);
    LOOP_BOUND(PATH); LOOP_SHARE(join_run, 2 * PATH); LOOP_SHARE(heap_give, PATHS);
    for (uint16 bit = TOP_BIT; *link != &no_hole && (uintptr_t)*link != at; bit >>= 1) {
        link = offset & bit ? &(*link)->side[1] : &(*link)->side[0];
    }
    return link;
}

/* From the top downwards whoever is larger stays, the other goes on into its half. */
static HAL_OUTLINE void put_hole(void *at, uint16 size)
{
    hole *h = at, **link = &holes;
    uint16 bit = TOP_BIT;
    h->size = size;
    *last_step((uint8 *)at + size) = size;
    do {
        hole *stays = *link;
        if (stays->size < h->size) {
            *link = h;
            h->side[0] = stays->side[0];
            h->side[1] = stays->side[1];
            h = stays;
            stays = *link;
        }
        link = offset_of(h) & bit ? &stays->side[1] : &stays->side[0];
        bit >>= 1;
        LOOP_BOUND(PATH - 1);
    } while (h != &no_hole);
}

/* Out of the tree: the larger of the two below fills the gap, and so on downwards. */
static HAL_OUTLINE hole *pull_hole(hole **link)
{
    hole *gone = *link, *left = gone->side[0], *right = gone->side[1];
    /* What was searched lies above what is pulled, on one path. */
    LOOP_BOUND(PATH - 1); LOOP_SHARE(heap_keep, PATH); LOOP_SHARE(join_run, 2 * PATH); LOOP_SHARE(heap_give, PATHS);
    while (left != right) { /* not both nothing */
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
    return gone;
}

/* ---- The reserve ------------------------------------------------------------------------------------------------ */

static HAL_INLINE uint16 reserve(void)
{
    return (uint16)(high - HAL_LOAD(low));
}

/* Slice locked. */
static HAL_OUTLINE void join_run(void)
{
    uint8 *begin = run, *end = run_end;
    bool apart = false;
    if (begin == end) {
        return;
    }
    run = run_end;
    /* The size of a hole, if one ends here; if not, no hole begins so far below that ends here. Who starts a thread gives
     * nothing back (but where hal_stack_init() may fail): it joins what waits. */
    CALL_SHARE(find_hole, heap_give, RUNS); CALL_SHARE(find_hole, process.c / start, min(1, j));
    hole **link = find_hole((uintptr_t)begin - *last_step(begin));
    if ((uint8 *)*link + (*link)->size == begin) {
        CALL_SHARE(pull_hole, heap_give, RUNS); CALL_SHARE(pull_hole, process.c / start, min(1, j));
        begin = (uint8 *)pull_hole(link);
    }
    CALL_SHARE(find_hole, heap_give, RUNS); CALL_SHARE(pull_hole, heap_give, RUNS);
    CALL_SHARE(find_hole, process.c / start, min(1, j)); CALL_SHARE(pull_hole, process.c / start, min(1, j));
    end += pull_hole(find_hole((uintptr_t)end))->size; /* of nothing: 0 */
    hal_lock_state lock = hal_lock_devices();
    if (end == low) {
        low = begin;
    } else if (begin == high) {
        high = end;
    } else {
        apart = true;
    }
    hal_unlock(lock);
    if (apart) {
        CALL_SHARE(put_hole, heap_give, RUNS); CALL_SHARE(put_hole, process.c / start, min(1, j));
        put_hole(begin, (uint16)(end - begin));
    }
}

/* Slice locked. A hole that is larger than the reserve changes places with it. */
static HAL_OUTLINE uint16 renew_reserve(void)
{
    if (holes->size <= reserve()) {
        return 0;
    }
    CALL_IF(pull_hole, min(1, x));
    hole *h = pull_hole(&holes);
    hal_lock_state lock = hal_lock_devices();
    uint8 *from = low, *to = high;
    low = (uint8 *)h;
    high = (uint8 *)h + h->size;
    hal_unlock(lock);
    if (from != to) {
        put_hole(from, (uint16)(to - from));
    }
    return 1;
}

void heap_settle(void)
{
    join_run();
    renew_reserve();
}

/* ---- Taking and giving ------------------------------------------------------------------------------------------ */

/* What remains of a piece is nothing, or enough for a hole. */
void *heap_take(uint16 size)
{
    if (HAL_ALLOCATION_FAILS()) {
        return NULL;
    }
    size = round_up(size);
    do {
        hal_lock_state lock = hal_lock_devices();
        uint8 *block = low, *rest = block + size;
        if (HAL_LIKELY(high - rest >= (ptrdiff_t)sizeof(hole)) || rest == high) {
            low = rest;
            os_statistics.heap_used += size;
            hal_unlock(lock);
            return block;
        }
        hal_unlock(lock);
        LOOP_BOUND(1); /* the reserve is the largest piece then */
    } while (!hal_in_isr() && renew_reserve());
    return NULL;
}

/* Down the left side, as far as there is room. */
void *heap_keep(uint16 size)
{
    hole **link = NULL, **next = &holes;
    LOOP_BOUND(PATH); LOOP_SHARE(heap_keep, PATH);
    while ((*next)->size >= size + sizeof(hole)) {
        link = next;
        next = &(*link)->side[0];
    }
    if (link == NULL) {
        return heap_take(size);
    }
    if (HAL_ALLOCATION_FAILS()) {
        return NULL;
    }
    HAL_ADD(os_statistics, heap_used, size);
    hole *h = pull_hole(link);
    uint16 rest = (uint16)(h->size - size);
    put_hole(h, rest);
    return (uint8 *)h + rest;
}

void heap_give_later(void *freed, uint16 size)
{
    size = round_up(size);
    heap_note_use();
    HAL_ADD(os_statistics, heap_used, -size);
    if (freed != run_end) {
        join_run();
        run = freed;
    }
    run_end = (uint8 *)freed + size;
}

void heap_give(void *freed, uint16 size)
{
    heap_give_later(freed, size);
    heap_settle();
}
