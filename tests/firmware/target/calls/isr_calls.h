/* Calls that the injected interrupt of target/calls makes. */
#ifndef ISR_CALLS_H
#define ISR_CALLS_H

#include <openswarm.h>

enum { HEARD = SYS_FIRST_USER_EVENT, AWAITED, PASSING, UNKNOWN };

extern uint16 driver_pid;
uint16 each_byte(uint8 byte, uint8 *buffer, uint16 *used);

/* Makes the calls that isr_wanted selects, once: 0 none, n the n-th of isr_acts, 0xFFFF all. */
void isr_calls(void);

#endif
