/* UARTs: bounded buffers, back-pressure and replaceable Tx- and Rx-processors.
 *
 * A message is encoded straight into the transmit ring behind what is committed, and committed as a whole or not at
 * all. Writers lock the slice; the ISR only moves tail. */
#include "io.h"
#include "kernel.h"

#include <string.h>

#define MASK (SYS_UART_TX - 1u)
typedef char ring_is_a_power_of_two[(SYS_UART_TX & (SYS_UART_TX - 1)) == 0 && SYS_UART_TX <= 128 ? 1 : -1];

typedef struct {
    sys_tx_processor encode;
    sys_rx_processor decode;
    volatile uint8 head, tail;  /* free-running; head - tail bytes are committed */
    volatile bool wants_ready;  /* a writer was refused */
    bool quiet;                 /* no byte since the last 1 ms tick */
    uint16 used;                /* bytes in received */
    uint8 sent[SYS_UART_TX];
    uint8 received[SYS_UART_RX];
    sys_uart_statistics statistics;
} channel;

static channel channels[SYS_UARTS];

enum { PER_UART = SYS_UART2_RECEIVED - SYS_UART1_RECEIVED };

static uint16 event_of(uint8 uart, uint16 of_uart1)
{
    return (uint16)(of_uart1 + uart * PER_UART);
}

/* ---- Sending ---------------------------------------------------------------------------------------------------- */

static channel *writing; /* slice locked while set */
static uint8 writing_head;

static bool put(uint8 byte)
{
    if ((uint8)(writing_head - writing->tail) >= SYS_UART_TX) {
        return false;
    }
    writing->sent[writing_head & MASK] = byte;
    writing_head++;
    return true;
}

static bool write_message(uint8 uart, const void *message, uint16 size)
{
    channel *c = &channels[uart];
    if (os_enter() != SYS_OK) {
        return false;
    }
    writing = c;
    writing_head = c->head;
    bool fits = c->encode(message, size, put);
    hal_lock_state device_lock = hal_lock_devices();
    if (fits) {
        c->head = writing_head;
        hal_uart_transmit(uart);
    } else {
        c->wants_ready = true;
    }
    hal_unlock(device_lock);
    if (!fits) {
        os_count(&c->statistics.tx_refused);
    }
    return os_leave(fits ? SYS_OK : SYS_ERROR_BUSY);
}

sint16 uart_next_byte(uint8 uart)
{
    channel *c = &channels[uart];
    uint8 waiting = (uint8)(c->head - c->tail);
    if (c->wants_ready && waiting <= SYS_UART_TX / 2) {
        c->wants_ready = false;
        (void)Sys_Send_IntEvent(event_of(uart, SYS_UART1_READY), (uint16)(SYS_UART_TX - waiting));
    }
    if (waiting == 0) {
        return -1;
    }
    uint8 byte = c->sent[c->tail & MASK];
    c->tail++;
    return byte;
}

static bool on_send(uint16 pid, uint16 event, sys_event_data *data)
{
    (void)pid;
    (void)write_message(event == SYS_SEND_UART1 ? SYS_UART1 : SYS_UART2, data->payload, data->size);
    return true;
}

bool Sys_Write_UART1(const void *message, uint16 size)
{
    return write_message(SYS_UART1, message, size);
}

bool Sys_Write_UART2(const void *message, uint16 size)
{
    return write_message(SYS_UART2, message, size);
}

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

/* A chunk also ends when the line was quiet from one tick to the next. */
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
}

/* ---- Processors and life cycle
 * ------------------------------------------------------------------------------------ */

sys_tx_processor Sys_Set_TxProcessor(uint8 uart, sys_tx_processor wanted)
{
    Sys_Start_CriticalSection();
    sys_tx_processor before = channels[uart].encode;
    channels[uart].encode = wanted != NULL ? wanted : Sys_Raw_Tx;
    Sys_End_CriticalSection();
    return before;
}

sys_rx_processor Sys_Set_RxProcessor(uint8 uart, sys_rx_processor wanted)
{
    channel *c = &channels[uart];
    uint8 left[SYS_UART_RX];
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
    (void)Sys_Subscribe_to_Event(send, 0, on_send, NULL);
}

void uart_start(uint8 uart)
{
    hal_uart_start(uart);
}
