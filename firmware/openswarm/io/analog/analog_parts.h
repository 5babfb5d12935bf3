/* SPDX-License-Identifier: MIT */
/* Private interface of this folder: the measurements in the stream of scans. */
#ifndef ANALOG_PARTS_H
#define ANALOG_PARTS_H

#include "analog.h"

enum { ANALOG_ZERO = 2048 /* counts at rest (epuck.md §6) */ };

void proximity_init(void);
void proximity_measured(uint8 sensor, uint16 raw, bool lit);
void proximity_send(void);

void motion_init(void);
void motion_measured(const uint16 *axes); /* x, y, z */
void motion_send(void);

void sound_init(void);
void sound_measured(const uint16 *microphones);
void sound_send(void);

#endif
