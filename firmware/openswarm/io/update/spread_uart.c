/* SPDX-License-Identifier: MIT */
/* A host as a neighbour at the other end of a UART (spread.h; openswarm/flashing/messages.py). */
#include "hal_compiler.h"
#include "spread.h"

BOUNDS_AT("put(0)", calls sys_put);
bool Sys_Spread_Tx(const uint8 *message, uint16 size, sys_put put)
{
    bool is_frame = size == SYS_SPREAD_BYTES && (message[0] & SYS_SPREAD_KIND) != 0;
    return is_frame ? put(0) && Sys_Frame_Tx(message, size, put) : Sys_Raw_Tx(message, size, put);
}
