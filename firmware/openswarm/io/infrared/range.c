/* SPDX-License-Identifier: MIT */
/* Distance from strength, by the amplitudes that libIrcom's authors measured between two e-pucks (swarmcom.md 3.1):
 * their fit is 10,269 (d - 6)^-2.354 counts for d cm between the centres. */
#include "infrared_parts.h"

enum { STEP_MM = 10, FIRST_MM = 80, POINTS = 14, NO_LIGHT_MM = 600, TAIL = 23 /* mm per count */ };

/* Counts at 80, 90, ... 210 mm; beyond that the distance is linear in the counts. */
static const uint16 counts_at[POINTS] = {2008, 773, 393, 232, 151, 106, 77, 58, 46, 36, 30, 24, 21, 17};

uint16 Sys_Estimate_Range(uint16 strength)
{
    if (strength >= counts_at[0]) {
        return strength >= 3500 ? 70 : FIRST_MM - STEP_MM / 2;
    }
    uint8 i = 1;
    while (i < POINTS && strength < counts_at[i]) {
        i++;
    }
    if (i == POINTS) {
        return (uint16)(NO_LIGHT_MM - TAIL * strength);
    }
    uint16 span = (uint16)(counts_at[i - 1] - counts_at[i]);
    return (uint16)(FIRST_MM + STEP_MM * i - STEP_MM * (strength - counts_at[i]) / span);
}
