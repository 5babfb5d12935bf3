/* Heap layouts that are worst cases for calls that use the tree of free blocks: their offset in os_memory, and their
 * pieces in order of address.
 *
 * A positive number is a hole of that many bytes. A negative number -n is the subscription that is freed as the n-th.
 * The pieces of `chain` lie in the upper half of memory, from 0x1000 on; the smaller a hole, the lower its address. The
 * tree is then one path: removing its root pulls up all other nodes, and inserting it pushes them down again.
 * The other layouts were found by simulated annealing on a model of the tree that counts the steps of searches,
 * removals and insertions. For nearly all freed pieces, two paths of full length are searched or pulled up, and a third
 * one is pushed down. `three_given_back` shows the principle: to the right of each freed piece lies the second largest
 * hole; only the hole that was merged before is larger. */
#ifndef LAYOUTS_H
#define LAYOUTS_H

enum { KEPT = 0, END = 127, EVENT = -128, SUBSCRIPTIONS = 22, PIECES = 80 };

typedef struct {
    unsigned begin;
    const signed char *pieces;
} layout;

static const signed char chain_pieces[] = {
    6, KEPT, 8, KEPT, 10, KEPT, 12, KEPT, 14, KEPT, 16, KEPT, 18, KEPT, 60, KEPT, END,
};
static const layout chain = {0x1000, chain_pieces};

static const signed char three_given_back_pieces[] = {
    KEPT, 26, KEPT, 10, KEPT, 34,   KEPT, KEPT, 6,  KEPT, KEPT, 28, KEPT, 16, KEPT, KEPT, KEPT,
    KEPT, 18, KEPT, 10, KEPT, KEPT, KEPT, 60,   -1, 56,   -2,   50, -3,   48, KEPT, KEPT, END,
};
static const layout three_given_back = {0x0E06, three_given_back_pieces};

/* The memory of the event itself is freed last. */
static const signed char three_and_event_given_back_pieces[] = {
    KEPT, 24, KEPT,  12, KEPT, KEPT, 30, KEPT, KEPT, 8,  KEPT, 20, KEPT, KEPT, 22,   KEPT, KEPT, 8,
    KEPT, 32, EVENT, 60, -1,   56,   -2, 38,   -3,   34, KEPT, 10, KEPT, 14,   KEPT, 18,   KEPT, END,
};
static const layout three_and_event_given_back = {0x0E12, three_and_event_given_back_pieces};

static const signed char many_given_back_pieces[] = {
    KEPT, 28,  KEPT, KEPT, KEPT, 46,   KEPT, KEPT, 12,   KEPT, KEPT, -3,   -1,   46,  KEPT, 18,  KEPT,
    KEPT, 32,  KEPT, KEPT, 36,   KEPT, 28,   KEPT, 8,    KEPT, 14,   KEPT, -22,  -21, -15,  -7,  -2,
    52,   -4,  -5,   -6,   -8,   -9,   -10,  -11,  6,    -12,  -13,  -14,  16,   -16, 12,   -17, -18,
    -19,  -20, KEPT, 8,    KEPT, KEPT, KEPT, 10,   KEPT, 26,   KEPT, KEPT, KEPT, 22,  KEPT, END,
};
static const layout many_given_back = {0x0C26, many_given_back_pieces};

#endif
