// USART0 in asynchronous mode (data sheet, chapter USART0). A frame takes its real time; the pins do not show its bits.

enum { RXC = 7, TXC = 6, UDRE = 5, DOR = 3, U2X = 1 };         // UCSR0A
enum { RXCIE = 7, TXCIE = 6, UDRIE = 5, RXEN = 4, TXEN = 3 };  // UCSR0B

static u64 frame_cycles(const struct avr *m)
{
    u32 c = m->data[UCSR0C], bits = 1 + 5 + (c >> 1 & 3) + (c >> 5 & 1) + 1 + (c >> 3 & 1);
    u32 divisor = word_at(m, UBRR0L) + 1;
    return (u64)bits * divisor * (bit_of(m, UCSR0A, U2X) ? 8 : 16);
}

static void uart_shift_out(struct avr *m, u32 byte, u64 at)
{
    m->uart_shifting = 1, m->uart_shift = (u8)byte;
    schedule(m, EVENT_UART_SENT, at + frame_cycles(m));
}

static void uart_sent(struct avr *m, u64 at)
{
    m->due[EVENT_UART_SENT] = NEVER;
    log_change(m, UDR0, m->uart_shift, at);
    m->uart_shifting = 0;
    set_bit(m, UCSR0A, UDRE, 1);
    if (m->uart_has_next) {
        m->uart_has_next = 0;
        uart_shift_out(m, m->uart_next, at);
    } else
        set_bit(m, UCSR0A, TXC, 1);
}

static void uart_received(struct avr *m, u32 byte)
{
    if (!bit_of(m, UCSR0B, RXEN))
        return;
    if (m->uart_fifo_count == 2) {
        set_bit(m, UCSR0A, DOR, 1);
        return;
    }
    m->uart_fifo[m->uart_fifo_count++] = (u8)byte;
    set_bit(m, UCSR0A, RXC, 1);
}

static u32 uart_read(struct avr *m, u32 address)
{
    if (address != UDR0)
        return m->data[address];
    u32 byte = m->uart_fifo[0];
    if (m->uart_fifo_count) {
        m->uart_fifo[0] = m->uart_fifo[1];
        m->uart_fifo_count--;
    }
    set_bit(m, UCSR0A, RXC, m->uart_fifo_count != 0);
    set_bit(m, UCSR0A, DOR, 0);
    return byte;
}

static void uart_write(struct avr *m, u32 address, u32 value, u64 at)
{
    if (address == UCSR0A) {
        u32 cleared = value & 1u << TXC; // writing 1 clears TXC
        m->data[UCSR0A] = (u8)((m->data[UCSR0A] & (0xFCu & ~cleared)) | (value & 3));
        return;
    }
    if (address != UDR0) {
        m->data[address] = (u8)value;
        if (address == UCSR0B && !(value >> RXEN & 1))
            m->uart_fifo_count = 0, set_bit(m, UCSR0A, RXC, 0);
        return;
    }
    if (!bit_of(m, UCSR0B, TXEN) || !bit_of(m, UCSR0A, UDRE))
        return;
    if (m->uart_shifting) {
        m->uart_next = (u8)value, m->uart_has_next = 1;
        set_bit(m, UCSR0A, UDRE, 0);
    } else
        uart_shift_out(m, value, at);
}
