/* SPDX-License-Identifier: MIT */
/* Two stores, one of which always keeps the program that works. README.md has the order of writes. */
#include "update.h"

#include "authentication.h"

#include <string.h>

/* A flag bit is 1 until its step has happened. */
enum { ALL = 0xFFFF, NOT_ACTIVE = 0x8000, NOT_CONFIRMED = 0x4000, TRIES = (1 << SYS_UPDATE_TRIES) - 1 };

enum { FACTS = 8, MARK = 0xA7, NONE = 0xFF, WRITES = 3 /* attempts before a row counts as worn out */ };

static uint8 target = NONE; /* store that is being filled */
static uint8 running = NONE;
static uint8 stored = NONE; /* store that Sys_Get_StoredUpdate found last */
/* Since the last start: */
static uint8 worn;                       /* bit n: a write to store n failed; no more writes */
static uint8 refused;                    /* bit n: the program of store n could not be tried */
static uint16 frozen[HAL_UPDATE_STORES]; /* flags that did not change when written, and are not written again */
static sys_update coming;
static uint32 missing;

uint32 Sys_Add_UpdateCrc(uint32 crc, const uint8 *bytes, uint8 count)
{
    while (count-- != 0) {
        crc ^= *bytes++;
        for (uint8 bit = 0; bit < 8; bit++) {
            crc = (crc & 1u) != 0 ? crc >> 1 ^ 0xEDB88320u : crc >> 1;
        }
    }
    return crc;
}

static bool is_possible(const sys_update *facts)
{
    return facts->version != 0 && facts->rows != 0 && facts->rows <= HAL_UPDATE_ROWS;
}

static void pack(uint8 *row, const sys_update *facts)
{
    const uint8 plain[FACTS] = {MARK,
                                (uint8)facts->version,
                                (uint8)(facts->version >> 8),
                                facts->rows,
                                (uint8)facts->crc,
                                (uint8)(facts->crc >> 8),
                                (uint8)(facts->crc >> 16),
                                (uint8)(facts->crc >> 24)};
    memset(row, 0xFF, HAL_UPDATE_ROW);
    for (uint8 i = 0; i < FACTS; i++) {
        row[i] = plain[i];
        row[FACTS + i] = (uint8)~plain[i]; /* an interrupted write leaves 1s, which one of the two copies reveals */
    }
}

static bool read_facts(uint8 store, sys_update *facts)
{
    uint8 row[HAL_UPDATE_ROW];
    hal_update_read(store, 0, row);
    for (uint8 i = 0; i < FACTS; i++) {
        if ((row[i] ^ row[FACTS + i]) != 0xFF) {
            return false;
        }
    }
    facts->version = (uint16)(row[1] | (uint16)row[2] << 8);
    facts->rows = row[3];
    facts->crc = row[4] | (uint32)row[5] << 8 | (uint32)row[6] << 16 | (uint32)row[7] << 24;
    return row[0] == MARK && is_possible(facts);
}

static bool holds(uint8 store, const sys_update *facts)
{
    uint8 row[HAL_UPDATE_ROW];
    uint32 crc = 0xFFFFFFFFu;
    for (uint8 i = 1; i <= facts->rows; i++) {
        hal_update_read(store, i, row);
        crc = Sys_Add_UpdateCrc(crc, row, HAL_UPDATE_ROW);
    }
    return (crc ^ 0xFFFFFFFFu) == facts->crc && Sys_Is_UpdateAuthentic(store, facts);
}

static bool is_whole(uint8 store, sys_update *facts)
{
    return read_facts(store, facts) && holds(store, facts);
}

static bool is_confirmed(uint8 store)
{
    return (hal_update_flags(store) & NOT_CONFIRMED) == 0;
}

/* Returns the store whose program should run, or NONE. */
static uint8 choose(sys_update *best)
{
    uint8 chosen = NONE;
    for (uint8 store = 0; store < HAL_UPDATE_STORES; store++) {
        sys_update facts;
        uint16 flags = hal_update_flags(store);
        bool may_start = (refused >> store & 1u) == 0 && (flags & NOT_ACTIVE) == 0 &&
                         ((flags & NOT_CONFIRMED) == 0 || (flags & TRIES) != 0);
        if (may_start && is_whole(store, &facts) && (chosen == NONE || facts.version > best->version)) {
            chosen = store;
            *best = facts;
        }
    }
    return chosen;
}

static bool write_row(uint8 slot, uint8 row, const uint8 *bytes)
{
    uint8 there[HAL_UPDATE_ROW];
    hal_update_read(slot, row, there);
    for (uint8 n = 0; n < WRITES && memcmp(there, bytes, HAL_UPDATE_ROW) != 0; n++) {
        hal_update_erase(slot, row);
        hal_update_write(slot, row, bytes);
        hal_update_read(slot, row, there);
    }
    return memcmp(there, bytes, HAL_UPDATE_ROW) == 0;
}

static bool write_store(uint8 store, uint8 row, const uint8 *bytes)
{
    if (write_row(store, row, bytes)) {
        return true;
    }
    worn |= (uint8)(1u << store);
    target = NONE;
    missing = 0;
    return false;
}

