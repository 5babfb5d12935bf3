/* SPDX-License-Identifier: MIT */
/* Line-of-sight sensor: classifies what is in front of the robot as one colour. Plain C99, integers only;
 * independent of kernel and robot. */
#ifndef LINE_OF_SIGHT_H
#define LINE_OF_SIGHT_H

#include <stdint.h>

enum { SIGHT_GREEN = 2, SIGHT_RED = 4, SIGHT_WHITE = 7 }; /* as sys_colour */

/* Classifies a 20 x 20 frame in RGB565, high byte first: SIGHT_RED (object), SIGHT_GREEN (robot), SIGHT_WHITE
 * (neither). */
uint8_t line_of_sight(const uint8_t *frame);

#endif
