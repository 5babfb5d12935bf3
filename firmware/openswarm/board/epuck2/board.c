/* SPDX-License-Identifier: MIT */
/* The e-puck2: pins, and the list of its devices. */
#include "hal_board.h"
#include "io.h"
#include "kernel.h"
#include "pins.h"
#include "stm32f407.h"

/* Everything off before it becomes an output. */
static void pins_init(void)
{
    RCC_AHB1ENR |= 1u << GPIO_B | 1u << GPIO_C | 1u << GPIO_D | 1u << GPIO_E;
    (void)RCC_AHB1ENR; /* two cycles until the ports answer (RM0090, RCC) */
    GPIO_BSRR(GPIO_B) = PIN_BODY_LED_B << 16;
    GPIO_BSRR(GPIO_D) = PIN_LED_RING_D | PIN_FRONT_LED_D << 16;
    GPIO_BSRR(GPIO_E) = PIN_MOTORS_E << 16;
    pins_set_mode(GPIO_B, PIN_BODY_LED_B, PINS_OUTPUT);
    pins_set_mode(GPIO_D, PIN_LED_RING_D | PIN_FRONT_LED_D, PINS_OUTPUT);
    pins_set_mode(GPIO_E, PIN_MOTORS_E, PINS_OUTPUT);
}

void board_init(void)
{
    pins_init();
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
    GPIO_BSRR(GPIO_D) = PIN_LED_RING_D << 16; /* low: on */
}

void board_report(const char *text)
{
    while (*text != '\0') {
        while (!(USART3_SR & USART_SR_TXE)) {
        }
        USART3_DR = (uint8)*text++;
    }
    while (!(USART3_SR & USART_SR_TC)) {
    }
}
