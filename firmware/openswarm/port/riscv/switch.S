/* SPDX-License-Identifier: MIT */
# Context switch, entry of interrupts to the kernel stack, exceptions and reset of a RV32IMAC in machine mode.
#
# A thread that does not run has on its stack, from the top:
#     preempted  ra, t0-t6, a0-a7                                       64 bytes
#     always     s0-s11, address of the resuming code, its argument in t0   64 bytes; sp points at s0
# A stack pointer is always a multiple of 16. The kernel stack is the start of os_memory; it is empty whenever a thread
# runs. It lies below all other stacks. gp and tp never change.
#include "openswarm_config.h"
#include "registers.h"

        .equ    PCB_LIMIT, 4            # offset in sys_pcb (0: sp), checked by cpu.c
        .equ    PAINT, 0xA5A5A5A5
        .equ    TOP, os_memory + HAL_KERNEL_STACK

        .global cpu_reset, cpu_start_thread, hal_yield, hal_block, hal_abandon
        .text

        .macro  each_scratch operation
        \operation ra, 0(sp)
        \operation t0, 4(sp)
        \operation t1, 8(sp)
        \operation t2, 12(sp)
        \operation t3, 16(sp)
        \operation t4, 20(sp)
        \operation t5, 24(sp)
        \operation t6, 28(sp)
        \operation a0, 32(sp)
        \operation a1, 36(sp)
        \operation a2, 40(sp)
        \operation a3, 44(sp)
        \operation a4, 48(sp)
        \operation a5, 52(sp)
        \operation a6, 56(sp)
        \operation a7, 60(sp)
        .endm

# End of an interrupt. It cancels the reservation of an interrupted LR, which stores of the same hart may not cancel. If
# this SC succeeds, it stores the value that memory holds already.
        .macro  return_from_interrupt
        each_scratch lw
        sc.w    zero, ra, (sp)
        addi    sp, sp, 64
        mret
        .endm

        .macro  each_saved operation
        \operation s0, 0(sp)
        \operation s1, 4(sp)
        \operation s2, 8(sp)
        \operation s3, 12(sp)
        \operation s4, 16(sp)
        \operation s5, 20(sp)
        \operation s6, 24(sp)
        \operation s7, 28(sp)
        \operation s8, 32(sp)
        \operation s9, 36(sp)
        \operation s10, 40(sp)
        \operation s11, 44(sp)
        \operation t1, 48(sp)           # where the thread resumes
        \operation t0, 52(sp)
        .endm

        .macro  code name
        .type   \name, @function
\name:
        .endm

        .macro  end name
        .size   \name, . - \name
        .endm

# ---- Preemption: end of slice, or hal_slice_force(); level thread, MIE = 0 --------------------------------------------
        code    slice_interrupt
        addi    sp, sp, -64
        each_scratch sw
        li      t0, CLINT_MSIP
        sw      zero, 0(t0)
        la      t0, cpu_forced
        sb      zero, 0(t0)
        csrci   mie, MIE_MSIE
        csrr    t0, mepc
        la      t1, resume_preempted
        la      t2, os_slice_end
        j       leave_thread
        end     slice_interrupt

        code    resume_preempted        # MIE = 0
        csrw    mepc, t0
        li      t0, MSTATUS_RESUME
        csrs    mstatus, t0
        csrsi   mie, MIE_MSIE
        return_from_interrupt
        end     resume_preempted

# ---- void hal_block(void): thread stack, level slice ------------------------------------------------------------------
        code    hal_block
        la      t2, os_schedule
        j       1f
        end     hal_block

# ---- void hal_yield(void): thread stack, level thread -----------------------------------------------------------------
        code    hal_yield
        csrci   mie, MIE_MSIE           # an interrupt that came before finds nothing half-done
        la      t2, os_yield
1:      mv      t0, ra
        la      t1, resume_yielded
        end     hal_yield

