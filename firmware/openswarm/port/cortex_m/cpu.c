/* SPDX-License-Identifier: MIT */
/* Cortex-M port of hal_cpu.h: clock, first frames, faults. The switch is in switch.S, the levels in hal_port.h. */
#include "kernel.h"

/* Assumptions of switch.S. */
#define ASSUME(name, condition) typedef char name[(condition) ? 1 : -1]
ASSUME(pcb_begins_so, offsetof(sys_pcb, sp) == 0 && offsetof(sys_pcb, limit) == 4);
ASSUME(kernel_stack_is_the_ports, SYS_KERNEL_STACK == HAL_KERNEL_STACK && HAL_KERNEL_STACK % 32 == 0);

enum { GUARD = 32, THUMB = 0x01000000, KERNEL_GUARD_REGION = 0x11 /* MPU_RBAR: VALID, region 1 */ };

typedef struct { /* registers restored by PendSV, then those restored by the hardware */
    uint32_t r4_r11[8], exc_return;
    uint32_t r0, r1, r2, r3, r12, lr, pc, xpsr;
} frame;

volatile uint8 cpu_slice_ms = CPU_SLICE_MS;
volatile bool cpu_forced;
volatile hal_pick cpu_pick;

extern uint32_t main_stack_bottom[];

#if SYS_CHECK_LEVELS
void cpu_check_level(void)
{
    enum { NMI = 2, FIRST_INTERRUPT = 16 };
    static bool reporting; /* the report locks, too */
    uint32_t exception = cpu_exception();
    uint32_t priority = exception >= FIRST_INTERRUPT ? NVIC_IPR(exception - FIRST_INTERRUPT)
                        : exception == NMI           ? 0
                                                     : CPU_PRIORITY_DEVICE;
    if ((priority < CPU_PRIORITY_DEVICE || priority >= CPU_PRIORITY_SLICE) && !reporting) {
        reporting = true;
        Sys_Assertion_Failed("kernel call at a wrong priority, exception", (uint16)exception);
    }
}
#endif

static uint32_t guard_of(const void *stack)
{
    return (((uint32_t)stack + GUARD - 1u) & ~(GUARD - 1u)) | CPU_GUARD_REGION;
}

HAL_USED void SysTick_Handler(void)
{
    os_clock_tick();
    if (cpu_slice_ms == 0 || --cpu_slice_ms == 0) {
        SCB_ICSR = SCB_ICSR_PENDSVSET;
    }
}

void hal_init(sys_pcb *process)
{
    SCB_SHPR(CPU_PENDSV) = CPU_PRIORITY_SLICE;
    (void)hal_lock_slice();
    process->limit = guard_of(main_stack_bottom);
    MPU_RBAR = (uint32_t)os_memory.bytes | KERNEL_GUARD_REGION;
    MPU_RASR = MPU_RASR_32_BYTES_READ_ONLY;
    MPU_RBAR = process->limit;
    MPU_RASR = MPU_RASR_32_BYTES_READ_ONLY;
    SCB_SHCSR |= SCB_SHCSR_FAULTS;
    SCB_CCR |= SCB_CCR_DIV_0_TRP;
    MPU_CTRL = MPU_CTRL_ON;
    __asm__ volatile("dsb\n\tisb" ::: "memory");
}

void hal_start(void)
{
    SCB_SHPR(15) = CPU_PRIORITY_DEVICE; /* SysTick */
    SYST_RVR = F_CPU / 1000 - 1;
    SYST_CVR = 0;
    SYST_CSR = 7; /* on, interrupt, CPU clock */
}

static HAL_NORETURN void thread_main(void (*entry)(void *), void *arg)
{
    hal_lock_state lock = hal_lock_slice();
    os_running->status |= SYS_READY;
    hal_unlock(lock);
    entry(arg);
    os_thread_returned();
}

bool hal_stack_init(sys_pcb *process, uint8_t *stack, uint16_t bytes, void (*entry)(void *), void *arg)
{
    uint32_t hardware = ((uint32_t)(stack + bytes) - (sizeof(frame) - offsetof(frame, r0))) & ~7u;
    frame *f = (frame *)(hardware - offsetof(frame, r0));
    f->exc_return = 0xFFFFFFFDu; /* thread, process stack, no FPU */
    f->r0 = (uint32_t)entry;
    f->r1 = (uint32_t)arg;
    f->lr = 0;
    f->pc = (uint32_t)thread_main & ~1u;
    f->xpsr = THUMB;
    process->sp = f;
    process->limit = guard_of(stack);
    return true;
}

/* Disables the guard, which may still be in force in PendSV after the thread, before the heap writes there. */
void hal_stack_release(sys_pcb *process)
{
    if (process->limit == UINT32_MAX || (MPU_RBAR ^ process->limit) < GUARD) {
        MPU_RBAR = CPU_GUARD_REGION; /* to flash */
    }
}

static void pend_and_open(hal_pick pick)
{
    cpu_pick = pick;
    SCB_ICSR = SCB_ICSR_PENDSVSET;
    hal_unlock(0);
    __asm__ volatile("dsb\n\tisb" ::: "memory"); /* the switch happens here */
}

static sys_pcb *turn(void)
{
    return os_yield(os_running);
}

void hal_yield(void)
{
    pend_and_open(turn);
}

void hal_block(void)
{
    pend_and_open(os_schedule);
}

void hal_abandon(hal_pick pick)
{
    pend_and_open(pick);
    for (;;) {
    }
}

void hal_idle(const volatile uint16_t *pending)
{
    __asm__ volatile("cpsid i" ::: "memory");
    if ((*pending & OS_WORK) == 0) {
        __asm__ volatile("dsb\n\twfi" ::: "memory"); /* a masked interrupt ends the sleep, too */
    }
    __asm__ volatile("cpsie i\n\tisb" ::: "memory");
}

HAL_OUTLINE void hal_stop(void)
{
    __asm__ volatile("cpsid i" ::: "memory");
    for (;;) {
        __asm__ volatile("wfi");
    }
}

/* ---- Faults ------------------------------------------------------------------------------------------------------ */

/* Handles a thread that wrote into its guard, or an interrupt that could not store its registers there. PendSV runs
 * next, even if the thread holds a lock. It ends the thread, because every stack pointer is below the new limit. */
HAL_USED void cpu_guard_hit(void)
{
    SCB_CFSR = SCB_CFSR_MEMMANAGE;
    os_running->limit = UINT32_MAX;
    cpu_slice_ms = 0; /* hal_slice_unforce() in an ISR before PendSV does not withdraw it */
    pend_and_open(NULL);
}

/* On an emptied kernel stack, at the fault's priority. */
HAL_USED HAL_NORETURN void cpu_fault(const uint32_t *stacked)
{
    enum { ADDRESS = 1, MATH = 2, INTERRUPT = 3, FIRST_INTERRUPT = 16, PC = 6 };
    uint32_t kernel_guard = (uint32_t)os_memory.bytes;
    uint32_t pc = 0;
    uint16 cause = ADDRESS;
    if (cpu_exception() >= FIRST_INTERRUPT) {
        cause = INTERRUPT;
    } else if (SCB_CFSR & SCB_CFSR_DIVBYZERO) {
        cause = MATH;
    } else if ((SCB_CFSR & SCB_CFSR_MEMMANAGE) && ((uint32_t)stacked < kernel_guard + 2 * GUARD)) {
        cause = OS_STACK;
    }
    MPU_CTRL = 0; /* the fault report may use the guard's bytes */
    if (cause != OS_STACK) {
        pc = stacked[PC];
    }
    os_trap(cause, (uint16)pc, (uint16)(pc >> 16));
}
