/* SPDX-License-Identifier: MIT */
/* dsPIC30F: implementation of openswarm_interrupt.h. */
#ifndef HAL_INTERRUPT_H
#define HAL_INTERRUPT_H

#include "hal_port.h"

/* The only vector whose name differs from that of its bits. */
#define _ADCIF _ADIF
#define _ADCIE _ADIE
#define _ADCIP _ADIP

#define HAL_INTERRUPT_CLEAR(vector) (_##vector##IF = 0)
#define HAL_INTERRUPT_RAISE(vector) (_##vector##IF = 1)
#define HAL_INTERRUPT_DISABLE(vector) (_##vector##IE = 0, hal_barrier())
#define HAL_INTERRUPT_ENABLE(vector, level) (_##vector##IP = (level), _##vector##IF = 0, _##vector##IE = 1)

/* Defines a symbol from which the linker reads the level. */
#define HAL_INTERRUPT_ENTRY(vector, level, function)                                                                  \
    __asm__(".equ HAL_KERNEL_STACK, " HAL_TEXT(HAL_KERNEL_STACK) "\n\t.equ HAL_KERNEL_STACK_LIMIT, "                    \
            HAL_TEXT(HAL_KERNEL_STACK_LIMIT) "\n\t.include \"isr.inc\"\n\t.text\n\tisr __" #vector "Interrupt, _" #function \
            "\n\t.global os_level_of_" #vector "\n\t.equ os_level_of_" #vector ", " #level);

#endif
