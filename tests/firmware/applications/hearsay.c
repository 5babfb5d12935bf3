/* Forwarded information in apps/average: two robots tell each other of a third robot while it works, after it has
 * failed, and when they meet late. Messages wait for up to a second, and handlers run late. A failure ends with status
 * 1. */
#define main application
#include "apps/average/main.c"
#undef main

#include <stdlib.h>

enum { ROBOTS = 2, THIRD = 9, VALUE_OF_THIRD = 7, STEP = 5, AIR = 105, LATE_HANDLER = 60, MOST_WAIT = 1000 };

static struct {
    entry others[OTHERS];
    uint8 message[MESSAGE_BYTES];
    uint32 leaves_at, arrives_at; /* times in ms; 0: no message */
} robots[ROBOTS];
static uint32 now, seed = 1;
static uint16 number;

uint32 Sys_Get_SystemTime(void)
{
    return now;
}

uint16 Sys_Get_RobotNumber(void)
{
    return number;
}

static uint32 chance(uint32 below)
{
    seed = seed * 1664525u + 1013904223u;
    return (seed >> 8) % below;
}

static void enter(int n)
{
    number = (uint16)(n + 1);
    memcpy(others, robots[n].others, sizeof others);
}

static void leave(void)
{
    memcpy(robots[number - 1].others, others, sizeof others);
}

static void hear(int n, uint16 source, const uint8 *message)
{
    sys_neighbour_message m = {source, 100, 0, 0, MESSAGE_BYTES, {0}};
    sys_event_data data;
    memset(&data, 0, sizeof data);
    memcpy(m.payload, message, MESSAGE_BYTES);
    data.payload = &m;
    data.size = sizeof m;
    enter(n);
    on_message(0, SYS_NEIGHBOUR_MESSAGE, &data);
    leave();
}

static void hear_third(int n)
{
    uint8 message[MESSAGE_BYTES] = {VALUE_OF_THIRD};
    hear(n, THIRD, message);
}

static uint8 count(int n)
{
    uint8 all, near;
    enter(n);
    (void)mean(0, tick(), &all, &near);
    leave();
    return all;
}

static void speak(int n)
{
    robots[n].message[VALUE] = 0;
    robots[n].message[QUEUED_AT] = (uint8)tick();
    enter(n);
    tell_others(robots[n].message + OWN_BYTES, tick());
    leave();
    robots[n].leaves_at = now + 1 + chance(MOST_WAIT);
}

/* Simulates a number of ms, in which the two robots exchange messages if they meet. */
static void pass(uint32 ms, bool they_meet)
{
    for (uint32 end = now + ms; now < end; now += STEP) {
        for (int n = 0; n < ROBOTS; n++) {
            if (robots[n].arrives_at != 0 && now >= robots[n].arrives_at) {
                hear(1 - n, (uint16)(n + 1), robots[n].message);
                robots[n].arrives_at = 0;
            } else if (robots[n].leaves_at != 0 && now >= robots[n].leaves_at) {
                leaves(robots[n].message, MESSAGE_BYTES);
                robots[n].leaves_at = 0;
                robots[n].arrives_at = now + AIR + chance(LATE_HANDLER);
            } else if (they_meet && robots[n].leaves_at == 0 && robots[n].arrives_at == 0 && chance(40) == 0) {
                speak(n);
            }
            (void)count(n);
        }
    }
}

static void check(bool is_true, const char *what)
{
    if (!is_true) {
        printf("failed: %s (at %lu ms)\n", what, (unsigned long)now);
        exit(1);
    }
}

static void begin(uint32 at)
{
    memset(robots, 0, sizeof robots);
    now = at;
}

int main(void)
{
    const uint32 moments[] = {1000, 60000, (0x10000u << TICK_SHIFT) - 9000u}; /* in the last, ticks wrap */
    for (int i = 0; i < 3; i++) {
        begin(moments[i]);
        hear_third(0);
        pass(6000, false);
        check(count(0) == 2 && count(1) == 1, "one robot has met the third, no other has");
        pass(4000, true);
        check(count(0) == 3 && count(1) == 3, "who meets that one later hears of it");
        uint32 gone = now - 10000u + (FORGET << TICK_SHIFT);
        while (now < gone + (1u << TICK_SHIFT)) {
            pass(STEP, true);
        }
        for (int step = 0; step < 1000; step++) {
            check(count(0) == 2 && count(1) == 2, "a failed robot expires whichever robot forwards it, and does not return");
            pass(100, true);
        }
        for (int step = 0; step < 30; step++) {
            hear_third(0);
            pass(3000, true);
            check(count(0) == 3 && count(1) == 3, "one that is heard by another now and then counts");
        }
    }
    printf("it was known and forgotten\n");
    return 0;
}
