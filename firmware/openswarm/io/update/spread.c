/* SPDX-License-Identifier: MIT */
/* Advertisement, request, data, and when to keep quiet (spread.h; README.md). Deluge's rules, with rows for pages. */
#include "spread.h"

#include <string.h>

enum {
    ADVERTISEMENT = 0x80, /* +1: activated.  version 2, rows, CRC 4 */
    REQUEST = 0xA0,       /* + row.  version 2, parts that are missing 3, identity 2 */
    DATA = 0xC0,          /* + row.  part * 8 + identity above its low byte, that, 5 bytes */
    KINDS = 0xE0,
    ROW = 0x1F,
    IDENTITY = 0x07FF, /* of a program, in its CRC: two of one version share no rows */
    DATA_HEADER = 3,
    PART = 5,
    PARTS = (HAL_UPDATE_ROW + PART - 1) / PART,
    SHORTEST = 1000, /* ms between advertisements, doubled while nothing is new */
    LONGEST = 60000,
    PATIENCE = 3 * SYS_SPREAD_TICK, /* without data before a request is made again, and up to twice that more */
    BEHIND = 2000,                  /* the same, when somebody was sent a row that is here already */
    POLITENESS = 20000, /* ms without a part of use after which a robot asks for its row whoever else is served */
    DOUBLINGS = 3,      /* of PATIENCE, while no data come */
    MOST_ASKED = 16,    /* requests in vain: then another program may take the place, and there are no more of them */
    MOST_SERVED = 180,  /* parts of a row; then a request for it is answered by one part */
    FORGIVEN = 16000,   /* ms after which a part counts no more, of each row */
    ENOUGH = 1,         /* equal advertisements heard that make the own one needless */
    MOST_FAILED = 3     /* times that all rows of a program came and its CRC was wrong */
};

/* Neighbours are not trusted to stop, or to get on: no wait for them is without end, and no answer takes what others
 * need. */
static const uint32 ALL_PARTS = 0xFFFFFFFFu >> (32 - PARTS);

static sys_update have; /* version 0: nothing */
static bool is_active;
static sys_update want;   /* version 0: nothing */
static sys_update vain;   /* what gave way to `want`, since nobody sent it */
static sys_update failed; /* what failed last, */
static uint8 failures;    /* and how often */
static uint8 row, asked, doublings, buffer[PARTS * PART];
static bool is_asking, is_polite;
static uint32 lacking; /* parts of `row`; bit n: part n */
static uint8 wanted_row, part_sent;
static uint32 wanted_parts;   /* of `wanted_row`, by others */
static uint8 served[ROW + 1]; /* parts of each row a message can name, by whomever, less what is forgiven */
static uint32 forgiven_at;
static uint32 clock, interval, begun, advertise_at, ask_at, useful_at;
static uint8 heard;
static uint32 noise;

static uint16 draw(uint16 below)
{
    noise = noise * 1664525u + 1013904223u;
    return (uint16)((noise >> 16) % below);
}

static void begin_interval(uint32 length)
{
    interval = length;
    begun = clock;
    heard = 0;
    advertise_at = clock + length / 2 + draw((uint16)(length / 2));
}

static void something_is_new(void)
{
    if (interval != SHORTEST) {
        begin_interval(SHORTEST);
    }
}

static bool is_due(uint32 moment)
{
    return (sint32)(clock - moment) >= 0;
}

static void ask_in(uint16 wait)
{
    ask_at = clock + wait + draw(2 * wait);
    is_asking = true;
}

/* Others are served: the own request is not made sooner than it would be, nor put off for ever. */
static void put_off(uint16 wait)
{
    is_polite = is_polite && clock - useful_at < POLITENESS;
    if (is_asking && is_polite) {
        uint32 before = ask_at;
        ask_in(wait);
        ask_at = (sint32)(ask_at - before) < 0 ? before : ask_at;
    }
}

static void go_on(void)
{
    asked = doublings = 0;
    useful_at = clock;
    ask_in(PATIENCE);
}

static void next_row(void)
{
    uint32 missing = Sys_Get_MissingRows();
    for (row = 0; (missing & 1u) == 0; row++) {
        missing >>= 1;
    }
    lacking = ALL_PARTS;
    is_polite = true; /* until it has waited for too long: then for this row no more */
    go_on();
}

