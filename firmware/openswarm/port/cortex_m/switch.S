/* SPDX-License-Identifier: MIT */
@ Context switch and reset of a Cortex-M4F.
@
@ A thread that does not run has on its process stack, from the top: the hardware's frame (32 bytes, 104 if the thread has
@ used the FPU), s16-s31 in that case (64), r4-r11 and EXC_RETURN (36); sp points below. The main stack is the kernel stack,
@ the start of os_memory; it is empty whenever a thread runs.
#include "openswarm_config.h"
#include "registers.h"

        .syntax unified
        .cpu    cortex-m4
        .fpu    fpv4-sp-d16
        .thumb
        .text

        .equ    PCB_LIMIT, 4            @ offset in sys_pcb (0: sp), checked by cpu.c

@ ---- Level slice: the end of a slice, a yield, or cpu_pick() for a thread that blocks or ends ------------------------
        .global PendSV_Handler
        .thumb_func
PendSV_Handler:
        ldr     r1, =os_running
        mrs     r0, psp
        ldr     r2, [r1]
        ldr     r1, [r2, #PCB_LIMIT]
        sub     r3, r0, #36 + 32        @ what is saved here must stay above the guard
        tst     lr, #0x10               @ 0: the thread has used the FPU
        it      eq
        subeq   r3, r3, #64
        cmp     r3, r1
        blo     overflow
        tst     lr, #0x10
        it      eq
        vstmdbeq r0!, {s16-s31}         @ makes the hardware store s0-s15 as well
        stmdb   r0!, {r4-r11, lr}
        str     r0, [r2]                @ sp
        ldr     r3, =cpu_pick
        ldr     r1, [r3]
        cbnz    r1, picked
        ldr     r3, =cpu_forced         @ else a request that needs no switch would be repeated for ever
        strb    r1, [r3]
        mov     r0, r2
        bl      os_slice_end
resume: movs    r1, #0
        msr     basepri, r1             @ a section that a handler left open ends here
        ldr     r1, [r0, #PCB_LIMIT]
        ldr     r2, =MPU_RBAR_ADDRESS
        str     r1, [r2]
        ldr     r0, [r0]
        ldmia   r0!, {r4-r11, lr}
        tst     lr, #0x10
        it      eq
        vldmiaeq r0!, {s16-s31}
        msr     psp, r0
        bx      lr

picked: movs    r0, #0
        str     r0, [r3]
        blx     r1
        b       resume

overflow:
#if SYS_ON_OVERFLOW == SYS_STOP_SYSTEM
        cpsid   i
        movs    r0, #4                  @ OS_STACK
        movs    r1, #0
        movs    r2, #0
        b       os_trap
#else
        @ the thread ends, so its registers are not saved
        ldr     r3, =cpu_pick
        movs    r0, #0
        str     r0, [r3]
        ldr     r3, =FPU_FPCCR_ADDRESS  @ prevents the hardware from storing s0-s15 on its stack
        ldr     r0, [r3]
        bic     r0, r0, #1
        str     r0, [r3]
        bl      os_overflow
        b       resume
#endif

@ ---- Reset: main runs on the process stack, the hardware has set the main stack ------------------------------------
        .global Reset_Handler
        .thumb_func
Reset_Handler:
        ldr     r0, =main_stack_top
        msr     psp, r0
        movs    r0, #2
        msr     control, r0
        isb
        ldr     r0, =SCB_CPACR_ADDRESS
        ldr     r1, [r0]
        orr     r1, r1, #0xF << 20
        str     r1, [r0]
        dsb
        isb
        ldr     r0, =data_begin
        ldr     r1, =data_end
        ldr     r2, =data_load
1:      cmp     r0, r1
        itt     lo
        ldrlo   r3, [r2], #4
        strlo   r3, [r0], #4
        blo     1b
        ldr     r0, =bss_begin
        ldr     r1, =bss_end
        movs    r2, #0
2:      cmp     r0, r1
        it      lo
        strlo   r2, [r0], #4
        blo     2b
        ldr     r0, =os_system          @ reports of faults before Sys_Init_Kernel() read it, too
        ldr     r1, =os_running
        str     r0, [r1]
        bl      board_clock
        bl      main
        b       hal_stop

@ ---- Faults: the frame's place and what it belongs to decide, in C -----------------------------------------------------
        .global MemManage_Handler, HardFault_Handler, BusFault_Handler, UsageFault_Handler, Default_Handler
        .thumb_func
MemManage_Handler:
        tst     lr, #8                  @ from a thread,
        beq     HardFault_Handler
        ldr     r0, =SCB_CFSR_ADDRESS
        ldr     r0, [r0]
        tst     r0, #0x12               @ a store or the storing of registers: its stack limit
        bne     cpu_guard_hit
        .thumb_func
HardFault_Handler:
        .thumb_func
BusFault_Handler:
        .thumb_func
UsageFault_Handler:
        .thumb_func
Default_Handler:
        tst     lr, #4
        ite     eq
        mrseq   r0, msp
        mrsne   r0, psp
        ldr     r1, =os_memory + HAL_KERNEL_STACK
        mov     sp, r1
        b       cpu_fault
