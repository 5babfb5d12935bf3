/* Included before every file of the image (app.mk): allocations may fail, and every unlock of a level is counted, so that
 * an interrupt can occur within a call. Loads and stores of words are single steps on every CPU but the AVR, and in the
 * model: hal_cpu.h writes (hal_unlock) where they unlock, which this macro does not replace. */
#ifndef __ASSEMBLER__
#include "hal_cpu.h"

bool machine_allocation_fails(void);
void machine_unlock(hal_lock_state before);

#undef HAL_ALLOCATION_FAILS
#define HAL_ALLOCATION_FAILS() machine_allocation_fails()
#define hal_unlock(before) machine_unlock(before)
#endif
