/* SPDX-License-Identifier: MIT */
/* The registers of the STM32F407 that the board uses (ST, RM0090). */
#ifndef STM32F407_H
#define STM32F407_H

#include "registers.h"

#define RCC_CR REGISTER(0x40023800)
#define RCC_CR_HSEON (1u << 16)
#define RCC_CR_HSERDY (1u << 17)
#define RCC_CR_PLLON (1u << 24)
#define RCC_CR_PLLRDY (1u << 25)
#define RCC_PLLCFGR REGISTER(0x40023804)
#define RCC_PLLCFGR_HSE (1u << 22)
#define RCC_CFGR REGISTER(0x40023808)
#define RCC_CFGR_APB1_BY_4 (5u << 10)
#define RCC_CFGR_APB2_BY_2 (4u << 13)
#define RCC_CFGR_PLL 2u
#define RCC_AHB1ENR REGISTER(0x40023830)
#define RCC_APB1ENR REGISTER(0x40023840)
#define RCC_APB1ENR_TIM4 (1u << 2)
#define RCC_APB1ENR_USART3 (1u << 18)
#define FLASH_ACR REGISTER(0x40023C00)
#define FLASH_ACR_5_WAITS_AND_CACHES (7u << 8 | 5u)

enum { GPIO_B = 1, GPIO_C, GPIO_D, GPIO_E };
#define GPIO(port, offset) REGISTER(0x40020000 + 0x400 * (port) + (offset))
#define GPIO_MODER(port) GPIO(port, 0x00)
#define GPIO_PUPDR(port) GPIO(port, 0x0C)
#define GPIO_IDR(port) GPIO(port, 0x10)
#define GPIO_ODR(port) GPIO(port, 0x14)
#define GPIO_BSRR(port) GPIO(port, 0x18) /* low half sets, high half clears */
#define GPIO_AFRH(port) GPIO(port, 0x24)

#define USART3_SR REGISTER(0x40004800)
#define USART_SR_FE (1u << 1)
#define USART_SR_ORE (1u << 3)
#define USART_SR_RXNE (1u << 5)
#define USART_SR_TC (1u << 6)
#define USART_SR_TXE (1u << 7)
#define USART3_DR REGISTER(0x40004804)
#define USART3_BRR REGISTER(0x40004808)
#define USART3_CR1 REGISTER(0x4000480C)
#define USART_CR1_RE (1u << 2)
#define USART_CR1_TE (1u << 3)
#define USART_CR1_RXNEIE (1u << 5)
#define USART_CR1_TXEIE (1u << 7)
#define USART_CR1_UE (1u << 13)

#define TIM4_CR1 REGISTER(0x40000800)
#define TIM4_DIER REGISTER(0x4000080C)
#define TIM4_SR REGISTER(0x40000810)
#define TIM4_CNT REGISTER(0x40000824)
#define TIM4_PSC REGISTER(0x40000828)
#define TIM4_ARR REGISTER(0x4000082C)

enum { IRQ_TIM4 = 30, IRQ_USART3 = 39, IRQS = 82 };

#endif
