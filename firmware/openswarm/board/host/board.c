/* SPDX-License-Identifier: MIT */
/* The e-puck's devices on a host: UART1 is standard output; motors and LEDs store their last commands (board.h).
 * Works with every port that runs on a host. */
#include "board.h"

#include "hal_board.h"
#include "io.h"
#include "kernel.h"

#include <string.h>
#include <unistd.h>

static int16_t left, right;
static uint16 leds;
static uint8 selector;
static void (*uart_sink)(uint8 uart, uint8 byte);

void board_init(void)
{
    motors_init();
    uart_init(SYS_UART1);
    uart_init(SYS_UART2);
    hal_led_init();
    selector_init();
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
    leds = (1u << SYS_LED_RING) - 1u;
}

void board_report(const char *text)
{
    ssize_t written = write(STDOUT_FILENO, text, strlen(text));
    (void)written;
}

void hal_motors_init(void)
{
    hal_motors_drive(0, 0);
}

void hal_motors_drive(int16_t left_mm_s, int16_t right_mm_s)
{
    left = left_mm_s;
    right = right_mm_s;
}

void hal_uart_init(uint8_t uart)
{
    (void)uart;
}

void hal_uart_start(uint8_t uart)
{
    (void)uart;
}

/* The host's line is infinitely fast: every byte leaves at once, unless a test holds the line. */
static bool line_held;

static void drain(uint8 uart)
{
    sint16 byte;
    while (!line_held && (byte = uart_next_byte(uart)) >= 0) {
        uint8 b = (uint8)byte;
        if (uart_sink != NULL) {
            uart_sink(uart, b);
        } else if (uart == SYS_UART1) {
            ssize_t written = write(STDOUT_FILENO, &b, 1);
            (void)written;
        }
    }
}

void hal_uart_transmit(uint8_t uart)
{
    drain(uart);
}

void host_hold_line(bool hold)
{
    line_held = hold;
    if (!hold) {
        hal_lock_state lock = hal_lock_devices();
        drain(SYS_UART1);
        drain(SYS_UART2);
        hal_unlock(lock);
    }
}

void host_receive(uint8 uart, uint8 byte)
{
    hal_lock_state lock = hal_lock_devices();
    uart_received(uart, byte);
    hal_unlock(lock);
}

void host_uart_sink(void (*sink)(uint8 uart, uint8 byte))
{
    uart_sink = sink;
}

void hal_led_init(void)
{
    leds = 0;
}

void hal_led_set(uint8_t led, bool on)
{
    leds = (uint16)(on ? leds | 1u << led : leds & ~(1u << led));
}

bool hal_led_get(uint8_t led)
{
    return leds >> led & 1u;
}

void hal_selector_init(void)
{
}

uint8_t hal_selector_read(void)
{
    return selector;
}

void host_set_selector(uint8 position)
{
    selector = position;
}

int16_t host_left(void)
{
    return left;
}

int16_t host_right(void)
{
    return right;
}
