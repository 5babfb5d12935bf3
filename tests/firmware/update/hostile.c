/* One robot among neighbours that say anything: true and false advertisements, requests, data of every program in any
 * order, half of them of two programs with one version; power fails in the middle of operations, clocks wrap, bytes of
 * flash stick. Whatever has happened, only whole programs are called, and only parts of whole programs are sent. */
#include "update.c"

#include "spread.c"

#include <setjmp.h>
#include <stdio.h>
#include <stdlib.h>

enum { PROGRAMS = 14, SLOTS = HAL_UPDATE_STORES + 1, HISTORIES = 150, STEPS = 3000, NEVER = 1 << 30 };

static struct {
    sys_update facts;
    uint8 rows[HAL_UPDATE_ROWS][HAL_UPDATE_ROW];
} programs[PROGRAMS];

static uint8 cells[SLOTS][HAL_UPDATE_ROWS + 1][HAL_UPDATE_ROW];
static uint16 flags[HAL_UPDATE_STORES];
static jmp_buf power_off;
static int cut_in, history;
static const uint8 *stuck; /* a row of which a byte does not change */
static bool sticks;
static uint8 worn_stores;  /* bit n: nothing in store n changes any more */
static uint16 stuck_flags; /* bits of all flags that stay as they are */
static long changes;
static uint32 seed, now;
static long sent, calls, reads, kinds[4]; /* kinds: what it has sent, by the upper three bits */

static uint32 chance(uint32 below)
{
    seed = seed * 1664525u + 1013904223u;
    return (seed >> 8) % below;
}

static void check(bool is_true, const char *what)
{
    if (!is_true) {
        printf("failed: %s (history %d)\n", what, history);
        exit(1);
    }
}

static void operated(void)
{
    if (cut_in != NEVER && cut_in-- == 0) {
        longjmp(power_off, 1);
    }
}

static bool is_worn(const uint8 *row_of_cells)
{
    bool is = false;
    for (int store = 0; store < HAL_UPDATE_STORES; store++) {
        is |= (worn_stores >> store & 1) != 0 && row_of_cells >= cells[store][0] && row_of_cells < cells[store + 1][0];
    }
    return is;
}

static void change(uint8 *row_of_cells, const uint8 *to)
{
    changes++;
    if (is_worn(row_of_cells)) {
        return;
    }
    for (int i = row_of_cells == stuck ? 1 : 0; i < HAL_UPDATE_ROW; i++) {
        uint8 bits = cut_in == 0 ? (uint8)chance(256) : 0xFF;
        row_of_cells[i] = (uint8)((row_of_cells[i] & ~bits) | (to[i] & bits));
    }
    operated();
}

void hal_update_read(uint8_t slot, uint8_t r, uint8_t *bytes)
{
    memcpy(bytes, cells[slot][r], HAL_UPDATE_ROW);
    reads++;
}

void hal_update_erase(uint8_t slot, uint8_t r)
{
    uint8 ones[HAL_UPDATE_ROW];
    memset(ones, 0xFF, sizeof ones);
    change(cells[slot][r], ones);
}

void hal_update_write(uint8_t slot, uint8_t r, const uint8_t *bytes)
{
    uint8 both[HAL_UPDATE_ROW];
    for (int i = 0; i < HAL_UPDATE_ROW; i++) {
        both[i] = bytes[i] & cells[slot][r][i];
    }
    change(cells[slot][r], both);
}

uint16_t hal_update_flags(uint8_t store)
{
    return flags[store];
}

void hal_update_clear(uint8_t store, uint16_t bits)
{
    flags[store] &= (uint16) ~(bits & ~stuck_flags);
    changes++;
    operated();
}

void hal_update_renew(uint8_t store)
{
    flags[store] |= (uint16)~stuck_flags;
    changes++;
    operated();
}

void hal_update_run(void)
{
    bool is_whole_one = false;
    for (int n = 0; n < PROGRAMS; n++) {
        is_whole_one |= memcmp(cells[HAL_UPDATE_RUN], programs[n].rows, programs[n].facts.rows * HAL_UPDATE_ROW) == 0;
    }
    check(is_whole_one, "what is called is a program");
    calls++;
}

