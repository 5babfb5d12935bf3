/* Compares the allocator with a model of every heap byte, and checks the state of the heap after bursts of messages. */
#include "test.h"

enum {
    SMALLEST = 3 * sizeof(void *), /* minimum size of heap_alloc() */
    BLOCKS = 200,
    HISTORY = 120000
};

typedef struct {
    uint8 *at;
    uint16 size, asked;
    uint8 filled;
} held_block;

static held_block held[BLOCKS];
static uint8 taken[SYS_HEAP / HEAP_STEP]; /* whether each heap step is in use */
static bool unsettled;

static uint16 steps(uint16 bytes)
{
    return (uint16)((bytes + HEAP_STEP - 1) / HEAP_STEP);
}

static void mark(const held_block *b, uint8 use)
{
    const uint8 *heap = os_memory.bytes + SYS_KERNEL_STACK;
    CHECK(b->at >= heap && b->at + b->size <= heap + SYS_HEAP);
    CHECK_EQ((b->at - heap) % (long)HEAP_STEP, 0);
    for (uint16 i = 0; i < steps(b->size); i++) {
        uint8 *step = &taken[(size_t)(b->at - heap) / HEAP_STEP + i];
        CHECK_EQ(*step, 1 - use);
        *step = use;
    }
}

static uint16 largest_gap(void)
{
    uint16 largest = 0, gap = 0;
    for (uint16 i = 0; i < SYS_HEAP / HEAP_STEP; i++) {
        gap = taken[i] ? 0 : (uint16)(gap + HEAP_STEP);
        largest = gap > largest ? gap : largest;
    }
    return largest;
}

static void release(held_block *b)
{
    for (uint16 i = 0; i < b->size; i++) {
        CHECK_EQ(b->at[i], b->filled);
    }
    mark(b, 0);
    unsettled = rand() % 4 == 0; /* deferred as within a round of handlers */
    if (unsettled) {
        heap_free_deferred(b->at, b->asked);
    } else {
        heap_free(b->at, b->asked);
    }
    b->at = NULL;
}

/* Allocates a block; fails if and only if the contract permits it. */
static void obtain(held_block *b, uint16 asked, bool stays, uint8 fill)
{
    uint16 gap = largest_gap();
    b->asked = asked;
    b->size = (uint16)(steps(asked) * HEAP_STEP);
    b->at = stays ? heap_alloc_lasting(b->size) : heap_alloc(asked);
    CHECK(b->at != NULL || unsettled || (gap < b->size + SMALLEST && gap != b->size));
    if (b->at != NULL) {
        b->filled = fill;
        mark(b, 1);
        memset(b->at, fill, b->size);
    }
}

static uint16 model_use(void)
{
    uint16 use = 0;
    for (uint16 i = 0; i < SYS_HEAP / HEAP_STEP; i++) {
        use = (uint16)(use + taken[i] * HEAP_STEP);
    }
    return use;
}

TEST(random_histories_agree_with_a_model, "memory.c: no overlap, no loss, success whenever a free block is long enough")
{
    uint16 peak = 0;
    heap_init();
    for (unsigned seed = 1; seed <= 3; seed++) {
        srand(seed);
        for (long i = 0; i < HISTORY; i++) {
            held_block *b = &held[rand() % (i % 10000 < 5000 ? BLOCKS : BLOCKS / 8)];
            if (b->at != NULL) {
                release(b);
            } else {
                int most = rand() % 8 == 0 ? 60 : rand() % 8 == 0 ? 40 : 6;
                obtain(b, (uint16)(SMALLEST + rand() % (most * (int)HEAP_STEP)), rand() % 2, (uint8)rand());
            }
            peak = heap_now() > peak ? heap_now() : peak;
            if (i % 64 == 0) {
                CHECK_EQ(heap_now(), model_use());
            }
        }
        for (held_block *b = held; b != held + BLOCKS; b++) {
            if (b->at != NULL) {
                release(b);
            }
        }
        CHECK_EQ(heap_now(), 0);
        heap_coalesce();
        unsettled = false;
        held_block all;
        obtain(&all, SYS_HEAP, false, 0); /* requires that all free blocks have been merged */
        CHECK_EQ(all.size, SYS_HEAP);
        release(&all);
    }
    CHECK(peak > SYS_HEAP / 2);
    exit(0); /* without a kernel main.c cannot check its lists */
}

