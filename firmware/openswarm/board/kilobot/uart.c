/* SPDX-License-Identifier: MIT */
/* USART0 of the Kilobot, 38,400 baud 8N1. On the robot PD1 is the debug output and PD0 the charger's pin: bytes
 * arrive only if external hardware drives PD0. */
#include "io.h"
#include "kernel.h"

#include <avr/io.h>

enum { BAUD_DIVISOR = (F_CPU + 8 * 38400UL) / (16 * 38400UL) - 1 }; /* 12 at 8 MHz: 0.2 % fast */

void hal_uart_init(uint8_t uart)
{
    (void)uart;
    UBRR0 = BAUD_DIVISOR;
    UCSR0C = 1 << UCSZ01 | 1 << UCSZ00;
    UCSR0B = 1 << TXEN0;
}

void hal_uart_start(uint8_t uart)
{
    (void)uart;
    UCSR0B |= 1 << RXEN0 | 1 << RXCIE0;
}

void hal_uart_transmit(uint8_t uart)
{
    (void)uart;
    UCSR0B |= 1 << UDRIE0;
}

HAL_USED void uart_empty_isr(void)
{
    sint16 byte = uart_next_byte(SYS_UART1);
    if (byte < 0) {
        UCSR0B &= (uint8)~(1 << UDRIE0);
    } else {
        UDR0 = (uint8)byte;
    }
}

HAL_USED void uart_received_isr(void)
{
    uint8 status = UCSR0A, byte = UDR0;
    if (status & 1 << DOR0) {
        uart_overrun(SYS_UART1);
    }
    if (status & 1 << FE0) {
        uart_overrun(SYS_UART1);
    } else {
        uart_received(SYS_UART1, byte);
    }
}
