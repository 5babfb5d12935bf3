/* SPDX-License-Identifier: MIT */
/* UARTs: dynamically buffered transmission, back-pressure and replaceable Tx- and Rx-processors.
 *
 * A message is encoded into a chain of small blocks of the heap, which is committed as a whole or not at all.
 * Writers lock the slice; the ISR sends from the first block and passes it to the kernel when it is empty. */
#include "io.h"
#include "kernel.h"

#include <string.h>

typedef struct {
    sys_tx_processor encode;
    sys_rx_processor decode;
    message *first, *last; /* blocks to send; devices locked, as the next two fields */
    uint16 position;       /* index of the byte sent last in the first block */
    uint16 taken;          /* heap bytes of the blocks */
    bool quiet;            /* no byte since the last 1 ms tick */
    uint16 used;           /* bytes in `received` */
    uint8 received[SYS_UART_RX];
    sys_uart_statistics statistics;
} channel;

static channel channels[SYS_UARTS];
static uint8 refused; /* bit n: UART n has refused a message as BUSY; devices locked */

enum { PER_UART = SYS_UART2_RECEIVED - SYS_UART1_RECEIVED };

static uint16 event_of(uint8 uart, uint16 of_uart1)
{
    return (uint16)(of_uart1 + uart * PER_UART);
}

/* ---- Sending ---------------------------------------------------------------------------------------------------- */

/* A block is a message whose payload is a byte count, then the bytes. */
enum {
    LARGEST = SYS_SMALL_PAYLOAD - 1, /* bytes; such blocks are allocated and freed in constant time */
    GROWTH = 7                       /* bytes added when a message exceeds its expected size; odd, for even sizes */
};

static uint8 *bytes_of(message *block)
{
    return (uint8 *)(block + 1);
}

static uint16 size_of(const message *block)
{
    return (uint16)(sizeof *block + block->queued.size);
}

/* Message under construction; slice locked. The next writer frees the message of a writer that was killed half-way. */
static struct {
    const channel *to;
    message *first, *last;
    uint16 expected; /* bytes without a block yet */
    uint16 taken;    /* heap bytes of its blocks */
    uint16 limit;    /* maximum of taken: SYS_UART_TX less the bytes already queued */
    sys_error error; /* why the message cannot be sent */
} building;

BOUNDS_AT("while (", loop d);
static void discard(void)
{
    while (building.first != NULL) {
        message *block = building.first;
        building.first = block->queued.next;
        heap_free(block, size_of(block));
    }
}

static HAL_OUTLINE bool begin_block(void)
{
    uint16 room = building.expected > LARGEST ? LARGEST : building.expected != 0 ? building.expected | 1u : GROWTH;
    uint16 taken = (uint16)(building.taken + sizeof(message) + 1 + room);
    message *block = taken <= building.limit ? heap_alloc((uint16)(taken - building.taken)) : NULL;
    if (block == NULL) {
        if (taken <= SYS_UART_TX) {
            building.error = SYS_ERROR_BUSY; /* room becomes free later */
        }
        return false;
    }
    building.taken = taken;
    building.expected = building.expected > room ? (uint16)(building.expected - room) : 0;
    block->queued.next = NULL;
    block->queued.size = (uint16)(1 + room);
    *bytes_of(block) = 0;
    *(building.first == NULL ? &building.first : &building.last->queued.next) = block;
    building.last = block;
    return true;
}

static bool put(uint8 byte)
{
    if ((building.first == NULL || *bytes_of(building.last) + 1u == building.last->queued.size) && !begin_block()) {
        return false;
    }
    uint8 *bytes = bytes_of(building.last);
    bytes[++*bytes] = byte;
    return true;
}

BOUNDS_AT("c->encode(", calls sys_tx_processor);
static HAL_OUTLINE bool write_message(uint8 uart, const void *message, uint16 size)
{
    channel *c = &channels[uart];
    if (os_enter() != SYS_OK) {
        return false;
    }
    discard();
    building.to = c;
    building.expected = size;
    building.taken = 0;
    building.error = SYS_ERROR_ARGUMENT;
    building.limit = (uint16)(SYS_UART_TX - HAL_LOAD(c->taken));
    bool sound = c->encode(message, size, put) && building.to == c; /* false also if the processor wrote to a UART */
    building.to = NULL;
    hal_lock_state lock = hal_lock_devices();
    if (!sound) {
        refused |= (uint8)((building.error == SYS_ERROR_BUSY) << uart);
    } else if (building.first != NULL) {
        *(c->first == NULL ? &c->first : &c->last->queued.next) = building.first;
        c->last = building.last;
        c->taken += building.taken;
        building.first = NULL;
        hal_uart_transmit(uart);
    }
    hal_unlock(lock);
    if (sound) {
        return os_leave(SYS_OK);
    }
    discard();
    os_count(&c->statistics.tx_refused);
    return os_leave(building.error);
}

/* Passes a sent block to the kernel, which frees it with the next messages: ISRs must not free memory. */
static void retire(message *block)
{
    block->queued.event = NULL;
    block->queued.next = NULL;
    *queue_end = block;
    queue_end = &block->queued.next;
    os_pending |= OS_MESSAGES;
}

sint16 uart_next_byte(uint8 uart)
{
    channel *c = &channels[uart];
    message *block = c->first;
    if (block == NULL) {
        return -1;
    }
    uint8 byte = bytes_of(block)[++c->position];
    if (c->position == *bytes_of(block)) {
        c->position = 0;
        c->taken -= size_of(block);
        c->first = block->queued.next;
        retire(block);
    }
    return byte;
}

