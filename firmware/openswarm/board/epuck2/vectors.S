/* SPDX-License-Identifier: MIT */
@ Vector table of the STM32F407: the kernel's exceptions, then the interrupts the board uses. Another interrupt gets an
@ entry by a line "entry NUMBER, handler", in increasing order.
#include "hal_limits.h"
        .syntax unified
        .text
        .thumb
        .thumb_func
not_linked:
        b       Default_Handler

        .section .vectors, "a", %progbits

        .equ    place, 0
        .macro  entry number, handler
        .weak   \handler                @ of a device that is not linked: a trap
        .thumb_set \handler, not_linked
        .rept   \number - place
        .word   Default_Handler
        .endr
        .word   \handler
        .equ    place, \number + 1
        .endm

        .word   os_memory + HAL_KERNEL_STACK
        .word   Reset_Handler
        .word   Default_Handler
        .word   HardFault_Handler
        .word   MemManage_Handler
        .word   BusFault_Handler
        .word   UsageFault_Handler
        .rept   7
        .word   Default_Handler
        .endr
        .word   PendSV_Handler
        .word   SysTick_Handler
        entry   30, TIM4_Handler
        entry   39, USART3_Handler
        .rept   82 - place
        .word   Default_Handler
        .endr