static void draw_programs(void)
{
    for (int n = 0; n < PROGRAMS; n++) {
        uint8 least = n == PROGRAMS - 1 ? 3 : 1; /* the newest has rows to get on with */
        uint8 rows = (uint8)(least + chance(chance(4) != 0 ? 4 : HAL_UPDATE_ROWS + 1u - least));
        uint32 crc = 0xFFFFFFFFu;
        for (uint8 r = 0; r < rows; r++) {
            for (int i = 0; i < HAL_UPDATE_ROW; i++) {
                programs[n].rows[r][i] = (uint8)chance(256);
            }
            crc = Sys_Add_UpdateCrc(crc, programs[n].rows[r], HAL_UPDATE_ROW);
        }
        programs[n].facts = (sys_update){(uint16)(1 + n / 2), rows, ~crc};
    }
}

static void boot(void)
{
    target = running = stored = NONE;
    missing = 0;
    clock = 0;
    memset(&want, 0, sizeof want);
    now = chance(2) != 0 ? 0 : 0u - chance(200000);
    Sys_Start_Update();
    Sys_Start_Spreading((uint16)chance(1000));
}

static void tick(void)
{
    uint8 m[SYS_SPREAD_BYTES];
    long before = reads;
    now += SYS_SPREAD_TICK;
    bool speaks = Sys_Spread(now, m), is_known = !speaks || (m[0] & KINDS) != DATA;
    if (speaks) {
        kinds[m[0] >> 5 & 3]++;
    }
    for (int n = 0; n < PROGRAMS && !is_known; n++) {
        uint8 r = m[0] & ROW;
        int at = (m[1] >> 3) * PART, size = at + PART <= HAL_UPDATE_ROW ? PART : HAL_UPDATE_ROW - at;
        is_known = identity(&programs[n].facts) == ((m[1] & 7) << 8 | m[2]) && r < programs[n].facts.rows &&
                   memcmp(programs[n].rows[r] + at, m + DATA_HEADER, (size_t)size) == 0;
    }
    check(is_known || sticks, "what is sent is part of a program");
    check((m[0] & KINDS) != DATA || reads != before, "what is sent comes out of a store");
    sent++;
}

static void hear_advertisement(sys_update facts, bool active)
{
    sys_update own = have;
    bool own_active = is_active;
    uint8 m[SYS_SPREAD_BYTES];
    have = facts;
    is_active = active;
    advertise(m);
    have = own;
    is_active = own_active;
    Sys_Hear_Update(now, m);
}

static void hear_part(int n, uint8 r, uint8 part)
{
    uint16 program = identity(&programs[n].facts);
    uint8 m[SYS_SPREAD_BYTES] = {(uint8)(DATA | r), (uint8)(part << 3 | program >> 8), (uint8)program};
    uint8 whole[PARTS * PART] = {0};
    memcpy(whole, programs[n].rows[r], HAL_UPDATE_ROW);
    memcpy(m + DATA_HEADER, whole + part * PART, PART);
    Sys_Hear_Update(now, m);
}

/* What it asks for, as a neighbour that has it would send it. */
static void hear_what_is_wanted(uint32 one_lost_of)
{
    for (int n = 0; n < PROGRAMS; n++) {
        bool is_it = want.version == programs[n].facts.version && want.crc == programs[n].facts.crc;
        uint8 r = row;
        for (uint8 part = 0; is_it && part < PARTS && r < programs[n].facts.rows; part++) {
            if (chance(one_lost_of) != 0) {
                hear_part(n, r, part);
            }
        }
    }
}

