/* SPDX-License-Identifier: MIT */
/* USART3 of the e-puck2, 115,200 baud 8N1: the line to outside and to the radio's CPU. */
#include "io.h"
#include "kernel.h"
#include "pins.h"
#include "stm32f407.h"

enum { BAUD = (42000000 + 115200 / 2) / 115200 };

void hal_uart_init(uint8_t uart)
{
    (void)uart;
    RCC_AHB1ENR |= 1u << GPIO_D;
    RCC_APB1ENR |= RCC_APB1ENR_USART3;
    (void)RCC_APB1ENR; /* two cycles until they answer (RM0090, RCC) */
    GPIO_AFRH(GPIO_D) = (GPIO_AFRH(GPIO_D) & ~0xFFu) | 0x77u; /* PD8, PD9: USART3 */
    pins_set_mode(GPIO_D, 3u << 8, PINS_ALTERNATE);
    USART3_BRR = BAUD;
    USART3_CR1 = USART_CR1_UE | USART_CR1_TE | USART_CR1_RE;
}

void hal_uart_start(uint8_t uart)
{
    (void)uart;
    NVIC_IPR(IRQ_USART3) = CPU_PRIORITY_DEVICE;
    USART3_CR1 |= USART_CR1_RXNEIE;
    NVIC_ISER(IRQ_USART3) = NVIC_BIT(IRQ_USART3);
}

/* Sets the interrupt pending, because QEMU's UART raises none when it is ready to send. */
void hal_uart_transmit(uint8_t uart)
{
    (void)uart;
    USART3_CR1 |= USART_CR1_TXEIE;
    NVIC_ISPR(IRQ_USART3) = NVIC_BIT(IRQ_USART3);
}

HAL_USED void USART3_Handler(void)
{
    uint32_t status = USART3_SR;
    if (status & (USART_SR_RXNE | USART_SR_ORE)) {
        uint8 byte = (uint8)USART3_DR; /* clears the errors as well */
        if (status & USART_SR_ORE) {
            uart_overrun(SYS_UART1);
        }
        if (status & USART_SR_FE) {
            uart_overrun(SYS_UART1);
        } else if (status & USART_SR_RXNE) {
            uart_received(SYS_UART1, byte);
        }
    }
    while ((USART3_CR1 & USART_CR1_TXEIE) && (USART3_SR & USART_SR_TXE)) {
        sint16 byte = uart_next_byte(SYS_UART1);
        if (byte < 0) {
            USART3_CR1 &= ~USART_CR1_TXEIE;
        } else {
            USART3_DR = (uint8)byte;
        }
    }
}
