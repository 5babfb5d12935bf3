/* INT0 as injected interrupt: the harness sets its flag. The pin PD2 stays high, so that no edge sets the flag. */
#include "../boundaries.h"

#include <avr/io.h>

void inject_init(void)
{
    DDRD |= 1 << PD2;
    PORTD |= 1 << PD2;
    EICRA = 1 << ISC01; /* on a falling edge */
    EIMSK = 1 << INT0;
}
