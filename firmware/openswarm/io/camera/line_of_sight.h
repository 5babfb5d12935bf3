/* SPDX-License-Identifier: MIT */
/* The line-of-sight sensor: one colour for what stands in front of the robot. Plain C99, integers only; knows neither
 * kernel nor robot. */
#ifndef LINE_OF_SIGHT_H
#define LINE_OF_SIGHT_H

#include <stdint.h>

enum { SIGHT_GREEN = 2, SIGHT_RED = 4, SIGHT_WHITE = 7 }; /* as sys_colour */

/* Of a 20 x 20 frame in RGB565, high byte first: SIGHT_RED (object), SIGHT_GREEN (robot) or SIGHT_WHITE (nothing). */
uint8_t line_of_sight(const uint8_t *frame);

#endif
