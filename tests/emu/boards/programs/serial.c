/* Echoes characters of UART1 and counts receive errors (dspic30f6014a.md §10.2). */
#include <p30F6014A.h>
#include <stdint.h>

volatile uint16_t framing_errors, overruns, received;

int main(void)
{
    U1BRG = 7;
    U1MODE = 0x8000;
    U1STA = 0x0400;
    while (received < 40) {
        if (U1STAbits.OERR) {
            overruns++;
            U1STAbits.OERR = 0;
        }
        if (!U1STAbits.URXDA)
            continue;
        uint8_t broken = U1STAbits.FERR;
        uint8_t byte = (uint8_t)U1RXREG;
        received++;
        if (broken)
            framing_errors++;
        else
            U1TXREG = byte;
        if (byte == 's') /* delay, so that the FIFO overruns */
            for (volatile uint16_t i = 0; i < 2000; i++) {
            }
    }
    return 0;
}
