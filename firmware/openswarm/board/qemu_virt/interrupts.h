/* SPDX-License-Identifier: MIT */
/* Device interrupts of the platform-level interrupt controller, all at level device. */
#ifndef INTERRUPTS_H
#define INTERRUPTS_H

#include <stdint.h>

enum { SOURCE_UART = 10, SOURCE_RTC = 11, SOURCES };

/* From then on isr is called for the source, 1 to SOURCES - 1. It may call the kernel. */
void interrupts_connect(uint32_t source, void (*isr)(void));

#endif
