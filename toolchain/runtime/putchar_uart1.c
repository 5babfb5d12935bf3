/* SPDX-License-Identifier: MIT */
/* Default __putchar of the library: blocking output on UART1, which it enables on first use at the highest rate (U1BRG 0). */
#include <dspic30f6014a.h>
#include <stdio.h>

int __putchar(int character)
{
    if (!U1MODEbits.UARTEN) {
        U1BRG = 0;
        U1MODEbits.UARTEN = 1;
        U1STAbits.UTXEN = 1;
    }
    while (U1STAbits.UTXBF) {
    }
    U1TXREG = (unsigned char)character;
    return character;
}
