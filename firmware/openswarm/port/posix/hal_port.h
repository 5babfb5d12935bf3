/* POSIX: levels are a variable, interrupts are signals or, for tests, calls at chosen points (host.h). */
#ifndef HAL_PORT_H
#define HAL_PORT_H

#define HAL_USED
#define HAL_NORETURN __attribute__((noreturn))
#define HAL_LIKELY(condition) __builtin_expect(condition, 1)
#define HAL_INLINE inline __attribute__((always_inline)) /* hot, although the rest is optimised for size */
#define HAL_OUTLINE __attribute__((noinline))            /* cold */

typedef int hal_lock_state;
typedef void *hal_limit;

bool host_allocation_fails(void);
#define HAL_ALLOCATION_FAILS() host_allocation_fails()

hal_lock_state hal_lock_slice(void);
hal_lock_state hal_lock_devices(void);
void hal_unlock(hal_lock_state before);
bool hal_in_thread(void);
bool hal_in_isr(void);
void hal_slice_restart(void);
void hal_slice_force(void);

static inline void hal_barrier(void)
{
    __asm__ volatile("" ::: "memory");
}

#endif
