/* What stops a thread or the system: stack overflow, traps, failed assertions. The motors stop first. */
#include "kernel.h"

static char *put_text(char *to, const char *text)
{
    while (*text != '\0') {
        *to++ = *text++;
    }
    return to;
}

static char *put_number(char *to, uint32 number, uint16 radix)
{
    char digits[11];
    uint16 n = 0;
    do {
        digits[n++] = "0123456789abcdef"[number % radix];
        number /= radix;
    } while (number != 0);
    while (n > 0) {
        *to++ = digits[--n];
    }
    return to;
}

/* "stopped: <cause> <number> in thread <pid>" */
static HAL_NORETURN void stop(const char *cause, const char *prefix, uint32 number, uint16 radix)
{
    char line[32];
    board_failsafe();
    board_report("stopped: ");
    board_report(cause);
    char *end = put_number(put_text(line, prefix), number, radix);
    end = put_number(put_text(end, " in thread "), os_running->pid, 10);
    *put_text(end, "\r\n") = '\0';
    board_report(line);
    hal_stop();
}

/* Called by the port, on a stack of its own choice, with everything masked. */
void os_trap(uint16 cause, uint32 pc)
{
    static const char *const causes[] = {"oscillator failure", "address error", "math error", "unexpected interrupt",
                                         "kernel stack overflow", "main stack overflow"};
    stop(causes[cause], " at 0x", pc, 16);
}

void Sys_Assertion_Failed(const char *file, uint16 line)
{
    (void)hal_lock_devices();
    stop(file, ":", line, 10);
}

/* The thread is gone after this; a listener hears its PID, and UART1 says so once it is free. */
sys_pcb *os_overflow(void)
{
    char line[40];
    uint16 pid = os_running->pid;
    board_failsafe();
    os_count(&os_statistics.overflows);
    if (pid == 0) {
        os_trap(OS_MAIN_OVERFLOW, 0);
    }
    char *end = put_text(put_number(put_text(line, "stack overflow: thread "), pid, 10), " ended\r\n");
    (void)Sys_Send_Event(SYS_SEND_UART1, line, (uint16)(end - line));
    (void)Sys_Send_IntEvent(SYS_EVENT_TERMINATION, pid);
    return process_end_running();
}
