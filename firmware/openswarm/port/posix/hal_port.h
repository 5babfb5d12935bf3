/* SPDX-License-Identifier: MIT */
/* POSIX: levels are a variable, interrupts are signals or, for tests, calls at chosen points (host.h). */
#ifndef HAL_PORT_H
#define HAL_PORT_H

typedef int hal_lock_state;
#define HAL_THREAD_LEVEL 0
typedef void *hal_limit;

bool host_allocation_fails(void);
#define HAL_ALLOCATION_FAILS() host_allocation_fails()
#define HAL_STACK_IS_TAKEN
#define HAL_WORD_IS_ONE_ACT 1 /* "interrupts" occur between C statements only */

hal_lock_state hal_lock_slice(void);
hal_lock_state hal_lock_devices(void);
void hal_unlock(hal_lock_state before);
bool hal_in_thread(void);
bool hal_in_isr(void);
void hal_slice_restart(uint16_t spent); /* ms */
uint16_t hal_slice_spent(void);
bool hal_slice_is_over(void);
void hal_slice_force(void);
void hal_slice_unforce(void);

#endif
