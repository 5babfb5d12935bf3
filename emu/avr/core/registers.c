// Reads and writes of I/O registers, events, and the interrupts that are pending.
//
// Registers that only the program changes are plain memory (`plain`); all others are reached through these functions.

enum { PLAIN_READ = 1, PLAIN_WRITE = 2 };

static const u8 plain[256] = {
    [GPIOR0] = 3, [GPIOR1] = 3, [GPIOR2] = 3, [SPL] = 3, [SPH] = 3, [PORTB] = 1, [PORTC] = 1, [PORTD] = 1,
    [DDRB] = 1, [DDRC] = 1, [DDRD] = 1,
};

static void apply_input(struct avr *m, u64 at)
{
    u32 first = m->input_first, kind = m->input_kind[first], value = m->input_value[first];
    m->input_first = (u16)((first + 1) % INPUT_ROOM);
    m->input_count--;
    m->due[EVENT_INPUT] = m->input_count ? m->input_cycle[m->input_first] : NEVER;
    if (kind == INPUT_UART)
        uart_received(m, value & 0xFF);
    else if (kind == INPUT_PIN) {
        u32 port = value >> 16;
        m->pin_driven[port] = (u8)(value >> 8), m->pin_level[port] = (u8)value;
        port_update(m, port, at);
    } else {
        m->analog_uv[kind - INPUT_ANALOG] = value;
        comparator_update(m, at);
    }
}

static void apply_event(struct avr *m, u32 event, u64 at)
{
    m->resting = m->tracing = 0;
    m->round = 0, m->counts_until = 0;
    switch (event) {
    case EVENT_INPUT:
        apply_input(m, at);
        break;
    case EVENT_TIMER0: case EVENT_TIMER1: case EVENT_TIMER2:
        timer_sync(m, event - EVENT_TIMER0, at);
        timer_schedule(m, event - EVENT_TIMER0);
        break;
    case EVENT_ADC_SAMPLE:
        adc_sample(m);
        break;
    case EVENT_ADC_DONE:
        adc_done(m, at);
        break;
    case EVENT_UART_SENT:
        uart_sent(m, at);
        break;
    case EVENT_EEPROM_DONE:
        eeprom_done(m);
        break;
    case EVENT_FLASH_DONE:
        flash_done(m);
        break;
    default:
        watchdog_done(m, at);
    }
}

static void find_next_due(struct avr *m)
{
    m->next_due = NEVER;
    for (u32 event = 0; event < EVENTS; event++)
        if (m->due[event] < m->next_due)
            m->next_due = m->due[event];
}

// Apply all events up to cycle `at`, in order of time and then of number.
static void apply_events(struct avr *m, u64 at)
{
    while (m->next_due <= at) {
        u64 now = m->next_due;
        u32 event = 0;
        while (m->due[event] != now)
            event++;
        apply_event(m, event, now);
        find_next_due(m);
    }
}

static u32 pending_vectors(const struct avr *m)
{
    const u8 *d = m->data;
    u32 found = 0;
    for (u32 n = 0; n < 2; n++)
        if (d[EIMSK] >> n & 1 &&
            (d[EIFR] >> n & 1 || (!(d[EICRA] >> 2 * n & 3) && !(m->pin_now[2] >> (2 + n) & 1))))
            found |= 1u << (V_INT0 + n);
    found |= (u32)(d[PCIFR] & d[PCICR] & 7) << V_PCINT0;
    found |= (u32)(d[WDTCSR] >> WDIF & d[WDTCSR] >> WDIE & 1) << V_WDT;
    u32 t0 = d[TIFR0] & d[TIMSK0], t1 = d[TIFR1] & d[TIMSK1], t2 = d[TIFR2] & d[TIMSK2];
    found |= (t2 >> 1 & 3) << V_T2_COMPA | (t2 & 1) << V_T2_OVF;
    found |= (t1 >> 5 & 1) << V_T1_CAPT | (t1 >> 1 & 3) << V_T1_COMPA | (t1 & 1) << V_T1_OVF;
    found |= (t0 >> 1 & 3) << V_T0_COMPA | (t0 & 1) << V_T0_OVF;
    found |= (u32)(d[UCSR0A] >> RXC & d[UCSR0B] >> RXCIE & 1) << V_UART_RX;
    found |= (u32)(d[UCSR0A] >> UDRE & d[UCSR0B] >> UDRIE & 1) << V_UART_UDRE;
    found |= (u32)(d[UCSR0A] >> TXC & d[UCSR0B] >> TXCIE & 1) << V_UART_TX;
    found |= (u32)(d[ADCSRA] >> ADIF & d[ADCSRA] >> ADIE & 1) << V_ADC;
    found |= (u32)(d[EECR] >> EERIE & ~(d[EECR] >> EEPE) & 1) << V_EE_READY;
    found |= (u32)(d[ACSR] >> ACI & d[ACSR] >> ACIE & 1) << V_COMPARATOR;
    found |= (u32)(d[SPMCSR] >> SPMIE & ~(u32)(m->due[EVENT_FLASH_DONE] != NEVER) & 1) << V_SPM_READY;
    return found;
}

