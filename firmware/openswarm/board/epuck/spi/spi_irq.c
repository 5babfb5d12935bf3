/* SPDX-License-Identifier: MIT */
/* SPI2 of the e-puck at 921.6 kHz for a turret: SCK2 RG6, SDI2 RG7, SDO2 RG8, and RG9 as select (dspic30f6014a.md
 * §12). The selector has the same pins (epuck.md §2) and reads the levels that the bus leaves on them. */
#include "hal_spi.h"
#include "openswarm_interrupt.h"
#include "pins.h"

enum {
    SELECT = 0x0200,    /* RG9, low = selected */
    OUTPUTS = 0x0140,   /* RG6, RG8 */
    MASTER = 0x013D,    /* SPI2CON: CKE (mode 0), MSTEN, 1:1 x 1:16, 128 Tcy a byte */
    ON = 0x8000         /* SPI2STAT: SPIEN */
};

static void byte_done(void)
{
    int16_t next = spi_exchanged((uint8_t)SPI2BUF);
    if (next >= 0) {
        SPI2BUF = (uint16_t)next;
    } else {
        Sys_Disable_Interrupt(SPI2);
    }
}
SYS_INTERRUPT(SPI2, 4, byte_done)

void hal_spi_start(void)
{
    LATG |= SELECT;
    TRISG &= (uint16_t)~(SELECT | OUTPUTS);
    SPI2CON = MASTER;
}

void hal_spi_begin(uint8_t first)
{
    SPI2STAT = ON;
    LATG &= (uint16_t)~SELECT;
    Sys_Enable_Interrupt(SPI2);
    SPI2BUF = first;
}

void hal_spi_end(void)
{
    Sys_Disable_Interrupt(SPI2);
    __asm__ volatile("nop"); /* one more interrupt may be taken after the write (isa.md §14.3) */
    SPI2STAT = 0;
    LATG |= SELECT;
}
