/* Forged, replayed, truncated and downgraded programs, with right CRCs, for a robot that authenticates updates, and
 * such advertisements. Every single bit of a program, of an advertisement and of each frame of a transfer is changed
 * once. Prints the numbers of attacks. */
#include "neighbours.c"

enum { OLD = 2, NEW = PROGRAMS - 1, ROWS = 3, TAG = HAL_UPDATE_ROW - SYS_ASCON_BYTES, SECONDS = 1000 / SYS_SPREAD_TICK };

static struct {
    uint8 cells[SLOTS][HAL_UPDATE_ROWS + 1][HAL_UPDATE_ROW];
    uint16 flags[HAL_UPDATE_STORES], versions[HAL_UPDATE_CELLS];
} before;
static uint8 forged[HAL_UPDATE_ROWS + 1][HAL_UPDATE_ROW];

static void keep(void)
{
    memcpy(before.cells, cells, sizeof cells);
    memcpy(before.flags, flags, sizeof flags);
    memcpy(before.versions, kept_versions, sizeof kept_versions);
}

/* Restores the robot kept in `before`, after a reset. */
static void restore(void)
{
    memcpy(cells, before.cells, sizeof cells);
    memcpy(flags, before.flags, sizeof flags);
    memcpy(kept_versions, before.versions, sizeof kept_versions);
    for (uint8 store = 0; store < HAL_UPDATE_STORES; store++) {
        Sys_Forget_UpdateTag(store);
    }
    boot();
}

static void copy(int n)
{
    memset(forged, 0xFF, sizeof forged);
    memcpy(forged, programs[n].rows, (size_t)programs[n].facts.rows * HAL_UPDATE_ROW);
}

/* Returns whether the robot stores `forged` with the CRC that these rows have. */
static bool is_taken(uint16 version, uint8 rows)
{
    sys_update facts = {version, rows, 0xFFFFFFFFu};
    for (uint8 r = 0; r < rows && rows <= HAL_UPDATE_ROWS; r++) {
        facts.crc = Sys_Add_UpdateCrc(facts.crc, forged[r], HAL_UPDATE_ROW);
    }
    facts.crc = ~facts.crc;
    bool is = Sys_Begin_Update(&facts);
    for (uint8 r = 0; is && r < rows; r++) {
        is = Sys_Put_UpdateRow(r, forged[r]);
    }
    return is && Sys_End_Update();
}

static void refuse(uint16 version, uint8 rows, const char *what)
{
    check(!is_taken(version, rows), what);
    check(!Sys_Activate_Update(version), "what is refused cannot be activated");
}

static long forge(void)
{
    long attacks = 0;
    uint16 version = programs[NEW].facts.version;
    for (int bit = 0; bit < ROWS * HAL_UPDATE_ROW * 8; bit++, attacks++) {
        restore();
        copy(NEW);
        forged[bit / 8 / HAL_UPDATE_ROW][bit / 8 % HAL_UPDATE_ROW] ^= (uint8)(1u << bit % 8);
        refuse(version, ROWS, "a program with a changed bit");
    }
    for (int bit = 0; bit < 24; bit++, attacks++) {
        restore();
        copy(NEW);
        refuse(bit < 16 ? (uint16)(version ^ 1u << bit) : version, (uint8)(bit < 16 ? ROWS : ROWS ^ 1u << (bit - 16)),
               "changed facts");
    }
    for (uint8 rows = 1; rows <= HAL_UPDATE_ROWS; rows++, attacks++) {
        restore();
        copy(NEW);
        check(is_taken(version, rows) == (rows == ROWS), "a truncated or extended program");
    }
    for (uint8 rows = 1; rows < ROWS; rows++, attacks++) {
        restore();
        copy(NEW);
        memcpy(forged[rows - 1] + TAG, programs[NEW].rows[ROWS - 1] + TAG, SYS_ASCON_BYTES);
        refuse(version, rows, "a truncated program with the whole one's tag");
    }
    return attacks;
}

static long forge_keys(void)
{
    uint8 own[SYS_ASCON_BYTES];
    uint16 version = programs[NEW].facts.version;
    memcpy(own, swarm_key, sizeof own);
    for (int bit = 0; bit < SYS_ASCON_BYTES * 8; bit++) {
        restore();
        copy(NEW);
        swarm_key[bit / 8] ^= (uint8)(1u << bit % 8);
        add_tag(version, ROWS, forged);
        memcpy(swarm_key, own, sizeof own);
        refuse(version, ROWS, "the tag of another key");
    }
    restore();
    copy(NEW);
    memset(swarm_key, 0xFF, sizeof swarm_key);
    add_tag(version, ROWS, forged);
    refuse(version, ROWS, "a robot without a key takes nothing");
    check(Sys_Start_Update() == programs[OLD].facts.version, "but runs what it had found right");
    Sys_Forget_UpdateTag(0);
    Sys_Forget_UpdateTag(1);
    check(Sys_Start_Update() == 0, "until the next start");
    memcpy(swarm_key, own, sizeof own);
    return 8 * SYS_ASCON_BYTES + 1;
}

