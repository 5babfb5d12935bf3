/* Included before every file of the image (app.mk): allocations may fail, and every unlock of a level is counted, so that
 * an interrupt can occur within a call. The model treats HAL_LOAD and HAL_STORE as atomic. On the AVR they lock and
 * unlock, but hal_cpu.h calls (hal_unlock) in parentheses, so that this macro does not count them. */
#ifndef __ASSEMBLER__
#include "hal_cpu.h"

bool machine_allocation_fails(void);
void machine_unlock(hal_lock_state before);

#undef HAL_ALLOCATION_FAILS
#define HAL_ALLOCATION_FAILS() machine_allocation_fails()
#define hal_unlock(before) machine_unlock(before)
#endif
