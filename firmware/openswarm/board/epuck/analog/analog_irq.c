/* SPDX-License-Identifier: MIT */
/* ADC of the e-puck: AN2-4 microphones, AN5-7 accelerometer, AN8-15 proximity (epuck.md §2). Each interrupt ends a
 * scan of eight inputs, the pair of proximity sensors last. */
#include "hal_analog.h"
#include "openswarm_interrupt.h"
#include "pins.h"

enum {
    FIXED = 0x00FC,
    PAIR = 0x1100,       /* AN8 and AN12, to be shifted by the number of the pair */
    PAIRS = 4,
    SCAN_OF_8 = 0x041C,  /* ADCON2: CSCNA, interrupt after 8 conversions */
    SLOWEST = 0x1F3F,    /* ADCON3: 31 + 14 TAD of 32 Tcy, 97.7 us an input: the pair is sampled 0.59 ms after a switch;
                            0.3 ms settle it (epuck.md §5) */
    AUTOMATIC = 0x00E4,  /* ADCON1: SSRC = 7, ASAM; unsigned */
    ON = 0x8000
};

static hal_analog_scan scan;

static void light(uint8_t pair, bool on)
{
    volatile unsigned int *latch = pair < 2 ? &LATF : &LATG;
    uint16_t pin = pair < 2 ? (uint16_t)(0x0080u << pair) : (uint16_t)(1u << (pair - 2)); /* RF7 RF8 RG0 RG1 */
    if (on) {
        *latch |= pin;
    } else {
        *latch &= (uint16_t)~pin;
    }
}

/* Restarts the scan with the selected pair, by switching the converter off and on. */
static void restart(void)
{
    ADCON1 = AUTOMATIC;
    ADCSSL = (uint16_t)(FIXED | PAIR << scan.pair);
    ADCON1 = ON | AUTOMATIC;
}

static void scan_done(void)
{
    volatile unsigned int *buffer = &ADCBUF0;
    for (uint8_t i = 0; i < HAL_ANALOG_FIXED; i++) {
        scan.fixed[i] = (uint16_t)buffer[i];
    }
    scan.near[0] = (uint16_t)buffer[HAL_ANALOG_FIXED];
    scan.near[1] = (uint16_t)buffer[HAL_ANALOG_FIXED + 1];
    hal_analog_scan done = scan;
    scan.lit = !scan.lit;
    light(scan.pair, scan.lit);
    if (!scan.lit) {
        scan.pair = (uint8_t)((scan.pair + 1u) % PAIRS);
    }
    restart();
    analog_scanned(&done);
}
SYS_INTERRUPT(ADC, 4, scan_done)

void hal_analog_start(void)
{
    ADPCFG = PIN_DEBUGGER;
    ADCON2 = SCAN_OF_8;
    ADCON3 = SLOWEST;
    Sys_Enable_Interrupt(ADC);
    scan.pair = 0;
    scan.lit = false;
    restart();
}