static void refresh(void)
{
    wanted_parts = 0; /* of what was here before */
    memset(served, 0, sizeof served);
    if (!Sys_Get_StoredUpdate(&have, &is_active)) {
        have = (sys_update){0, 0, 0};
    }
}

void Sys_Start_Spreading(uint16 number)
{
    noise = number * 2654435761u;
    want.version = vain.version = 0;
    failures = 0;
    refresh();
    begin_interval(SHORTEST);
}

uint16 Sys_Get_StoredVersion(bool *is_activated)
{
    *is_activated = is_active;
    return have.version;
}

bool Sys_Offer_Activation(uint16 version)
{
    if (have.version != version || version == 0) {
        return false;
    }
    if (!is_active) {
        something_is_new();
    }
    is_active = true; /* the word goes round, even if the flag sticks here */
    return Sys_Activate_Update(version);
}

static bool is_same(const sys_update *one, const sys_update *other)
{
    return one->version == other->version && one->rows == other->rows && one->crc == other->crc;
}

static uint16 identity(const sys_update *facts)
{
    return (uint16)facts->crc & IDENTITY;
}

static bool is_newer(const sys_update *their)
{
    return their->version > have.version && (failures < MOST_FAILED || !is_same(their, &failed)) &&
           ((their->version > want.version && !is_same(their, &vain)) ||
            (asked == MOST_ASKED && !is_same(their, &want)));
}

static void on_advertisement(const uint8 *m)
{
    sys_update their = {(uint16)(m[1] | (uint16)m[2] << 8), m[3],
                        m[4] | (uint32)m[5] << 8 | (uint32)m[6] << 16 | (uint32)m[7] << 24};
    bool theirs_is_active = (m[0] & 1u) != 0;
    bool is_ours = is_same(&their, &have);
    if (is_newer(&their)) {
        sys_update before = want;
        if (Sys_Begin_Update(&their)) {
            vain =
                asked == MOST_ASKED ? before : vain; /* not again before this one has ended, or been in vain as well */
            want = their;
            refresh(); /* the store may be that of a program that is not activated */
            next_row();
            something_is_new();
        }
    } else if (want.version != 0 && is_same(&their, &want)) {
        if (!is_asking) { /* once more: who has it is there, perhaps */
            ask_in(PATIENCE << DOUBLINGS);
        }
    } else if (their.version < have.version || (is_ours && is_active && !theirs_is_active)) {
        something_is_new(); /* for them */
    } else if (is_ours && theirs_is_active && !is_active) {
        (void)Sys_Offer_Activation(have.version);
    } else if (is_ours) {
        heard += heard != 0xFF;
    }
}

/* Somebody who does not get on, or has the row, may ask for it for ever. A part for a request leaves the others theirs,
 * and who really lacks it has it some time. */
static uint32 allowed(uint8 their_row, uint32 parts)
{
    uint8 part = (uint8)draw(PARTS);
    while ((parts >> part & 1u) == 0) {
        part = part + 1u < PARTS ? (uint8)(part + 1u) : 0;
    }
    return served[their_row] < MOST_SERVED ? parts : (uint32)1 << part;
}

static void on_request(const uint8 *m)
{
    uint16 version = (uint16)(m[1] | (uint16)m[2] << 8), program = (uint16)(m[6] | (uint16)m[7] << 8);
    uint32 parts = (m[3] | (uint32)m[4] << 8 | (uint32)m[5] << 16) & ALL_PARTS;
    uint8 their_row = m[0] & ROW;
    if (parts == 0 || version == 0) {
        return;
    }
    if (version == have.version && program == identity(&have) && their_row < have.rows) {
        parts = allowed(their_row, parts);
        if (wanted_parts == 0 || their_row < wanted_row) { /* who is behind first: the others fill their gaps as well */
            wanted_row = their_row;
            wanted_parts = parts;
            part_sent = (uint8)draw(PARTS); /* so that two who have the row begin with different parts */
        } else if (their_row == wanted_row) {
            wanted_parts |= parts;
        }
    } else if (version == want.version && program == identity(&want) && their_row == row && (lacking & ~parts) == 0) {
        put_off(PATIENCE); /* the answer will do here as well */
    }
}

static void count_served(uint8 their_row)
{
    served[their_row] += served[their_row] != 0xFF;
}

