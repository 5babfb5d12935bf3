/* Robots in a row whose cells are RAM, with one medium of frames: who hears two at once or sends itself hears nothing, and a
 * share of the rest is lost. One robot has a program; printed is when all have it, and what it took. An argument: so many
 * seeds, and 22 rows as well. */
#include "update.c"

#include "spread.c"

#include <stdio.h>
#include <stdlib.h>

enum { MOST = 30, STEP = 15, FRAME = 105, ROWS_MOST = HAL_UPDATE_ROWS + 1 };

typedef struct {
    uint8 rows[HAL_UPDATE_STORES + 1][ROWS_MOST][HAL_UPDATE_ROW];
    uint16 flags[HAL_UPDATE_STORES];
    uint8 target, running, stored, row, asked, wanted_row, heard, failures, worn, refused, buffer[PARTS * PART];
    sys_update coming, have, want, failed;
    uint32 missing, clock, interval, begun, advertise_at, ask_at, noise, lacking, wanted_parts;
    bool is_active;
    uint8 frame[SYS_SPREAD_BYTES];
    int sends_until, waits_until; /* ms */
} robot;

static robot robots[MOST], *me;
static long frames[8], lost, collided;
static uint32 seed;

static uint16 random_below(uint16 below)
{
    seed = seed * 1664525u + 1013904223u;
    return (uint16)((seed >> 16) % below);
}

void hal_update_read(uint8_t slot, uint8_t r, uint8_t *bytes)
{
    memcpy(bytes, me->rows[slot][r], HAL_UPDATE_ROW);
}

void hal_update_erase(uint8_t slot, uint8_t r)
{
    memset(me->rows[slot][r], 0xFF, HAL_UPDATE_ROW);
}

void hal_update_write(uint8_t slot, uint8_t r, const uint8_t *bytes)
{
    for (int i = 0; i < HAL_UPDATE_ROW; i++) {
        me->rows[slot][r][i] &= bytes[i];
    }
}

uint16_t hal_update_flags(uint8_t store)
{
    return me->flags[store];
}

void hal_update_clear(uint8_t store, uint16_t bits)
{
    me->flags[store] &= (uint16)~bits;
}

void hal_update_renew(uint8_t store)
{
    me->flags[store] = 0xFFFF;
}

void hal_update_run(void)
{
}

/* The firmware's variables are those of one robot at a time. */
#define EACH(move)                                                                                                          \
    move(target) move(running) move(stored) move(row) move(asked) move(wanted_row) move(heard) move(coming) move(have) move(want)      \
        move(missing) move(clock) move(interval) move(begun) move(advertise_at) move(ask_at) move(noise) move(lacking)     \
            move(wanted_parts) move(is_active) move(failures) move(failed) move(worn) move(refused)
#define TAKE(name) name = me->name;
#define KEEP(name) me->name = name;

static void enter(int n)
{
    me = robots + n;
    EACH(TAKE)
    memcpy(buffer, me->buffer, sizeof buffer);
}

static void leave(void)
{
    EACH(KEEP)
    memcpy(me->buffer, buffer, sizeof buffer);
}

static void provide(uint16 version, uint8 rows)
{
    uint8 image[HAL_UPDATE_ROWS][HAL_UPDATE_ROW];
    sys_update facts = {version, rows, 0xFFFFFFFFu};
    for (uint8 r = 0; r < rows; r++) {
        for (int i = 0; i < HAL_UPDATE_ROW; i++) {
            image[r][i] = (uint8)random_below(256);
        }
        facts.crc = Sys_Add_UpdateCrc(facts.crc, image[r], HAL_UPDATE_ROW);
    }
    facts.crc ^= 0xFFFFFFFFu;
    bool is_done = Sys_Begin_Update(&facts);
    for (uint8 r = 0; r < rows; r++) {
        is_done = Sys_Put_UpdateRow(r, image[r]) && is_done;
    }
    if (!is_done || !Sys_End_Update()) {
        printf("failed: the first robot does not take it\n");
        exit(1);
    }
}

/* How many have the version, activated or not. */
static int count(int number, uint16 version, bool activated)
{
    int found = 0;
    for (int n = 0; n < number; n++) {
        found += robots[n].have.version == version && (robots[n].is_active || !activated);
    }
    return found;
}