/* ISR. If there is no memory for the event, the next tick tries again. */
BOUNDS_AT("for (", loop SYS_UARTS);
static HAL_OUTLINE void tell_ready(void)
{
    for (uint8 uart = 0; uart < SYS_UARTS; uart++) {
        if ((refused & 1u << uart) && channels[uart].first == NULL &&
            Sys_Send_IntEvent(event_of(uart, SYS_UART1_READY), SYS_UART_TX)) {
            refused &= (uint8)~(1u << uart);
        }
    }
}

static bool on_send(uint16 pid, uint16 event, sys_event_data *data)
{
    (void)pid;
    (void)write_message(SYS_UARTS == 1 || event == SYS_SEND_UART1 ? SYS_UART1 : SYS_UART2, data->payload, data->size);
    return true;
}

bool Sys_Write_UART1(const void *message, uint16 size)
{
    return write_message(SYS_UART1, message, size);
}

bool Sys_Write_UART2(const void *message, uint16 size)
{
    return SYS_UARTS > SYS_UART2 ? write_message(SYS_UART2, message, size) : os_fail(SYS_ERROR_ARGUMENT);
}

BOUNDS_AT("for (", loop d);
BOUNDS_AT("!put_byte(", calls sys_put);
bool Sys_Raw_Tx(const uint8 *message, uint16 size, sys_put put_byte)
{
    for (uint16 i = 0; i < size; i++) {
        if (!put_byte(message[i])) {
            return false;
        }
    }
    return true;
}

/* ---- Receiving -------------------------------------------------------------------------------------------------- */

static void pass_on(uint8 uart, const uint8 *bytes, uint16 size)
{
    if (!Sys_Send_Event(event_of(uart, SYS_UART1_RECEIVED), bytes, size)) {
        os_count(&channels[uart].statistics.rx_lost);
    }
}

BOUNDS_AT("c->decode(", calls sys_rx_processor);
void uart_received(uint8 uart, uint8 byte)
{
    channel *c = &channels[uart];
    uint16 used = c->used;
    c->quiet = false;
    uint16 size = c->decode(byte, c->received, &c->used);
    if (size != 0) {
        c->used = 0;
        pass_on(uart, c->received, size);
    } else if (c->used == 0 && used > 1) {
        os_count(&c->statistics.rx_damaged);
    }
}

void uart_overrun(uint8 uart)
{
    os_count(&channels[uart].statistics.rx_lost);
}

uint16 Sys_Chunk_Rx(uint8 byte, uint8 *buffer, uint16 *used)
{
    buffer[*used] = byte;
    ++*used;
    return *used < SYS_UART_RX ? 0 : *used;
}

/* Ends a chunk if no byte arrived from one tick to the next. */
BOUNDS_AT("for (", loop SYS_UARTS);
void uart_tick(void)
{
    for (uint8 uart = 0; uart < SYS_UARTS; uart++) {
        channel *c = &channels[uart];
        if (c->quiet && c->used != 0 && c->decode == Sys_Chunk_Rx) {
            uint16 size = c->used;
            c->used = 0;
            pass_on(uart, c->received, size);
        }
        c->quiet = true;
    }
    if (refused != 0) {
        tell_ready();
    }
}

/* ---- Processors and life cycle ---------------------------------------------------------------------------------- */

sys_tx_processor Sys_Set_TxProcessor(uint8 uart, sys_tx_processor wanted)
{
    if (os_enter() != SYS_OK) {
        return NULL;
    }
    sys_tx_processor before = channels[uart].encode;
    channels[uart].encode = wanted != NULL ? wanted : Sys_Raw_Tx;
    section_close();
    return before;
}

sys_rx_processor Sys_Set_RxProcessor(uint8 uart, sys_rx_processor wanted)
{
    channel *c = &channels[uart];
    uint8 left[SYS_UART_RX];
    Sys_Start_CriticalSection(); /* the caller must not be killed between taking the bytes and passing them on */
    hal_lock_state lock = hal_lock_devices();
    sys_rx_processor before = c->decode;
    uint16 size = c->used;
    c->decode = wanted != NULL ? wanted : Sys_Chunk_Rx;
    c->used = 0;
    memcpy(left, c->received, sizeof left);
    hal_unlock(lock);
    if (size != 0) {
        pass_on(uart, left, size <= sizeof left ? size : (uint16)sizeof left);
    }
    Sys_End_CriticalSection();
    return before;
}

const sys_uart_statistics *Sys_Get_UARTStatistics(uint8 uart)
{
    return &channels[uart].statistics;
}

void uart_init(uint8 uart)
{
    channel *c = &channels[uart];
    c->encode = Sys_Raw_Tx;
    c->decode = Sys_Chunk_Rx;
    hal_uart_init(uart);
    uint16 send = uart == SYS_UART1 ? SYS_SEND_UART1 : SYS_SEND_UART2;
    (void)Sys_Register_Event(send);
    (void)Sys_Register_Event(event_of(uart, SYS_UART1_RECEIVED));
    (void)Sys_Register_Event(event_of(uart, SYS_UART1_READY));
    (void)event_connect(send, on_send);
}

void uart_start(uint8 uart)
{
    hal_uart_start(uart);
}
