/* SPDX-License-Identifier: MIT */
/* UART1 (Bluetooth) and UART2 of the e-puck, both 115,200 baud 8N1 (epuck.md §2). The interrupt entries are in
 * vectors.S. */
#include "io.h"
#include "kernel.h"

enum {
    BAUD_DIVISOR = 7, /* 14.7456 MHz / 16 / 115,200 - 1 (dspic30f6014a.md §10) */
    ENABLE = 0x8000,  /* UxMODE: UARTEN, 8N1 */
    TRANSMIT = 0x8400, /* UxSTA: UTXEN; interrupt when the last byte leaves the FIFO */
    HAS_BYTE = 0x0001,
    OVERRUN = 0x0002,
    FRAMING_ERROR = 0x0004,
    FIFO_FULL = 0x0200
};

typedef struct {
    uint16 mode, status, transmit, receive, baud;
} registers;

static HAL_OUTLINE volatile registers *registers_of(uint8 uart)
{
    return (volatile registers *)(uart == SYS_UART1 ? &U1MODE : &U2MODE);
}

void hal_uart_init(uint8_t uart)
{
    volatile registers *r = registers_of(uart);
    r->baud = BAUD_DIVISOR;
    r->mode = ENABLE;
    r->status = TRANSMIT;
}

/* Priorities are 4 after a reset (dspic30f6014a.md §5). */
void hal_uart_start(uint8_t uart)
{
    if (uart == SYS_UART1) {
        IEC0bits.U1RXIE = 1;
        hal_barrier(); /* keeps the branches apart: merged code is larger */
    } else {
        IEC1bits.U2RXIE = 1;
    }
}

/* Enables the transmit interrupt, which stays enabled while bytes wait, and requests it, so that it runs at once. */
void hal_uart_transmit(uint8_t uart)
{
    if (uart == SYS_UART1) {
        IFS0bits.U1TXIF = 1;
        IEC0bits.U1TXIE = 1;
        hal_barrier();
    } else {
        IFS1bits.U2TXIF = 1;
        IEC1bits.U2TXIE = 1;
    }
}

/* Fills the FIFO; returns 1 if the queue became empty. */
BOUNDS_AT("while (", loop 5); /* four places, and the byte that leaves meanwhile */
static HAL_OUTLINE uint16 fill(uint8 uart)
{
    volatile registers *r = registers_of(uart);
    while (!(r->status & FIFO_FULL)) {
        sint16 byte = uart_next_byte(uart);
        if (byte < 0) {
            return 1;
        }
        r->transmit = (uint16)byte;
    }
    return 0;
}

BOUNDS_AT("while (", loop 6, one); /* four places of the FIFO, the shift register, a byte that arrives meanwhile */
static HAL_OUTLINE void empty(uint8 uart)
{
    volatile registers *r = registers_of(uart);
    uint16 status;
    while ((status = r->status) & HAS_BYTE) {
        uint8 byte = (uint8)r->receive;
        if (status & FRAMING_ERROR) {
            uart_overrun(uart);
        } else {
            uart_received(uart, byte);
        }
    }
    if (status & OVERRUN) {
        r->status = (uint16)(status & ~OVERRUN); /* also empties the FIFO */
        uart_overrun(uart);
    }
}

/* Common handler of the four UART interrupts; a flag that is set meanwhile is served in the same call. */
HAL_USED void uart_isr(void)
{
    if (IFS0bits.U1RXIF) {
        IFS0bits.U1RXIF = 0;
        empty(SYS_UART1);
    }
    if (IFS1bits.U2RXIF) {
        IFS1bits.U2RXIF = 0;
        empty(SYS_UART2);
    }
    if (IEC0bits.U1TXIE && IFS0bits.U1TXIF) {
        IFS0bits.U1TXIF = 0;
        if (fill(SYS_UART1) != 0) {
            IEC0bits.U1TXIE = 0;
        }
    }
    if (IEC1bits.U2TXIE && IFS1bits.U2TXIF) {
        IFS1bits.U2TXIF = 0;
        if (fill(SYS_UART2) != 0) {
            IEC1bits.U2TXIE = 0;
        }
    }
}
