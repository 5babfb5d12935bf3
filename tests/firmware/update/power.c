/* The program stores of io/update in RAM cells whose power fails at an operation that the test selects. The operation
 * has not happened, has happened, or has changed some of its bits. The test prints figures; a failure ends with status
 * 1. */
#include "update.c"

#include <setjmp.h>
#include <stdio.h>
#include <stdlib.h>

#include "tags.c"

enum { NOT_DONE, DONE, TORN, MODES, SLOTS = HAL_UPDATE_STORES + 1, NEVER = 1 << 30 };

typedef struct {
    uint8 rows[SLOTS][HAL_UPDATE_ROWS + 1][HAL_UPDATE_ROW];
    uint16 flags[HAL_UPDATE_STORES];
    uint8 versions[HAL_UPDATE_CELLS][2];
} cells;

static cells now;
static bool flags_stick; /* worn out: flags cannot change */
static jmp_buf power_off;
static int operations, cut_at = NEVER, mode;
static uint32 seed = 1;
static uint16 ran;
static long checks;

static uint8 images[8][HAL_UPDATE_ROWS][HAL_UPDATE_ROW]; /* indexed by version */
static uint8 rows_of[8];

static uint8 noise(void)
{
    seed = seed * 1664525u + 1013904223u;
    return (uint8)(seed >> 24);
}

static void check(bool is_true, const char *what)
{
    checks++;
    if (!is_true) {
        printf("failed: %s (power off at operation %d, mode %d)\n", what, cut_at, mode);
        exit(1);
    }
}

static void change(uint8 *cell, const uint8 *to, int count)
{
    bool is_cut = operations++ == cut_at;
    for (int i = 0; i < count && !(is_cut && mode == NOT_DONE); i++) {
        uint8 bits = is_cut && mode == TORN ? noise() : 0xFF;
        cell[i] = (uint8)((cell[i] & ~bits) | (to[i] & bits));
    }
    if (is_cut) {
        cut_at = NEVER;
        longjmp(power_off, 1);
    }
}

void hal_update_read(uint8_t slot, uint8_t row, uint8_t *bytes)
{
    memcpy(bytes, now.rows[slot][row], HAL_UPDATE_ROW);
}

void hal_update_erase(uint8_t slot, uint8_t row)
{
    uint8 ones[HAL_UPDATE_ROW];
    memset(ones, 0xFF, sizeof ones);
    change(now.rows[slot][row], ones, HAL_UPDATE_ROW);
}

void hal_update_write(uint8_t slot, uint8_t row, const uint8_t *bytes)
{
    uint8 both[HAL_UPDATE_ROW];
    for (int i = 0; i < HAL_UPDATE_ROW; i++) {
        both[i] = bytes[i] & now.rows[slot][row][i];
    }
    change(now.rows[slot][row], both, HAL_UPDATE_ROW);
}

uint16_t hal_update_flags(uint8_t store)
{
    return now.flags[store];
}

static void set_flags(uint8 store, uint16 flags)
{
    if (flags_stick) {
        return;
    }
    uint8 to[2] = {(uint8)flags, (uint8)(flags >> 8)}, cell[2] = {(uint8)now.flags[store], (uint8)(now.flags[store] >> 8)};
    if (operations == cut_at) { /* does not return from `change` */
        uint16 bits = mode == NOT_DONE ? 0 : mode == DONE ? 0xFFFF : (uint16)(noise() | noise() << 8);
        now.flags[store] = (uint16)((now.flags[store] & ~bits) | (flags & bits));
    } else {
        now.flags[store] = flags;
    }
    change(cell, to, 2);
}

void hal_update_clear(uint8_t store, uint16_t bits)
{
    set_flags(store, now.flags[store] & (uint16)~bits);
}

void hal_update_renew(uint8_t store)
{
    set_flags(store, 0xFFFF);
}

uint16_t hal_update_cell(uint8_t cell)
{
    return (uint16_t)(now.versions[cell][0] | now.versions[cell][1] << 8);
}

void hal_update_set_cell(uint8_t cell, uint16_t value)
{
    change(now.versions[cell], (const uint8[]){0xFF, 0xFF}, 2);
    change(now.versions[cell], (const uint8[]){(uint8)value, (uint8)(value >> 8)}, 2);
}

/* The execution slot must contain one of the images, whole. */
void hal_update_run(void)
{
    ran = 0;
    for (uint16 version = 1; version < 8; version++) {
        bool is_same = rows_of[version] != 0;
        for (uint8 row = 0; row < rows_of[version]; row++) {
            is_same = is_same && memcmp(now.rows[HAL_UPDATE_RUN][row], images[version][row], HAL_UPDATE_ROW) == 0;
        }
        ran = is_same ? version : ran;
    }
    check(ran != 0, "what is called is no image");
}

