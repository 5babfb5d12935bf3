/* SPDX-License-Identifier: MIT */
/* Distance from strength, by the calibration tables in a Kilobot's EEPROM: 14 counts of each gain, high bytes first,
 * at 33, 38, ... 98 mm between the robots' centres (kilolib's estimate_distance). */
#include "infrared_parts.h"
#include "pulses.h"

#include <avr/eeprom.h>

enum { POINTS = 14, FIRST_MM = 33, STEP_MM = 5, MOST_COUNTS = 1023 };
#define LOW_GAIN ((const uint8 *)0x20)
#define HIGH_GAIN ((const uint8 *)0x50)

static uint16 counts_at(const uint8 *table, uint8 point)
{
    uint8 high = eeprom_read_byte(table + 2u * point);
    return (uint16)((uint16)high << 8 | eeprom_read_byte(table + 2u * point + 1u));
}

uint16 Sys_Estimate_Range(uint16 strength)
{
    const uint8 *table = HIGH_GAIN;
    if (strength >= PULSES_LOW_GAIN) {
        table = LOW_GAIN;
        strength = (uint16)(strength - PULSES_LOW_GAIN);
    }
    uint16 nearer = counts_at(table, 0);
    if (nearer > MOST_COUNTS) { /* erased EEPROM: this robot is not calibrated */
        return 0;
    }
    if (strength >= nearer) {
        return FIRST_MM;
    }
    for (uint8 i = 1; i < POINTS; i++) {
        uint16 farther = counts_at(table, i);
        if (strength >= farther) {
            return (uint16)(FIRST_MM + STEP_MM * i - STEP_MM * (strength - farther) / (nearer - farther));
        }
        nearer = farther;
    }
    return FIRST_MM + STEP_MM * (POINTS - 1);
}
