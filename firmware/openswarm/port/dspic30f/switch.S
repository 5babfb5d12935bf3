/* SPDX-License-Identifier: MIT */
; Context switch, entry of interrupts to the kernel stack, and traps, for pic30-as.
;
; Two kinds of frame lie on the stack of a thread that does not run, each under the address of the code that resumes it:
;     preempted  PC, SRL (by hardware), W0-W14, RCOUNT, TBLPAG, PSVPAG, tag                   42 bytes
;     yielded    return address, W8-W14, tag                                                  20 bytes
; A SYS_DSP thread has accumulators, CORCON and its DO levels, under a tag of their own, on top of either.
; The kernel stack is the start of os_memory; it is empty whenever a thread runs. It lies below all thread stacks, so a
; thread's SPLIM, which stays set, never trips there.
#include "openswarm_config.h"

        .equ    PCB_LIMIT, 2            ; offsets in sys_pcb (0: sp) and bits of its status, checked by cpu.c
        .equ    PCB_STATUS, 8
        .equ    STATUS_READY, 0
        .equ    STATUS_DSP, 4
        .equ    STKERR, 2               ; bits of INTCON1, CORCON and IEC0 (dspic30f6014a.md §5, isa.md §2.4)
        .equ    IPL3, 3
        .equ    T2IE, 6
        .equ    C2IF, 6
        .equ    ACCUMULATORS, 6         ; words of both, one behind the other
        .equ    LOOP, 5                 ; words of a DO loop, DCOUNT to DOENDH, the same

        .global __T2Interrupt, __C2Interrupt, _hal_yield, _hal_block, _hal_abandon, _os_resume_yielded, _os_thread_start
        .global _hal_idle, __StackError, os_isr_exit
        .text

; The running thread's frame is complete: store its stack pointer and move to the kernel stack. W0 = the thread.
        .macro  leave_thread resume
        mov     _os_running, w0
        mov     #handle(\resume), w2
        mov     [w0+PCB_STATUS], w3
        btsc    w3, #STATUS_DSP
        rcall   save_dsp
        push    w2
        mov     w15, [w0]               ; sp
        mov     #_os_memory, w15
        .endm

; ---- Preemption: 10 ms timer, or hal_slice_force(); IPL 1 ------------------------------------------------------------
__C2Interrupt:
        bclr    IFS2, #C2IF
__T2Interrupt:
        bset    SR, #7                  ; IPL 5: only the camera may still stack on this thread
        push.d  w0
        push.d  w2
        push.d  w4
        push.d  w6
        push.d  w8
        push.d  w10
        push.d  w12
        push    w14
        push    RCOUNT
        push    TBLPAG
        push    PSVPAG
        leave_thread resume_preempted
        bclr    SR, #7                  ; IPL 1, on the kernel stack
        rcall   _os_slice_end
        bra     resume

resume_preempted:
        pop     PSVPAG
        pop     TBLPAG
        pop     RCOUNT
        pop     w14
        pop.d   w12
        pop.d   w10
        pop.d   w8
        pop.d   w6
        pop.d   w4
        pop.d   w2
        pop.d   w0
        retfie

; ---- void hal_abandon(hal_pick): any stack, IPL 1 ------------------------------------------------------------------
_hal_abandon:
        mov     #_os_memory, w15
        call    w0
        bra     resume

; ---- void hal_block(void): thread stack, IPL 1 ---------------------------------------------------------------------
_hal_block:
        mov     #handle(_os_schedule), w1
        bra     1f

; ---- void hal_yield(void): thread stack, IPL 0 ---------------------------------------------------------------------
_hal_yield:
        bset    SR, #5                  ; IPL 1; an interrupt before it takes effect finds a consistent state
        mov     #handle(_os_yield), w1
1:      push.d  w8
        push.d  w10
        push.d  w12
        push    w14
        leave_thread _os_resume_yielded
        call    w1

; ---- W0 = thread to resume; kernel stack, IPL 1 ------------------------------------------------------------------
resume:
        bset    SR, #7                  ; IPL 5
        mov     [w0+PCB_LIMIT], w1      ; harmless if one more interrupt slips in
        mov     w1, SPLIM               ; above the kernel stack, where W15 still is
        mov     [w0], w15
        pop     w1
        goto    w1

_os_resume_yielded:
        pop     w14
        pop.d   w12
        pop.d   w10
        pop.d   w8
        retfie                          ; the high word of a return address holds SRL = 0: back to IPL 0

; First instructions of every thread; the initial frame puts entry into W8 and its argument into W9.
_os_thread_start:
        mov     _os_running, w1
        mov     [w1+PCB_STATUS], w0
        bset    w0, #STATUS_READY
        mov     w0, [w1+PCB_STATUS]
        mov     w9, w0
        call    w8
        bra     _os_thread_returned

