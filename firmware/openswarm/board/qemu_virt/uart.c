/* SPDX-License-Identifier: MIT */
/* The NS16550 of QEMU's virt machine, 115,200 baud 8N1. QEMU sends each byte at once. */
#include "interrupts.h"
#include "io.h"
#include "kernel.h"
#include "ns16550.h"

enum { DIVISOR = 3686400 / 16 / 115200 };

static void interrupt(void)
{
    uint8 status = UART_LSR;
    while (status & (UART_LSR_DR | UART_LSR_OE)) {
        uint8 byte = UART_DATA;
        if (status & UART_LSR_OE) {
            uart_overrun(SYS_UART1);
        }
        if (status & UART_LSR_FE) {
            uart_overrun(SYS_UART1);
        } else if (status & UART_LSR_DR) {
            uart_received(SYS_UART1, byte);
        }
        status = UART_LSR;
    }
    while ((UART_IER & UART_IER_EMPTY) && (UART_LSR & UART_LSR_THRE)) {
        sint16 byte = uart_next_byte(SYS_UART1);
        if (byte < 0) {
            UART_IER &= (uint8)~UART_IER_EMPTY;
        } else {
            UART_DATA = (uint8)byte;
        }
    }
}

void hal_uart_init(uint8_t uart)
{
    (void)uart;
    UART_LCR = UART_LCR_DIVISOR;
    UART_DATA = DIVISOR;
    UART_IER = 0; /* the divisor's high byte */
    UART_LCR = UART_LCR_8N1;
}

void hal_uart_start(uint8_t uart)
{
    (void)uart;
    interrupts_connect(SOURCE_UART, interrupt);
    UART_IER |= UART_IER_RECEIVED;
}

void hal_uart_transmit(uint8_t uart)
{
    (void)uart;
    UART_IER |= UART_IER_EMPTY;
}
