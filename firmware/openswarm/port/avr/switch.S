/* SPDX-License-Identifier: MIT */
; Context switch, idle and entry of interrupts to the kernel stack, for avr-gcc's assembler. Interrupts do not nest.
;
; The stack of a thread that does not run, from the top: what preemption or a yield stored, then what leave_thread saved.
;     preempted  PC, r30, r31, SREG, r24, r25, r0, r1, r18-r23, r26, r27   17 bytes
;     yielded    PC                                          2 bytes
;     both       return into the above, r2-r17, r28, r29    20 bytes; sp points below
; The kernel stack is the start of os_memory; it is empty whenever a thread runs. The bit "kernel" says that SP is on it;
; both change together, with interrupts off.
#define __SFR_OFFSET 0
#include <avr/io.h>
#include "hal_limits.h"

#define OPEN 0                          /* bits of GPIOR0, hal_port.h */
#define DUE 1
#define KERNEL 2
#define OVER 3
#define FORCED 4
#define PCB_STATUS 8                    /* offsets in sys_pcb (0: sp, 2: limit) and bits, checked by cpu.c */
#define STATUS_READY 1
#define PAINT 0xA5
#define SAVED 18                        /* bytes leave_thread pushes */
#define TOP (os_memory + HAL_KERNEL_STACK - 1)

        .global TIMER0_COMPA_vect, hal_yield, hal_block, hal_abandon, hal_idle, cpu_open, os_thread_start, os_isr
        .text

; ---- Preemption: end of slice, or a device interrupt made it due -----------------------------------------------
TIMER0_COMPA_vect:
        sbi     GPIOR0, OVER
        sbis    GPIOR0, OPEN
        rjmp    later
preempt:                                ; level thread, I = 0, all registers the thread's
        cbi     GPIOR0, OPEN
        push    r30
        push    r31
        in      r30, SREG
        push    r30
        sei                             ; from here on only slices are excluded
        push    r24
        push    r25
        rcall   push_scratch
        ldi     r30, lo8(gs(os_slice_end))
        ldi     r31, hi8(gs(os_slice_end))
        rcall   leave_thread
        rcall   pop_scratch
        pop     r25
        pop     r24
        pop     r30
        out     SREG, r30               ; I = 0: level and stack change together
        pop     r31
        pop     r30
        sbi     GPIOR0, OPEN
        sbic    GPIOR0, DUE             ; an interrupt ended the new slice already
        rjmp    preempt
        reti

later:  sbi     GPIOR0, DUE             ; cpu_open() sees it
        reti

; ---- void hal_block(void): thread stack, level slice ------------------------------------------------------------
hal_block:
        ldi     r30, lo8(gs(os_schedule))
        ldi     r31, hi8(gs(os_schedule))
        rjmp    1f

take_due:
        cbi     GPIOR0, OPEN
        ldi     r30, lo8(gs(os_slice_end))
        ldi     r31, hi8(gs(os_slice_end))
        rjmp    1f

; ---- void hal_yield(void): thread stack, level thread -----------------------------------------------------------
hal_yield:
        cbi     GPIOR0, OPEN
        ldi     r30, lo8(gs(os_yield))
        ldi     r31, hi8(gs(os_yield))
1:      rcall   leave_thread

; ---- void cpu_open(void): to level thread, unless interrupts are off -------------------------------------------
cpu_open:
        sbi     GPIOR0, OPEN
        sbis    GPIOR0, DUE
        ret
        brie    take_due                ; in an interrupt, its exit takes the slice end
        ret

; ---- Saves the running thread, runs Z on the kernel stack, resumes the thread it returns; level slice ------------
; libgcc's prologue and epilogue (-mcall-prologues) push and pop r2-r17, r28 and r29. The prologue continues at Z with
; Y = SP; the epilogue frees r30 bytes above Y.
leave_thread:
        cbi     GPIOR0, FORCED          ; else a request that needs no switch would be repeated for ever
        movw    r22, r30
        ldi     r26, 0
        ldi     r27, 0
        ldi     r30, lo8(gs(saved))
        ldi     r31, hi8(gs(saved))
        jmp     __prologue_saves__
