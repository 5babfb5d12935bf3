/* SPDX-License-Identifier: MIT */
/* Decodes RC-5 from edges (epuck.md §6). Every bit has an edge in its middle: falling is 1, rising 0. Edges between two
 * bits come half a bit later and carry no information, so only the distance to the last middle counts. */
#include "remote.h"

#include "hal_remote.h"
#include "kernel.h"

enum { BITS = 14, START_BITS = 3u << 12, TOGGLE = 1u << 11, NO_FRAME = 0 };

/* Distances to the last middle are 1 (between bits) or 2 half bits; limits lie in between. */
#define HALF_BIT (HAL_REMOTE_TICKS_PER_S / 1000UL * 889UL / 1000UL) /* 0.889 ms, within 32 bits */
#define SHORTEST (HALF_BIT / 2)
#define MIDDLE (HALF_BIT * 3 / 2)
#define LONGEST (HALF_BIT * 5 / 2)

static sys_remote_processor processor;
static uint32 last_middle;
static uint16 bits, last_frame;
static uint8 count; /* bits so far; 0 = idle */

static void complete(uint16 frame)
{
    sys_remote_frame seen = {(uint8)(frame >> 6 & 31u), (uint8)(frame & 63u), (frame & TOGGLE) != 0};
    if ((frame & START_BITS) != START_BITS || frame == last_frame) { /* not RC-5, or the key is held */
        return;
    }
    last_frame = frame;
    if (processor == NULL || processor(&seen)) {
        (void)Sys_Send_Event(SYS_IO_REMOTECONTROL, &seen.command, sizeof seen.command);
    }
}

void remote_edge(bool falling, uint32 ticks)
{
    uint32 distance = ticks - last_middle;
    if (count != 0 && distance >= SHORTEST && distance < MIDDLE) {
        return;
    }
    if (count == 0 || distance < SHORTEST || distance >= LONGEST) { /* may be the middle of a first start bit */
        count = falling ? 1 : 0;
        bits = 1;
    } else {
        bits = (uint16)(bits << 1 | (falling ? 1u : 0u));
        if (++count == BITS) {
            count = 0;
            complete(bits);
        }
    }
    last_middle = ticks;
}

sys_remote_processor Sys_Set_RemoteProcessor(sys_remote_processor wanted)
{
    sys_remote_processor before = processor;
    HAL_STORE(processor, wanted);
    return before;
}

bool Sys_Start_Remote(void)
{
    count = 0;
    last_frame = NO_FRAME;
    hal_remote_start();
    return Sys_Register_Event(SYS_IO_REMOTECONTROL);
}
