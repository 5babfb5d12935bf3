/* SPDX-License-Identifier: MIT */
/* Spreading of programs: advertisements, requests, data and their suppression (spread.h, docs/design/update.md). The
 * rules are Deluge's, with rows instead of pages. */
#include "spread.h"

#include "authentication.h"

#include <string.h>

enum {
    ADVERTISEMENT = 0x80, /* +1: activated.  bytes: version 2, rows 1, CRC 4 */
    REQUEST = 0xA0,       /* + row.  bytes: version 2, missing parts 3, identity 2 */
    DATA = 0xC0,          /* + row.  part * 8 + upper bits of the identity, its low byte, 5 data bytes */
    PROOF = SYS_PROOF_KIND, /* tag of the advertisement before, 7: with update_auth only */
    KINDS = 0xE0,
    ROW = 0x1F,
    IDENTITY = 0x07FF, /* bits of the CRC that identify a program: two of one version share no rows */
    DATA_HEADER = 3,
    PART = 5,
    PARTS = (HAL_UPDATE_ROW + PART - 1) / PART,
    SHORTEST = 1000, /* ms between advertisements, doubled after each one without an inconsistency */
    LONGEST = 60000,
    PATIENCE = 3 * SYS_SPREAD_TICK, /* ms without data before a request is repeated, plus up to twice that */
    BEHIND = 2000,                  /* the same after data of a row that this robot has already */
    POLITENESS = 20000, /* ms without a useful part after which a robot no longer postpones its requests */
    DOUBLINGS = 3,      /* number of times that PATIENCE doubles while no data arrive */
    MOST_ASKED = 16,    /* requests in vain; then requests stop and another program may replace this one */
    MOST_SERVED = 180,  /* parts of a row; beyond that a request for the row is answered by one part */
    FORGIVEN = 16000,   /* ms after which one served part of each row is forgotten */
    ENOUGH = 1,         /* equal advertisements heard that suppress this robot's own */
    MOST_FAILED = 3     /* times that a program arrived whole with a wrong CRC */
};

/* Neighbours may misbehave: no wait for them is unbounded, and answers to one never use up the share of the others. */
static const uint32 ALL_PARTS = 0xFFFFFFFFu >> (32 - PARTS);

static sys_update have; /* stored program; version 0: none */
static bool is_active;
static sys_update want;   /* program being received; version 0: none */
static sys_update vain;   /* program that `want` replaced, because no neighbour sent it */
static sys_update failed; /* program that failed last; with proofs, the highest version that failed */
static uint8 failures;    /* number of its failures; with proofs, also of lower versions since */
static uint8 row, asked, doublings, buffer[PARTS * PART];
static bool is_asking, is_polite;
static uint32 lacking; /* missing parts of `row`; bit n: part n */
static uint8 wanted_row, part_sent;
static uint32 wanted_parts;   /* parts of `wanted_row` that neighbours request */
static uint8 served[ROW + 1]; /* parts of each row sent by any robot, less the forgotten ones */
static uint32 forgiven_at;
static uint32 clock, interval, begun, advertise_at, ask_at, useful_at;
static uint8 heard;
static uint32 noise;
static uint8 claimed[SYS_SPREAD_BYTES]; /* advertisement that waits for its proof; first byte 0: none */
static bool owes_proof;                 /* of the last advertisement sent */

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

/* Shortens the interval of advertisements (Trickle's inconsistency). */
static void reset_interval(void)
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

/* Postpones this robot's request while others are served: never to an earlier time, and not for ever. */
static void postpone_request(uint16 wait)
{
    is_polite = is_polite && clock - useful_at < POLITENESS;
    if (is_asking && is_polite) {
        uint32 before = ask_at;
        ask_in(wait);
        ask_at = (sint32)(ask_at - before) < 0 ? before : ask_at;
    }
}

/* Resets the counters of requests in vain after a useful part. */
static void note_progress(void)
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
    is_polite = true; /* until it has waited too long for this row */
    note_progress();
}

static void refresh(void)
{
    wanted_parts = 0; /* the wanted parts belong to the previous program */
    memset(served, 0, sizeof served);
    if (!Sys_Get_StoredUpdate(&have, &is_active)) {
        have = (sys_update){0, 0, 0};
    }
}

void Sys_Start_Spreading(uint16 number)
{
    noise = number * 2654435761u;
    want.version = vain.version = 0;
    failures = claimed[0] = 0;
    owes_proof = false;
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
        reset_interval();
    }
    is_active = true; /* the activation is passed on even if the flag cannot be written here */
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

/* Whether failures of `failed` count against a program. A forger who spoils two proved programs in turn would otherwise
 * wear the flash out; without proofs, a forged program must not count against a true one. */
