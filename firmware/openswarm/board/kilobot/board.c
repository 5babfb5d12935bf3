/* SPDX-License-Identifier: MIT */
/* The Kilobot: pins and the list of its devices. Pins and channels are those of kilolib (README.md). */
#include "hal_board.h"
#include "io.h"
#include "kernel.h"
#include "pins.h"

#include <avr/io.h>

void board_init(void)
{
    ACSR = 1 << ACD; /* the comparator that detects infrared pulses is off until the link's driver enables it */
    hal_led_init();
    motors_init();
    uart_init(SYS_UART1);
}

void board_start(void)
{
    uart_start(SYS_UART1);
}

void board_tick(void)
{
    uart_tick();
    kilobot_motors_tick();
}

void board_failsafe(void)
{
    motors_stop();
    DDRC &= (uint8)~(PIN_GREEN_C | PIN_BLUE_C);
    DDRD |= PIN_RED_D;
}

void board_report(const char *text)
{
    UCSR0B |= 1 << TXEN0; /* also before board_init() */
    while (*text != '\0') {
        while (!(UCSR0A & 1 << UDRE0)) {
        }
        UCSR0A |= 1 << TXC0;
        UDR0 = (uint8)*text++;
    }
    while (!(UCSR0A & 1 << TXC0)) {
    }
}
