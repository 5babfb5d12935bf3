/* SPDX-License-Identifier: MIT */
/* OpenSwarm devices: events in and out, and the processors that can be exchanged at run time.
 *
 * A device has a lower layer (hal_*.h, fulfilled by the board) and a processor between it and the events:
 *     output device   event -> post-processor -> lower layer
 *     input device    lower layer -> pre-processor -> event
 *     communication   message -> Tx-processor -> bytes,   bytes -> Rx-processor -> message
 * A setter returns the processor that was in force; NULL restores the default. A change never cuts a message.
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

/* Turns an event into wheel speeds. In: the speeds in force. False: leave them. Handler context. */
typedef bool (*sys_motor_processor)(uint16 event, const sys_event_data *data, sys_wheel_speeds *speeds);

bool Sys_Default_MotorProcessor(uint16 event, const sys_event_data *data, sys_wheel_speeds *speeds);
sys_motor_processor Sys_Set_MotorProcessor(sys_motor_processor processor); /* MTH */
/* MTH | no | as Sys_Subscribe_to_Event.  Hands a further (virtual actuator) event to the post-processor. */
bool Sys_Connect_Motors(uint16 event);

/* ---- UARTs: SYS_SEND_UARTn, SYS_UARTn_RECEIVED, SYS_UARTn_READY ------------------------------------------------ */

enum { SYS_UART1, SYS_UART2 }; /* of which the board has SYS_UARTS */

/* Appends one byte to the message under construction; false: stop, the message will be dropped whole. */
typedef bool (*sys_put)(uint8 byte);
/* Writes one message as bytes. False: the message is refused, also as soon as put fails. Thread or handler context, slice
 * locked; must not write to a UART itself. */
typedef bool (*sys_tx_processor)(const uint8 *message, uint16 size, sys_put put);
/* One received byte. Returns the size of a message now complete in buffer (SYS_UART_RX bytes), or 0. *used is the fill
 * level, kept between calls, 0 after a completed message. ISR context. */
typedef uint16 (*sys_rx_processor)(uint8 byte, uint8 *buffer, uint16 *used);

bool Sys_Raw_Tx(const uint8 *message, uint16 size, sys_put put);        /* bytes as they are (default) */
/* Full buffer, or 1 ms without a byte (default). */
uint16 Sys_Chunk_Rx(uint8 byte, uint8 *buffer, uint16 *used);
bool Sys_Frame_Tx(const uint8 *message, uint16 size, sys_put put);      /* COBS + CRC-16/CCITT-FALSE, 0 ends a frame */
uint16 Sys_Frame_Rx(uint8 byte, uint8 *buffer, uint16 *used);           /* damaged frames are dropped */

sys_tx_processor Sys_Set_TxProcessor(uint8 uart, sys_tx_processor processor); /* MTH */
/* MTHI.  Bytes already received by the old processor are passed on first, as one chunk. */
sys_rx_processor Sys_Set_RxProcessor(uint8 uart, sys_rx_processor processor);

/* MTH | no | 60 + 30 per byte | 44 | BUSY, ARGUMENT.  Queues one message behind those before it, whole or not at all. It
 * is copied into blocks of the heap, freed one by one as they are sent: E + 1 bytes and up to SYS_SMALL_PAYLOAD - 1 of the
 * message each. BUSY: SYS_UART_TX or the heap is exhausted; SYS_UARTn_READY follows once everything queued is sent.
 * ARGUMENT: the message alone needs more than SYS_UART_TX, or the Tx-processor refused it. */
bool Sys_Write_UART1(const void *message, uint16 size);
bool Sys_Write_UART2(const void *message, uint16 size);

typedef struct {
    uint16 tx_refused; /* messages that were not queued */
    uint16 rx_lost;    /* messages lost for lack of memory, or overrun bytes */
    uint16 rx_damaged; /* frames with a wrong length or checksum */
} sys_uart_statistics;
const sys_uart_statistics *Sys_Get_UARTStatistics(uint8 uart); /* MTHI */

/* ---- LEDs ------------------------------------------------------------------------------------------------------ */

enum { SYS_LED_RING = 8, SYS_LED_BODY = 8, SYS_LED_FRONT = 9, SYS_LEDS = 10 };
/* MTHI | no | 30 | 8 | ARGUMENT.  led 0-7 clockwise from the front, SYS_LED_BODY, SYS_LED_FRONT. */
bool Sys_Set_LED(uint8 led, bool on);
bool Sys_Toggle_LED(uint8 led);

/* ---- Selector: SYS_IO_SELECTOR --------------------------------------------------------------------------------- */

/* Sees a debounced position before it becomes an event; may change it; false: no event. ISR context. */
typedef bool (*sys_selector_processor)(uint8 *position);
sys_selector_processor Sys_Set_SelectorProcessor(sys_selector_processor processor); /* MTHI */
uint8 Sys_Get_Selector(void); /* MTHI.  0-15, debounced */

#ifdef __cplusplus
}
#endif

#endif
