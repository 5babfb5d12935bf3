/* CRC-16 over 512 random bytes and a bubble sort of 128 random numbers, ROUNDS times; the same source runs on the
 * dsPIC30F, on an AVR and on the host. Random input makes branches unpredictable. */
#include <stdint.h>

#ifndef ROUNDS
#define ROUNDS 20
#endif

static uint8_t bytes[512];
static int16_t numbers[128];
static uint16_t state = 1;

static uint16_t random16(void)
{
    state = (uint16_t)(state * 25173u + 13849u);
    return (uint16_t)(state >> 8 | state << 8);
}

static uint16_t crc16(const uint8_t *data, uint16_t count)
{
    uint16_t crc = 0xFFFF;
    while (count--) {
        crc ^= *data++;
        for (uint8_t bit = 0; bit < 8; bit++) {
            crc = (crc & 1) ? (uint16_t)((crc >> 1) ^ 0xA001) : (uint16_t)(crc >> 1);
        }
    }
    return crc;
}

static void sort(int16_t *a, uint16_t count)
{
    for (uint16_t i = 0; i + 1 < count; i++) {
        for (uint16_t j = 0; j + 1 < count - i; j++) {
            if (a[j] > a[j + 1]) {
                int16_t swap = a[j];
                a[j] = a[j + 1];
                a[j + 1] = swap;
            }
        }
    }
}

volatile uint16_t result;

int main(void)
{
    for (uint16_t round = 0; round < ROUNDS; round++) {
        for (uint16_t i = 0; i < sizeof bytes; i++) {
            bytes[i] = (uint8_t)random16();
        }
        for (uint16_t i = 0; i < 128; i++) {
            numbers[i] = (int16_t)random16();
        }
        sort(numbers, 128);
        result ^= crc16(bytes, sizeof bytes) ^ (uint16_t)numbers[64];
    }
    return 0;
}
