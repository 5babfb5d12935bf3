/* SPDX-License-Identifier: MIT */
/* Lower layer of the analog inputs: repeated scans, two for each pair of emitters: first dark, then lit. */
#ifndef HAL_ANALOG_H
#define HAL_ANALOG_H

#include <stdbool.h>
#include <stdint.h>

#define HAL_ANALOG_FIXED 6 /* three microphones, then x, y and z of the accelerometer */

typedef struct {
    uint16_t fixed[HAL_ANALOG_FIXED];
    uint16_t near[2]; /* sensors `pair` and `pair` + 4 */
    uint8_t pair;     /* 0-3 */
    bool lit;         /* the emitters of this pair had been on for over 0.5 ms */
} hal_analog_scan;

void hal_analog_start(void);
void analog_scanned(const hal_analog_scan *scan); /* ISR, io/analog; 1,280 times a second */

#endif