/* Versions 2 (running) and 5 (stored); then a transfer that never completes begins and erases 5. */
static long replay(void)
{
    static const int older[] = {0, OLD, 4, 6, 8};
    restore();
    take(8);
    check(is_whole(0, &have) && is_whole(1, &have), "both stores are full");
    sys_update false_one = {65535, 1, 1};
    check(Sys_Begin_Update(&false_one), "the beginning of a transfer is not authenticated, only its message");
    for (int start = 0; start < 2; start++) {
        for (int i = 0; i < 5; i++) {
            copy(older[i]);
            check(!is_taken(programs[older[i]].facts.version, programs[older[i]].facts.rows),
                  "a version that is not above all before");
        }
        boot();
        check(running != NONE, "the version that works runs");
    }
    copy(10);
    check(is_taken(programs[10].facts.version, programs[10].facts.rows), "a higher version is taken");
    return 2 * 5;
}

/* Makes an advertisement and its proof as a neighbour with these facts does. */
static void prove(const sys_update *facts, bool active, uint8 *advertisement, uint8 *proof)
{
    sys_update own = have;
    bool own_active = is_active;
    have = *facts;
    is_active = active;
    advertise(advertisement);
    Sys_Prove_Advertisement(advertisement, proof);
    have = own;
    is_active = own_active;
}

/* Returns whether a robot with two stored programs, of which the older one runs, begins another one or activates the
 * newer one when it receives an advertisement and a proof. */
static bool is_believed(const uint8 *advertisement, const uint8 *proof)
{
    static uint8 cells_before[SLOTS][HAL_UPDATE_ROWS + 1][HAL_UPDATE_ROW];
    memcpy(cells_before, cells, sizeof cells);
    Sys_Start_Spreading(1);
    Sys_Hear_Update(now, advertisement);
    Sys_Hear_Update(now, proof);
    bool is = want.version != 0 || is_active;
    check(is || memcmp(cells, cells_before, sizeof cells) == 0, "a forged advertisement erases nothing");
    return is;
}

static long forge_advertisements(void)
{
    enum { STORED = 8, BITS = SYS_SPREAD_BYTES * 8 };
    static const int older[] = {0, OLD, 4, 6};
    uint8 own[SYS_ASCON_BYTES], m[SYS_SPREAD_BYTES], proof[SYS_SPREAD_BYTES];
    long attacks = 0;
    restore();
    take(STORED);
    memcpy(own, swarm_key, sizeof own);
    for (int active = 0; active < 2; active++) {
        const sys_update *facts = &programs[active ? STORED : NEW].facts;
        prove(facts, active, m, proof);
        for (int bit = 0; bit < 2 * BITS; bit++, attacks++) {
            uint8 *changed = bit < BITS ? m : proof;
            changed[bit / 8 % SYS_SPREAD_BYTES] ^= (uint8)(1u << bit % 8);
            check(!is_believed(m, proof), "an advertisement or a proof with a changed bit");
            changed[bit / 8 % SYS_SPREAD_BYTES] ^= (uint8)(1u << bit % 8);
        }
        for (int bit = 0; bit < SYS_ASCON_BYTES * 8; bit++, attacks++) {
            swarm_key[bit / 8] ^= (uint8)(1u << bit % 8);
            prove(facts, active, m, proof);
            memcpy(swarm_key, own, sizeof own);
            check(!is_believed(m, proof), "the proof of another key");
        }
        memset(swarm_key, 0xFF, sizeof swarm_key);
        prove(facts, active, m, proof);
        check(!is_believed(m, proof), "a robot without a key believes no advertisement");
        check(!Sys_Prove_Advertisement(m, proof), "and proves none");
        memcpy(swarm_key, own, sizeof own);
        attacks++;
    }
    for (int i = 0; i < 4; i++, attacks++) {
        prove(&programs[older[i]].facts, true, m, proof);
        check(!is_believed(m, proof), "a replayed advertisement of a lower version");
    }
    prove(&programs[NEW].facts, false, m, proof);
    check(is_believed(m, proof) && want.version == programs[NEW].facts.version, "a true one is believed");
    return attacks;
}

