/* Text on UART1 by polling. */
#include "serial.h"

#include <p30F4011.h>

#define BAUD_DIVIDER 15u /* 29.4912 MHz / 16 / 115,200 - 1 */
#define DIGITS 5

void serial_init(void)
{
    U1BRG = BAUD_DIVIDER;
    U1MODEbits.UARTEN = 1;
    U1STAbits.UTXEN = 1;
}

void serial_text(const char *text)
{
    for (; *text != '\0'; text++) {
        while (U1STAbits.UTXBF) {
        }
        U1TXREG = (unsigned char)*text;
    }
}

void serial_number(int16_t number)
{
    char digits[DIGITS + 2];
    char *place = digits + DIGITS + 1;
    uint16_t size = number < 0 ? (uint16_t)-number : (uint16_t)number;
    *place = '\0';
    do {
        *--place = (char)('0' + size % 10u);
        size /= 10u;
    } while (size != 0);
    if (number < 0) {
        *--place = '-';
    }
    serial_text(place);
}
