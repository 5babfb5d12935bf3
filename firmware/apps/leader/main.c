/* Election of a leader, and of a successor when it fails (README.md): the robot of the highest known rank. The leader
 * increments a counter that followers forward; a new value from any robot is its sign of life, an old one is not. */
#include "rove.h"

#include <openswarm.h>
#include <openswarm_infrared.h>
#include <openswarm_io.h>
#include <stdio.h>
#include <string.h>

enum {
    PERIOD_MS = 450,    /* between the leader's counts, up to a quarter more or less */
    RELAY_MS = 350,     /* longest delay before a follower forwards a count */
    ENOUGH = 2,         /* a follower that has received this many copies of a count does not forward it */
    FIRST_MS = 1000,    /* longest delay of a robot's first claim, which it omits if it receives a higher one before */
    ANSWER_MS = 150,    /* longest delay before a leader answers a robot that follows a lower rank */
    PATIENCE_MS = 5000, /* without a new count, about eleven periods: the leader has failed or is out of reach */
    SPREAD_MS = 500,    /* at most added to PATIENCE_MS at random, so that one robot claims first */
    LOOK_MS = 25, LINE = 16, STACK = 240
};

typedef struct {
    uint16 rank;
    uint8 count;
} word;

enum { WORD_BYTES = 3 };

static word leader, given_up; /* given_up: the lost leader with its last known count */
static uint16 mine, heard_at, given_up_at, patience, next; /* low words of the system time */
static uint8 copies; /* received of the leader's count */
static uint16 random_state;

static uint16 draw(uint16 below)
{
    random_state = (uint16)(random_state * 25173u + 13849u + mine);
    return (uint16)((random_state >> 4) % below);
}

/* The selector is in the upper bits, so that a user can choose the leader; the robot number breaks ties. */
static uint16 rank(void)
{
    return (uint16)((uint16)Sys_Get_Selector() << 11 | Sys_Get_RobotNumber());
}

static bool is_newer(uint8 count, uint8 than)
{
    return (sint8)(count - than) > 0;
}

/* Whether a value is an old one of the lost leader, which may restart after PATIENCE_MS. */
static bool is_stale(const word *w, uint16 now)
{
    return w->rank == given_up.rank && !is_newer(w->count, given_up.count) && (uint16)(now - given_up_at) < PATIENCE_MS;
}

static void follow(const word *w, uint16 now)
{
    leader = *w;
    heard_at = now;
    copies = 1;
    patience = (uint16)(PATIENCE_MS + draw(SPREAD_MS));
    next = (uint16)(now + draw(RELAY_MS));
}

static bool on_message(uint16 pid, uint16 event, sys_event_data *data)
{
    const sys_neighbour_message *m = data->payload;
    uint16 now = (uint16)Sys_Get_SystemTime();
    word w = {0, m->payload[2]};
    (void)pid;
    (void)event;
    memcpy(&w.rank, m->payload, sizeof w.rank);
    if (m->size != WORD_BYTES || mine == 0 || w.rank == mine) {
        return true;
    }
    if (w.rank > leader.rank ? !is_stale(&w, now) : w.rank == leader.rank && is_newer(w.count, leader.count)) {
        follow(&w, now);
    } else if (w.rank == leader.rank && w.count == leader.count && copies < ENOUGH) {
        copies++;
    } else if (w.rank < leader.rank && leader.rank == mine && (sint16)(next - now) > ANSWER_MS) {
        next = (uint16)(now + draw(ANSWER_MS));
    }
    return true;
}

/* Whether a message is due: the own count, or the leader's count for robots that have not received it. */
static bool is_due(word *w, uint16 now)
{
    if (leader.rank != mine && (uint16)(now - heard_at) > patience) {
        given_up = leader;
        given_up_at = now;
        leader = (word){mine, (uint8)draw(256)};
        next = now;
    }
    if ((sint16)(now - next) < 0) {
        return false;
    }
    if (leader.rank == mine) {
        leader.count++;
        next = (uint16)(now + PERIOD_MS * 3 / 4 + draw(PERIOD_MS / 2));
    } else if (copies < ENOUGH) {
        copies = ENOUGH; /* once */
    } else {
        return false;
    }
    *w = leader;
    return true;
}

static void say(const char *what, uint16 who)
{
    char line[LINE];
    snprintf(line, sizeof line, "%s %u\n", what, who);
    Sys_Send_Event(SYS_SEND_UART1, line, (uint16)strlen(line));
}

/* Starts the election again: the robot has drawn its number, or a user has turned the selector. */
static void become_candidate(void)
{
    mine = rank();
    random_state += mine;
    leader = (word){mine, (uint8)draw(256)};
    next = (uint16)(Sys_Get_SystemTime() + draw(FIRST_MS));
}

static void lead(void *unused)
{
    uint16 said = 0;
    (void)unused;
    for (;;) {
        word w;
        Sys_Sleep(LOOK_MS);
        if (Sys_Get_RobotNumber() == 0) {
            continue; /* not drawn yet */
        }
        bool is_new = mine != rank();
        Sys_Start_CriticalSection();
        if (is_new) {
            become_candidate();
        }
        bool speaks = is_due(&w, (uint16)Sys_Get_SystemTime());
        uint16 who = leader.rank;
        Sys_End_CriticalSection();
        if (speaks) {
            (void)Sys_Send_Neighbours(&w, WORD_BYTES);
        }
        if (is_new) {
            say("rank", mine);
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
    Sys_Subscribe_to_Event(SYS_NEIGHBOUR_MESSAGE, 0, on_message, NULL);
    const sys_process_config thread = {.entry = lead, .stack = STACK};
    SYS_ASSERT(Sys_Start_ProcessWith(&thread) != 0);
    Sys_Start_Kernel();
    Sys_Run_SystemThread();
    return 0;
}