static bool is_suspect(const sys_update *their)
{
    return is_same(their, &failed) || (SYS_NEEDS_PROOFS && their->version < failed.version);
}

static bool is_newer(const sys_update *their)
{
    return their->version > have.version && (failures < MOST_FAILED || !is_suspect(their)) &&
           ((their->version > want.version && !is_same(their, &vain)) ||
            (asked == MOST_ASKED && !is_same(their, &want)));
}

/* An advertisement that erases a store or activates a program needs a proof; others cost a few messages at most. */
static void on_advertisement(const uint8 *m, bool is_proved)
{
    sys_update their = {(uint16)(m[1] | (uint16)m[2] << 8), m[3],
                        m[4] | (uint32)m[5] << 8 | (uint32)m[6] << 16 | (uint32)m[7] << 24};
    bool theirs_is_active = (m[0] & 1u) != 0;
    bool is_ours = is_same(&their, &have);
    if (is_newer(&their)) {
        if (!is_proved) {
            memcpy(claimed, m, sizeof claimed);
            return;
        }
        sys_update before = want;
        if (Sys_Begin_Update(&their)) {
            vain =
                asked == MOST_ASKED ? before : vain; /* not begun again until this one ends or is in vain, too */
            want = their;
            refresh(); /* the store may have held a program that was not activated */
            next_row();
            reset_interval();
        }
    } else if (want.version != 0 && is_same(&their, &want)) {
        if (!is_asking) { /* request again: the advertising robot may have the program */
            ask_in(PATIENCE << DOUBLINGS);
        }
    } else if (their.version < have.version || (is_ours && is_active && !theirs_is_active)) {
        reset_interval(); /* so that the other robot hears of it soon */
    } else if (is_ours && theirs_is_active && !is_active) {
        if (!is_proved) {
            memcpy(claimed, m, sizeof claimed);
            return;
        }
        (void)Sys_Offer_Activation(have.version);
    } else if (is_ours) {
        heard += heard != 0xFF;
    }
}

/* Returns the parts to send for a request. A robot that makes no progress, or has the row, may request it for ever. One
 * part per request leaves time to the others, and a robot that lacks the row still completes it. */
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
        if (wanted_parts == 0 || their_row < wanted_row) { /* lowest row first: it fills gaps of the others, too */
            wanted_row = their_row;
            wanted_parts = parts;
            part_sent = (uint8)draw(PARTS); /* two robots with the row begin with different parts */
        } else if (their_row == wanted_row) {
            wanted_parts |= parts;
        }
    } else if (version == want.version && program == identity(&want) && their_row == row && (lacking & ~parts) == 0) {
        postpone_request(PATIENCE); /* the answer serves this robot, too */
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
    if (have.version != 0 && program == identity(&have)) { /* another robot sent it */
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
        if (their_row <= row) { /* robots that are behind come first, so that each row is sent once to all */
            postpone_request(their_row < row ? BEHIND : PATIENCE);
        }
        return;
    }
    note_progress();
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
    } else { /* the next advertisement begins it again if a store is usable */
        failures = (uint8)(is_suspect(&want) ? failures + (failures != MOST_FAILED) : 1);
        failed = SYS_NEEDS_PROOFS && is_suspect(&want) ? failed : want;
    }
    want.version = vain.version = 0;
    begin_interval(SHORTEST);
}

static bool is_proof(const uint8 *m)
{
    uint8 right[SYS_SPREAD_BYTES];
    return (m[0] & KINDS) == PROOF && claimed[0] != 0 && Sys_Prove_Advertisement(claimed, right) &&
           memcmp(m, right, sizeof right) == 0;
}

void Sys_Hear_Update(uint32 now, const uint8 *message)
{
    bool is_proved = !SYS_NEEDS_PROOFS || is_proof(message);
    clock = now;
    if (SYS_NEEDS_PROOFS && is_proved) {
        message = claimed;
    }
    switch (message[0] & KINDS) {
    case ADVERTISEMENT:
        on_advertisement(message, is_proved);
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
    do { /* in turn, so that repeated requests for some parts do not starve the others */
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
    is_asking = asked != MOST_ASKED; /* afterwards only an advertisement of the program starts requests */
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
    if (owes_proof) {
        uint8 whole[SYS_SPREAD_BYTES];
        owes_proof = false;
        advertise(whole);
        return Sys_Prove_Advertisement(whole, message);
    }
    /* Rare messages first: requests for parts may never end. */
    if (advertise_at != begun && is_due(advertise_at)) {
        advertise_at = begun; /* once per interval */
        if (heard < ENOUGH) {
            owes_proof = SYS_NEEDS_PROOFS && have.version != 0;
            return advertise(message);
        }
    }
    if (want.version != 0 && is_asking && is_due(ask_at)) {
        return ask(message);
    }
    return wanted_parts != 0 && send_part(message);
}
