/* INT0, whose flag the harness sets: PD2 stays high, so that nothing else does. */
#include "../boundaries.h"

#include <avr/io.h>

void inject_init(void)
{
    DDRD |= 1 << PD2;
    PORTD |= 1 << PD2;
    EICRA = 1 << ISC01; /* falling edge */
    EIMSK = 1 << INT0;
}
