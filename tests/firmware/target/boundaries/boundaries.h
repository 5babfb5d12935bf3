/* A round of kernel calls that the harness interrupts at any instruction. See README.md. */
#ifndef BOUNDARIES_H
#define BOUNDARIES_H

#include <openswarm.h>

/* Per CPU (avr/, cortex_m/, riscv/): the device interrupt that the harness requests calls boundaries_isr(). */
void inject_init(void);
void boundaries_isr(void);

void round_begin(void); /* breakpoints of the harness */
void round_end(void);

#endif
