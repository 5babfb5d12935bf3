/* SPDX-License-Identifier: MIT */
/* Lines of text as messages of UART1. */
#include "bluetooth.h"
#include "hal_compiler.h"

enum { CR = '\r', LF = '\n' };

/* A line that fills the buffer is too long: its rest is discarded, and its end drops the whole line. */
uint16 Sys_Line_Rx(uint8 byte, uint8 *buffer, uint16 *used)
{
    uint16 size = *used;
    if (byte == CR || byte == LF) {
        *used = 0;
        return size < SYS_UART_RX ? size : 0;
    }
    if (size < SYS_UART_RX) {
        buffer[size] = byte;
        *used = (uint16)(size + 1);
    }
    return 0;
}

BOUNDS_AT("for (", loop d);
BOUNDS_AT("!put(", calls sys_put);
BOUNDS_AT("put(CR)", calls sys_put);
bool Sys_Line_Tx(const uint8 *message, uint16 size, sys_put put)
{
    for (uint16 i = 0; i < size; i++) {
        if (!put(message[i])) {
            return false;
        }
    }
    return (size != 0 && message[size - 1] == LF) || (put(CR) && put(LF));
}
