; SPDX-License-Identifier: MIT
; dsp.h: PID controller. tPID is {fractional *abcCoefficients, *controlHistory, controlOutput, measuredOutput,
; controlReference}: output += a * e[0] + b * e[1] + c * e[2], e[0] = reference - measured. All results saturate.

        .include "dsp.inc"

; fractional *PID(tPID *controller)
        .section .text._PID,code
        .global _PID
_PID:
        fractional w1
        mov     [w0+8],w1
        lac     w1,A
        mov     [w0+6],w1
        lac     w1,B
        sub     A
        sac     A,w5                    ; e[0]
        mov     [w0++],w1               ; coefficients
        mov     [w0++],w2               ; history
        mov     [w2],w6
        mov     [w2+2],w7
        lac     [w0],A
        mov     [w1++],w4
        mac     w4*w5,A
        mov     [w1++],w4
        mac     w4*w6,A
        mov     [w1++],w4
        mac     w4*w7,A
        sac.r   A,[w0]
        mov     w5,[w2++]
        mov     w6,[w2++]
        mov     w7,[w2]
        sub     w0,#4,w0
        pop     _CORCON
        return

; void PIDInit(tPID *controller)
        .section .text._PIDInit,code
        .global _PIDInit
_PIDInit:
        mov     [w0+2],w1
        clr     [w1++]
        clr     [w1++]
        clr     [w1]
        add     w0,#4,w1
        clr     [w1]
        return

; void PIDCoeffCalc(fractional *gains {Kp, Ki, Kd}, tPID *controller): a = Kp + Ki + Kd, b = -(Kp + 2 Kd), c = Kd
        .section .text._PIDCoeffCalc,code
        .global _PIDCoeffCalc
_PIDCoeffCalc:
        fractional w2
        mov     [w1],w1
        mov     [w0++],w2               ; Kp
        lac     w2,A
        add     [w0++],A
        mov     [w0],w3                 ; Kd
        add     w3,A
        sac     A,[w1++]
        lac     w2,A
        add     w3,A
        add     w3,A
        neg     A
        sac     A,[w1++]
        mov     w3,[w1]
        pop     _CORCON
        return