// Clear the flag of an interrupt when the CPU enters it. The conditions of UART data, EEPROM and flash persist.
static void acknowledge(struct avr *m, u32 vector)
{
    switch (vector) {
    case V_INT0: case V_INT1:
        m->data[EIFR] &= (u8) ~(1u << (vector - V_INT0));
        break;
    case V_PCINT0: case V_PCINT1: case V_PCINT2:
        m->data[PCIFR] &= (u8) ~(1u << (vector - V_PCINT0));
        break;
    case V_WDT:
        set_bit(m, WDTCSR, WDIF, 0);
        if (bit_of(m, WDTCSR, WDE))
            set_bit(m, WDTCSR, WDIE, 0); // the next time-out resets
        break;
    case V_T2_COMPA: case V_T2_COMPB:
        m->data[TIFR2] &= (u8) ~(COMPARE_A << (vector - V_T2_COMPA));
        break;
    case V_T2_OVF:
        m->data[TIFR2] &= (u8)~OVERFLOW;
        break;
    case V_T1_CAPT:
        m->data[TIFR1] &= (u8)~CAPTURE;
        break;
    case V_T1_COMPA: case V_T1_COMPB:
        m->data[TIFR1] &= (u8) ~(COMPARE_A << (vector - V_T1_COMPA));
        break;
    case V_T1_OVF:
        m->data[TIFR1] &= (u8)~OVERFLOW;
        break;
    case V_T0_COMPA: case V_T0_COMPB:
        m->data[TIFR0] &= (u8) ~(COMPARE_A << (vector - V_T0_COMPA));
        break;
    case V_T0_OVF:
        m->data[TIFR0] &= (u8)~OVERFLOW;
        break;
    case V_UART_TX:
        set_bit(m, UCSR0A, TXC, 0);
        break;
    case V_ADC:
        set_bit(m, ADCSRA, ADIF, 0);
        break;
    case V_COMPARATOR:
        set_bit(m, ACSR, ACI, 0);
    }
    timers_schedule(m); // a timer posts no event for a flag that is already set
}

// Recompute the cycle at which the interpreter must leave its loop, after a change of registers.
static void reschedule(struct avr *m)
{
    find_next_due(m);
    if (m->deadline == 0)
        return;
    m->deadline = m->next_due < m->until ? m->next_due : m->until;
    if (m->shadow || (m->data[SREG_AT] & FLAG_I && pending_vectors(m)))
        m->deadline = 0;
}

static int is_unmodelled(u32 address, u32 value)
{
    return (address >= SPCR && address <= SPDR) || (address >= TWBR && address <= TWAMR) ||
           (address == ASSR && value & 0x60) || (address == CLKPR && value & 0x0F);
}

// Whether a read has no side effect and returns the same value until the next event.
static int is_steady(u32 address)
{
    switch (address) {
    case TIFR0: case TIFR1: case TIFR2: case TCNT0: case TCNT2: case TCNT1L: case TCNT1H: case ICR1L: case ICR1H:
    case ADCL: case ADCH: case UDR0: case EECR: case SPMCSR: case WDTCSR:
        return 0;
    default:
        return 1;
    }
}

// Whether writing the value that register `address` already has changes nothing.
static int is_idempotent(u32 address)
{
    switch (address) {
    case DDRB: case PORTB: case DDRC: case PORTC: case DDRD: case PORTD: case OCR0A: case OCR0B: case OCR2A: case OCR2B:
    case TCCR0A: case TCCR2A: case TCCR2B: case TIMSK0: case TIMSK1: case TIMSK2: case ADMUX: case SREG_AT: case PCMSK0:
    case PCMSK1: case PCMSK2: case PCICR: case EIMSK: case SMCR: case EEARL: case EEARH: case EEDR:
        return 1;
    default:
        return 0;
    }
}

// Read I/O register `address` at m->cycle.
static u32 io_read(struct avr *m, u32 address)
{
    apply_events(m, m->cycle);
    if (!is_steady(address))
        m->touched = 1;
    switch (address) {
    case PINB: case PINC: case PIND:
        return port_read(m, (address - PINB) / 3);
    case TIFR0: case TIFR1: case TIFR2:
        timer_sync(m, address - TIFR0, m->cycle);
        timer_schedule(m, address - TIFR0);
        return m->data[address];
    case TCNT0:
        timer_sync(m, 0, m->cycle);
        return timer_read(m, address);
    case TCNT2:
        timer_sync(m, 2, m->cycle);
        return timer_read(m, address);
    case TCNT1L: case TCNT1H: case ICR1L: case ICR1H:
        timer_sync(m, 1, m->cycle);
        return timer_read(m, address);
    case ADCL: case ADCH:
        return adc_read(m, address);
    case UDR0:
        return uart_read(m, address);
    case EECR:
        return eeprom_read_control(m);
    case SPMCSR:
        return spm_read(m);
    case WDTCSR:
        return m->data[WDTCSR] | (u32)(m->watchdog_window && m->cycle <= m->watchdog_window) << WDCE;
    default:
        if (is_unmodelled(address, 0))
            m->unmodelled = (u8)address;
        return m->data[address];
    }
}

