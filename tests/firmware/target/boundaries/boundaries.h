/* A round of kernel calls that an interrupt may cut anywhere. README.md. */
#ifndef BOUNDARIES_H
#define BOUNDARIES_H

#include <openswarm.h>

/* Of the CPU (avr/): an interrupt of level device calls boundaries_isr() once per request. */
void inject_init(void);
void inject_request(void); /* where the CPU can do that by itself: the next boundary, from now on */
void inject_cancel(void);  /* end of the round */
void boundaries_isr(void);

void round_begin(void); /* stops of the harness */
void round_end(void);

#endif
