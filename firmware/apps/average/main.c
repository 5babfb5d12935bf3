/* Gossip average (README.md): a message contains the values of the sender and of two other robots, with the ages of
 * their last messages. Each robot keeps a table of values and computes the mean of those that have not expired. */
#include "rove.h"

#include <openswarm.h>
#include <openswarm_infrared.h>
#include <openswarm_io.h>
#include <stdio.h>
#include <string.h>

enum {
    OTHERS = 10,       /* other robots in the table */
    TOLD = 2,          /* other robots in a message */
    PACE_MS = 200,     /* pause between messages per near robot: the air is busy for half of the time in any group */
    TICK_SHIFT = 6,    /* times of messages are in ticks of 64 ms */
    HOP = 3,           /* ticks added per hop: more than a message takes from its first light to its handler */
    FORGET = 208,      /* ticks, 13.3 s, without a heartbeat: the robot has failed, and its value no longer counts */
    NEAR = 78,         /* ticks, 5 s, after the last direct message: the robot is out of reach */
    MOST_AGE = 0xFF,   /* ticks: greatest age in a message */
    NUMBER_BITS = 11,  /* of a robot's number */
    VALUE_MOST = 15,   /* greatest selector position: value and number share two bytes */
    LOOK_MS = 50, LINE = 16, STACK = 280
};

enum { VALUE, QUEUED_AT, OWN_BYTES }; /* own value; low byte of the tick at which the message was queued */
enum { WHO_LOW, WHO_HIGH, AGE, ITEM_BYTES };
enum { MESSAGE_BYTES = OWN_BYTES + TOLD * ITEM_BYTES };

typedef struct {
    uint16 number; /* 0: free entry */
    uint8 value;
    bool counts;  /* included in the mean */
    uint16 alive; /* tick of the last known heartbeat */
    uint16 heard; /* tick of its last message that this robot received */
    bool is_near; /* `heard` is no older than NEAR */
} entry;

static entry others[OTHERS];

static uint16 tick(void)
{
    return (uint16)(Sys_Get_SystemTime() >> TICK_SHIFT);
}

/* Returns the entry of a robot, or else a free one, or NULL. */
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

/* Records a heartbeat that is `age` ticks old, received from the robot itself or through another one. Each hop adds to
 * the age, so the age of a failed robot is never too small. */
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

/* Writes the next TOLD other robots to a message, in turn. */
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

/* ISR at the start of a transmission: adds the queueing delay to the ages in the message. */
static void leaves(uint8 *payload, uint8 size)
{
    uint8 waited = (uint8)((uint8)tick() - payload[QUEUED_AT]);
    for (uint8 *age = payload + OWN_BYTES + AGE; age < payload + size; age += ITEM_BYTES) {
        *age = (uint8)(*age > MOST_AGE - waited ? MOST_AGE : *age + waited);
    }
}

/* Returns the mean in hundredths; stores how many robots count, and how many of them are near, this one included. */
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