static void timer_register_write(struct avr *m, u32 n, u32 address, u32 value, u64 at)
{
    timer_sync(m, n, at);
    timer_write(m, address, value);
    turn_at_top(m, n);
    timer_schedule(m, n);
}

static void device_write(struct avr *m, u32 address, u32 value, u64 at)
{
    u8 *d = m->data;
    switch (address) {
    case PINB: case DDRB: case PORTB: case PINC: case DDRC: case PORTC: case PIND: case DDRD: case PORTD:
        port_write(m, address, value, at);
        return;
    case TIFR0: case TIFR1: case TIFR2:
        timer_sync(m, address - TIFR0, at);
        d[address] &= (u8)~value;
        timer_schedule(m, address - TIFR0);
        return;
    case PCIFR: case EIFR:
        d[address] &= (u8)~value;
        return;
    case EECR:
        eeprom_write(m, value, at);
        return;
    case EEARH:
        d[address] = value & 3;
        return;
    case GTCCR:
        timers_sync(m, at);
        prescaler_write(m, value, at);
        timers_schedule(m);
        return;
    case TCCR0A: case TCCR0B: case TCNT0: case OCR0A: case OCR0B:
        timer_register_write(m, 0, address, value, at);
        return;
    case TCCR1A: case TCCR1B: case TCCR1C: case TCNT1L: case TCNT1H: case ICR1L: case ICR1H:
    case OCR1AL: case OCR1AH: case OCR1BL: case OCR1BH:
        timer_register_write(m, 1, address, value, at);
        return;
    case TCCR2A: case TCCR2B: case TCNT2: case OCR2A: case OCR2B:
        timer_register_write(m, 2, address, value, at);
        return;
    case TIMSK0: case TIMSK1: case TIMSK2:
        timer_sync(m, address - TIMSK0, at);
        d[address] = (u8)value;
        timer_schedule(m, address - TIMSK0);
        return;
    case PRR:
        timers_sync(m, at);
        d[PRR] = value & 0xEF;
        timers_schedule(m);
        return;
    case ACSR:
        comparator_write(m, value, at);
        return;
    case ADCSRA:
        adc_write(m, value, at);
        timers_schedule(m);
        return;
    case ADCSRB:
        d[ADCSRB] = value & 0x47;
        timers_schedule(m);
        comparator_update(m, at);
        return;
    case ADMUX:
        d[ADMUX] = value & 0xEF;
        comparator_update(m, at);
        return;
    case ADCL: case ADCH: case 0x65:
        return; // read-only
    case MCUSR:
        d[MCUSR] &= (u8)value;
        return;
    case MCUCR: {
        int open = m->vector_window && at <= m->vector_window;
        d[MCUCR] = (u8)((value & 0x10) | (open ? value & 2 : d[MCUCR] & 2)); // PUD, IVSEL
        m->vector_window = value & 1 ? at + TIMED_WINDOW : 0;
        for (u32 port = 0; port < 3; port++)
            port_update(m, port, at);
        return;
    }
    case CLKPR: {
        int open = m->clock_window && at <= m->clock_window;
        if (open && !(value & 0x80))
            d[CLKPR] = value & 0x0F;
        m->clock_window = (value & 0x8F) == 0x80 ? at + TIMED_WINDOW : 0;
        return;
    }
    case SPMCSR:
        spm_write(m, value, at);
        return;
    case SREG_AT:
        m->shadow = (value & ~(u32)d[SREG_AT] & FLAG_I) != 0;
        d[SREG_AT] = (u8)value;
        return;
    case WDTCSR:
        watchdog_write(m, value, at);
        return;
    case UCSR0A: case UCSR0B: case UCSR0C: case UBRR0L: case UBRR0H: case UDR0:
        uart_write(m, address, value, at);
        return;
    default:
        d[address] = (u8)value;
    }
}

// Write I/O register `address` at m->cycle; it acts from the next cycle.
static void io_write(struct avr *m, u32 address, u32 value)
{
    apply_events(m, m->cycle);
    if (is_unmodelled(address, value))
        m->unmodelled = (u8)address;
    u32 old = m->data[address], is_port = address <= PORTD;
    if (old != value || !is_idempotent(address))
        m->touched = 1;
    device_write(m, address, value, m->cycle + 1);
    if (m->watched[address] && !is_port && m->data[address] != old)
        log_change(m, address, m->data[address], m->cycle + 1);
    reschedule(m);
}

// Execute SBI or CBI, which write one bit. Writing the other flags of such a register back would clear them.
static void io_set_bit(struct avr *m, u32 address, u32 bit, u32 on)
{
    u32 value = m->data[address], flag = 1u << bit;
    int is_flags = (address >= TIFR0 && address <= EIFR) || (address >= PINB && address <= PIND && address % 3 == 2);
    if (is_flags)
        value = on ? flag : 0; // PINx (a one toggles) and interrupt flags (a one clears)
    else
        value = (value & ~flag) | on << bit;
    io_write(m, address, value);
}
