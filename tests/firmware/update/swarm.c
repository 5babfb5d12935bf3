/* A swarm of robots in a row, with flash cells in RAM and one shared medium. A robot receives nothing while it sends or
 * while several neighbours send; a share of the other frames is lost. One or two robots start with a program; the test
 * prints when all have it, and how many frames that took. A deaf robot, which requests the first row for ever, and a
 * greedy robot, which has all rows and requests them, may take part. The argument is a number of seeds; it also adds
 * programs of 22 rows. */
#include "update.c"

#include "spread.c"

#include <stdio.h>
#include <stdlib.h>

enum { MOST = 30, STEP = 15, FRAME = 105, ROWS_MOST = HAL_UPDATE_ROWS + 1, LIMIT = 10800000 /* ms */ };
enum { NORMAL, DEAF, GREEDY };

typedef struct {
    int robots, reach, loss, within; /* range in robots, loss in %, time limit in s for nine of ten */
    uint8 rows, early;               /* number of robots that start with the program */
    bool with_naggers;               /* adds a deaf and a greedy robot, which do not count among the nine of ten */
} scenario;

typedef struct {
    uint8 rows[HAL_UPDATE_STORES + 1][ROWS_MOST][HAL_UPDATE_ROW];
    uint16 flags[HAL_UPDATE_STORES];
    uint8 target, running, stored, row, asked, doublings, wanted_row, part_sent, heard, failures, worn, refused;
    uint8 buffer[PARTS * PART], served[HAL_UPDATE_ROWS], frame[SYS_SPREAD_BYTES];
    sys_update coming, have, want, vain, failed;
    uint32 missing, clock, interval, begun, advertise_at, ask_at, useful_at, forgiven_at, noise, lacking, wanted_parts;
    bool is_active, is_asking, is_polite;
    int role, sends_until, waits_until, asks_at; /* ms */
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

/* Applies an operation to each firmware variable: their values belong to one robot at a time. */
#define EACH(move)                                                                                                     \
    move(target) move(running) move(stored) move(row) move(asked) move(doublings) move(wanted_row) move(part_sent)     \
        move(heard) move(coming) move(have) move(want) move(vain) move(missing) move(clock) move(interval) move(begun) \
            move(advertise_at) move(ask_at) move(useful_at) move(forgiven_at) move(noise) move(lacking)                \
                move(wanted_parts) move(is_active) move(is_asking) move(is_polite) move(failures) move(failed)         \
                    move(worn) move(refused) move(buffer) move(served)
#define TAKE(name) memcpy(&name, &me->name, sizeof name);
#define KEEP(name) memcpy(&me->name, &name, sizeof name);

static void enter(int n)
{
    me = robots + n;
    EACH(TAKE)
}

static void leave(void)
{
    EACH(KEEP)
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

/* Counts the robots that have the version; `activated`: only those that have activated it. */
static int count(int number, uint16 version, bool activated)
{
    int found = 0;
    for (int n = 0; n < number; n++) {
        found += robots[n].have.version == version && (robots[n].is_active || !activated);
    }
    return found;
}

/* Delivers the frames that end now to every robot in range of their senders. */
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
        } else if (from >= 0 && robots[n].role == NORMAL) {
            enter(n);
            Sys_Hear_Update((uint32)now, robots[from].frame);
            leave();
        }
    }
}

/* Composes the next request of a deaf or greedy robot for the program of robot 0; returns whether it is due. */
static bool nag(robot *who, int now, uint8 *m)
{
    sys_update facts = robots[0].have;
    if (now < who->asks_at) {
        return false;
    }
    who->asks_at = now + PATIENCE + random_below(2 * PATIENCE);
    who->row = who->role == GREEDY ? (uint8)((who->row + 1) % facts.rows) : 0;
    want = facts, row = who->row, lacking = ALL_PARTS;
    return ask(m);
}

/* Sends the message of a robot whose turn it is, unless it is receiving; returns whether it sends. */
static bool speak(int n, int number, int reach, int now)
{
    bool is_busy = now < robots[n].waits_until || now < robots[n].sends_until;
    for (int k = n - reach; k <= n + reach && !is_busy; k++) {
        is_busy = k >= 0 && k < number && robots[k].sends_until > now;
    }
    if (is_busy) {
        return false;
    }
    enter(n);
    bool speaks = me->role != NORMAL ? nag(me, now, me->frame) : Sys_Spread((uint32)now, me->frame);
    if (speaks) {
        frames[me->frame[0] >> 5]++;
        me->sends_until = now + FRAME - FRAME % STEP;
    }
    me->waits_until = now + SYS_SPREAD_TICK + random_below(8) * STEP;
    if (me->role == NORMAL) {
        leave();
    }
    return speaks;
}

/* Shuffles the order in which robots try to send. */
static void shuffle(int *order, int number)
{
    for (int n = number - 1; n > 0; n--) {
        int other = random_below((uint16)(n + 1)), kept = order[n];
        order[n] = order[other];
        order[other] = kept;
    }
}

