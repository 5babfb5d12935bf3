/* SPDX-License-Identifier: MIT */
/* QEMU's virt machine as a robot. It has one UART; motors, LEDs and selector are variables that a debugger reads and
 * writes. */
#include "hal_board.h"
#include "io.h"
#include "kernel.h"
#include "ns16550.h"

volatile sint16 board_left, board_right; /* mm/s */
volatile uint16 board_leds;              /* bit n: LED n is on */
volatile uint8 board_selector;           /* 0-15 */

void board_init(void)
{
    motors_init();
    uart_init(SYS_UART1);
    hal_led_init();
    selector_init();
}

void board_start(void)
{
    uart_start(SYS_UART1);
}

void board_tick(void)
{
    uart_tick();
    selector_tick();
}

void board_failsafe(void)
{
    motors_stop();
    board_leds = (1u << SYS_LED_RING) - 1u;
}

void board_report(const char *text)
{
    while (*text != '\0') {
        while (!(UART_LSR & UART_LSR_THRE)) {
        }
        UART_DATA = (uint8)*text++;
    }
    while (!(UART_LSR & UART_LSR_TEMT)) {
    }
}

void hal_motors_init(void)
{
    hal_motors_drive(0, 0);
}

void hal_motors_drive(int16_t left_mm_s, int16_t right_mm_s)
{
    board_left = left_mm_s;
    board_right = right_mm_s;
}

void hal_led_init(void)
{
    board_leds = 0;
}

void hal_led_set(uint8_t led, bool on)
{
    board_leds = (uint16)(on ? board_leds | 1u << led : board_leds & ~(1u << led));
}

bool hal_led_get(uint8_t led)
{
    return board_leds >> led & 1u;
}

void hal_selector_init(void)
{
}

uint8_t hal_selector_read(void)
{
    return board_selector;
}
