/* Gossip average (README.md): a message has the sender's number and those of two other robots, with the ages of their last
 * messages. Each robot keeps a table and computes the mean of the numbers that have not expired. */
#include "rove.h"

#include <openswarm.h>
#include <openswarm_infrared.h>
#include <openswarm_io.h>
#include <stdio.h>
#include <string.h>

enum {
    OTHERS = 10,       /* robots that are remembered beside the own */
    TOLD = 2,          /* of them in a message */
    PACE_MS = 200,     /* between two robots' messages, so the air is busy for half of the time, however many there are */
    TICK_SHIFT = 6,    /* signs of life are dated in ticks of 64 ms */
    HOP = 3,           /* ticks: more than a message takes from its first light to its handler, dates being rounded down */
    FORGET = 208,      /* 13.3 s without a sign of life: that robot is gone, and its number with it */
    NEAR = 78,         /* 5 s after its last own message a robot is taken to be out of sight */
    MOST_AGE = 0xFF,   /* ticks, in a message */
    NUMBER_BITS = 11,  /* of a robot */
    VALUE_MOST = 15,   /* the selector: so number and value share two bytes */
    LOOK_MS = 50, LINE = 16, STACK = 280
};

enum { VALUE, QUEUED_AT, OWN_BYTES }; /* the own value, and while the message waits, when it was written */
enum { WHO_LOW, WHO_HIGH, AGE, ITEM_BYTES };
enum { MESSAGE_BYTES = OWN_BYTES + TOLD * ITEM_BYTES };

typedef struct {
    uint16 number; /* 0: free entry */
    uint8 value;
    bool counts;  /* included in the mean */
    uint16 alive; /* tick of the last sign of life that is known of */
    uint16 heard; /* tick of its last message that came here */
    bool is_near; /* `heard` is no older than NEAR */
} entry;

static entry others[OTHERS];

static uint16 tick(void)
{
    return (uint16)(Sys_Get_SystemTime() >> TICK_SHIFT);
}

/* The place of a robot, or of one that does not count. */
static entry *place_of(uint16 number)
{
    entry *best = NULL;
    for (entry *e = others; e != others + OTHERS; e++) {
        if (e->counts && e->number == number) {
            return e;
        }
        if (!e->counts) {
            best = e;
        }
    }
    return best;
}

/* Records a sign of life of a certain age in ticks, received from the robot itself or from another one. Ages only grow on
 * their way, so a failed robot's age is never too small. */
static entry *learn(uint16 number, uint8 value, uint16 age, uint16 now)
{
    uint16 alive = (uint16)(now - age);
    if (number == 0 || number == Sys_Get_RobotNumber() || age >= FORGET) {
        return NULL;
    }
    entry *e = place_of(number);
    if (e != NULL && !e->counts) {
        *e = (entry){number, value, true, alive, 0, false};
    } else if (e != NULL && (sint16)(alive - e->alive) > 0) {
        e->value = value;
        e->alive = alive;
    }
    return e;
}

static bool on_message(uint16 pid, uint16 event, sys_event_data *data)
{
    const sys_neighbour_message *m = data->payload;
    const uint8 *from = m->payload + OWN_BYTES;
    uint16 now = tick();
    (void)pid;
    (void)event;
    if (m->size == MESSAGE_BYTES) {
        entry *sender = learn(m->source, m->payload[VALUE] & VALUE_MOST, HOP, now);
        if (sender != NULL) {
            sender->heard = now;
            sender->is_near = true;
        }
        for (uint8 told = 0; told < TOLD; told++, from += ITEM_BYTES) {
            uint16 who = (uint16)(from[WHO_LOW] | (uint16)from[WHO_HIGH] << 8);
            (void)learn(who & ((1u << NUMBER_BITS) - 1u), (uint8)(who >> NUMBER_BITS) & VALUE_MOST, from[AGE] + HOP, now);
        }
    }
    return true;
}

