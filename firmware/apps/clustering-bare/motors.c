/* Stepper motors from T3 at 9,600 Hz. v mm/s are v * 1000 / 129 steps/s (epuck.md §3), that is 5 v / 6192 of a step per tick. */
#include "bare.h"
#include "hal_compiler.h"

enum { TICK_TCY = 1536, STEP = 6192, RATE = 5, PRIORITY = 5, TIMER_ON = 0x8000 };
INTERRUPT_LEVEL(T3, 5);

/* Coils A-D by index, on the low nibble; forward is the next index on the right, the previous on the left. */
static const uint8_t phases[4] = {0xA, 0x6, 0x5, 0x9};

typedef struct {
    uint16_t rate, fraction;
    uint8_t index;
} motor;

static motor left, right;

OS_ISR(_T3Interrupt)
{
    IFS0bits.T3IF = 0;
    left.fraction += left.rate;
    if (left.fraction >= STEP) {
        left.fraction -= STEP;
        left.index = (uint8_t)(left.index - 1u) & 3u;
    }
    right.fraction += right.rate;
    if (right.fraction >= STEP) {
        right.fraction -= STEP;
        right.index = (uint8_t)(right.index + 1u) & 3u;
    }
    uint8_t coils = left.rate != 0 ? phases[left.index] : 0;
    if (right.rate != 0) {
        coils |= (uint8_t)(phases[right.index] << 4);
    }
    *(volatile uint8_t *)&LATD = coils;
}

void motors_init(void)
{
    LATD &= 0xFF00u;
    TRISD &= 0xFF00u;
    PR3 = TICK_TCY - 1;
    IPC1bits.T3IP = PRIORITY;
    IFS0bits.T3IF = 0;
    IEC0bits.T3IE = 1;
    T3CON = TIMER_ON;
}

void motors_drive(uint8_t left_mm_s, uint8_t right_mm_s)
{
    left.rate = (uint16_t)(left_mm_s * RATE); /* one store each: a tick between both uses one new and one old rate */
    right.rate = (uint16_t)(right_mm_s * RATE);
}