saved:  lds     r24, os_running
        lds     r25, os_running+1
        movw    r26, r24
        st      X+, r28
        st      X+, r29
        ld      r20, X+                 ; overflow: SP is below the limit, or the byte there was overwritten
        ld      r21, X
        cp      r28, r20
        cpc     r29, r21
        brlo    overflow
        movw    r26, r20
        ld      r18, X
        cpi     r18, PAINT
        brne    overflow
        movw    r30, r22
to_kernel:
        ldi     r18, lo8(TOP)
        ldi     r19, hi8(TOP)
        cli
        out     SPH, r19
        out     SPL, r18
        sbi     GPIOR0, KERNEL
        sei
        icall                           ; r25:r24 = the thread that ran
resume: movw    r30, r24                ; the thread that shall run
        ld      r28, Z
        ldd     r29, Z+1
        cli
        cbi     GPIOR0, KERNEL
        out     SPH, r29
        out     SPL, r28
        sei
        ldi     r30, SAVED
        jmp     __epilogue_restores__

; ---- void hal_abandon(hal_pick): any stack, level slice ---------------------------------------------------------
hal_abandon:
        movw    r30, r24
        rjmp    to_kernel

; The stack reached its last byte: what lies below may be damaged, so this is the end.
overflow:
        ldi     r30, lo8(gs(cpu_overflow))
        ldi     r31, hi8(gs(cpu_overflow))
        rjmp    to_kernel

; First instructions of every thread; the initial frame puts entry into r17:r16 and its argument into r15:r14.
os_thread_start:
        lds     r30, os_running
        lds     r31, os_running+1
        ldd     r24, Z+PCB_STATUS
        ori     r24, STATUS_READY
        std     Z+PCB_STATUS, r24
        rcall   cpu_open
        movw    r24, r14
        movw    r30, r16
        icall
        jmp     os_thread_returned

; ---- void hal_idle(const volatile uint16_t *pending): kernel stack, level slice -----------------------------------
hal_idle:
        movw    r30, r24
        cli
        ld      r24, Z
        tst     r24
        brne    1f
        ldi     r24, 1 << SE            ; mode idle: the timers run on
        out     SMCR, r24
        sei                             ; the next instruction still comes before any interrupt
        sleep
        out     SMCR, r1
1:      sei
        ret

; ---- What C may change, r24, r25, r30 and r31 apart: on the stack, and back. Z is the way back of both ----------------
push_scratch:
        pop     r31
        pop     r30
        push    r0
        push    r1
        clr     r1
        push    r18
        push    r19
        push    r20
        push    r21
        push    r22
        push    r23
        push    r26
        push    r27
        ijmp

pop_scratch:
        pop     r31
        pop     r30
        pop     r27
        pop     r26
        pop     r23
        pop     r22
        pop     r21
        pop     r20
        pop     r19
        pop     r18
        pop     r1
        pop     r0
        ijmp

; ---- Device interrupts: r30 and r31 are saved, Z = C function (isr.inc) -------------------------------------------
os_isr: push    r24
        in      r24, SREG
        push    r24
        push    r28
        push    r29
        in      r28, SPL
        in      r29, SPH
        sbic    GPIOR0, KERNEL
        rjmp    1f                      ; it interrupted something that is on the kernel stack
        ldi     r24, lo8(TOP)
        out     SPL, r24
        ldi     r24, hi8(TOP)
        out     SPH, r24
1:      push    r25
        movw    r24, r30
        rcall   push_scratch
        movw    r30, r24
        icall
        rcall   pop_scratch
        pop     r25
        out     SPH, r29
        out     SPL, r28
        pop     r29
        pop     r28
        pop     r24
        out     SREG, r24
        pop     r24
        pop     r31
        pop     r30
        sbis    GPIOR0, DUE
        reti
        sbis    GPIOR0, OPEN
        reti
        rjmp    preempt

#include "isr.inc"

        isr     TIMER1_COMPB_vect, cpu_clock_isr