static void something(void)
{
    int n = (int)chance(PROGRAMS);
    sys_update facts = programs[n].facts;
    uint8 m[SYS_SPREAD_BYTES];
    for (int i = 0; i < SYS_SPREAD_BYTES; i++) {
        m[i] = (uint8)chance(256);
    }
    switch (chance(16)) {
    case 0:
    case 1:
        hear_advertisement(facts, chance(2));
        break;
    case 2: /* false ones */
        facts.rows = (uint8)chance(256);
        facts.version = (uint16)(chance(3) == 0 ? 65535 : chance(20));
        hear_advertisement(facts, chance(2));
        break;
    case 3: /* for the program that is here */
        m[0] = (uint8)(REQUEST | (m[0] & ROW));
        m[1] = (uint8)have.version;
        m[2] = (uint8)(have.version >> 8);
        m[6] = (uint8)identity(&have);
        m[7] = (uint8)(identity(&have) >> 8);
        Sys_Hear_Update(now, m);
        break;
    case 4:
        hear_part(n, (uint8)chance(facts.rows), (uint8)chance(PARTS));
        break;
    case 5:
    case 6:
    case 7:
        hear_what_is_wanted(8);
        break;
    case 8:
        Sys_Offer_Activation(have.version);
        break;
    case 9:
        Sys_Confirm_Update();
        break;
    case 10:
        cut_in = chance(4) == 0 ? (int)chance(12) : cut_in;
        break;
    case 11:
        stuck = sticks && chance(8) == 0 ? cells[chance(SLOTS)][chance(5)] : NULL;
        break;
    case 12:
        if (chance(8) == 0) {
            boot();
        }
        break;
    case 13:
        Sys_Hear_Update(now, m);
        break;
    default:
        for (uint32 ticks = chance(6); ticks-- != 0;) {
            tick();
        }
    }
}

static void begin_history(bool with_stuck_bytes)
{
    seed = (uint32)++history;
    sticks = with_stuck_bytes;
    stuck = NULL;
    cut_in = NEVER;
    memset(cells, 0xFF, sizeof cells);
    memset(flags, 0xFF, sizeof flags);
    draw_programs();
}

enum {
    ADVERTISED = ADVERTISEMENT >> 5 & 3,
    REQUESTED = REQUEST >> 5 & 3,
    SENT = DATA >> 5 & 3,
    MINUTE = 60000 / SYS_SPREAD_TICK
};

static void forget_kinds(void)
{
    memset(kinds, 0, sizeof kinds);
}

/* Whatever it has heard: when nobody says anything any more it says little, and after some minutes that it is there. */
static void silence(void)
{
    forget_kinds();
    for (int n = 0; n < 10 * MINUTE; n++) {
        tick();
    }
    check(kinds[REQUESTED] <= MOST_ASKED && kinds[SENT] <= PARTS && kinds[ADVERTISED] <= 20,
          "in silence it falls silent");
    forget_kinds();
    for (int n = 0; n < 10 * MINUTE; n++) {
        tick();
    }
    check(kinds[REQUESTED] == 0 && kinds[SENT] == 0 && kinds[ADVERTISED] <= 11, "and stays so");
}

static void hear_request(int n, uint8 their_row, uint32 parts)
{
    sys_update facts = programs[n].facts;
    uint16 program = identity(&facts);
    uint8 m[SYS_SPREAD_BYTES] = {(uint8)(REQUEST | their_row),
                                 (uint8)facts.version,
                                 (uint8)(facts.version >> 8),
                                 (uint8)parts,
                                 (uint8)(parts >> 8),
                                 (uint8)(parts >> 16),
                                 (uint8)program,
                                 (uint8)(program >> 8)};
    Sys_Hear_Update(now, m);
}

/* A promise that nobody keeps does not shut out the program that is really there, however often it is made. */
static void promise(bool is_repeated)
{
    sys_update false_one = {65535, HAL_UPDATE_ROWS, 1};
    hear_advertisement(false_one, false);
    check(want.version == 65535, "it is believed at first");
    for (int n = 0; n < 4 * MINUTE && have.version != programs[PROGRAMS - 1].facts.version; n++) {
        tick();
        if (is_repeated) {
            hear_advertisement(false_one, false);
        }
        hear_advertisement(programs[PROGRAMS - 1].facts, false);
        hear_what_is_wanted(8);
    }
    check(have.version == programs[PROGRAMS - 1].facts.version, "the true one comes in four minutes");
    forget_kinds();
    for (int n = 0; n < 60 * MINUTE; n++) {
        tick();
        hear_advertisement(false_one, false);
    }
    check(want.version == 65535 && kinds[REQUESTED] <= 60 * 60 * 1000 / (PATIENCE << DOUBLINGS),
          "it is asked for seldom");
}