/* Delivers a neighbour's frames in order and changes a bit of frame `spoilt`. Returns the number of frames. */
static long transfer(long spoilt, int bit, int seconds)
{
    long frames = 0;
    for (int t = 0; t < seconds * SECONDS && have.version != programs[NEW].facts.version; t++) {
        uint8 m[SYS_SPREAD_BYTES];
        uint8 r = row;
        if (t % SECONDS == 0) {
            uint8 both[2][SYS_SPREAD_BYTES];
            is_active = false;
            prove(&programs[NEW].facts, false, both[0], both[1]);
            for (int i = 0; i < 2; i++, frames++) {
                both[i][bit / 8] ^= frames == spoilt ? (uint8)(1u << bit % 8) : 0;
                Sys_Hear_Update(now, both[i]);
            }
        }
        now += SYS_SPREAD_TICK;
        if (!Sys_Spread(now, m) || (m[0] & KINDS) != REQUEST || want.crc != programs[NEW].facts.crc) {
            continue;
        }
        for (uint8 part = 0; part < PARTS; part++, frames++) {
            uint8 whole[PARTS * PART] = {0};
            memcpy(whole, programs[NEW].rows[r], HAL_UPDATE_ROW);
            m[0] = (uint8)(DATA | r);
            m[1] = (uint8)(part << 3 | identity(&programs[NEW].facts) >> 8);
            m[2] = (uint8)identity(&programs[NEW].facts);
            memcpy(m + DATA_HEADER, whole + part * PART, PART);
            m[bit / 8] ^= frames == spoilt ? (uint8)(1u << bit % 8) : 0;
            Sys_Hear_Update(now, m);
        }
    }
    return frames;
}

static long spoil_frames(void)
{
    restore();
    long frames = transfer(-1, 0, 60);
    check(have.crc == programs[NEW].facts.crc && frames > ROWS * PARTS, "a whole transfer");
    for (long spoilt = 0; spoilt < frames; spoilt++) {
        for (int bit = 0; bit < SYS_SPREAD_BYTES * 8; bit++) {
            sys_update facts;
            bool active;
            restore();
            transfer(spoilt, bit, 240);
            check(Sys_Get_StoredUpdate(&facts, &active) && is_same(&facts, &programs[NEW].facts),
                  "the program arrives after a changed frame");
            check(Sys_Activate_Update(facts.version) && Sys_Start_Update() == facts.version, "and runs");
        }
    }
    return frames * SYS_SPREAD_BYTES * 8;
}

/* Replays the advertisements of two newer programs in turn and answers with false data. Returns the number of transfers
 * that the robot begins, each of which writes its flash. */
static long wear_out(void)
{
    static const int newer[] = {10, NEW};
    long begun_transfers = 0;
    restore();
    Sys_Start_Spreading(1);
    failed = (sys_update){0, 0, 0};
    for (int turn = 0; turn < 40; turn++) {
        const sys_update *facts = &programs[newer[turn % 2]].facts;
        uint8 both[2][SYS_SPREAD_BYTES];
        prove(facts, false, both[0], both[1]);
        Sys_Hear_Update(now, both[0]);
        Sys_Hear_Update(now, both[1]);
        begun_transfers += want.version != 0;
        while (want.version != 0) {
            for (uint8 part = 0; part < PARTS && want.version != 0; part++) {
                uint8 m[SYS_SPREAD_BYTES] = {(uint8)(DATA | row), (uint8)(part << 3 | identity(facts) >> 8),
                                             (uint8)identity(facts)};
                Sys_Hear_Update(now, m);
            }
        }
    }
    check(begun_transfers >= MOST_FAILED && begun_transfers <= 2 * MOST_FAILED, "a forger wears the flash out");
    return begun_transfers;
}

int main(void)
{
    begin_history(false);
    programs[NEW].facts.rows = ROWS;
    finish(NEW);
    boot();
    take(OLD);
    check(Sys_Activate_Update(programs[OLD].facts.version) && Sys_Start_Update() != 0 && Sys_Confirm_Update(), "it runs");
    keep();
    long forgeries = forge(), keys = forge_keys(), replays = replay(), frames = spoil_frames();
    long advertisements = forge_advertisements();
    printf("%ld forgeries, %ld keys, %ld replays, %ld frames, ", forgeries, keys, replays, frames);
    printf("%ld advertisements, %ld spoiled\n", advertisements, wear_out());
    return 0;
}