TEST(exhaustion_is_an_error_and_all_memory_can_be_allocated_again, "engines.md §6: bounded, deterministic allocator")
{
    static void *blocks[4096];
    boot();
    uint16 empty = heap_now();
    for (int round = 0; round < 3; round++) {
        for (uint16 size = SMALLEST; size <= 40 * HEAP_STEP; size = (uint16)(size + 3 * HEAP_STEP)) {
            uint16 n = 0;
            while ((blocks[n] = heap_alloc(size)) != NULL) {
                memset(blocks[n++], 0x5A, size);
            }
            CHECK(n >= (SYS_HEAP - empty) * 9 / 10 / size);
            for (uint16 i = 0; i < n; i++) { /* every second block first: the others then merge with both neighbours */
                heap_free_deferred(blocks[i * 2 < n ? i * 2 : (i * 2 - n) | 1], size);
            }
            heap_coalesce();
            CHECK_EQ(heap_now(), empty);
            void *all = heap_alloc((uint16)(SYS_HEAP - empty));
            CHECK(all != NULL);
            heap_free(all, (uint16)(SYS_HEAP - empty));
        }
    }
}

/* A long robot run: events and subscriptions are added and remain, some of them during bursts of messages, and threads
 * start and end. Finally all threads and messages end. */
enum { THREAD = 48 * HEAP_STEP, LASTING = 40, QUEUED = 120, RUNNING = 12, ROUNDS = 40 };

static void a_long_day(held_block lasting[], held_block queued[], held_block running[])
{
    for (int i = 0; i < 500; i++) {
        held_block *l = &lasting[rand() % LASTING], *r = &running[rand() % RUNNING];
        for (int n = rand() % 4 == 0 ? rand() % QUEUED : rand() % 6; n > 0; n--) {
            held_block *q = &queued[rand() % QUEUED];
            if (q->at == NULL) {
                obtain(q, (uint16)(SMALLEST + rand() % 5 * (int)HEAP_STEP), false, 1);
            }
            if (rand() % 32 == 0 && l->at == NULL) {
                obtain(l, SMALLEST, true, 2);
            }
        }
        for (held_block *q = queued; q != queued + QUEUED && i % 2 == 0; q++) {
            if (q->at != NULL && rand() % 32 != 0) {
                release(q);
            }
        }
        if (rand() % 8 == 0) {
            l->at != NULL ? release(l) : obtain(l, SMALLEST, true, 2);
        }
        if (rand() % 8 == 0) {
            r->at != NULL ? release(r) : obtain(r, (uint16)(THREAD + rand() % 3 * 80), false, 3);
        }
    }
}

static void release_all(held_block blocks[], int n)
{
    for (held_block *b = blocks; b != blocks + n; b++) {
        if (b->at != NULL) {
            release(b);
        }
    }
}

TEST(long_lived_blocks_gather_low, "memory.c, heap_alloc_lasting: events scattered over the heap would leave no room for threads")
{
    static held_block lasting[LASTING], queued[QUEUED], running[RUNNING];
    long room = 0, threads = 0;
    heap_init();
    srand(11);
    for (int round = 0; round < ROUNDS; round++) {
        a_long_day(lasting, queued, running);
        release_all(queued, QUEUED);
        release_all(running, RUNNING);
        uint16 n = 0;
        room += (SYS_HEAP - heap_now()) / THREAD;
        for (held[n].at = NULL; obtain(&held[n], THREAD, false, 4), held[n].at != NULL; n++) {
        }
        threads += n;
        release_all(held, n);
    }
    CHECK(threads >= room * 85 / 100);
    exit(0);
}

static uint16 threads_that_fit(void)
{
    static uint16 pids[SYS_HEAP / SYS_DEFAULT_STACK];
    uint16 n = 0;
    while ((pids[n] = Sys_Start_Process(boot)) != 0) {
        n++;
    }
    for (uint16 i = 0; i < n; i++) {
        CHECK(Sys_Kill_Process(pids[i]));
    }
    return n;
}

static bool ignore(uint16 pid, uint16 event, sys_event_data *data)
{
    (void)pid;
    (void)event;
    (void)data;
    return true;
}

TEST(an_event_registered_in_a_burst_costs_one_thread_at_most, "without low placement 20 threads would become 4")
{
    boot();
    Sys_Register_Event(E1);
    Sys_Subscribe_to_Event(E1, 0, ignore, NULL);
    uint16 before = threads_that_fit();
    for (uint16 burst = 3; Sys_Get_Statistics()->events_lost == 0; burst = (uint16)(burst * 2)) {
        for (uint16 i = 0; i < burst; i++) {
            Sys_Send_IntEvent(E1, i);
        }
        Sys_Register_Event((uint16)(E4 + burst)); /* allocated between the messages */
        for (uint16 i = 0; i < burst; i++) {
            Sys_Send_IntEvent(E1, i);
        }
        Sys_Yield();
        CHECK(threads_that_fit() + 1 >= before);
        Sys_Unregister_Event((uint16)(E4 + burst));
        CHECK_EQ(threads_that_fit(), before);
    }
}