static sys_update facts_of(uint16 version)
{
    uint32 crc = 0xFFFFFFFFu;
    for (uint8 row = 0; row < rows_of[version]; row++) {
        crc = Sys_Add_UpdateCrc(crc, images[version][row], HAL_UPDATE_ROW);
    }
    return (sys_update){version, rows_of[version], crc ^ 0xFFFFFFFFu};
}

static void reboot(void)
{
    target = running = NONE;
    missing = 0;
    ran = 0;
}

static uint16 start(void)
{
    reboot();
    uint16 version = Sys_Start_Update();
    check(version == ran, "the returned version is the one that was called");
    return version;
}

/* Receives a version, starts it and confirms it. The next start shows the result. */
static void receive(uint16 version)
{
    sys_update facts = facts_of(version);
    if (Sys_Begin_Update(&facts)) {
        for (uint8 row = facts.rows; row-- != 0;) {
            check(Sys_Put_UpdateRow(row, images[version][row]), "a row is taken");
        }
        check(Sys_Get_MissingRows() == 0 && Sys_End_Update(), "a whole image is taken");
    }
    Sys_Activate_Update(version);
    start();
    Sys_Confirm_Update();
}

static cells empty(void)
{
    cells all;
    memset(&all, 0xFF, sizeof all);
    return all;
}

/* Cuts power at operation `first` of an update from `old` (0: firmware alone) to `old` + 1, then at operation `second`
 * of the next start. Returns the number of power failures that occurred: short sequences have fewer. */
static int fails_twice(const cells *before, uint16 old, int first, int first_mode, int second, int second_mode)
{
    volatile bool is_cut = false, is_cut_again = false;
    uint16 new = old + 1;
    now = *before;
    reboot();
    operations = 0, cut_at = first, mode = first_mode;
    if (setjmp(power_off) == 0) {
        receive(new);
    } else {
        is_cut = true;
    }
    operations = 0, cut_at = second, mode = second_mode;
    if (setjmp(power_off) == 0) {
        start();
    } else {
        is_cut_again = true;
    }
    cut_at = NEVER;
    uint16 version = start();
    check(version == old || version == new, "the old or the new one runs");
    check(is_cut || version == new, "an update without a failure arrives");
    Sys_Confirm_Update();
    receive(new); /* the interrupted update can be completed */
    check(start() == new, "the update can be finished");
    receive(new + 1); /* the following update can be completed too */
    check(start() == new + 1, "the next update arrives");
    return is_cut + is_cut_again;
}

static void power(uint16 old)
{
    now = empty();
    reboot();
    check(start() == 0, "nothing is called where nothing is");
    for (uint16 version = 1; version <= old; version++) {
        receive(version);
    }
    check(start() == old, "the versions before are there");
    cells before = now;
    int pairs = 0, first = 0;
    for (bool goes_on = true; goes_on; first++) {
        goes_on = false;
        for (int m = 0; m < MODES; m++) {
            goes_on |= fails_twice(&before, old, first, m, NEVER, DONE) != 0;
            for (int second = 0; second < 12; second++) { /* more operations than a start of this image makes */
                for (int n = 0; n < MODES; n++) {
                    pairs += fails_twice(&before, old, first, m, second, n) == 2;
                }
            }
        }
    }
    printf("from version %u: %d operations, each cut in %d ways, and again in the start: %d pairs\n", old, first - 1, MODES,
           pairs);
}

/* Starts of a program that never confirms. */
static void roll_back(void)
{
    now = empty();
    reboot();
    receive(1);
    sys_update facts = facts_of(2);
    check(Sys_Begin_Update(&facts), "begun");
    for (uint8 row = 0; row < facts.rows; row++) {
        sys_update old = facts_of(1), large = {9, HAL_UPDATE_ROWS + 1, 0};
        check(!Sys_Begin_Update(&old) && !Sys_Begin_Update(&large), "neither is taken");
        check(Sys_Put_UpdateRow(row, images[2][row]), "the update in progress continues");
    }
    check(Sys_End_Update(), "ended");
    check(start() == 1, "not before it is activated");
    check(Sys_Activate_Update(2), "activated");
    for (int i = 0; i < SYS_UPDATE_TRIES; i++) {
        flags_stick = true;
        check(start() == 1 && Sys_Get_NextVersion() == 1, "where tries cannot be counted the one before runs");
        flags_stick = false;
        check(start() == 2, "tried");
        sys_update third = facts_of(3);
        check(!Sys_Begin_Update(&third), "nothing is overwritten during the trial");
    }
    check(Sys_Get_NextVersion() == 1 && start() == 1 && start() == 1, "the one before is back");
    check(!Sys_Begin_Update(&facts), "what has failed is not taken again");
    receive(3);
    check(start() == 3, "a newer one is");
    now.rows[running][1][5] ^= 0x10;
    check(start() == 1, "a bit that flash has lost is noticed");
    receive(3);
    check(start() == 3, "and that version taken again");
}