static void set_up(const scenario *s)
{
    memset(robots, 0, sizeof robots);
    memset(frames, 0, sizeof frames);
    lost = collided = 0;
    uint32 program = seed;
    for (int n = 0; n < s->robots; n++) {
        memset(robots[n].rows, 0xFF, sizeof robots[n].rows);
        robots[n].flags[0] = robots[n].flags[1] = 0xFFFF;
        robots[n].target = robots[n].running = robots[n].stored = NONE;
        robots[n].role = s->with_naggers && n == 2 ? DEAF : s->with_naggers && n == 4 ? GREEDY : NORMAL;
        enter(n);
        if (n == 0 || (s->early == 2 && n == s->robots / 2)) {
            uint32 kept = seed;
            seed = program; /* the same program for every early robot */
            provide(7, s->rows);
            seed = n == 0 ? seed : kept;
        }
        Sys_Start_Spreading((uint16)(seed + n + 1));
        leave();
    }
}

static void activate(void)
{
    enter(0);
    if (!Sys_Offer_Activation(7)) {
        printf("failed: not activated\n");
        exit(1);
    }
    leave();
}

static void trial(const scenario *s)
{
    int order[MOST], number = s->robots, normal = number - (s->with_naggers ? 2 : 0);
    int now = STEP, most = 0, all = 0, active = 0, quiet = 0;
    long by_then = 0;
    set_up(s);
    for (int n = 0; n < number; n++) {
        order[n] = n;
    }
    for (; now < LIMIT && (active == 0 || now < active + 300000); now += STEP) {
        deliver(number, s->reach, now, s->loss);
        shuffle(order, number);
        for (int n = 0; n < number; n++) {
            quiet += speak(order[n], number, s->reach, now) && active != 0;
        }
        int whole = count(number, 7, false);
        if (most == 0 && whole * 10 >= normal * 9) {
            most = now;
        }
        if (all == 0 && whole == normal) {
            all = now;
            by_then = frames[4] + frames[5] + frames[6];
            activate();
        }
        if (active == 0 && count(number, 7, true) == normal) {
            active = now;
        }
    }
    printf(
        "%d robots, reach %d, %u rows, %d %% lost, %d early, %d nag: nine of ten %.1f s, whole %.1f s, active %.1f s,"
        " %ld frames, %ld data, %ld requests, %ld collided, then %d in 300 s\n",
        number, s->reach, s->rows, s->loss, s->early, number - normal, most / 1e3, all / 1e3, active / 1e3, by_then,
        frames[6], frames[5], collided, quiet);
    if (most == 0 || most > s->within * 1000 || (normal == number && active == 0)) {
        printf("failed: not enough have it within %d s\n", s->within);
        exit(1);
    }
    for (int n = 0; n < number && active != 0; n++) {
        enter(n);
        if (me->role == NORMAL && (Sys_Start_Update() != 7 || memcmp(me->rows[HAL_UPDATE_RUN], robots[0].rows[0][1],
                                                                     s->rows * HAL_UPDATE_ROW) != 0)) {
            printf("failed: robot %d does not run it\n", n);
            exit(1);
        }
        leave();
    }
}

/* Random messages do no harm, and the running program continues. */
static void babble(void)
{
    enter(1);
    Sys_Confirm_Update();
    for (long n = 0; n < 100000; n++) {
        uint8 message[SYS_SPREAD_BYTES];
        for (int i = 0; i < SYS_SPREAD_BYTES; i++) {
            message[i] = (uint8)random_below(256);
        }
        if (n % 3 != 0) { /* repair some fields: the wanted version, and rows that exist */
            message[0] = (uint8)(DATA | row);
            message[1] = (uint8)((message[1] & 0xF8) | identity(&want) >> 8);
            message[2] = (uint8)identity(&want);
        }
        Sys_Hear_Update((uint32)(n * SYS_SPREAD_TICK), message);
        Sys_Spread((uint32)(n * SYS_SPREAD_TICK), message);
    }
    if (Sys_Start_Update() != 7) {
        printf("failed: 7 does not run after messages of chance\n");
        exit(1);
    }
    leave();
}

static const scenario QUICK[] = {
    {.robots = 2, .reach = 1, .rows = 2, .loss = 0, .early = 1, .within = 600},
    {.robots = 3, .reach = 2, .rows = 4, .loss = 30, .early = 1, .within = 600},
    {.robots = 30, .reach = 3, .rows = 2, .loss = 30, .early = 1, .within = 600},
    {.robots = 12, .reach = 11, .rows = 4, .loss = 30, .early = 2, .with_naggers = true, .within = 600},
};

static const scenario LONG[] = {
    {.robots = 10, .reach = 2, .rows = 22, .loss = 30, .early = 1, .within = 3600},
    {.robots = 30, .reach = 29, .rows = 22, .loss = 30, .early = 1, .within = 1800},
    {.robots = 30, .reach = 3, .rows = 22, .loss = 30, .early = 1, .within = 7200},
    {.robots = 12, .reach = 11, .rows = 22, .loss = 30, .early = 2, .with_naggers = true, .within = 1800},
    {.robots = 12, .reach = 3, .rows = 22, .loss = 30, .early = 1, .with_naggers = true, .within = 9000},
};

int main(int count_of_words, char **words)
{
    int seeds = count_of_words > 1 ? atoi(words[1]) : 0;
    for (int s = 1; s <= (seeds > 0 ? seeds : 2); s++) {
        seed = (uint32)s;
        for (size_t n = 0; n < sizeof QUICK / sizeof *QUICK; n++) {
            trial(QUICK + n);
        }
        for (size_t n = 0; n < sizeof LONG / sizeof *LONG && seeds > 0; n++) {
            trial(LONG + n);
        }
    }
    babble();
    printf("whatever was said\n");
    return 0;
}
