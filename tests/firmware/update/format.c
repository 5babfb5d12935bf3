/* Prints constants by name, and then messages of spread.c and their frames as hexadecimal numbers. The host's tests
 * compare them with their own encoding. */
#include "update.c"

#include "spread.c"

#include "framing.c"
#include "spread_uart.c"

#include <stdio.h>

enum { VERSION = 0xA123, ROWS = 3 };

void hal_update_read(uint8_t slot, uint8_t r, uint8_t *bytes)
{
    (void)slot;
    for (int i = 0; i < HAL_UPDATE_ROW; i++) {
        bytes[i] = (uint8_t)(r * 7 + i * 3);
    }
}

void hal_update_erase(uint8_t slot, uint8_t r)
{
    (void)slot;
    (void)r;
}

void hal_update_write(uint8_t slot, uint8_t r, const uint8_t *bytes)
{
    (void)bytes;
    hal_update_erase(slot, r);
}

uint16_t hal_update_flags(uint8_t store)
{
    (void)store;
    return 0;
}

void hal_update_clear(uint8_t store, uint16_t bits)
{
    (void)store;
    (void)bits;
}

void hal_update_renew(uint8_t store)
{
    (void)store;
}

void hal_update_run(void)
{
}

bool Sys_Raw_Tx(const uint8 *message, uint16 size, sys_put put_byte)
{
    (void)message;
    (void)size;
    (void)put_byte;
    return false; /* unused here: every message is sent as a frame */
}

static bool put(uint8 byte)
{
    printf("%02x", byte);
    return true;
}

static void show(const char *name, const uint8 *message)
{
    printf("%s ", name);
    for (int i = 0; i < SYS_SPREAD_BYTES; i++) {
        put(message[i]);
    }
    printf(" ");
    Sys_Spread_Tx(message, SYS_SPREAD_BYTES, put);
    printf("\n");
}

int main(void)
{
    uint8 m[SYS_SPREAD_BYTES] = {0};
    printf("row %d\nrows %d\nparts %d\nmessage %d\n", HAL_UPDATE_ROW, HAL_UPDATE_ROWS, PARTS, SYS_SPREAD_BYTES);
    uint32 crc = 0xFFFFFFFFu;
    for (uint8 r = 1; r <= ROWS; r++) {
        uint8 bytes[HAL_UPDATE_ROW];
        hal_update_read(0, r, bytes);
        crc = Sys_Add_UpdateCrc(crc, bytes, HAL_UPDATE_ROW);
    }
    have = (sys_update){VERSION, ROWS, ~crc};
    advertise(m);
    show("stored", m);
    is_active = true;
    advertise(m);
    show("active", m);
    want = have;
    row = 2;
    lacking = 0x80001;
    ask(m);
    show("request", m);
    stored = 0;
    wanted_row = 2;
    for (int part = 0; part < PARTS; part++) {
        wanted_parts = (uint32)1 << part;
        send_part(m);
        show("data", m);
    }
    return 0;
}
