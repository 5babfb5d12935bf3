/* SPDX-License-Identifier: MIT */
/* The part of the port that the kernel may inline; contract in hal/hal_cpu.h. */
#ifndef HAL_PORT_H
#define HAL_PORT_H

#define HAL_STACK_IS_TAKEN
#define HAL_WORD_IS_ONE_ACT 0 /* correct for every CPU; 1 saves locks where loads and stores of words are atomic */

typedef int hal_lock_state; /* replace: saved interrupt mask */
#define HAL_THREAD_LEVEL 0  /* replace: the mask of level thread */
typedef void *hal_limit;    /* replace: stack limit register, or any type if there is none */

hal_lock_state hal_lock_slice(void);
hal_lock_state hal_lock_devices(void);
void hal_unlock(hal_lock_state before);
bool hal_in_thread(void);
bool hal_in_isr(void);
void hal_slice_restart(uint16_t spent); /* replace: for example in counts of your slice timer */
uint16_t hal_slice_spent(void);
bool hal_slice_is_over(void);
void hal_slice_force(void);
void hal_slice_unforce(void);

#endif