/* Others in turn. */
static void tell_others(uint8 *to, uint16 now)
{
    static uint8 turn;
    memset(to, 0, TOLD * ITEM_BYTES);
    for (uint8 looked = 0, told = 0; looked < OTHERS && told < TOLD; looked++) {
        turn = (uint8)((turn + 1u) % OTHERS);
        const entry *e = others + turn;
        if (e->counts) {
            uint16 who = (uint16)(e->number | (uint16)e->value << NUMBER_BITS);
            to[WHO_LOW] = (uint8)who;
            to[WHO_HIGH] = (uint8)(who >> 8);
            to[AGE] = (uint8)(now - e->alive);
            to += ITEM_BYTES;
            told++;
        }
    }
}

/* ISR at the begin of a transmission: adds the queueing delay to the ages in it. */
static void leaves(uint8 *payload, uint8 size)
{
    uint8 waited = (uint8)((uint8)tick() - payload[QUEUED_AT]);
    for (uint8 *age = payload + OWN_BYTES + AGE; age < payload + size; age += ITEM_BYTES) {
        *age = (uint8)(*age > MOST_AGE - waited ? MOST_AGE : *age + waited);
    }
}

/* Hundredths; and how many robots it is of, and how many are near. */
static uint16 mean(uint8 own, uint16 now, uint8 *robots, uint8 *near)
{
    uint16 sum = own;
    *robots = *near = 1;
    for (entry *e = others; e != others + OTHERS; e++) {
        e->counts = e->counts && (uint16)(now - e->alive) < FORGET;
        e->is_near = e->is_near && e->counts && (uint16)(now - e->heard) < NEAR;
        if (e->counts) {
            sum = (uint16)(sum + e->value);
            ++*robots;
        }
        *near = (uint8)(*near + e->is_near);
    }
    return (uint16)(((uint32)sum * 100u + *robots / 2u) / *robots);
}

static void say(const char *what, uint16 number)
{
    char line[LINE];
    snprintf(line, sizeof line, "%s %u\n", what, number);
    Sys_Send_Event(SYS_SEND_UART1, line, (uint16)strlen(line));
}

static void gossip(void *unused)
{
    uint16 random = 0, next = 0, said_mean = 0xFFFF;
    uint8 said_value = 0xFF;
    (void)unused;
    for (;;) {
        uint8 message[MESSAGE_BYTES], robots, near, value = (uint8)Sys_Get_Selector();
        Sys_Sleep(LOOK_MS);
        uint16 now = (uint16)Sys_Get_SystemTime(), now_tick = tick();
        bool speaks = (sint16)(now - next) >= 0 && Sys_Get_RobotNumber() != 0;
        Sys_Start_CriticalSection();
        uint16 is = mean(value, now_tick, &robots, &near);
        if (speaks) {
            tell_others(message + OWN_BYTES, now_tick);
        }
        Sys_End_CriticalSection();
        if (speaks) {
            uint16 pace = (uint16)(PACE_MS * near);
            random = (uint16)(random * 25173u + 13849u + Sys_Get_RobotNumber());
            next = (uint16)(now + pace * 3u / 4u + (random >> 4) % (pace / 2u));
            message[VALUE] = value;
            message[QUEUED_AT] = (uint8)now_tick;
            (void)Sys_Send_Neighbours(message, sizeof message);
        }
        if (value != said_value) {
            say("value", said_value = value);
        }
        if (is != said_mean) {
            say("mean", said_mean = is);
        }
    }
}

int main(void)
{
    Sys_Init_Kernel();
    SYS_ASSERT(Sys_Start_Infrared() && rove_begin());
    Sys_Subscribe_to_Event(SYS_NEIGHBOUR_MESSAGE, 0, on_message, NULL);
    Sys_Set_LeavingProcessor(leaves);
    const sys_process_config talker = {.entry = gossip, .stack = STACK};
    SYS_ASSERT(Sys_Start_ProcessWith(&talker) != 0);
    Sys_Start_Kernel();
    Sys_Run_SystemThread();
    return 0;
}