/* Of two programs of one version the one that was begun comes whole, whatever is heard of the other before. */
static void namesakes(int wanted, int other)
{
    sys_update facts = programs[other].facts;
    check(facts.version == programs[wanted].facts.version && facts.crc != programs[wanted].facts.crc,
          "two of one version");
    hear_advertisement(programs[wanted].facts, false);
    for (int n = 0; n < 100 && have.version != facts.version; n++) {
        for (uint8 part = 0; part < PARTS && row < facts.rows; part++) {
            hear_part(other, row, part);
        }
        hear_what_is_wanted(8);
        hear_advertisement(facts, true);
        tick();
    }
    check(have.version == facts.version && have.crc == programs[wanted].facts.crc, "the one that was begun");
    check(!is_active, "that the other one is activated does not concern it");
    begin_interval(SHORTEST);
    hear_advertisement(facts, false);
    check(heard == 0, "nor has anybody said the same by naming the other");
    for (uint8 r = 0; r < facts.rows; r++) { /* who asks for the other's rows does not get these */
        uint8 m[SYS_SPREAD_BYTES];
        sys_update own = want;
        want = facts, row = r, lacking = ALL_PARTS;
        ask(m);
        want = own;
        Sys_Hear_Update(now, m);
        check(wanted_parts == 0, "requests are for one program");
    }
}

/* Neighbours that have a program, as long as it is asked for; how many requests that took. */
static int serve(int n, int ticks)
{
    int requests = 0;
    for (uint8 m[SYS_SPREAD_BYTES]; ticks-- != 0;) {
        if (ticks % 8 == 0) {
            hear_advertisement(programs[n].facts, false);
        }
        now += SYS_SPREAD_TICK;
        if (Sys_Spread(now, m) && (m[0] & KINDS) == REQUEST) {
            requests++;
            hear_what_is_wanted(1000);
        }
    }
    return requests;
}

static void take(int n)
{
    serve(n, 4000);
    check(have.version == programs[n].facts.version && want.version == 0, "it comes");
}

/* Who asks for a row for ever, of which it has none or all, gets little, and what others ask for and what is due goes
 * on. */
static void nagged(bool for_all_rows)
{
    int n = PROGRAMS - 1, rows = programs[n].facts.rows, last = rows - 1, requests = 0;
    uint32 got = 0;
    take(n);
    begin_interval(SHORTEST);
    forget_kinds();
    for (int t = 0; t < MOST_SERVED; t++) {
        hear_request(n, (uint8)(t % rows), ALL_PARTS);
        check(wanted_parts != 0, "there is always something to serve");
        tick();
    }
    check(kinds[ADVERTISED] >= 2, "that does not keep it from advertising");
    forget_kinds();
    for (int t = 0; t < 60 * MINUTE; t++) {
        if (t % 6 == 0) {
            hear_request(n, (uint8)(for_all_rows ? requests % rows : 0), ALL_PARTS);
            requests++;
        }
        tick();
    }
    check(kinds[SENT] <= requests + (MOST_SERVED + PARTS + 3600000 / FORGIVEN) * (for_all_rows ? rows : 1),
          "one part for a request");
    check(kinds[ADVERTISED] >= 30, "it advertises all the same");
    for (int t = 0; t < 60 * MINUTE && got != ALL_PARTS; t++) {
        uint8 m[SYS_SPREAD_BYTES];
        if (t % 6 == 0) {
            hear_request(n, 0, ALL_PARTS);
        }
        if (t % 12 == 3) {
            hear_request(n, (uint8)last, ALL_PARTS & ~got);
        }
        now += SYS_SPREAD_TICK;
        if (Sys_Spread(now, m) && (m[0] & KINDS) == DATA && (m[0] & ROW) == last) {
            got |= (uint32)1 << (m[1] >> 3);
        }
    }
    check(got == ALL_PARTS, "who lacks the last row has it in an hour");
    hear_request(n, 0, ALL_PARTS);
    check(wanted_parts != ALL_PARTS, "a row that was served often is not served whole");
    for (int t = 0; t < 60 * MINUTE; t++) {
        tick();
    }
    hear_request(n, 0, ALL_PARTS);
    check(wanted_parts == ALL_PARTS, "but after an hour");
    wanted_parts = 0;
    hear_request(n, 0, 0);
    check(wanted_parts == 0, "who asks for no parts gets none");
}

