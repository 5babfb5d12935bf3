/* Motors and remote control of the program without a kernel. */
#ifndef BARE_H
#define BARE_H

#include <p30F6014A.h>
#include <stdint.h>

#ifndef OS_ISR /* Microchip's headers do not define this macro */
#define OS_ISR(name) void __attribute__((__interrupt__, __no_auto_psv__)) name(void)
#endif

void motors_init(void);
void motors_drive(uint8_t left_mm_s, uint8_t right_mm_s); /* 0..129, forward */

enum { RC5_NOTHING = 0xFF };
void rc5_init(void);
uint8_t rc5_take(void); /* the command of a new frame, once, or RC5_NOTHING */

#endif
