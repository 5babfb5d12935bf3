/* SPDX-License-Identifier: MIT */
/* Default __getchar of the library: waits for a character from UART1, which it enables on first use like __putchar. */
#include <dspic30f6014a.h>
#include <stdio.h>

int __getchar(void)
{
    if (!U1MODEbits.UARTEN) {
        U1BRG = 0;
        U1MODEbits.UARTEN = 1;
        U1STAbits.UTXEN = 1;
    }
    while (!U1STAbits.URXDA) {
        if (U1STAbits.OERR) /* receive buffer overrun: the receiver stops until the flag is cleared */
            U1STAbits.OERR = 0;
    }
    return U1RXREG & 0xFF;
}
