/* Variables that a measuring program on the host sets, and its breakpoints. README.md lists the scenarios. */
#ifndef LATENCY_H
#define LATENCY_H

#include <openswarm.h>

enum { LATENCY_EVENT = SYS_FIRST_USER_EVENT, LATENCY_WAITED = SYS_FIRST_USER_EVENT + 1 };

typedef struct {
    uint16 threads;     /* threads that are always ready and never yield, 0-8 */
    uint16 yielders;    /* threads that only yield, 0-8 */
    uint16 subscribers; /* of LATENCY_EVENT, 0-4 */
    uint16 waiters;     /* threads waiting for LATENCY_WAITED, 0-2 */
    uint16 events;      /* registered before LATENCY_EVENT, 0-16: the list that sending searches */
    uint16 payload;     /* bytes of each message, 0-24 */
    uint16 sender;      /* 1: a thread sends LATENCY_EVENT for ever; 2: LATENCY_WAITED; 0: none */
} latency_scenario;

extern volatile latency_scenario latency_wanted;

void latency_begin(void); /* breakpoint: set latency_wanted here */
void latency_ready(void); /* breakpoint: the scenario runs from here on */
void latency_isr(void);   /* INT1, IPL 4: sends LATENCY_EVENT with latency_wanted.payload bytes */

#endif
