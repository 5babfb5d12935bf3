/* Electing a leader, and another when it dies (README.md): the robot of the highest rank that is heard of. An event that
 * robots share carries who leads; the leader sends it all the time, so it is missed when it stops. */
#include "rove.h"

#include <openswarm.h>
#include <openswarm_infrared.h>
#include <openswarm_io.h>
#include <openswarm_remote.h>
#include <stdio.h>
#include <string.h>

enum {
    I_LEAD = SYS_FIRST_USER_EVENT, /* [uint16 rank] */
    HOPS = 1,          /* six robots that pass it on fill the air */
    PERIOD_MS = 300,   /* of the leader, give or take a quarter: a third of the air's time */
    FIRST_MS = 1000,   /* the first words come at random within it, or not at all if a better one is heard before */
    PATIENCE_MS = 2000, /* without a word of the leader: six or seven of which each is lost with about 0.5 */
    LOOK_MS = 50, LINE = 16, STACK = 240
};

static uint16 mine, leader;
static uint16 heard_at; /* low word of the system time */

/* Selector above, so that a user can say who is to lead; the number of the robot decides among equals. */
static uint16 rank(void)
{
    return (uint16)((uint16)Sys_Get_Selector() << 11 | Sys_Get_RobotNumber());
}

static bool on_lead(uint16 pid, uint16 event, sys_event_data *data)
{
    (void)pid;
    (void)event;
    if (data->value >= leader) {
        leader = data->value;
        heard_at = (uint16)Sys_Get_SystemTime();
    }
    return true;
}

static void say(const char *what, uint16 who)
{
    char line[LINE];
    snprintf(line, sizeof line, "%s %u\n", what, who);
    Sys_Send_Event(SYS_SEND_UART1, line, (uint16)strlen(line));
}

static void lead(void *unused)
{
    uint16 random = 0, next = 0, said = 0;
    (void)unused;
    for (;;) {
        Sys_Sleep(LOOK_MS);
        uint16 now = (uint16)Sys_Get_SystemTime();
        if (Sys_Get_RobotNumber() == 0) {
            continue; /* not drawn yet */
        }
        if (mine != rank()) {
            mine = rank();
            random = (uint16)(mine * 25173u + 13849u);
            next = (uint16)(Sys_Get_SystemTime() + random % FIRST_MS);
            say("rank", mine);
        }
        Sys_Start_CriticalSection();
        if (leader < mine || (leader != mine && (uint16)(now - heard_at) > PATIENCE_MS)) {
            leader = mine; /* until a better one is heard */
        }
        uint16 who = leader;
        Sys_End_CriticalSection();
        if (who == mine && (sint16)(now - next) >= 0) {
            random = (uint16)(random * 25173u + 13849u + mine);
            next = (uint16)(now + PERIOD_MS * 3 / 4 + random % (PERIOD_MS / 2));
            Sys_Send_IntEvent(I_LEAD, who);
        }
        if (who != said) {
            said = who;
            say("leader", who);
            Sys_Set_LED(SYS_LED_BODY, who == mine);
        }
    }
}

int main(void)
{
    Sys_Init_Kernel();
    SYS_ASSERT(Sys_Start_Infrared() && rove_begin());
    SYS_ASSERT(Sys_Register_Event(I_LEAD) && Sys_Share_Event(I_LEAD, HOPS));
    Sys_Subscribe_to_Event(I_LEAD, 0, on_lead, NULL);
    const sys_process_config thread = {.entry = lead, .stack = STACK};
    SYS_ASSERT(Sys_Start_ProcessWith(&thread) != 0);
    Sys_Start_Kernel();
    Sys_Run_SystemThread();
    return 0;
}
