/* SPDX-License-Identifier: MIT */
/* Registers of the NS16550, one byte each. */
#ifndef NS16550_H
#define NS16550_H

#include "soc.h"

#include <stdint.h>

#define UART_REGISTER(number) (*(volatile uint8_t *)(UART_BASE + (number)))
#define UART_DATA UART_REGISTER(0) /* with LCR_DIVISOR the divisor's low byte */
#define UART_IER UART_REGISTER(1)  /* with LCR_DIVISOR its high byte */
#define UART_IER_RECEIVED 0x01
#define UART_IER_EMPTY 0x02
#define UART_LCR UART_REGISTER(3)
#define UART_LCR_8N1 0x03
#define UART_LCR_DIVISOR 0x80
#define UART_LSR UART_REGISTER(5)
#define UART_LSR_DR 0x01   /* a byte was received */
#define UART_LSR_OE 0x02   /* a byte was lost */
#define UART_LSR_FE 0x08   /* a byte without stop bit */
#define UART_LSR_THRE 0x20 /* the next byte can be written */
#define UART_LSR_TEMT 0x40 /* every byte was sent */

#endif
