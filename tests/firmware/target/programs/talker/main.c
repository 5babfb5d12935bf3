/* A program with all storage of C: initialised and uninitialised variables, constants, a function table, library calls,
 * and a handler and a thread that continue after main has returned. */
#include <openswarm_io.h>
#include <stdio.h>
#include <string.h>

enum { SELECTED = 0x50, STACK = 400, MS = 20 };

static uint32 total = 1000000;
static uint16 ticks, heard;
static const char *const names[] = {"zero", "one", "two"};

static sint16 twice(sint16 x)
{
    return (sint16)(2 * x);
}

static sint16 square(sint16 x)
{
    return (sint16)(x * x);
}

static sint16 (*const functions[])(sint16) = {twice, square};

static void say(const char *what)
{
    Sys_Send_Event(SYS_SEND_UART1, what, (uint16)strlen(what));
}

static bool on_selected(uint16 pid, uint16 event, sys_event_data *data)
{
    (void)pid;
    (void)event;
    heard += data->value;
    return true;
}

static void go_on(void *step)
{
    char line[48];
    for (;;) {
        Sys_Sleep(MS);
        Sys_Send_IntEvent(SELECTED, 3);
        total += *(const uint16 *)step;
        ticks++;
        snprintf(line, sizeof line, "%s %u %lu %d\n", names[ticks % 3], heard, (unsigned long)total,
                 functions[ticks % 2]((sint16)ticks));
        say(line);
    }
}

int main(void)
{
    static const uint16 step = 7;
    const sys_process_config thread = {.entry = go_on, .arg = (void *)&step, .stack = STACK};
    Sys_Register_Event(SELECTED);
    Sys_Subscribe_to_Event(SELECTED, 0, on_selected, NULL);
    say("talks\n");
    return Sys_Start_ProcessWith(&thread) != 0 ? 0 : 1;
}
