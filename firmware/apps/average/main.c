/* The mean of a number that each robot has, by gossip (README.md). A message carries the sender's number and two that it has
 * heard of; each robot keeps a table and takes the mean of those robots that still count. */
#include "rove.h"

#include <openswarm.h>
#include <openswarm_infrared.h>
#include <openswarm_io.h>
#include <stdio.h>
#include <string.h>

enum {
    OTHERS = 10,      /* robots that are remembered beside the own */
    TOLD = 2,         /* of them in a message */
    PACE_MS = 200,    /* between two robots' messages, so the air is busy for half of the time, however many there are */
    RELAY_MS = 1500,  /* for which a count is passed on */
    FORGET_MS = 8000, /* without a new count: a robot that is silent for so long is gone, and its number with it */
    NUMBER_BITS = 11, /* of a robot */
    COUNTS = 32,      /* a robot counts its messages, modulo so many */
    LOOK_MS = 50, LINE = 16, STACK = 280
};

typedef struct {
    uint16 who; /* number, count above; 0: nobody */
    uint8 value;
} item;

enum { ITEM_BYTES = 3, OWN_BYTES = 2, MESSAGE_BYTES = OWN_BYTES + TOLD * ITEM_BYTES };

typedef struct {
    item last;    /* kept when it is forgotten, so that its old counts do not come back */
    bool counts;  /* among those of whom the mean is */
    uint16 heard; /* low word of the system time */
} entry;

static entry others[OTHERS];

static uint16 number_of(const item *i)
{
    return i->who & ((1u << NUMBER_BITS) - 1u);
}

static uint8 count_of(const item *i)
{
    return (uint8)(i->who >> NUMBER_BITS);
}

static bool is_newer(uint8 count, uint8 than)
{
    uint8 ahead = (uint8)((count - than) % COUNTS);
    return ahead != 0 && ahead < COUNTS / 2;
}

static uint16 age(const entry *e, uint16 now)
{
    return (uint16)(now - e->heard);
}

/* Its own place, or that of the one who has been silent for longest among those who do not count. */
static entry *place_of(uint16 number, uint16 now)
{
    entry *best = NULL;
    for (entry *e = others; e != others + OTHERS; e++) {
        if (number_of(&e->last) == number) {
            return e;
        }
        if (!e->counts && (best == NULL || age(e, now) > age(best, now))) {
            best = e;
        }
    }
    return best;
}

/* What a robot itself says is new; what others say of it only if its count is. */
static void learn(const item *i, bool is_own_word, uint16 now)
{
    uint16 number = number_of(i);
    if (number == 0 || number == Sys_Get_RobotNumber()) {
        return;
    }
    entry *e = place_of(number, now);
    if (e != NULL && (is_own_word || number_of(&e->last) != number || is_newer(count_of(i), count_of(&e->last)))) {
        *e = (entry){*i, true, now};
    }
}

static bool on_message(uint16 pid, uint16 event, sys_event_data *data)
{
    const sys_neighbour_message *m = data->payload;
    const uint8 *from = m->payload + OWN_BYTES;
    uint16 now = (uint16)Sys_Get_SystemTime();
    (void)pid;
    (void)event;
    if (m->size == MESSAGE_BYTES) {
        item own = {(uint16)(m->source | (uint16)m->payload[1] << NUMBER_BITS), m->payload[0]};
        learn(&own, true, now);
        for (uint8 told = 0; told < TOLD; told++, from += ITEM_BYTES) {
            item i = {(uint16)(from[0] | (uint16)from[1] << 8), from[2]};
            learn(&i, false, now);
        }
    }
    return true;
}

/* Others in turn, as long as what is known of them is fresh. */
static void tell_others(uint8 *to, uint16 now)
{
    static uint8 turn;
    memset(to, 0, TOLD * ITEM_BYTES);
    for (uint8 looked = 0, told = 0; looked < OTHERS && told < TOLD; looked++) {
        turn = (uint8)((turn + 1u) % OTHERS);
        const entry *e = others + turn;
        if (e->counts && age(e, now) < RELAY_MS) {
            to[0] = (uint8)e->last.who;
            to[1] = (uint8)(e->last.who >> 8);
            to[2] = e->last.value;
            to += ITEM_BYTES;
            told++;
        }
    }
}

/* Hundredths; and how many robots it is of. */
static uint16 mean(uint8 own, uint16 now, uint8 *robots)
{
    uint16 sum = own;
    *robots = 1;
    for (entry *e = others; e != others + OTHERS; e++) {
        e->counts = e->counts && age(e, now) < FORGET_MS;
        if (e->counts) {
            sum = (uint16)(sum + e->last.value);
            ++*robots;
        }
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
    uint8 said_value = 0xFF, count = 0;
    (void)unused;
    for (;;) {
        uint8 message[MESSAGE_BYTES], robots, value = (uint8)Sys_Get_Selector();
        Sys_Sleep(LOOK_MS);
        uint16 now = (uint16)Sys_Get_SystemTime();
        bool speaks = (sint16)(now - next) >= 0 && Sys_Get_RobotNumber() != 0;
        Sys_Start_CriticalSection();
        uint16 is = mean(value, now, &robots);
        if (speaks) {
            tell_others(message + OWN_BYTES, now);
        }
        Sys_End_CriticalSection();
        if (speaks) {
            uint16 pace = (uint16)(PACE_MS * robots);
            random = (uint16)(random * 25173u + 13849u + Sys_Get_RobotNumber());
            next = (uint16)(now + pace * 3u / 4u + (random >> 4) % (pace / 2u));
            message[0] = value;
            message[1] = count;
            count = (uint8)((count + 1u) % COUNTS);
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
    const sys_process_config talker = {.entry = gossip, .stack = STACK};
    SYS_ASSERT(Sys_Start_ProcessWith(&talker) != 0);
    Sys_Start_Kernel();
    Sys_Run_SystemThread();
    return 0;
}
