/* Clocks that agree by gossip (README.md): the swarm's time is that of the robot that has been on for longest. A message
 * contains the swarm's time when it was sent; the receiver adds the duration of the transmission, AIR_MS. */
#include "rove.h"

#include <openswarm.h>
#include <openswarm_infrared.h>
#include <openswarm_io.h>
#include <stdio.h>
#include <string.h>

enum {
    PAUSE_MS = 700, /* shortest pause between messages, the longest is twice that: six robots use 0.4 of the time */
    AIR_MS = 69,    /* duration of a message of four bytes, less 2: both clocks count whole ms, and may count late */
    LINE = 24, STACK = 220
};

static volatile uint32 ahead; /* swarm time minus own time, ms modulo 2^32; the link's interrupt writes it */

/* ISR at the start of a transmission: writes the swarm time to the message. */
static void tell(uint8 *payload, uint8 size)
{
    uint32 time = Sys_Get_SystemTime() + ahead;
    memcpy(payload, &time, size);
}

/* ISR at the end of a reception. Received times are never ahead of the true time, so the latest one is the best. */
static bool hear(sys_neighbour_message *m)
{
    uint32 time;
    if (m->size == sizeof time) {
        memcpy(&time, m->payload, sizeof time);
        time += AIR_MS - Sys_Get_SystemTime();
        if ((sint32)(time - ahead) > 0) {
            ahead = time;
        }
    }
    return false;
}

static uint32 swarm_time(void)
{
    uint32 before, time;
    do {
        before = ahead;
        time = Sys_Get_SystemTime() + before;
    } while (before != ahead);
    return time;
}

static void gossip(void *unused)
{
    uint16 random = 0;
    (void)unused;
    for (;;) {
        char line[LINE];
        random = (uint16)(random * 25173u + 13849u + Sys_Get_RobotNumber());
        Sys_Sleep((uint16)(PAUSE_MS + random % PAUSE_MS));
        (void)Sys_Send_Neighbours(&(const uint32){0}, sizeof(uint32)); /* `tell` fills it */
        snprintf(line, sizeof line, "clock %lu\n", swarm_time());
        Sys_Send_Event(SYS_SEND_UART1, line, (uint16)strlen(line));
    }
}

int main(void)
{
    Sys_Init_Kernel();
    SYS_ASSERT(Sys_Start_Infrared() && rove_begin());
    Sys_Set_LeavingProcessor(tell);
    Sys_Set_MessageProcessor(hear);
    const sys_process_config talker = {.entry = gossip, .stack = STACK};
    SYS_ASSERT(Sys_Start_ProcessWith(&talker) != 0);
    Sys_Start_Kernel();
    Sys_Run_SystemThread();
    return 0;
}
