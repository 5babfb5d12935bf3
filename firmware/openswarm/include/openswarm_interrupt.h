/* SPDX-License-Identifier: MIT */
/* Application interrupts: a C function as interrupt service routine at a chosen level, without assembly.
 *
 *     static void on_button(void) { Sys_Send_IntEvent(PRESSED, 1); }
 *     SYS_INTERRUPT(INT1, 4, on_button)             at file scope; vectors are named as in the CPU's data sheet
 *     ...
 *         Sys_Enable_Interrupt(INT1);                   in main after Sys_Init_Kernel, or later
 *
 * The function runs on the kernel stack; its flag is cleared first.
 *   Level 4        may make the calls marked I in openswarm.h. It waits for other ISRs and for short locks of the kernel.
 *   Levels 5 and 6 must not call the kernel or a device. They raise an otherwise unused interrupt of level 4
 *                  (Sys_Raise_Interrupt) that does the rest. The kernel does not delay them, except that 5 waits for
 *                  the frame of a thread switch. Each needs 4 bytes of the interrupted thread's stack beyond
 *                  HAL_MINIMUM_STACK. Level 6 belongs to the camera's capture where that is linked.
 *
 * Checks: the compiler refuses levels and vectors that do not exist. The linker refuses a vector that already has a
 * function (of the kernel, a driver or another application interrupt). It also refuses calls that levels 5 and 6 must
 * not make, directly, through other functions, or through pointers (CALL_TARGETS states the targets of a pointer).
 */
#ifndef OPENSWARM_INTERRUPT_H
#define OPENSWARM_INTERRUPT_H

#include "openswarm.h"

#include "hal_compiler.h"
#include "hal_interrupt.h" /* from the port */

#ifdef __cplusplus
extern "C" {
#endif

#define SYS_INTERRUPT(vector, level, function)                                                                        \
    HAL_ASSUME(sys_level_of_##vector##_is_4_5_or_6, (level) >= 4 && (level) <= 6);                                      \
    HAL_USED void sys_isr_##vector(void);                                                                             \
    HAL_USED void sys_isr_##vector(void)                                                                              \
    {                                                                                                                 \
        HAL_INTERRUPT_CLEAR(vector);                                                                                  \
        function();                                                                                                   \
    }                                                                                                                 \
    void sys_enable_##vector(void);                                                                                   \
    void sys_enable_##vector(void)                                                                                    \
    {                                                                                                                 \
        hal_lock_state lock = hal_lock_devices();                                                                     \
        HAL_INTERRUPT_ENABLE(vector, level);                                                                          \
        hal_unlock(lock);                                                                                             \
    }                                                                                                                 \
    HAL_INTERRUPT_ENTRY(vector, level, sys_isr_##vector)

/* MTHI | no | 13 | 4 | none.  Sets the level, clears the flag and enables the interrupt. From any file. */
#define Sys_Enable_Interrupt(vector)                                                                                  \
    do {                                                                                                              \
        extern void sys_enable_##vector(void);                                                                        \
        sys_enable_##vector();                                                                                        \
    } while (0)
/* Any context | no | 1 | 0 | none.  An interrupt raised at this instant may still be taken; the next Enable discards
 * one raised later. */
#define Sys_Disable_Interrupt(vector) HAL_INTERRUPT_DISABLE(vector)
/* Any context, also levels 5 and 6 | no | 1 | 0 | none.  It is taken once as soon as its level allows, however often
 * raised. */
#define Sys_Raise_Interrupt(vector) HAL_INTERRUPT_RAISE(vector)

#ifdef __cplusplus
}
#endif

#endif
