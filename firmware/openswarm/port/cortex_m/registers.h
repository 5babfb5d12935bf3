/* SPDX-License-Identifier: MIT */
/* Registers of every Cortex-M4 (ARMv7-M architecture reference manual, B3). Also read by switch.S. */
#ifndef REGISTERS_H
#define REGISTERS_H

#define CPU_GUARD_REGION 0x10 /* MPU_RBAR: VALID, region 0 */
#define MPU_RBAR_ADDRESS 0xE000ED9C
#define SCB_CPACR_ADDRESS 0xE000ED88
#define SCB_CFSR_ADDRESS 0xE000ED28
#define FPU_FPCCR_ADDRESS 0xE000EF34

#ifndef __ASSEMBLER__
#include <stdbool.h>
#include <stdint.h>

#define REGISTER(address) (*(volatile uint32_t *)(address))
#define REGISTER8(address) (*(volatile uint8_t *)(address))

#define SYST_CSR REGISTER(0xE000E010)
#define SYST_RVR REGISTER(0xE000E014)
#define SYST_CVR REGISTER(0xE000E018)
#define NVIC_ISER(irq) REGISTER(0xE000E100 + (irq) / 32 * 4)
#define NVIC_ISPR(irq) REGISTER(0xE000E200 + (irq) / 32 * 4)
#define NVIC_IPR(irq) REGISTER8(0xE000E400 + (irq))
#define NVIC_BIT(irq) (1u << (irq) % 32)
#define SCB_ICSR REGISTER(0xE000ED04)
#define SCB_ICSR_PENDSVSET (1u << 28)
#define SCB_ICSR_PENDSVCLR (1u << 27)
#define SCB_CCR REGISTER(0xE000ED14)
#define SCB_CCR_DIV_0_TRP (1u << 4)
#define SCB_SHPR(exception) REGISTER8(0xE000ED14 + (exception)) /* 4-15 */
#define SCB_SHCSR REGISTER(0xE000ED24)
#define SCB_SHCSR_FAULTS (7u << 16) /* MemManage, BusFault and UsageFault have their own handlers */
#define SCB_CFSR REGISTER(SCB_CFSR_ADDRESS)
#define SCB_CFSR_DIVBYZERO (1u << 25)
#define SCB_CFSR_MEMMANAGE 0xFFu
#define MPU_CTRL REGISTER(0xE000ED94)
#define MPU_CTRL_ON 5u /* enabled, default map for privileged code */
#define MPU_RBAR REGISTER(MPU_RBAR_ADDRESS)
#define MPU_RASR REGISTER(0xE000EDA0)
#define MPU_RASR_32_BYTES_READ_ONLY (5u << 24 | 1u << 28 | 4u << 1 | 1u) /* 2^5 bytes, never executed, enabled */
#endif

#endif
