/* SPDX-License-Identifier: MIT */
/* Fault reports: stack overflow, traps and failed assertions. The motors stop before anything is reported. */
#include "kernel.h"

void (*os_record_fault)(uint16 fault, uint16 place, uint16 page);

enum { DIGITS = 6 }; /* buffer size: digits of a 16-bit number and the terminating NUL */

/* Writes the digits of a number in front of end; returns the first one. */
LOOPS_OF(put_number, 4);
static HAL_OUTLINE char *put_number(char *end, uint16 number, uint16 radix)
{
    do {
        uint16 digit = number % radix;
        number /= radix;
        *--end = (char)(digit < 10 ? '0' + digit : 'a' - 10 + digit);
    } while (number != 0);
    return end;
}

static HAL_OUTLINE void report_number(const char *before, uint16 number, uint16 radix)
{
    char text[DIGITS];
    if (!SYS_REPORTS) {
        return;
    }
    text[DIGITS - 1] = '\0';
    board_report(before);
    board_report(put_number(text + DIGITS - 1, number, radix));
}

static HAL_NORETURN void stop(void)
{
    report_number(" in thread ", os_running->pid, 10);
    board_report("\r\n");
    hal_stop();
}

/* Reports "address trap at 0x0:1234 in thread 1" and stops. Cause "stack": the stack of the kernel or of main, at
 * 0x0:0. The port calls it on a stack of its own choice, with all interrupts masked. */
void os_trap(uint16 cause, uint16 pc, uint16 pc_high)
{
    static const char names[] = "oscillator\0address\0math\0interrupt\0stack";
    static const uint8 at[] = {0, 11, 19, 24, 34};
    board_failsafe();
    if (SYS_REPORTS && os_record_fault != NULL) {
        os_record_fault((uint16)(cause + 1u), pc, pc_high);
    }
    board_report(names + at[cause]);
    report_number(" trap at 0x", pc_high, 16);
    report_number(":", pc, 16);
    stop();
}

enum { FAULT_ASSERTION = 6 }; /* next code after those of os_trap(), which are its `cause` plus 1 */

/* Reports "file.c:123 in thread 1" and stops. */
void Sys_Assertion_Failed(const char *file, uint16 line)
{
    (void)hal_lock_devices();
    board_failsafe();
    if (SYS_REPORTS && os_record_fault != NULL) {
        os_record_fault(FAULT_ASSERTION, line, 0);
    }
    board_report(file);
    report_number(":", line, 10);
    stop();
}

#if SYS_ON_OVERFLOW == SYS_DROP_THREAD
/* Ends the running thread. Subscribers of SYS_EVENT_TERMINATION get its PID, and UART1 sends a report once it is
 * free. */
sys_pcb *os_overflow(void)
{
    static const char text[] = "stack overflow: thread ";
    char number[DIGITS + 1];
    char *end = number + sizeof number;
    if (os_cleanup_host != NULL) { /* a cleanup overflowed the stack; process_end_running() continues the teardown */
        HAL_STORE(os_running, os_cleanup_host);
        os_cleanup_host = NULL;
        os_in_kernel = false;
    }
    uint16 pid = os_running->pid;
    board_failsafe();
    os_count(&os_statistics.overflows);
    if (pid == 0) {
        os_trap(OS_STACK, 0, 0);
    }
    *--end = '\n';
    *--end = '\r';
    end = put_number(end, pid, 10);
    (void)Sys_Send_Event(SYS_SEND_UART1, text, sizeof text - 1);
    (void)Sys_Send_Event(SYS_SEND_UART1, end, (uint16)(number + sizeof number - end));
    return process_end_running();
}
#endif
