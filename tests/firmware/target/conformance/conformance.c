/* Runs the checks as PID 0 and prints the result on UART1: "conforms: N checks", or "N of M checks failed". */
#include "conformance.h"

#include <string.h>

#define FILE_LETTER 'c'

static uint16 checks, failures;

static char *put(char *at, const char *text)
{
    while (*text != '\0') {
        *at++ = *text++;
    }
    return at;
}

static char *put_number(char *at, uint16 number)
{
    char digits[6];
    char *first = digits + sizeof digits;
    uint16 count;
    do {
        *--first = (char)('0' + number % 10u);
        number /= 10u;
    } while (number != 0);
    count = (uint16)(digits + sizeof digits - first);
    memcpy(at, first, count);
    return at + count;
}

static void say(const char *line, const char *end)
{
    while (!Sys_Write_UART1(line, (uint16)(end - line))) {
        Sys_Sleep(5);
    }
    Sys_Sleep(15); /* until the line is sent, before the next one */
}

void check_line(bool holds, char file, uint16 line)
{
    char text[24];
    checks++;
    if (!holds) {
        failures++;
        text[0] = file;
        say(text, put(put_number(put(text + 1, ".c:"), line), " fails\r\n"));
    }
}

static void tell(void)
{
    char text[32];
    char *end = text;
    if (failures == 0) {
        end = put(put_number(put(end, "conforms: "), checks), " checks\r\n");
    } else {
        end = put(put_number(put(put_number(end, failures), " of "), checks), " checks failed\r\n");
    }
    say(text, end);
}

uint16 heap_now(void)
{
    return Sys_Get_Statistics()->heap_used;
}

static char trace[16];
static volatile uint8 length;

void note(char c)
{
    Sys_Start_CriticalSection();
    if (length < sizeof trace) {
        trace[length++] = c;
    }
    Sys_End_CriticalSection();
}

void forget(void)
{
    length = 0;
}

bool noted(const char *text)
{
    return strlen(text) == length && memcmp(text, trace, length) == 0;
}

uint16 start(void (*entry)(void *), void *arg, uint8 priority)
{
    sys_process_config config = {entry, arg, 0, priority, 0, 0, 0};
    return Sys_Start_ProcessWith(&config);
}

/* A scheduler other than round robin may be set, and threads may be created, before the kernel starts. Calls that may
 * block are refused until then. */
#ifndef FIRST_SCHEDULER
#define FIRST_SCHEDULER sys_fixed_priority
#endif
static void early(void *unused)
{
    (void)unused;
    note('e');
}

#if defined(__unix__)
#include <unistd.h>
static void leave(void)
{
    _exit(failures == 0 ? 0 : 1);
}
#else
static void leave(void)
{
    Sys_Run_SystemThread();
}
#endif

int main(void)
{
    Sys_Init_Kernel();
    Sys_Set_Scheduler(&FIRST_SCHEDULER);
    CHECK(start(early, NULL, 1) != 0);
    Sys_Yield();
    Sys_Sleep(1);
    Sys_Run_SystemThread();
    CHECK(Sys_Wait_for_Event(SYS_1ms_TIMER) == NULL && !Sys_Wait_for_Period());
    CHECK(Sys_Get_Statistics()->refused == 5 && Sys_Get_LastError() == SYS_ERROR_CONTEXT);
#ifdef SUITE_OF_OPTIONS
    Sys_Start_Kernel();
#else
    Sys_Start_CriticalSection();
    Sys_Start_Kernel();
    CHECK(noted("")); /* the section continues */
    Sys_End_CriticalSection();
#endif
    Sys_Sleep(2);
    CHECK(noted("e"));
    Sys_Set_Scheduler(&sys_round_robin);
#ifdef SUITE_OF_OPTIONS
    check_options();
    check_limits();
    check_waits();
#else
    check_threads();
    check_events();
    check_attacks();
    check_registers();
#endif
    tell();
    leave();
    return 0;
}
