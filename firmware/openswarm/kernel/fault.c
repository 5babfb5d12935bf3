/* What stops a thread or the system: stack overflow, traps, failed assertions. The motors stop first. */
#include "kernel.h"

#include <string.h>

/* Most significant digit first, leading zeros left out. */
static char *put_number(char *to, uint16 number, uint16 radix)
{
    uint16 weight = 1;
    while (number / weight >= radix) {
        weight = (uint16)(weight * radix);
    }
    for (; weight != 0; weight /= radix) {
        uint8 digit = (uint8)(number / weight);
        *to++ = (char)(digit < 10 ? '0' + digit : 'a' - 10 + digit);
        number %= weight;
    }
    return to;
}

static HAL_OUTLINE void report_number(const char *before, uint16 number, uint16 radix)
{
    char text[6];
    *put_number(text, number, radix) = '\0';
    board_report(before);
    board_report(text);
}

static HAL_NORETURN void stop(void)
{
    report_number(" in thread ", os_running->pid, 10);
    board_report("\r\n");
    hal_stop();
}

/* "address trap at 0x0:1234 in thread 1". Called by the port, on a stack of its own choice, with everything masked. */
void os_trap(uint16 cause, uint16 pc, uint16 pc_high)
{
    static const char names[6][14] = {"oscillator", "address", "math", "interrupt", "kernel stack", "main stack"};
    board_failsafe();
    board_report(names[cause]);
    report_number(" trap at 0x", pc_high, 16);
    report_number(":", pc, 16);
    stop();
}

/* "file.c:123 in thread 1" */
void Sys_Assertion_Failed(const char *file, uint16 line)
{
    (void)hal_lock_devices();
    board_failsafe();
    board_report(file);
    report_number(":", line, 10);
    stop();
}

/* The thread is gone after this; a listener hears its PID, and UART1 says so once it is free. */
sys_pcb *os_overflow(void)
{
    static const char text[] = "stack overflow: thread ";
    char line[sizeof text + 6];
    uint16 pid = os_running->pid;
    board_failsafe();
    os_count(&os_statistics.overflows);
    if (pid == 0) {
        os_trap(OS_MAIN_OVERFLOW, 0, 0);
    }
    memcpy(line, text, sizeof text - 1);
    char *end = put_number(line + sizeof text - 1, pid, 10);
    *end++ = '\r';
    *end++ = '\n';
    (void)Sys_Send_Event(SYS_SEND_UART1, line, (uint16)(end - line));
    (void)Sys_Send_IntEvent(SYS_EVENT_TERMINATION, pid);
    return process_end_running();
}
