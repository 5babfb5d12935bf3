/* Simultaneous stop (README.md): one robot decides when all stop. A message contains the time that is left at the
 * moment of its transmission, so all robots stop together, no matter from which robot the message came. */
#include "rove.h"

#include <openswarm.h>
#include <openswarm_infrared.h>
#include <openswarm_io.h>
#include <stdio.h>
#include <string.h>

enum {
    CALL_MS = 1200,  /* after the start: a robot whose selector is not 0 decides */
    AHEAD_MS = 3000, /* from the decision to the stop */
    PAUSE_MS = 400,  /* shortest pause between messages of an informed robot, the longest is twice that */
    AIR_MS = 60,     /* duration of a message of two bytes */
    LOOK_MS = 10, LINE = 16, STACK = 220
};

static volatile bool is_known;
static volatile uint16 stop_at; /* low word of the system time */

static bool learn(uint16 at)
{
    if (is_known) {
        return false;
    }
    stop_at = at;
    is_known = true;
    return true;
}

/* ISR at the start of a transmission: writes the time left to the message. */
static void tell(uint8 *payload, uint8 size)
{
    uint16 left = (uint16)(stop_at - (uint16)Sys_Get_SystemTime());
    memcpy(payload, &left, size);
}

/* ISR at the end of a reception: learns the time of the stop. */
static bool hear(sys_neighbour_message *m)
{
    uint16 left;
    if (m->size == sizeof left) {
        memcpy(&left, m->payload, sizeof left);
        (void)learn((uint16)((uint16)Sys_Get_SystemTime() + left - AIR_MS));
    }
    return false;
}

static void say(const char *what)
{
    char line[LINE];
    snprintf(line, sizeof line, "%s %u\n", what, (uint16)Sys_Get_SystemTime());
    Sys_Send_Event(SYS_SEND_UART1, line, (uint16)strlen(line));
}

static bool stand(uint16 event, const sys_event_data *data, sys_wheel_speeds *speeds)
{
    (void)event;
    (void)data;
    speeds->left = speeds->right = 0;
    return true;
}

static void decide(void)
{
    Sys_Sleep(CALL_MS);
    if (Sys_Get_Selector() != 0) {
        (void)learn((uint16)(Sys_Get_SystemTime() + AHEAD_MS));
    }
    while (!is_known) {
        Sys_Sleep(LOOK_MS);
    }
    say("known");
    Sys_Set_LED(SYS_LED_BODY, true);
}

static void obey(void *unused)
{
    uint16 random = Sys_Get_RobotNumber(), next = 0;
    (void)unused;
    decide();
    for (next = (uint16)Sys_Get_SystemTime();;) {
        uint16 now = (uint16)Sys_Get_SystemTime();
        if ((sint16)(now - stop_at) >= 0) {
            break;
        }
        if ((sint16)(now - next) >= 0) {
            random = (uint16)(random * 25173u + 13849u + Sys_Get_RobotNumber());
            next = (uint16)(now + PAUSE_MS + (random >> 4) % PAUSE_MS);
            (void)Sys_Send_Neighbours(&(const uint16){0}, sizeof(uint16)); /* `tell` fills it */
        }
        Sys_Sleep(LOOK_MS);
    }
    Sys_Set_MotorProcessor(stand);
    rove_drive(0, 0);
    say("halt");
    Sys_Set_LED(SYS_LED_FRONT, true);
    for (;;) {
        Sys_Sleep(0xFFFF);
    }
}

int main(void)
{
    Sys_Init_Kernel();
    SYS_ASSERT(Sys_Start_Infrared() && rove_begin());
    Sys_Set_LeavingProcessor(tell);
    Sys_Set_MessageProcessor(hear);
    const sys_process_config thread = {.entry = obey, .stack = STACK};
    SYS_ASSERT(Sys_Start_ProcessWith(&thread) != 0);
    Sys_Start_Kernel();
    Sys_Run_SystemThread();
    return 0;
}
