/* A round of kernel calls that an interrupt may cut anywhere. README.md. */
#ifndef BOUNDARIES_H
#define BOUNDARIES_H

#include <openswarm.h>

/* Of the CPU (avr/, cortex_m/): an interrupt of level device, which the harness requests, calls boundaries_isr(). */
void inject_init(void);
void boundaries_isr(void);

void round_begin(void); /* stops of the harness */
void round_end(void);

#endif