/* Damage to authenticated updates is made by a forger, who corrects the CRC. */
static void forge_crc(sys_update *facts, uint8 (*rows)[HAL_UPDATE_ROW])
{
    facts->crc = 0xFFFFFFFFu;
    for (uint8 row = 0; row < facts->rows; row++) {
        facts->crc = Sys_Add_UpdateCrc(facts->crc, rows[row], HAL_UPDATE_ROW);
    }
    facts->crc = ~facts->crc;
}

/* Transfers images with every kind of damage and returns how many were refused. */
static int damaged(int count)
{
    int refused = 0;
    now = empty();
    reboot();
    receive(1);
    cells before = now;
    for (int n = 0; n < count; n++) {
        now = before;
        check(start() == 1, "the old one runs");
        sys_update facts = facts_of(2);
        static uint8 spoilt[HAL_UPDATE_ROWS][HAL_UPDATE_ROW];
        memcpy(spoilt, images[2], sizeof spoilt);
        uint8 row = noise() % facts.rows, other = noise() % facts.rows, at = noise() % HAL_UPDATE_ROW;
        switch (n % 6) {
        case 0: /* bits */
            for (uint8 i = noise() % 8; i-- != 0;) {
                spoilt[noise() % facts.rows][noise() % HAL_UPDATE_ROW] ^= (uint8)(1u << noise() % 8);
            }
            spoilt[row][at] ^= (uint8)(1u << noise() % 8);
            break;
        case 1: /* a burst */
            for (uint8 i = at; i < HAL_UPDATE_ROW && i < at + 9; i++) {
                spoilt[row][i] = noise();
            }
            break;
        case 2: /* a row of another image */
            memcpy(spoilt[row], images[3][row], HAL_UPDATE_ROW);
            break;
        case 3: /* two rows exchanged */
            memcpy(spoilt[row], images[2][other], HAL_UPDATE_ROW);
            memcpy(spoilt[other], images[2][row], HAL_UPDATE_ROW);
            break;
        case 4: /* the end of a row is missing */
            memset(spoilt[row] + at, 0xFF, (size_t)(HAL_UPDATE_ROW - at));
            break;
        default: /* false facts */
            facts.crc ^= 1u << noise() % 32;
            facts.rows = noise() % 4 == 0 ? (uint8)(facts.rows + 1 + noise() % 40) : facts.rows;
        }
        if (IS_AUTHENTICATED && n % 6 != 5) {
            forge_crc(&facts, spoilt);
        }
        bool is_damaged = n % 6 == 5 || memcmp(spoilt, images[2], sizeof spoilt) != 0;
        bool is_taken = Sys_Begin_Update(&facts);
        for (uint8 i = 0; is_taken && i < facts.rows; i++) {
            Sys_Put_UpdateRow(i, spoilt[i]);
        }
        is_taken = is_taken && Sys_End_Update();
        check(is_taken == !is_damaged, "a damaged image is refused, a whole one taken");
        check(!is_damaged || !Sys_Activate_Update(2), "and not activated");
        check(start() == 1, "the old one runs on");
        refused += is_damaged;
    }
    return refused;
}

int main(void)
{
    for (int version = 1; version < 8; version++) {
        rows_of[version] = (uint8)(version == 2 ? 3 : version == 1 ? 2 : 1 + version % 3);
        for (int i = 0; i < HAL_UPDATE_ROWS * HAL_UPDATE_ROW; i++) {
            images[version][i / HAL_UPDATE_ROW][i % HAL_UPDATE_ROW] = noise();
        }
        add_tag((uint16)version, rows_of[version], images[version]);
    }
    power(0);
    power(1);
    power(2);
    roll_back();
    rows_of[2] = 9, rows_of[3] = 9;
    add_tag(2, 9, images[2]);
    add_tag(3, 9, images[3]);
    int refused = damaged(10500);
    check(refused >= 10000, "enough were damaged");
    printf("%d damaged images refused, %ld checks\n", refused, checks);
    return 0;
}
