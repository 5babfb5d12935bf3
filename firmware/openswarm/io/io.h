/* SPDX-License-Identifier: MIT */
/* Private to the device layer and the boards: what a lower layer (hal_io.h) calls, and the life cycle a board
 * drives. */
#ifndef OS_IO_H
#define OS_IO_H

#include "hal_io.h"
#include "openswarm_io.h"

void motors_init(void);
void motors_stop(void); /* speeds 0, coils off; any context */

void uart_init(uint8 uart);
void uart_start(uint8 uart);
void uart_tick(void);                         /* ISR, every 1 ms */
sint16 uart_next_byte(uint8 uart);            /* ISR: 0-255, or -1: no byte to send */
void uart_received(uint8 uart, uint8 byte);   /* ISR */
void uart_overrun(uint8 uart);                /* ISR: the hardware lost bytes */

void selector_init(void);
void selector_tick(void); /* ISR, every 1 ms */

#endif
