/* Clocks that agree by gossip (README.md): the swarm's time is that of the robot that has been on for longest. A message
 * tells when it was queued, and when the sender's last one ended. The first says at least what time it is now; the second
 * says it to a few ms, to who heard the end of that one. Nobody is ever told a later time than there is. */
#include "rove.h"

#include <openswarm.h>
#include <openswarm_infrared.h>
#include <openswarm_io.h>
#include <stdio.h>
#include <string.h>

enum {
    PAUSE_MS = 400, /* and up to as much again between messages: six robots take most of the air's time */
    PATIENCE_MS = 1000, /* for a message to be sent */
    AIR_MS = 92, /* of a message of seven bytes, less a little: eight words (io/infrared/README.md) */
    LATE_MS = 3, /* by which the sender may notice the end of its message after those who hear it: measured 1 to 2 */
    SOURCES = 8, LINE = 24, STACK = 260
};

typedef struct {
    uint16 source;
    uint8 number;
    uint32 ms; /* own clock when that message ended */
} heard;

typedef struct {
    uint32 queued;   /* swarm's time */
    uint16 since;    /* the end of the last one, ms; 0: unknown */
    uint8 number;    /* counts up */
    uint8 heard_at;  /* low byte of the receiver's clock, put there by itself */
} announcement;

static uint32 ahead; /* of the own clock is the swarm's, ms; modulo 2^32 */
static heard messages[SOURCES];

/* ISR: the end of a message is now, not when its handler runs. */
static bool stamp(sys_neighbour_message *m)
{
    m->payload[offsetof(announcement, heard_at)] = (uint8)Sys_Get_SystemTime();
    m->size = sizeof(announcement);
    return true;
}

static heard *message_of(uint16 source)
{
    static uint8 next;
    for (heard *h = messages; h != messages + SOURCES; h++) {
        if (h->source == source) {
            return h;
        }
    }
    next = (uint8)((next + 1u) % SOURCES);
    return messages + next;
}

/* When the own clock showed `own`, it was `time` at least. */
static void at_least(uint32 time, uint32 own)
{
    if ((sint32)(time - (own + ahead)) > 0) {
        ahead = time - own;
    }
}

static bool on_message(uint16 pid, uint16 event, sys_event_data *data)
{
    const sys_neighbour_message *m = data->payload;
    uint32 now = Sys_Get_SystemTime();
    announcement a;
    (void)pid;
    (void)event;
    memcpy(&a, m->payload, sizeof a);
    now -= (uint8)((uint8)now - a.heard_at);
    heard *h = message_of(m->source);
    at_least(a.queued + AIR_MS, now);
    if (h->source == m->source && (uint8)(a.number - h->number) == 1 && a.since != 0) {
        at_least(a.queued - a.since - LATE_MS, h->ms);
    }
    *h = (heard){m->source, a.number, now};
    return true;
}

static uint32 swarm_time(void)
{
    Sys_Start_CriticalSection();
    uint32 time = Sys_Get_SystemTime() + ahead;
    Sys_End_CriticalSection();
    return time;
}

/* Until the message has left, as the link counts; false: nobody must compare it. */
static bool send(uint8 number, uint16 since)
{
    const sys_infrared_statistics *counts = Sys_Get_InfraredStatistics();
    uint16 before = counts->sent;
    announcement a = {swarm_time(), since, number, 0};
    if (!Sys_Send_Neighbours(&a, offsetof(announcement, heard_at))) {
        return false;
    }
    for (uint16 waited = 0; waited < PATIENCE_MS; waited++) {
        if (*(const volatile uint16 *)&counts->sent != before) {
            return true;
        }
        Sys_Sleep(1);
    }
    return false;
}

static void gossip(void *unused)
{
    uint16 random = Sys_Get_RobotNumber(), ended = 0;
    bool was_sent = false;
    (void)unused;
    for (uint8 number = 0;; number++) {
        char line[LINE];
        random = (uint16)(random * 25173u + 13849u + Sys_Get_RobotNumber());
        Sys_Sleep((uint16)(PAUSE_MS + random % PAUSE_MS));
        was_sent = send(number, was_sent ? (uint16)(Sys_Get_SystemTime() - ended) : 0);
        ended = (uint16)Sys_Get_SystemTime();
        snprintf(line, sizeof line, "clock %lu\n", swarm_time());
        Sys_Send_Event(SYS_SEND_UART1, line, (uint16)strlen(line));
    }
}

int main(void)
{
    Sys_Init_Kernel();
    SYS_ASSERT(Sys_Start_Infrared() && rove_begin());
    Sys_Set_MessageProcessor(stamp);
    Sys_Subscribe_to_Event(SYS_NEIGHBOUR_MESSAGE, 0, on_message, NULL);
    const sys_process_config talker = {.entry = gossip, .stack = STACK};
    SYS_ASSERT(Sys_Start_ProcessWith(&talker) != 0);
    Sys_Start_Kernel();
    Sys_Run_SystemThread();
    return 0;
}