/* Clears flags; returns whether they are 0 now. */
static bool clear(uint8 store, uint16 bits)
{
    if ((hal_update_flags(store) & bits & (uint16)~frozen[store]) != 0) {
        hal_update_clear(store, bits);
        frozen[store] |= hal_update_flags(store) & bits;
    }
    return (hal_update_flags(store) & bits) == 0;
}

bool Sys_Begin_Update(const sys_update *facts)
{
    sys_update other;
    uint8 kept = choose(&other);
    if (!is_possible(facts) || !Sys_Is_UpdateAllowed(facts->version) || (kept != NONE && !is_confirmed(kept)) || (running != NONE && !is_confirmed(running))) {
        return false; /* `running` is checked because choose() skips a program during its last try */
    }
    for (uint8 store = 0; store < HAL_UPDATE_STORES; store++) {
        if (is_whole(store, &other) &&
            (facts->version <= other.version || !Sys_Keep_UpdateVersion(other.version))) {
            return false;
        }
    }
    uint8 store = kept == 0 || (kept == NONE && (worn & 1u) != 0) ? 1 : 0;
    if ((worn >> store & 1u) != 0) {
        return false;
    }
    target = NONE; /* power may fail below: the update is begun only once all is written */
    missing = 0;
    stored = stored == store ? NONE : stored;
    Sys_Forget_UpdateTag(store);
    hal_update_erase(store, 0); /* first: an erased head invalidates the store whatever its flags are */
    hal_update_renew(store);
    frozen[store] = 0;
    if (hal_update_flags(store) != ALL) {
        worn |= (uint8)(1u << store);
        return false;
    }
    coming = *facts;
    missing = 0xFFFFFFFFu >> (HAL_UPDATE_ROWS - facts->rows);
    target = store;
    return true;
}

bool Sys_Put_UpdateRow(uint8 row, const uint8 *bytes)
{
    if (target == NONE || row >= coming.rows) {
        return false;
    }
    uint32 bit = (uint32)1 << row;
    if ((missing & bit) != 0) {
        if (!write_store(target, (uint8)(row + 1u), bytes)) {
            return false;
        }
        missing &= ~bit;
    }
    return true;
}

uint32 Sys_Get_MissingRows(void)
{
    return missing;
}

bool Sys_End_Update(void)
{
    uint8 row[HAL_UPDATE_ROW];
    uint8 store = target;
    if (store == NONE || missing != 0) {
        return false;
    }
    target = NONE;
    if (!holds(store, &coming)) {
        return false;
    }
    pack(row, &coming);
    return write_store(store, 0, row); /* last: the head makes the program valid */
}

static uint8 newest(sys_update *best)
{
    uint8 found = NONE;
    for (uint8 store = 0; store < HAL_UPDATE_STORES; store++) {
        sys_update facts;
        if (store != target && is_whole(store, &facts) && (found == NONE || facts.version > best->version)) {
            found = store;
            *best = facts;
        }
    }
    return found;
}

bool Sys_Get_StoredUpdate(sys_update *facts, bool *is_active)
{
    uint8 store = newest(facts);
    *is_active = store != NONE && (hal_update_flags(store) & NOT_ACTIVE) == 0;
    stored = store;
    return store != NONE;
}

void Sys_Get_UpdateRow(uint8 row, uint8 *bytes)
{
    if (stored != NONE && row < HAL_UPDATE_ROWS) {
        hal_update_read(stored, (uint8)(row + 1u), bytes);
    }
}

bool Sys_Activate_Update(uint16 version)
{
    sys_update facts;
    for (uint8 store = 0; store < HAL_UPDATE_STORES; store++) {
        if (is_whole(store, &facts) && facts.version == version) {
            return clear(store, NOT_ACTIVE);
        }
    }
    return false;
}

uint16 Sys_Get_NextVersion(void)
{
    sys_update facts;
    return choose(&facts) == NONE ? 0 : facts.version;
}

/* Counts a try before the program runs, because an uncounted try could repeat for ever. If a bit cannot be
 * cleared, the next one counts. */
static bool count_try(uint8 store)
{
    uint16 tries = hal_update_flags(store) & TRIES;
    while (tries != 0) {
        uint16 one = tries & (uint16)-tries;
        if (clear(store, one)) {
            return true;
        }
        tries ^= one;
    }
    return false;
}

static bool install(uint8 store, uint8 rows)
{
    uint8 bytes[HAL_UPDATE_ROW];
    bool is_there = true;
    for (uint8 row = 0; row < rows && is_there; row++) {
        hal_update_read(store, (uint8)(row + 1u), bytes);
        is_there = write_row(HAL_UPDATE_RUN, row, bytes);
    }
    return is_there;
}

uint16 Sys_Start_Update(void)
{
    sys_update facts;
    worn = refused = 0;
    memset(frozen, 0, sizeof frozen);
    while ((running = choose(&facts)) != NONE) {
        if ((is_confirmed(running) || count_try(running)) && install(running, facts.rows)) {
            hal_update_run();
            return facts.version;
        }
        refused |= (uint8)(1u << running);
    }
    return 0;
}

bool Sys_Confirm_Update(void)
{
    if (running == NONE) {
        return false;
    }
    return is_confirmed(running) || clear(running, NOT_CONFIRMED);
}
