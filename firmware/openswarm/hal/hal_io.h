/* SPDX-License-Identifier: MIT */
/* Lower layers of the devices: contract; implemented in board/<robot>/. Their callbacks are in io/io.h. */
#ifndef HAL_IO_H
#define HAL_IO_H

#include <stdbool.h>
#include <stdint.h>

/* Motors. Average speed is exact: v mm/s are v * 1000 / 129 steps/s. 0 switches the coils off. Handler context. */
void hal_motors_init(void);
void hal_motors_drive(int16_t left_mm_s, int16_t right_mm_s);

/* UARTs, 115,200 baud 8N1. hal_uart_transmit: uart_next_byte() has bytes to send; device interrupts are locked. */
void hal_uart_init(uint8_t uart);
void hal_uart_start(uint8_t uart);
void hal_uart_transmit(uint8_t uart);

/* LEDs, numbered as in openswarm_io.h; device interrupts are locked. */
void hal_led_init(void);
void hal_led_set(uint8_t led, bool on);
bool hal_led_get(uint8_t led);

/* Selector position 0-15, not debounced. */
void hal_selector_init(void);
uint8_t hal_selector_read(void);

#endif