# ---- Saves the running thread, runs t2 on the kernel stack, resumes the thread it returns; level slice ---------------
        code    leave_thread
        addi    sp, sp, -64
        each_saved sw
        la      t0, os_running
        lw      a0, 0(t0)
        sw      sp, 0(a0)
        lw      t1, PCB_LIMIT(a0)
        bltu    sp, t1, overflow        # below the stack now, or was its last word written before?
check_paint:
        lw      t0, 0(t1)
        li      t1, PAINT
        bne     t0, t1, overflow
to_kernel:
        la      t0, TOP                 # not into sp, which two instructions would change
        mv      sp, t0
        csrsi   mstatus, MSTATUS_MIE
        jalr    t2                      # a0 = the thread that ran
        csrci   mstatus, MSTATUS_MIE
        lw      sp, 0(a0)               # the thread that shall run
        each_saved lw
        addi    sp, sp, 64
        jr      t1
        end     leave_thread

        code    resume_yielded          # MIE = 0
        csrsi   mie, MIE_MSIE
        csrsi   mstatus, MSTATUS_MIE
        jr      t0
        end     resume_yielded

# ---- void hal_abandon(hal_pick): any stack, level slice ---------------------------------------------------------------
        code    hal_abandon
        mv      t2, a0
        la      t0, os_running
        lw      a0, 0(t0)
        lw      t1, PCB_LIMIT(a0)
        j       check_paint             # a thread that ends without a switch may have overflowed its stack, too
        end     hal_abandon

# What lies below the stack may be damaged, so this is the end.
        code    overflow
        la      t2, cpu_overflow
        j       to_kernel
        end     overflow

# First instructions of every thread: s0 = entry, s1 = its argument, t0 = thread_main; MIE = 0.
        code    cpu_start_thread
        csrsi   mstatus, MSTATUS_MIE
        mv      a0, s0
        mv      a1, s1
        jr      t0
        end     cpu_start_thread

# ---- Interrupts of devices and clock: they do not nest, so mepc and mstatus stay ---------------------------------------
        code    clock_interrupt
        addi    sp, sp, -64
        each_scratch sw
        la      t2, cpu_clock_isr
        j       1f
        end     clock_interrupt

        code    external_interrupt
        addi    sp, sp, -64
        each_scratch sw
        la      t2, board_interrupt
1:      mv      t0, sp
        la      t1, TOP
        bgeu    t1, sp, 2f              # it interrupted something that is on the kernel stack
        mv      sp, t1
2:      addi    sp, sp, -16
        sw      t0, 0(sp)
        jalr    t2
        lw      sp, 0(sp)
        return_from_interrupt
        end     external_interrupt

# ---- Vectors, indexed by the number of an interrupt; 0 is every exception ----------------------------------------------
        .balign 64
vectors:
        .option push
        .option norvc
        j       exception
        j       exception
        j       exception
        j       slice_interrupt
        j       exception
        j       exception
        j       exception
        j       clock_interrupt
        j       exception
        j       exception
        j       exception
        j       external_interrupt
        .option pop

        code    exception
        la      sp, TOP
        csrr    a0, mcause
        csrr    a1, mepc
        j       cpu_fault
        end     exception

# ---- Reset: main runs on a stack of its own ----------------------------------------------------------------------------
        .section .reset, "ax"
        code    cpu_reset
        .option push
        .option norelax
        la      gp, __global_pointer$
        .option pop
        la      tp, thread_locals       # those of the C library, one for all threads
        la      sp, main_stack_top
        la      t0, vectors + MTVEC_VECTORED
        csrw    mtvec, t0
        csrw    mie, zero
        la      t0, bss_begin
        la      t1, bss_end
1:      bgeu    t0, t1, 2f
        sw      zero, 0(t0)
        addi    t0, t0, 4
        j       1b
2:      call    main
        j       hal_stop
        end     cpu_reset
