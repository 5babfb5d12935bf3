/* The swarm's key and the tags of programs, for tests of authenticated updates (-DSYS_UPDATE_AUTH). Without that, programs
 * have no tag. */
#ifdef SYS_UPDATE_AUTH

enum { IS_AUTHENTICATED = 1 };

#include "ascon.h"
#include "hal_update_auth.h"

static uint8 swarm_key[SYS_ASCON_BYTES] = {7, 1, 200, 43, 90, 0, 255, 18, 3, 77, 164, 31, 8, 250, 99, 121};

void hal_update_key(uint8_t *key)
{
    memcpy(key, swarm_key, sizeof swarm_key);
}

static void add_tag(uint16 version, uint8 count, uint8 (*rows)[HAL_UPDATE_ROW])
{
    uint8 nonce[SYS_ASCON_BYTES] = {(uint8)version, (uint8)(version >> 8), count};
    uint8 *block = rows[0], *end = rows[count - 1] + HAL_UPDATE_ROW - SYS_ASCON_BYTES;
    sys_ascon mac;
    Sys_Begin_AsconMac(&mac, swarm_key, nonce);
    for (; block != end; block += SYS_ASCON_BYTES) {
        Sys_Add_AsconMac(&mac, block);
    }
    Sys_End_AsconMac(&mac, swarm_key, block, 0, end);
}

#else

enum { IS_AUTHENTICATED = 0, HAL_UPDATE_CELLS = 4 };

uint16_t hal_update_cell(uint8_t cell);
void hal_update_set_cell(uint8_t cell, uint16_t value);

static void add_tag(uint16 version, uint8 count, uint8 (*rows)[HAL_UPDATE_ROW])
{
    (void)version;
    (void)count;
    (void)rows;
}

#endif
