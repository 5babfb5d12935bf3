/* SPDX-License-Identifier: MIT */
/* Stepper motors of the e-puck: rates and coils for the interrupt in stepper.S.
 *
 * T3 runs at 9,600 Hz (1,536 Tcy) while a motor turns. v mm/s are v * 1000 / 129 steps/s, that is v * 5 / 6192 steps
 * per tick: every tick adds 5 v to a fraction of 6192 and a step is due whenever it leaves 0..6191. No rounding
 * anywhere. */
#include "io.h"
#include "kernel.h"
#include "pins.h"

enum { TICK_PERIOD = 1536, RATE_PER_MM_S = 5, PRIORITY = 5 };
INTERRUPT_LEVEL(T3, 5);

/* Low nibble: phases A-D of the coils now; right rotation by a nibble = next index (epuck.md §3). */
enum { PHASES = 0x956A };

/* Shared with stepper.S, which relies on the order of the fields. A stepper interrupt between two
 * stores of a change does no harm, so no lock is needed. */
typedef struct {
    volatile sint16 rate; /* 5 v, in 1/6192 step per tick; positive turns to the next index */
    sint16 fraction;      /* 0..6191, in 1/6192 step */
    uint16 phases;
    volatile uint16 coils; /* 0x0F on, 0 off */
} stepper;

stepper stepper_left, stepper_right;

void hal_motors_init(void)
{
    stepper_left.phases = PHASES;
    stepper_right.phases = PHASES;
    stepper_left.fraction = 0;
    stepper_right.fraction = 0;
    PR3 = TICK_PERIOD - 1;
    IPC1bits.T3IP = PRIORITY;
    hal_motors_drive(0, 0);
}

static void set(stepper *s, sint16 mm_s)
{
    s->rate = (sint16)(mm_s * RATE_PER_MM_S);
    s->coils = mm_s != 0 ? 0x0F : 0;
}

void hal_motors_drive(int16_t left_mm_s, int16_t right_mm_s)
{
    set(&stepper_left, (sint16)-left_mm_s); /* forward is the previous index on the left, the next on the right */
    set(&stepper_right, right_mm_s);
    if (left_mm_s == 0 && right_mm_s == 0) {
        IEC0bits.T3IE = 0;
        T3CON = 0; /* one more interrupt may be taken here, which does no harm (isa.md §14.3) */
        LATD &= (uint16)~PIN_MOTORS;
    } else {
        if (!T3CONbits.TON) {
            TMR3 = 0;
            T3CON = 0x8000; /* on, 1:1 */
            IFS0bits.T3IF = 0;
        }
        IEC0bits.T3IE = 1;
    }
}