/* Who is behind comes first, but not for ever. */
static void pushed(void)
{
    enum { SECOND = 1000 / SYS_SPREAD_TICK };
    int n = PROGRAMS - 1;
    uint8 m[SYS_SPREAD_BYTES];
    now += 60000;
    hear_advertisement(programs[n].facts, false);
    check(!Sys_Spread(++now, m) || (m[0] & KINDS) != REQUEST, "it waits from when it hears on, not from when it spoke");
    forget_kinds();
    for (int t = 0; t < 20 * SECOND; t++) {
        tick();
    }
    check(kinds[REQUESTED] >= 4 && kinds[REQUESTED] <= 9, "where nobody answers it asks more and more seldom");
    for (int t = 0; t < MINUTE && row == 0; t++) {
        tick();
        hear_what_is_wanted(1000);
    }
    check(row == 1, "it is at the second row");
    forget_kinds();
    for (int t = 0; t < 5 * SECOND; t++) {
        hear_request(n, 0, ALL_PARTS);
        tick();
    }
    check(kinds[REQUESTED] > 1, "others' requests for what it has are no reason to wait");
    forget_kinds();
    for (int t = 0; t < 12 * SECOND; t++) {
        hear_part(n, 0, (uint8)chance(PARTS));
        tick();
    }
    check(kinds[REQUESTED] <= 1, "their data are");
    forget_kinds();
    for (int t = 0; t < 20 * SECOND; t++) {
        hear_part(n, 0, (uint8)chance(PARTS));
        hear_request(n, 1, ALL_PARTS);
        tick();
    }
    check(kinds[REQUESTED] > 1, "then it asks, whoever else is served or asks");
    forget_kinds();
    for (int t = 0; t < 10 * MINUTE; t++) {
        hear_request(n, 0, ALL_PARTS);
        tick();
    }
    check(kinds[REQUESTED] <= MOST_ASKED, "where there are no more data it ceases");
    forget_kinds();
    hear_advertisement(programs[n].facts, false);
    for (int t = 0; t < MINUTE; t++) {
        tick();
    }
    check(kinds[REQUESTED] == 1, "until somebody says to have it");
}

/* Flash that holds nothing any more is not asked for, nor written, without end; the store that does is used. */
static void worn_out(void)
{
    worn_stores = 1;
    serve(PROGRAMS - 1, 4000);
    check(have.version == programs[PROGRAMS - 1].facts.version,
          "where one store does not change the other one is used");
    begin_history(false);
    boot();
    worn_stores = 3;
    serve(PROGRAMS - 1, 1000);
    changes = 0;
    check(serve(PROGRAMS - 1, 4000) == 0 && changes == 0, "who has no store that changes asks for nothing");
    worn_stores = 0;
    check(serve(PROGRAMS - 1, 4000) == 0, "until the next start");
    boot();
    serve(PROGRAMS - 1, 4000);
    check(have.version == programs[PROGRAMS - 1].facts.version, "which tries again");
}

/* A CRC that no program has is not asked for without end. */
static void false_sum(void)
{
    programs[PROGRAMS - 1].facts.crc ^= 1;
    serve(PROGRAMS - 1, 4000);
    check(serve(PROGRAMS - 1, 4000) == 0, "what has failed some times is not asked for");
    programs[PROGRAMS - 1].facts.crc ^= 1;
    serve(PROGRAMS - 1, 4000);
    check(have.version == programs[PROGRAMS - 1].facts.version, "but the true one is");
}

