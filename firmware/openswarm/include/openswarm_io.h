/* SPDX-License-Identifier: MIT */
/* OpenSwarm devices: their events, and the processors that can be exchanged at run time.
 *
 * A device has a lower layer (hal_*.h, implemented by the board) and a processor between it and the events:
 *     output device   event -> post-processor -> lower layer
 *     input device    lower layer -> pre-processor -> event
 *     communication   message -> Tx-processor -> bytes,   bytes -> Rx-processor -> message
 * A setter returns the previous processor, or NULL if it is refused; setting NULL restores the default. A change never
 * splits a message.
 */
#ifndef OPENSWARM_IO_H
#define OPENSWARM_IO_H

#include "openswarm.h"

#ifdef __cplusplus
extern "C" {
#endif

/* ---- Motors: SYS_LEFTMOTOR_SPEED, SYS_RIGHTMOTOR_SPEED --------------------------------------------------------- */

enum { SYS_MAXIMUM_SPEED = 129 }; /* mm/s at 1000 steps/s (epuck.md §3, openswarm-original.md §5.2) */

typedef struct {
    sint16 left, right; /* mm/s, forward positive; clamped to +-SYS_MAXIMUM_SPEED after the post-processor, which sets
                           the handlers' last error to SYS_ERROR_ARGUMENT */
} sys_wheel_speeds;

/* Converts an event into wheel speeds; initially the current ones. False: keep the current speeds. Handler context. */
typedef bool (*sys_motor_processor)(uint16 event, const sys_event_data *data, sys_wheel_speeds *speeds);

bool Sys_Default_MotorProcessor(uint16 event, const sys_event_data *data, sys_wheel_speeds *speeds);
/* MTH | no | 55 | 16 | none. */
sys_motor_processor Sys_Set_MotorProcessor(sys_motor_processor processor);
/* MTH | no | as Sys_Subscribe_to_Event | 46 | EVENT, MEMORY.  Routes another (virtual actuator) event to the
 * post-processor. */
bool Sys_Connect_Motors(uint16 event);

/* ---- UARTs: SYS_SEND_UARTn, SYS_UARTn_RECEIVED, SYS_UARTn_READY ------------------------------------------------ */

enum { SYS_UART1, SYS_UART2 }; /* the board has SYS_UARTS of them */

/* Appends one byte to the message under construction; false: stop, the whole message is dropped. */
typedef bool (*sys_put)(uint8 byte);
/* Encodes one message into bytes. False: the message is refused, also when put fails. Thread or handler context, slice
 * locked; must not write to a UART. */
typedef bool (*sys_tx_processor)(const uint8 *message, uint16 size, sys_put put);
/* Processes one received byte. Returns the size of a message now complete in buffer (SYS_UART_RX bytes), or 0. *used
 * is the fill level, kept between calls, 0 after a completed message. ISR context. */
typedef uint16 (*sys_rx_processor)(uint8 byte, uint8 *buffer, uint16 *used);

bool Sys_Raw_Tx(const uint8 *message, uint16 size, sys_put put);        /* bytes unchanged (default) */
/* A message is a full buffer, or ends with 1 ms without a byte (default). */
uint16 Sys_Chunk_Rx(uint8 byte, uint8 *buffer, uint16 *used);
bool Sys_Frame_Tx(const uint8 *message, uint16 size, sys_put put);      /* COBS + CRC-16/CCITT-FALSE, 0 ends a frame */
uint16 Sys_Frame_Rx(uint8 byte, uint8 *buffer, uint16 *used);           /* damaged frames are dropped */

/* MTH | no | 62 | 16 | none. */
sys_tx_processor Sys_Set_TxProcessor(uint8 uart, sys_tx_processor processor);
/* MTHI | no | 85; 35 and those of Sys_Send_Event more if bytes were received | 64 | none.  Bytes received by the
 * previous processor are sent first, as one chunk. */
sys_rx_processor Sys_Set_RxProcessor(uint8 uart, sys_rx_processor processor);

/* MTH | no | 170 + 34 per byte + 75 per block; at most 460 more per block while memory is short, and g per block of a
 * killed writer's message | 56 | BUSY, ARGUMENT.  Queues one message, whole or not at all. It is copied into
 * blocks of the heap, which are freed one by one as they are sent: each has E + 1 bytes and up to SYS_SMALL_PAYLOAD
 * - 1 of the message. BUSY: SYS_UART_TX or the heap is exhausted; SYS_UARTn_READY follows once the queue is empty.
 * ARGUMENT: the message alone needs more than SYS_UART_TX, or the Tx-processor refused it. */
bool Sys_Write_UART1(const void *message, uint16 size);
bool Sys_Write_UART2(const void *message, uint16 size);

typedef struct {
    uint16 tx_refused; /* messages not queued */
    uint16 rx_lost;    /* messages lost for lack of memory, and overrun bytes */
    uint16 rx_damaged; /* frames with a wrong length or checksum */
} sys_uart_statistics;
/* MTHI | no | 9 | 4 | none. */
const sys_uart_statistics *Sys_Get_UARTStatistics(uint8 uart);

/* ---- LEDs ------------------------------------------------------------------------------------------------------ */

enum { SYS_LED_RING = 8, SYS_LED_BODY = 8, SYS_LED_FRONT = 9, SYS_LEDS = 10 };
/* MTHI | no | 41, toggling 56 | 18 | ARGUMENT.  led 0-7 clockwise from the front, SYS_LED_BODY, SYS_LED_FRONT. */
bool Sys_Set_LED(uint8 led, bool on);
bool Sys_Toggle_LED(uint8 led);

/* ---- Selector: SYS_IO_SELECTOR --------------------------------------------------------------------------------- */

/* Receives a debounced position before it is sent as an event, and may change it; false: no event. ISR context. */
typedef bool (*sys_selector_processor)(uint8 *position);
/* MTHI | no | 9 | 4 | none. */
sys_selector_processor Sys_Set_SelectorProcessor(sys_selector_processor processor);
/* MTHI | no | 4 | 4 | none.  0-15, debounced. */
uint8 Sys_Get_Selector(void);

#ifdef __cplusplus
}
#endif

#endif