/* Frames that end now, to everybody in sight of their senders. */
static void deliver(int number, int reach, int now, int loss)
{
    for (int n = 0; n < number; n++) {
        int senders = 0, from = -1;
        for (int k = n - reach; k <= n + reach; k++) {
            if (k >= 0 && k < number && k != n && robots[k].sends_until > now - FRAME && robots[k].sends_until != 0) {
                senders++;
                from = robots[k].sends_until == now ? k : from;
            }
        }
        bool is_deaf = robots[n].sends_until > now - FRAME && robots[n].sends_until != 0;
        if (from >= 0 && (is_deaf || senders > 1)) {
            collided++;
        } else if (from >= 0 && random_below(100) < loss) {
            lost++;
        } else if (from >= 0) {
            enter(n);
            Sys_Hear_Update(robots[from].frame);
            leave();
        }
    }
}

static void trial(int number, int reach, uint8 rows, int loss)
{
    memset(robots, 0, sizeof robots);
    memset(frames, 0, sizeof frames);
    lost = collided = 0;
    for (int n = 0; n < number; n++) {
        memset(robots[n].rows, 0xFF, sizeof robots[n].rows);
        robots[n].flags[0] = robots[n].flags[1] = 0xFFFF;
        robots[n].target = robots[n].running = robots[n].stored = NONE;
        enter(n);
        if (n == 0) {
            provide(7, rows);
        }
        Sys_Start_Spreading((uint16)(seed + n + 1));
        leave();
    }
    int now = STEP, all = 0, active = 0, limit = 3600000, quiet = 0;
    long by_then = 0;
    for (; now < limit && (active == 0 || now < active + 300000); now += STEP) {
        deliver(number, reach, now, loss);
        for (int n = 0; n < number; n++) {
            bool is_busy = now < robots[n].waits_until || now < robots[n].sends_until;
            for (int k = n - reach; k <= n + reach && !is_busy; k++) {
                is_busy = k >= 0 && k < number && robots[k].sends_until > now;
            }
            if (is_busy) {
                continue;
            }
            enter(n);
            if (Sys_Spread((uint32)now, me->frame)) {
                frames[me->frame[0] >> 5]++;
                me->sends_until = now + FRAME - FRAME % STEP;
                quiet += active != 0;
            }
            me->waits_until = now + SYS_SPREAD_TICK + random_below(8) * STEP;
            leave();
        }
        if (all == 0 && count(number, 7, false) == number) {
            all = now;
            by_then = frames[4] + frames[5] + frames[6];
            enter(0);
            if (!Sys_Offer_Activation(7)) {
                printf("failed: not activated\n");
                exit(1);
            }
            leave();
        }
        if (active == 0 && count(number, 7, true) == number) {
            active = now;
        }
    }
    printf("%d robots, reach %d, %u rows, %d %% lost: whole %.1f s, active %.1f s, %ld frames, %ld data, %ld requests,"
           " %ld collided, then %d in 300 s\n",
           number, reach, rows, loss, all / 1e3, active / 1e3, by_then, frames[6], frames[5], collided, quiet);
    if (all == 0 || active == 0) {
        printf("failed: not everybody has it\n");
        exit(1);
    }
    for (int n = 0; n < number; n++) {
        enter(n);
        if (Sys_Start_Update() != 7 || memcmp(me->rows[HAL_UPDATE_RUN], robots[0].rows[0][1], rows * HAL_UPDATE_ROW) != 0) {
            printf("failed: robot %d does not run it\n", n);
            exit(1);
        }
        leave();
    }
}

/* Messages of chance: nothing breaks, and the program that works goes on. */
static void babble(void)
{
    enter(1);
    Sys_Confirm_Update();
    for (long n = 0; n < 100000; n++) {
        uint8 message[SYS_SPREAD_BYTES];
        for (int i = 0; i < SYS_SPREAD_BYTES; i++) {
            message[i] = (uint8)random_below(256);
        }
        if (n % 3 != 0) { /* what fits: the version that it wants, and rows that it has */
            message[0] = (uint8)(DATA | row);
            message[1] = (uint8)((message[1] & 0xF8) | identity(&want) >> 8);
            message[2] = (uint8)identity(&want);
        }
        Sys_Hear_Update(message);
        Sys_Spread((uint32)(n * SYS_SPREAD_TICK), message);
    }
    if (Sys_Start_Update() != 7) {
        printf("failed: 7 does not run after messages of chance\n");
        exit(1);
    }
    leave();
}

int main(int count_of_words, char **words)
{
    int seeds = count_of_words > 1 ? atoi(words[1]) : 0;
    for (int s = 1; s <= (seeds > 0 ? seeds : 2); s++) {
        seed = (uint32)s;
        trial(2, 1, 2, 0);
        trial(3, 2, 4, 30);
        trial(30, 3, 2, 30);
        if (seeds > 0) {
            trial(10, 2, 22, 30);
            trial(30, 29, 22, 30);
            trial(30, 3, 22, 30);
        }
    }
    babble();
    printf("whatever was said\n");
    return 0;
}
