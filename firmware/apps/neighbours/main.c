/* Robots that exchange a byte: each sends a number once a second and reports received ones on UART1 (README.md). */
#include <openswarm.h>
#include <openswarm_infrared.h>
#include <openswarm_io.h>
#include <stdio.h>
#include <string.h>

enum { LINE = 40, STACK = 220, PERIOD_MS = 1000 };

static void listen(void *unused)
{
    (void)unused;
    for (;;) {
        sys_event_data *data = Sys_Wait_for_Event(SYS_NEIGHBOUR_MESSAGE);
        const sys_neighbour_message *m = data->payload;
        char line[LINE];
        snprintf(line, sizeof line, "%u says %u, sensor %u, %u mm\n", m->source, m->payload[0], m->sensor,
                 Sys_Estimate_Range(m->strength));
        Sys_Send_Event(SYS_SEND_UART1, line, (uint16)strlen(line));
        Sys_Clear_EventData(&data);
    }
}

/* The body LED is on while another robot is near. */
static bool on_neighbour(uint16 pid, uint16 event, sys_event_data *data)
{
    static uint8 near;
    (void)pid;
    (void)data;
    near = (uint8)(event == SYS_NEIGHBOUR_SEEN ? near + 1 : near - 1);
    Sys_Set_LED(SYS_LED_BODY, near != 0);
    return true;
}

static void talk(void *unused)
{
    (void)unused;
    for (uint8 number = 0;; number++) {
        Sys_Sleep(PERIOD_MS);
        Sys_Send_Event(SYS_SEND_NEIGHBOURS, &number, sizeof number);
    }
}

int main(void)
{
    Sys_Init_Kernel();
    SYS_ASSERT(Sys_Start_Infrared());
    Sys_Subscribe_to_Event(SYS_NEIGHBOUR_SEEN, 0, on_neighbour, NULL);
    Sys_Subscribe_to_Event(SYS_NEIGHBOUR_LOST, 0, on_neighbour, NULL);
    const sys_process_config listener = {.entry = listen, .stack = STACK};
    const sys_process_config talker = {.entry = talk};
    SYS_ASSERT(Sys_Start_ProcessWith(&listener) != 0 && Sys_Start_ProcessWith(&talker) != 0);
    Sys_Start_Kernel();
    Sys_Run_SystemThread();
    return 0;
}