/* Flags that do not change: what cannot be tried is not in the way of the one that works, nor of the next. */
static void stuck_bits(void)
{
    enum { FIRST = 0, SECOND = 2, THIRD = 4 };
    take(FIRST);
    check(Sys_Offer_Activation(1), "activated");
    boot();
    check(running != NONE && Sys_Confirm_Update(), "it runs, confirmed");
    take(SECOND);
    check(Sys_Offer_Activation(2), "activated");
    stuck_flags = 1;
    check(Sys_Start_Update() == 2, "a try that cannot be counted in one bit is counted in another");
    stuck_flags = TRIES;
    check(Sys_Start_Update() == 1, "tries that cannot be counted are none: the one before runs");
    check(Sys_Get_NextVersion() == 1, "and is known to");
    stuck_flags = 0;
    Sys_Start_Spreading(1);
    take(THIRD);
    stuck_flags = NOT_ACTIVE;
    check(!Sys_Activate_Update(3), "what is not active is not said to be");
    hear_advertisement(programs[THIRD].facts, true);
    changes = 0;
    hear_advertisement(programs[THIRD].facts, true);
    check(!Sys_Activate_Update(3) && !Sys_Offer_Activation(3) && changes == 0,
          "nor is it tried each time that somebody says so");
    stuck_flags = 0;
    check(!Sys_Activate_Update(3) && Sys_Start_Update() == 1 && Sys_Activate_Update(3), "but at the next start");
    changes = 0;
    check(Sys_Activate_Update(3) && changes == 0, "what is done is not done again");
    check(Sys_Start_Update() == 3, "it runs");
    stuck_flags = NOT_CONFIRMED;
    check(!Sys_Confirm_Update(), "what is not confirmed is not said to be");
    changes = 0;
    check(!Sys_Confirm_Update() && changes == 0, "nor is that tried each time");
    stuck_flags = 0;
}

/* Who is on trial begins nothing, however long that is and whatever it hears; then it does. */
static void long_trial(void)
{
    take(0);
    check(Sys_Offer_Activation(1), "activated");
    boot();
    check(running != NONE, "on trial");
    changes = 0;
    check(serve(PROGRAMS - 1, 60 * MINUTE) == 0 && changes == 0, "an hour of it");
    check(Sys_Confirm_Update(), "confirmed");
    take(PROGRAMS - 1);
}

/* There is nothing above the last version, and nothing below it comes back. */
static void last_versions(void)
{
    for (int n = 0; n < 4; n++) {
        programs[n].facts.version = (uint16)(n == 3 ? 1 : 65533 + n);
    }
    for (int n = 0; n < 3; n++) {
        take(n);
        check(Sys_Offer_Activation(programs[n].facts.version), "activated");
        boot();
        check(Sys_Confirm_Update() && have.version == programs[n].facts.version, "it runs");
    }
    changes = 0;
    for (int n = 0; n < 4; n++) {
        check(serve(n, 4000) == 0, "nothing is newer than the last");
    }
    sys_update nothing = {0, 0, 0xFFFFFFFF};
    hear_advertisement(nothing, false);
    check(changes == 0 && have.version == 65535, "nor is nothing");
}

static void histories(void)
{
    while (history < HISTORIES) {
        static int steps;
        begin_history(history % 3 == 2);
        steps = 0;
        setjmp(power_off);
        cut_in = NEVER;
        for (boot(); steps < STEPS; steps++) {
            something();
        }
        cut_in = NEVER;
        silence();
    }
}

int main(void)
{
    histories();
    for (int n = 0; n < 11; n++) {
        begin_history(false);
        boot();
        switch (n) {
        case 0:
        case 1:
            promise(n != 0);
            break;
        case 2:
            namesakes(6, 7);
            break;
        case 3:
            worn_out();
            break;
        case 4:
            false_sum();
            break;
        case 5:
            stuck_bits();
            break;
        case 6:
        case 7:
            nagged(n == 7);
            break;
        case 8:
            long_trial();
            break;
        case 9:
            last_versions();
            break;
        default:
            pushed();
        }
    }
    printf("%ld messages, %ld calls\n", sent, calls);
    return 0;
}
