/* SPDX-License-Identifier: MIT */
/* Receivers and emitters of the e-puck: AN8-15 in turn, into one half of the converter's buffer while the other is
 * read; all four pulse lines together. */
#include "hal_infrared.h"
#include "openswarm_interrupt.h"
#include "pins.h"

enum {
    RECEIVERS = 0xFF00,
    SCAN_IN_HALVES = 0x041E, /* ADCON2: CSCNA, interrupt after 8 conversions, BUFM */
    SECOND_HALF = 8,         /* which is filled while BUFS = 1 */
    SAMPLING = 0x1F13, /* ADCON3: 31 + 14 TAD of 10 Tcy, the fastest that 3.3 V allow: 244 us a scan, more than the
                          camera's longest line takes at IPL 6 */
    AUTOMATIC = 0x80E4 /* ADCON1: on, SSRC = 7, ASAM; unsigned */
};

static void scan_done(void)
{
    volatile unsigned int *buffer = &ADCBUF0;
    infrared_scanned(buffer + (ADCON2bits.BUFS ? 0 : SECOND_HALF));
}
SYS_INTERRUPT(ADC, 4, scan_done)

void hal_infrared_light(bool on)
{
    if (on) {
        LATF |= PIN_PULSE_IR_F;
        LATG |= PIN_PULSE_IR_G;
    } else {
        LATF &= (uint16_t)~PIN_PULSE_IR_F;
        LATG &= (uint16_t)~PIN_PULSE_IR_G;
    }
}

/* The last word of the data EEPROM; erased it reads FFFF. */
uint16_t hal_infrared_number(void)
{
    uint16_t number;
    TBLPAG = 0x7F;
    __asm__ volatile("tblrdl [%1], %0" : "=r"(number) : "r"(0xFFFEu));
    return number > 0x07FF ? 0 : number;
}

void hal_infrared_start(void)
{
    ADPCFG = PIN_DEBUGGER;
    ADCON2 = SCAN_IN_HALVES;
    ADCON3 = SAMPLING;
    ADCSSL = RECEIVERS;
    Sys_Enable_Interrupt(ADC);
    ADCON1 = AUTOMATIC;
}