; ---- DSP state, W2 = tag of the frame below, W0 and W1 kept; IPL >= 1 -----------------------------------------------
; CORCON.DL cannot be written and the outer level of two nested DO loops is not mapped. So each level is left by running
; off the end of a two-instruction loop with DCOUNT = 0, and entered again by DO; the registers that appear in between
; belong to that level. DOSTART is taken as writable (UNVERIFIED on silicon). Lost: OA OB SA SB and the PUSH.S shadow.
save_dsp:
        pop.d   w4                      ; return address
        push    w2
        mov     #ACCAL, w6
        repeat  #ACCUMULATORS-1
        mov     [w6++], [w15++]
        push    CORCON
        clr     w6                      ; levels
        mov     #0x0700, w7             ; CORCON.DL
1:      mov     CORCON, w3
        and     w3, w7, w3
        bra     z, 2f
        mov     #DCOUNT, w3
        repeat  #LOOP-1
        mov     [w3++], [w15++]
        clr     DCOUNT
        mov     #tbloffset(leave_loop), w3
        mov     w3, DOENDL
        mov     #tblpage(leave_loop), w3
        mov     w3, DOENDH
        inc     w6, w6
        nop
        nop
leave_loop:
        nop                             ; DL - 1; the next outer level, if any, is back in the registers
        bra     1b
2:      push    w6
        mov     #handle(resume_dsp), w2
        push.d  w4
        return

resume_dsp:
        pop     w6
1:      cp0     w6
        bra     z, 3f
        do      #0, 2f                  ; DL + 1
        mov     #DCOUNT+2*LOOP, w3
        repeat  #LOOP-1
        mov     [--w15], [--w3]
        dec     w6, w6
2:      nop
        bra     1b
3:      pop     CORCON
        mov     #ACCAL+2*ACCUMULATORS, w6
        repeat  #ACCUMULATORS-1
        mov     [--w15], [--w6]
        pop     w1
        goto    w1

; ---- void hal_idle(const volatile uint16_t *pending): kernel stack, IPL 1 -------------------------------------------
; At IPL 5 an interrupt that may send ends PWRSAV without being taken, so none slips in between the test and the sleep.
; The camera's, at IPL 6, is never late for that; what it sets for IPL 4 ends PWRSAV too.
_hal_idle:
        bclr    IEC0, #T2IE             ; no slice while nothing runs
        bset    SR, #7
        nop
        cp0.b   [w0]
        bra     nz, 1f
        pwrsav  #1
1:      bclr    SR, #7
        bset    IEC0, #T2IE
        return

; ---- Device interrupts ---------------------------------------------------------------------------------------------
#include "isr.inc"

        isr     __T1Interrupt, _cpu_clock_isr
os_isr_exit:
        pop.d   w6
        pop.d   w4
        pop.d   w2
        pop     RCOUNT
        pop     SPLIM                   ; above the kernel stack, where W15 still is
        pop     w0
        mov     w0, w15                 ; back to the interrupted stack
        pop.d   w0
        retfie

; ---- Traps --------------------------------------------------------------------------------------------------------
; Stack limit. A soft trap: the write has happened, within the thread's own block. With SYS_DROP_THREAD the thread is
; given up, and with it an ISR entry that had not yet left its stack; that interrupt's flag is still set. An overflow of
; the kernel stack stops the system.
__StackError:
#if SYS_ON_OVERFLOW == SYS_DROP_THREAD
        mov     SPLIM, w0
        setm    SPLIM
        mov     #_os_memory+HAL_KERNEL_STACK_LIMIT, w1
        cpsne   w0, w1                  ; whose limit it was
        bra     kernel_stack_error
        bclr    INTCON1, #STKERR
        mov     #_os_memory, w15
        bclr    CORCON, #IPL3
        bset    SR, #5                  ; IPL 4 (level 12) -> 5 -> 1
        bclr    SR, #7
        rcall   _os_overflow
        bra     resume
kernel_stack_error:
#endif
        mov     #4, w0
        bra     fatal

        .macro  trap vector, number
        .global \vector
\vector:
        mov     #\number, w0
        bra     fatal
        .endm

        trap    __OscillatorFail, 0     ; numbers: fault.c
        trap    __AddressError, 1
        trap    __MathError, 2
        trap    __DefaultInterrupt, 3
fatal:
        setm    SPLIM
        mov     [w15-4], w1             ; stacked PC
        mov     [w15-2], w2
        and     #0x7F, w2
        mov     #_os_memory, w15
        bra     _os_trap
