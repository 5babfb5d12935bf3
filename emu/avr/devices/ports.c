// Ports B, C and D, external interrupts and pin-change interrupts (data sheet, chapters on I/O ports and interrupts).

static u32 levels_of(const struct avr *m, u32 port)
{
    u32 out = m->data[DDRB + 3 * port], latch = m->data[PORTB + 3 * port], driven = m->pin_driven[port];
    u32 pull_up = m->data[MCUCR] >> 4 & 1 ? 0 : latch; // PUD
    return ((out & latch) | (~out & driven & m->pin_level[port]) | (~out & ~driven & pull_up)) & 0xFF;
}

static void external_interrupt(struct avr *m, u32 n, int rising)
{
    u32 mode = m->data[EICRA] >> 2 * n & 3;
    if (mode == 1 || mode == (rising ? 3 : 2))
        m->data[EIFR] |= (u8)(1 << n);
}

// Recompute the levels of a port at cycle `at`, and pass changes to the interrupts and timers.
static void port_update(struct avr *m, u32 port, u64 at)
{
    u32 now = levels_of(m, port), changed = now ^ m->pin_now[port];
    if (!changed)
        return;
    m->pin_before[port] = m->pin_now[port], m->pin_now[port] = (u8)now, m->pin_changed[port] = at;
    if (changed & m->data[PCMSK0 + port])
        m->data[PCIFR] |= (u8)(1 << port);
    if (port == 0 && changed & 1 && !bit_of(m, ACSR, ACIC) && (int)(now & 1) == bit_of(m, TCCR1B, 6))
        timer_capture(m, at); // ICP1
    if (port != 2)
        return;
    for (u32 n = 0; n < 2; n++) {
        if (changed >> (2 + n) & 1)
            external_interrupt(m, n, now >> (2 + n) & 1);
        if (changed >> (4 + n) & 1)
            timer_edge(m, n, now >> (4 + n) & 1, at);
    }
}

// Return the levels that the program reads: the synchroniser shows a change one cycle late.
static u32 port_read(struct avr *m, u32 port)
{
    if (m->cycle > m->pin_changed[port] || !m->pin_changed[port])
        return m->pin_now[port];
    m->touched = 1; // the next read may give another value
    return m->pin_before[port];
}

static void port_write(struct avr *m, u32 address, u32 value, u64 at)
{
    u32 port = (address - PINB) / 3;
    if (address == PINB + 3 * port) // a one toggles the latch
        address = PORTB + 3 * port, value ^= m->data[address];
    if (m->watched[address] && m->data[address] != value)
        log_change(m, address, value, at);
    m->data[address] = (u8)value;
    u32 lit = m->data[DDRB] & m->data[PORTB] & m->emitters;
    if (!lit != !m->lit)
        m->light_changed = 1, m->light_cycle = at, m->deadline = 0;
    m->lit = (u8)lit;
    port_update(m, port, at);
}
