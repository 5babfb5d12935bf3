/* SPDX-License-Identifier: MIT */
/* The e-puck: clock and configuration words, pins, and the list of its devices. */
#include "hal_board.h"
#include "io.h"
#include "kernel.h"
#include "pins.h"

#if SYS_1PXSENSOR
#include "camera.h"
#endif

/* 7.3728 MHz crystal, PLL x8: 14.7456 MHz instruction clock (epuck.md §2, openswarm-original.md §10). */
_FOSC(CSW_FSCM_OFF & XT_PLL8);
_FWDT(WDT_OFF & WDTPSA_8 & WDTPSB_8); /* 128 ms once software starts it (hal_reset.h) */
_FBORPOR(PBOR_OFF & MCLR_EN);
_FGS(CODE_PROT_OFF);

/* Everything off before it becomes an output. */
static void pins_init(void)
{
    LATA &= (uint16)~PIN_LED_RING_ALL;
    LATC &= (uint16)~(PIN_FRONT_LED | PIN_BODY_LED | PIN_CAMERA_RESET);
    LATD &= (uint16)~PIN_MOTORS;
    LATF &= (uint16)~(PIN_PULSE_IR_F | PIN_AUDIO_ON);
    LATG &= (uint16)~(PIN_PULSE_IR_G | PIN_I2C);
    TRISA &= (uint16)~PIN_LED_RING_ALL;
    TRISC &= (uint16)~(PIN_FRONT_LED | PIN_BODY_LED | PIN_CAMERA_RESET);
    TRISD &= (uint16)~PIN_MOTORS;
    TRISF &= (uint16)~(PIN_PULSE_IR_F | PIN_AUDIO_ON);
    TRISG &= (uint16)~(PIN_PULSE_IR_G | PIN_I2C);
}

void board_init(void)
{
    pins_init();
    motors_init();
    uart_init(SYS_UART1);
    uart_init(SYS_UART2);
    hal_led_init();
    selector_init();
#if SYS_1PXSENSOR
    (void)Sys_Start_Camera(); /* without a camera the event is registered but never sent */
#endif
}

void board_start(void)
{
    uart_start(SYS_UART1);
    uart_start(SYS_UART2);
}

void board_tick(void)
{
    uart_tick();
    selector_tick();
}

void board_failsafe(void)
{
    motors_stop();
    LATA |= PIN_LED_RING_ALL;
}

BOUNDS_AT("while (*text", loop 40);
BOUNDS_AT("while (U1STAbits.UTXBF", loop 320); /* 1,280 Tcy are a byte */
BOUNDS_AT("while (!U1STAbits.TRMT", loop 1600); /* five bytes */
void board_report(const char *text)
{
    while (*text != '\0') {
        while (U1STAbits.UTXBF) {
        }
        U1TXREG = (uint8)*text++;
    }
    while (!U1STAbits.TRMT) {
    }
}
