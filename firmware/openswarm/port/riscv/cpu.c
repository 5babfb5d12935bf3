/* SPDX-License-Identifier: MIT */
/* RISC-V port of hal_cpu.h: clock, first frames, faults. The switch is in switch.S, the levels in hal_port.h. */
#include "kernel.h"

enum { CLOCK_COUNTS = MTIME_HZ / 1000 };

/* Assumptions of switch.S. */
HAL_ASSUME(pcb_begins_so, offsetof(sys_pcb, sp) == 0 && offsetof(sys_pcb, limit) == 4);
HAL_ASSUME(kernel_stack_is_the_ports, SYS_KERNEL_STACK == HAL_KERNEL_STACK && HAL_KERNEL_STACK % 16 == 0);

typedef struct { /* frame of a thread that does not run (switch.S) */
    uint32_t s0_s11[12], resume, resume_argument, unused[2];
} frame;

volatile uint8 cpu_slice_ms = CPU_SLICE_MS;
volatile bool cpu_forced;
static uint64_t next_tick; /* value of mtime */

extern uint32_t main_stack_bottom[];
extern void cpu_start_thread(void);

/* Writes the high word as all ones first, so that no intermediate value is earlier than both times. */
static void set_next_tick(uint64_t moment)
{
    next_tick = moment;
    REGISTER(CLINT_MTIMECMP + 4) = UINT32_MAX;
    REGISTER(CLINT_MTIMECMP) = (uint32_t)moment;
    REGISTER(CLINT_MTIMECMP + 4) = (uint32_t)(moment >> 32);
}

/* If a millisecond or more was missed, the interrupt stays pending. */
HAL_USED void cpu_clock_isr(void)
{
    set_next_tick(next_tick + CLOCK_COUNTS);
    os_clock_tick();
    if (cpu_slice_ms == 0 || --cpu_slice_ms == 0) {
        REGISTER(CLINT_MSIP) = 1;
    }
}

HAL_USED void cpu_overflow(void) /* kernel stack */
{
    (void)hal_lock_devices();
    os_trap(OS_STACK, 0, 0); /* the faulting program counter is unknown */
}

void hal_init(sys_pcb *process)
{
    process->limit = main_stack_bottom;
    stack_paint(main_stack_bottom, main_stack_bottom + 1);
    CSR_SET(mstatus, MSTATUS_MIE); /* level slice; no interrupt is enabled in mie yet */
}

void hal_start(void)
{
    uint32_t high, low;
    do {
        high = REGISTER(CLINT_MTIME + 4);
        low = REGISTER(CLINT_MTIME);
    } while (high != REGISTER(CLINT_MTIME + 4));
    set_next_tick(((uint64_t)high << 32 | low) + CLOCK_COUNTS);
    __asm__ volatile("csrs mie, %0" ::"r"(MIE_DEVICES) : "memory");
}

static HAL_USED HAL_NORETURN void thread_main(void (*entry)(void *), void *arg)
{
    os_running->status |= SYS_READY;
    hal_unlock(HAL_THREAD_LEVEL);
    entry(arg);
    os_thread_returned();
}

bool hal_stack_init(sys_pcb *process, uint8_t *stack, uint16_t bytes, void (*entry)(void *), void *arg)
{
    frame *f = (frame *)(((uint32_t)(stack + bytes) & ~15u) - sizeof(frame));
    f->s0_s11[0] = (uint32_t)entry;
    f->s0_s11[1] = (uint32_t)arg;
    f->resume = (uint32_t)cpu_start_thread;
    f->resume_argument = (uint32_t)thread_main;
    process->sp = f;
    process->limit = (uint32_t *)(void *)stack;
    return true;
}

/* A masked interrupt also ends WFI. */
void hal_idle(const volatile uint16_t *pending)
{
    (void)CSR_CLEAR(mstatus, MSTATUS_MIE);
    if ((*pending & OS_WORK) == 0) {
        __asm__ volatile("wfi" ::: "memory");
    }
    CSR_SET(mstatus, MSTATUS_MIE);
}

HAL_OUTLINE void hal_stop(void)
{
    (void)CSR_CLEAR(mstatus, MSTATUS_MIE);
    SOC_STOP();
    for (;;) {
        __asm__ volatile("wfi");
    }
}

/* An exception, or an interrupt that is never enabled; on an emptied kernel stack, everything is masked. */
HAL_USED HAL_NORETURN void cpu_fault(uint32_t cause, uint32_t pc)
{
    enum { ADDRESS = 1, INTERRUPT = 3, IS_INTERRUPT = 31 };
    static bool reporting;
    if (reporting) { /* a fault of the report itself */
        hal_stop();
    }
    reporting = true;
    os_trap(cause >> IS_INTERRUPT ? INTERRUPT : ADDRESS, (uint16)pc, (uint16)(pc >> 16));
}
