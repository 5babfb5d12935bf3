/* SPDX-License-Identifier: MIT */
/* Interface of the host board for tests. */
#ifndef HOST_BOARD_H
#define HOST_BOARD_H

#include "openswarm.h"

void host_uart_sink(void (*sink)(uint8 uart, uint8 byte)); /* instead of standard output */
void host_hold_line(bool hold);                            /* true: no byte leaves the transmit queues */
void host_receive(uint8 uart, uint8 byte);                 /* as the receive ISR */
void host_set_selector(uint8 position);
int16_t host_left(void); /* mm/s at the stepper driver */
int16_t host_right(void);

#endif
