/* One robot with faulty memory cells: power fails during operations, clocks wrap, bytes and flags are stuck, program
 * stores wear out. The robot must only ever call whole programs. */
#include "update.c"

#include "spread.c"

#include <setjmp.h>
#include <stdio.h>
#include <stdlib.h>

#include "tags.c"

enum { PROGRAMS = 14, SLOTS = HAL_UPDATE_STORES + 1, NEVER = 1 << 30 };

static struct {
    sys_update facts;
    uint8 rows[HAL_UPDATE_ROWS][HAL_UPDATE_ROW];
} programs[PROGRAMS];

static uint8 cells[SLOTS][HAL_UPDATE_ROWS + 1][HAL_UPDATE_ROW];
static uint16 flags[HAL_UPDATE_STORES];
static uint16 kept_versions[HAL_UPDATE_CELLS];
static jmp_buf power_off;
static int cut_in, history;
static const uint8 *stuck; /* a row with one byte that cannot change */
static bool sticks;
static uint8 worn_stores;  /* bit n: no cell of store n can change */
static uint16 stuck_flags; /* bits that cannot change, the same in all flags */
static long changes;
static uint32 seed, now;
static long calls, reads;

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

static void change_version(uint8 cell, uint16 to)
{
    uint16 bits = cut_in == 0 ? (uint16)chance(65536) : 0xFFFF;
    kept_versions[cell] = (uint16)((kept_versions[cell] & ~bits) | (to & bits));
    changes++;
    operated();
}

uint16_t hal_update_cell(uint8_t cell)
{
    return kept_versions[cell];
}

void hal_update_set_cell(uint8_t cell, uint16_t value)
{
    change_version(cell, 0xFFFF);
    change_version(cell, value);
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

/* Adds tag and CRC to a program. */
static void finish(int n)
{
    sys_update *facts = &programs[n].facts;
    add_tag(facts->version, facts->rows, programs[n].rows);
    facts->crc = 0xFFFFFFFFu;
    for (uint8 r = 0; r < facts->rows; r++) {
        facts->crc = Sys_Add_UpdateCrc(facts->crc, programs[n].rows[r], HAL_UPDATE_ROW);
    }
    facts->crc = ~facts->crc;
}

static void draw_programs(void)
{
    for (int n = 0; n < PROGRAMS; n++) {
        uint8 least = n == PROGRAMS - 1 ? 3 : 1; /* several rows: can be interrupted */
        uint8 rows = (uint8)(least + chance(chance(4) != 0 ? 4 : HAL_UPDATE_ROWS + 1u - least));
        for (uint8 r = 0; r < rows; r++) {
            for (int i = 0; i < HAL_UPDATE_ROW; i++) {
                programs[n].rows[r][i] = (uint8)chance(256);
            }
        }
        programs[n].facts = (sys_update){(uint16)(1 + n / 2), rows, 0};
        finish(n);
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

static void begin_history(bool with_stuck_bytes)
{
    seed = (uint32)++history;
    sticks = with_stuck_bytes;
    stuck = NULL;
    cut_in = NEVER;
    memset(cells, 0xFF, sizeof cells);
    memset(flags, 0xFF, sizeof flags);
    memset(kept_versions, 0xFF, sizeof kept_versions);
    draw_programs();
}
