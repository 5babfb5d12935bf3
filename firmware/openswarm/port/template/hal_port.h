/* The part of the port that the kernel may inline; contract in hal/hal_cpu.h. */
#ifndef HAL_PORT_H
#define HAL_PORT_H

#define HAL_USED /* your compiler's "referenced from assembly only" */
#define HAL_NORETURN __attribute__((noreturn))
#define HAL_LIKELY(condition) __builtin_expect(condition, 1)
#define HAL_INLINE inline __attribute__((always_inline)) /* hot, although the rest is optimised for size */
#define HAL_OUTLINE __attribute__((noinline))            /* cold */
#define HAL_ALLOCATION_FAILS() false

typedef int hal_lock_state; /* replace: whatever restores your interrupt mask */
typedef void *hal_limit;    /* replace: stack limit register, or any type if there is none */

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
