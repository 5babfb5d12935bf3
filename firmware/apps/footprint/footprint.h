/* Variables that a measuring program on the host sets and reads. All fields are 16-bit words, in this order. */
#ifndef FOOTPRINT_H
#define FOOTPRINT_H

#include <openswarm.h>

enum { FOOTPRINT_THREADS = 8, FOOTPRINT_PAYLOAD = 64 };

typedef struct {
    uint16 threads;       /* n, 0-8 */
    uint16 events;        /* m, 0-16 */
    uint16 subscriptions; /* s, 0-16; needs m >= 1 */
    uint16 messages;      /* pending messages of the first event; needs s >= 1 */
    uint16 payload;       /* d of each, 0-64 */
} footprint_request;

typedef struct {
    uint16 threads, events, subscriptions, messages; /* created; fewer than requested if memory is full */
    uint16 heap_used, heap_peak;                     /* the allocator's own count, at the last stop */
    uint16 kernel_stack_unused, thread_stack_unused;
} footprint_result;

extern volatile footprint_request footprint_wanted;
extern volatile footprint_result footprint_now;

/* Breakpoints, in this order: empty functions. */
void footprint_begin(void);  /* kernel initialised; set footprint_wanted here */
void footprint_empty(void);  /* footprint_now describes the empty kernel */
void footprint_built(void);  /* footprint_now describes the load */
void footprint_undone(void); /* the load is removed: heap_used must be that of footprint_empty */

#endif
