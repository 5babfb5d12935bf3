/* SPDX-License-Identifier: MIT */
/* Interrupts of the application's own: a function in C at a chosen level, without assembly.
 *
 *     static void on_button(void) { Sys_Send_IntEvent(PRESSED, 1); }
 *     SYS_INTERRUPT(INT1, 4, on_button)             at file scope; vectors are named as in the CPU's data sheet
 *     ...
 *     Sys_Enable_Interrupt(INT1);                   in main, behind Sys_Init_Kernel, or later
 *
 * The function runs on the kernel stack, its flag cleared before it. Levels: 4 may call what the contracts of openswarm.h
 * mark I, and waits for other ISRs and for short locks of the kernel. 5 and 6 are delayed by nothing of the kernel, except
 * that 5 waits for the frame of a thread switch, and may not call the kernel or a device: they raise an interrupt of level
 * 4 that nothing else uses (Sys_Raise_Interrupt) and leave the rest to it. Each takes 4 bytes more of the interrupted
 * thread's stack than HAL_MINIMUM_STACK allows for. Level 6 belongs to the camera's capture where that is linked.
 *
 * Enforced: levels and vectors that do not exist, by the compiler; a vector that has its function already, be it the
 * kernel's, a driver's or another of these, by the linker; what levels 5 and 6 may not do, by firmware/tools/interrupts.py
 * when make has linked the image.
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

/* MTHI | no | 10 | 4 | none.  Sets the level, forgets what came before, enables. From any file. */
#define Sys_Enable_Interrupt(vector)                                                                                  \
    do {                                                                                                              \
        extern void sys_enable_##vector(void);                                                                        \
        sys_enable_##vector();                                                                                        \
    } while (0)
/* Any context | no | 2 | 0 | none.  One that is due in this very moment may still come; one raised later is forgotten by
 * the next Enable. */
#define Sys_Disable_Interrupt(vector) HAL_INTERRUPT_DISABLE(vector)
/* Any context, also levels 5 and 6 | no | 1 | 0 | none.  It comes as soon as its level allows, once however often raised. */
#define Sys_Raise_Interrupt(vector) HAL_INTERRUPT_RAISE(vector)

#ifdef __cplusplus
}
#endif

#endif