static void on_data(const uint8 *m)
{
    uint8 their_row = m[0] & ROW, part = m[1] >> 3;
    uint16 program = (uint16)((uint16)(m[1] & 7u) << 8 | m[2]);
    uint32 bit = (uint32)1 << part;
    if (have.version != 0 && program == identity(&have)) { /* somebody else has sent it */
        count_served(their_row);
        if (their_row == wanted_row) {
            wanted_parts = served[their_row] < MOST_SERVED ? wanted_parts & ~bit : 0;
        }
    }
    if (want.version == 0 || program != identity(&want)) {
        return;
    }
    doublings = 0;
    if (their_row != row || (lacking & bit) == 0) {
        if (their_row <= row) { /* who is behind comes first, so that all go on together: a row is sent once to all */
            put_off(their_row < row ? BEHIND : PATIENCE);
        }
        return;
    }
    go_on();
    memcpy(buffer + part * PART, m + DATA_HEADER, PART);
    lacking &= ~bit;
    if (lacking != 0) {
        return;
    }
    bool is_put = Sys_Put_UpdateRow(row, buffer);
    if (is_put && Sys_Get_MissingRows() != 0) {
        next_row();
        return;
    }
    if (is_put && Sys_End_Update()) {
        refresh();
    } else { /* the next advertisement begins it anew, if there is a store for it */
        failures = (uint8)(is_same(&want, &failed) ? failures + (failures != MOST_FAILED) : 1);
        failed = want;
    }
    want.version = vain.version = 0;
    begin_interval(SHORTEST);
}

void Sys_Hear_Update(uint32 now, const uint8 *message)
{
    clock = now;
    switch (message[0] & KINDS) {
    case ADVERTISEMENT:
        on_advertisement(message);
        break;
    case REQUEST:
        on_request(message);
        break;
    case DATA:
        on_data(message);
        break;
    default:
        break;
    }
}

static bool send_part(uint8 *m)
{
    uint8 whole[PARTS * PART] = {0}, part = part_sent;
    do { /* in turn: none is left out because others are asked for again */
        part = part + 1u < PARTS ? (uint8)(part + 1u) : 0;
    } while ((wanted_parts >> part & 1u) == 0);
    part_sent = part;
    wanted_parts &= ~((uint32)1 << part);
    count_served(wanted_row);
    Sys_Get_UpdateRow(wanted_row, whole);
    m[0] = (uint8)(DATA | wanted_row);
    m[1] = (uint8)(part << 3 | identity(&have) >> 8);
    m[2] = (uint8)identity(&have);
    memcpy(m + DATA_HEADER, whole + part * PART, PART);
    return true;
}

static bool ask(uint8 *m)
{
    m[0] = (uint8)(REQUEST | row);
    m[1] = (uint8)want.version;
    m[2] = (uint8)(want.version >> 8);
    m[3] = (uint8)lacking;
    m[4] = (uint8)(lacking >> 8);
    m[5] = (uint8)(lacking >> 16);
    m[6] = (uint8)identity(&want);
    m[7] = (uint8)(identity(&want) >> 8);
    asked += asked != MOST_ASKED;
    ask_in((uint16)(PATIENCE << doublings));
    doublings += doublings != DOUBLINGS;
    is_asking = asked != MOST_ASKED; /* then only when somebody says that it has the program */
    return true;
}

static bool advertise(uint8 *m)
{
    m[0] = (uint8)(ADVERTISEMENT | (is_active ? 1u : 0u));
    m[1] = (uint8)have.version;
    m[2] = (uint8)(have.version >> 8);
    m[3] = have.rows;
    for (uint8 i = 0; i < 4; i++) {
        m[4 + i] = (uint8)(have.crc >> 8 * i);
    }
    return true;
}

static void forgive(void)
{
    forgiven_at = clock;
    for (uint8 r = 0; r <= ROW; r++) {
        served[r] -= served[r] != 0;
    }
}

bool Sys_Spread(uint32 now, uint8 *message)
{
    clock = now;
    memset(message, 0, SYS_SPREAD_BYTES);
    if (now - begun >= interval) {
        begin_interval(interval * 2 < LONGEST ? interval * 2 : LONGEST);
    }
    if (now - forgiven_at >= FORGIVEN) {
        forgive();
    }
    /* What is seldom goes first: parts may be asked for without end. */
    if (advertise_at != begun && is_due(advertise_at)) {
        advertise_at = begun; /* once an interval */
        if (heard < ENOUGH) {
            return advertise(message);
        }
    }
    if (want.version != 0 && is_asking && is_due(ask_at)) {
        return ask(message);
    }
    return wanted_parts != 0 && send_part(message);
}
