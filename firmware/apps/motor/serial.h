/* Text on UART1, 115,200 baud. */
#ifndef SERIAL_H
#define SERIAL_H

#include <stdint.h>

void serial_init(void);

/* Sends a text and waits until all of it is in the transmitter. */
void serial_text(const char *text);

/* Sends a number in decimal. */
void serial_number(int16_t number);

#endif
