/* SPDX-License-Identifier: MIT */
/* Light detection per sensor. Each sensor has a level (mean of about four scans), a background that follows slow
 * changes and a threshold that follows the noise; all in sixteenths of a count. */
#include "infrared_parts.h"

#include "hal_cpu.h"
#include "kernel.h"

enum {
    COUNT = 16,
    SPREAD_FINE = 4, /* the spread is in 1/64 of a count */
    SPREADS = 4,     /* per threshold, which is 4.6 sigma: a spread (75 % of a normal distribution) is 1.15 sigma */
    SPREAD_MOST = 15 * COUNT * SPREAD_FINE,
    RISING = 3, /* a level outside the spread adds this, one inside subtracts 1: in balance one in four is outside */
    STEP = 4,   /* change of the background per update: 32 counts a second */
    FIRST_THRESHOLD = 4
};

static struct {
    uint16 level;
    uint16 limit; /* the sensor is lit if its level is below */
} filters[HAL_INFRARED_SENSORS];
static uint16 background[HAL_INFRARED_SENSORS];
static uint16 spread[HAL_INFRARED_SENSORS]; /* distance from the background that three levels in four do not exceed */
static uint16 least = COUNT * FIRST_THRESHOLD; /* minimum threshold */
static uint8 followed; /* sensor updated last */

static uint16 margin(uint8 sensor)
{
    uint16 noise = (uint16)(SPREADS * spread[sensor] / SPREAD_FINE);
    return noise > least ? noise : least;
}

static void set_limit(uint8 sensor)
{
    uint16 dark = background[sensor];
    filters[sensor].limit = (uint16)(dark > margin(sensor) ? dark - margin(sensor) : 0);
}

/* Updates background and spread by steps of fixed size, so that a single reading has little effect. If a light went
 * out, the background follows at once. */
static HAL_INLINE void follow(uint8 sensor)
{
    uint16 level = filters[sensor].level, dark = background[sensor];
    uint16 distance = (uint16)(level > dark ? level - dark : dark - level);
    if (level > dark) {
        background[sensor] = (uint16)(distance > margin(sensor) ? level : dark + STEP);
    } else if (distance != 0 && level >= filters[sensor].limit) {
        background[sensor] = (uint16)(dark - STEP);
    }
    if (distance > spread[sensor] / SPREAD_FINE) {
        spread[sensor] = (uint16)(spread[sensor] + (spread[sensor] < SPREAD_MOST ? RISING : 0));
    } else if (spread[sensor] != 0) {
        spread[sensor]--;
    }
    set_limit(sensor);
}

HAL_OUTLINE void detector_follow(void)
{
    followed = (uint8)((followed + 1u) % HAL_INFRARED_SENSORS);
    follow(followed);
}

static HAL_INLINE bool filter_one(uint8 sensor, unsigned int reading)
{
    uint16 level = filters[sensor].level;
    level = (uint16)(level - (level >> 2) + (reading << 2));
    filters[sensor].level = level;
    return level < filters[sensor].limit;
}

/* Unrolled: a third faster, and it runs 4,096 times a second. */
bool detector_filter(scan raw)
{
    bool lit = filter_one(0, raw[0]);
    lit |= filter_one(1, raw[1]);
    lit |= filter_one(2, raw[2]);
    lit |= filter_one(3, raw[3]);
    lit |= filter_one(4, raw[4]);
    lit |= filter_one(5, raw[5]);
    lit |= filter_one(6, raw[6]);
    lit |= filter_one(7, raw[7]);
    return lit;
}

uint8 detector_strongest(void)
{
    uint8 strongest = 0;
    uint16 most = 0;
    for (uint8 i = 0; i < HAL_INFRARED_SENSORS; i++) {
        if (filters[i].level < background[i] && background[i] - filters[i].level > most) {
            most = (uint16)(background[i] - filters[i].level);
            strongest = i;
        }
    }
    return strongest;
}

void detector_forget(void)
{
    for (uint8 i = 0; i < HAL_INFRARED_SENSORS; i++) {
        filters[i].level = background[i];
    }
}

void detector_adapt(scan raw)
{
    for (uint8 i = 0; i < HAL_INFRARED_SENSORS; i++) {
        background[i] = (uint16)(raw[i] * COUNT);
        filters[i].level = background[i];
        set_limit(i);
    }
}

bool detector_is_dark(scan raw)
{
    for (uint8 i = 0; i < HAL_INFRARED_SENSORS; i++) {
        uint16 reading = (uint16)(raw[i] * COUNT);
        if (reading < background[i] && background[i] - reading > 2 * margin(i)) { /* noisier than the mean: twice */
            return false;
        }
    }
    return true;
}

uint16 detector_background(uint8 sensor)
{
    return background[sensor];
}

uint16 detector_level(uint8 sensor)
{
    return filters[sensor].level;
}

bool Sys_Set_InfraredThreshold(uint8 counts)
{
    if (counts == 0 || counts > 100) {
        return os_fail(SYS_ERROR_ARGUMENT);
    }
    HAL_STORE(least, (uint16)(COUNT * counts));
    return true;
}
