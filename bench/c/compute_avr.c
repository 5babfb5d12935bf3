/* compute.c on an ATmega2560: prints `D` on the first UART when it is done, because each emulator ends in its own
 * way. simavr prints only complete lines. */
#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/sleep.h>

#define main compute_main
#include "compute.c"
#undef main

static void say(char letter)
{
    while (!(UCSR0A & _BV(UDRE0))) {
    }
    UDR0 = (uint8_t)letter;
}

int main(void)
{
    compute_main();
    UCSR0B = _BV(TXEN0);
    say('D');
    say('\n');
    while (!(UCSR0A & _BV(TXC0))) {
    }
    cli();
    sleep_mode();
    for (;;) {
    }
}
