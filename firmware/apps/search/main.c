/* A search that robots share (README.md): the number below 2^16 with the longest Collatz sequence. Each robot searches
 * parts that it does not know to be done, and sends the set of done parts and the best number so far. */
#include "hal_compiler.h"
#include "rove.h"

#include <openswarm.h>
#include <openswarm_infrared.h>
#include <openswarm_io.h>
#include <stdio.h>
#include <string.h>

enum {
    PARTS = 32,     /* bits of a word */
    PART_BITS = 11, /* numbers of a part */
    BEST_BYTES = 2,
    PAUSE_MS = 450, /* shortest pause between messages, the longest is twice that: five robots use half of the time */
    LOOK_MS = 50, LINE = 16, SEARCH_STACK = 160, TELL_STACK = 240
};

static const uint32 ALL = 0xFFFFFFFFu;

typedef struct {
    uint32 done; /* a bit per part */
    uint8 best[BEST_BYTES];
} word;

enum { WORD_BYTES = sizeof(uint32) + BEST_BYTES };

static uint32 done, best = 1;
static uint16 best_steps;

/* Returns the length of a Collatz sequence. None that starts below 2^16 reaches 2^32; the longest starts at 52527. */
BOUNDS_AT("while (number > 1)", loop 339);
static uint16 steps_of(uint32 number)
{
    uint16 steps = 0;
    while (number > 1) {
        number = (number & 1u) != 0 ? 3u * number + 1u : number >> 1;
        steps++;
    }
    return steps;
}

/* Adds done parts and a candidate. The steps of a received candidate are computed here: a wrong one has no effect. */
static void learn(uint32 parts, uint32 number)
{
    uint16 steps = steps_of(number);
    Sys_Start_CriticalSection();
    done |= parts;
    if (steps > best_steps || (steps == best_steps && number < best)) {
        best = number;
        best_steps = steps;
    }
    Sys_End_CriticalSection();
}

static bool on_message(uint16 pid, uint16 event, sys_event_data *data)
{
    const sys_neighbour_message *m = data->payload;
    (void)pid;
    (void)event;
    if (m->size == WORD_BYTES) {
        uint32 parts, number = 0;
        memcpy(&parts, m->payload, sizeof parts);
        memcpy(&number, m->payload + sizeof parts, BEST_BYTES);
        learn(parts, number);
    }
    return true;
}

static uint32 best_of(uint8 part)
{
    uint32 number = (uint32)part << PART_BITS, end = number + (1u << PART_BITS), found = number;
    for (uint16 most = 0; number != end; number++) {
        uint16 steps = steps_of(number);
        if (steps > most) {
            most = steps;
            found = number;
        }
    }
    return found;
}

/* Robots begin at random parts, so that few search the same one. */
static void search(void *unused)
{
    uint16 random = 0;
    (void)unused;
    while (Sys_Get_RobotNumber() == 0) {
        Sys_Sleep(LOOK_MS);
    }
    for (;;) {
        Sys_Start_CriticalSection();
        uint32 left = ~done;
        Sys_End_CriticalSection();
        if (left == 0) {
            Sys_Sleep(0xFFFF);
            continue;
        }
        random = (uint16)(random * 25173u + 13849u + Sys_Get_RobotNumber());
        uint8 part = (uint8)((random >> 4) % PARTS);
        while ((left >> part & 1u) == 0) {
            part = (uint8)((part + 1u) % PARTS);
        }
        learn((uint32)1 << part, best_of(part));
    }
}

static void say(const char *what, uint32 number)
{
    char line[LINE];
    snprintf(line, sizeof line, "%s %lu\n", what, number);
    Sys_Send_Event(SYS_SEND_UART1, line, (uint16)strlen(line));
}

static uint16 ones(uint32 bits)
{
    uint16 count = 0;
    for (; bits != 0; bits &= bits - 1u) {
        count++;
    }
    return count;
}

static void tell(void *unused)
{
    uint16 random = 0, next = 0;
    uint32 said_done = 0, said_best = 0;
    (void)unused;
    for (;;) {
        Sys_Sleep(LOOK_MS);
        uint16 now = (uint16)Sys_Get_SystemTime();
        word w;
        Sys_Start_CriticalSection();
        uint32 is_done = done, is_best = best;
        Sys_End_CriticalSection();
        if ((sint16)(now - next) >= 0 && is_done != 0) {
            random = (uint16)(random * 25173u + 13849u + Sys_Get_RobotNumber());
            next = (uint16)(now + PAUSE_MS + (random >> 4) % PAUSE_MS);
            w.done = is_done;
            memcpy(w.best, &is_best, BEST_BYTES);
            (void)Sys_Send_Neighbours(&w, WORD_BYTES);
        }
        if (is_best != said_best) {
            say("best", said_best = is_best);
        }
        if (is_done != said_done) {
            said_done = is_done;
            say("done", ones(is_done));
            Sys_Set_LED(SYS_LED_BODY, is_done == ALL);
        }
    }
}

int main(void)
{
    Sys_Init_Kernel();
    SYS_ASSERT(Sys_Start_Infrared() && rove_begin());
    Sys_Subscribe_to_Event(SYS_NEIGHBOUR_MESSAGE, 0, on_message, NULL);
    const sys_process_config searcher = {.entry = search, .stack = SEARCH_STACK};
    const sys_process_config talker = {.entry = tell, .stack = TELL_STACK};
    SYS_ASSERT(Sys_Start_ProcessWith(&searcher) != 0 && Sys_Start_ProcessWith(&talker) != 0);
    Sys_Start_Kernel();
    Sys_Run_SystemThread();
    return 0;
}
