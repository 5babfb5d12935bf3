/* Messages of the robot, in which only parts of whole programs may be sent, and messages of its neighbours. */
#include "cells.c"

enum {
    ADVERTISED = ADVERTISEMENT >> 5 & 3,
    REQUESTED = REQUEST >> 5 & 3,
    SENT = DATA >> 5 & 3,
    PROVED = PROOF >> 5 & 3,
    MINUTE = 60000 / SYS_SPREAD_TICK
};

static long sent, kinds[4]; /* kinds: messages sent, by their upper three bits */

static void forget_kinds(void)
{
    memset(kinds, 0, sizeof kinds);
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

/* Hears an advertisement, and in builds with tags its proof if the program is a true one: only its owner has the key. */
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
    for (int n = 0; IS_AUTHENTICATED && n < PROGRAMS; n++) {
        if (is_same(&facts, &programs[n].facts)) {
            uint8 proof[SYS_SPREAD_BYTES];
            check(Sys_Prove_Advertisement(m, proof), "the robot has a key");
            Sys_Hear_Update(now, proof);
        }
    }
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

/* Delivers the requested parts, as a neighbour that has the program would send them. */
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

/* Simulates neighbours that have a program and answer requests; returns the number of requests. */
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
