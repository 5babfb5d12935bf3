/* SPDX-License-Identifier: MIT */
/* Text protocol on UART1, the Bluetooth link: converts lines of text to events, and events to lines of text.
 *
 * A line ends with CR or LF and has at most SYS_UART_RX - 1 characters; longer lines are dropped whole. The commands
 * are those of the robot's own firmware that concern devices of every program (epuck.md §6, SerCom): a letter, then
 * numbers after commas. The answer begins with the lower-case letter.
 *     D,l,r     wheel speeds in steps/s, +-1000; the driver keeps whole mm/s      d
 *     E         wheel speeds                                                      e,l,r
 *     L,n,v     LED n (8 body, 9 front): 0 off, 1 on, 2 toggle                    l
 *     B,v  F,v  body, front LED                                                   b  f
 *     C  V  H   selector, version, help                                           c,n  v,...  h,...
 *     S         wheels stop, LEDs off                                             s
 * Any registered event, by number:
 *     !e,v      send event e with value v                                         !
 *     +e  -e    report event e, no longer report it                               +  -
 * Every occurrence of a reported event is sent as a line !e,v. The answer to a command that fails is ?. Lines that
 * match no command become SYS_BLUETOOTH_RECEIVED. Lines for which the transmit buffer has no room are dropped whole
 * and counted (Sys_Get_UARTStatistics).
 */
#ifndef BLUETOOTH_H
#define BLUETOOTH_H

#include "openswarm_io.h"

/* [characters of one line without its end] for a line that is no command. To send: SYS_SEND_UART1 or
 * Sys_Write_UART1. */
enum { SYS_BLUETOOTH_RECEIVED = 0x15 };

/* Receives every line first; true: handled or dropped; false: the line becomes SYS_BLUETOOTH_RECEIVED. Handler
 * context. */
typedef bool (*sys_bluetooth_processor)(const char *line, uint16 size);
bool Sys_Default_BluetoothProcessor(const char *line, uint16 size); /* the commands above */
/* MTH | no | 15 | 4 | none.  NULL: default. */
sys_bluetooth_processor Sys_Set_BluetoothProcessor(sys_bluetooth_processor processor);

/* Rx- and Tx-processor of UART1 under this driver: a message is a line; CR LF is added unless it ends with LF. */
uint16 Sys_Line_Rx(uint8 byte, uint8 *buffer, uint16 *used);
bool Sys_Line_Tx(const uint8 *message, uint16 size, sys_put put);

/* M | no | - | 40 | MEMORY.  Between Sys_Init_Kernel and Sys_Start_Kernel. */
bool Sys_Start_Bluetooth(void);

#endif
