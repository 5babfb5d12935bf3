/* Layouts of the heap in which calls do the most on its tree: where they begin (from os_memory) and their pieces, by
 * address.
 *
 * A number is a hole of so many bytes, a negative one a subscription, which is the so many-th given back. Those of
 * `chain` lie in the half of the memory from 0x1000 on, the smaller the nearer, so that the tree is one path: taking
 * out its root pulls up all others, and putting it in pushes them down again. The others were found by simulated
 * annealing on a model of the tree that counts the steps of its searches, of taking out and putting in: for nearly all
 * pieces given back, two paths of full length are searched or pulled up, and a third is pushed down. In
 * `three_given_back` one sees how: what is to the right of each is the second largest hole, the largest but what was
 * joined before. */
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

/* The event itself is the last that is given back. */
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
