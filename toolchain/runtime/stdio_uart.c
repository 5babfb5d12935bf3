/* SPDX-License-Identifier: MIT */
/* __putchar and __getchar of programs that name __C30_UART, which selects UART1 or UART2. Like the default hooks they enable
 * the UART on first use at the highest rate (UxBRG 0). The driver requests __stdio_uart for such programs. */
#include <dspic30f6014a.h>
#include <dspic30f6014a_fields.h>
#include <libpic30.h>
#include <stdio.h>

struct uart {
    volatile unsigned int mode, status, transmit, receive, rate;
};

int __C30_UART = 1;

struct uart *__stdio_uart(void);

struct uart *__stdio_uart(void)
{
    struct uart *uart = (struct uart *)(__C30_UART == 2 ? &U2MODE : &U1MODE);
    if (!(uart->mode & _U1MODE_UARTEN_MASK)) {
        uart->rate = 0;
        uart->mode |= _U1MODE_UARTEN_MASK;
        uart->status |= _U1STA_UTXEN_MASK;
    }
    return uart;
}

int __putchar(int character)
{
    struct uart *uart = __stdio_uart();
    while (uart->status & _U1STA_UTXBF_MASK) {
    }
    uart->transmit = (unsigned char)character;
    return character;
}

int __getchar(void)
{
    struct uart *uart = __stdio_uart();
    while (!(uart->status & _U1STA_URXDA_MASK)) {
        if (uart->status & _U1STA_OERR_MASK) /* the receiver stops until the flag is cleared */
            uart->status &= ~_U1STA_OERR_MASK;
    }
    return uart->receive & 0xFF;
}
