/* SPDX-License-Identifier: MIT */
/* Names of Microchip's libpic30: delays, and the choice of the UART. For __delay_ms and __delay_us the program defines FCY, the instruction cycles per second. */
#ifndef LIBPIC30_H
#define LIBPIC30_H

#ifdef __cplusplus
extern "C" {
#endif

/* Wait for the given number of instruction cycles, or up to 3 more, including call and return; at least 9. */
void __delay32(unsigned long cycles);

/* UART of printf, putchar, scanf and getchar: 1 or 2. A program may define it, or assign to it. */
extern int __C30_UART;

#define __delay_ms(milliseconds) __delay32((unsigned long)((milliseconds) * (FCY) / 1000ULL))
#define __delay_us(microseconds) __delay32((unsigned long)((microseconds) * (FCY) / 1000000ULL))

#ifdef __cplusplus
}
#endif

#endif
