// Watchdog, sleep modes, reset and protected registers (data sheet, chapters on system control, clocks and sleep).

enum { WDIF = 7, WDIE = 6, WDCE = 4, WDE = 3 }; // WDTCSR
enum { IDLE, ADC_NOISE_REDUCTION, POWER_DOWN, POWER_SAVE, STANDBY = 6, EXTENDED_STANDBY };
enum { WDRF = 3, WAKE_CYCLES = 4, START_UP_CYCLES = 6 };

// Return the watchdog's time-out in CPU cycles. A period of its 128 kHz oscillator takes 62.5 cycles at 8 MHz.
static u64 watchdog_cycles(const struct avr *m)
{
    u32 select = (m->data[WDTCSR] & 7) | (m->data[WDTCSR] >> 2 & 8);
    return ((u64)2048 << (select > 9 ? 9 : select)) * 125 / 2;
}

static void watchdog_restart(struct avr *m, u64 at)
{
    m->due[EVENT_WATCHDOG] = NEVER;
    if (bit_of(m, WDTCSR, WDE) || bit_of(m, WDTCSR, WDIE))
        schedule(m, EVENT_WATCHDOG, at + watchdog_cycles(m));
}

static void watchdog_write(struct avr *m, u32 value, u64 at)
{
    u32 old = m->data[WDTCSR], open = m->watchdog_window && at <= m->watchdog_window;
    u32 changed = open ? 0x2F : 0; // WDE and the prescaler need the timed sequence
    u32 kept = (old & ~changed) & 0x2F, set = value & (changed | 1u << WDE);
    u32 flag = old & ~value & 1u << WDIF;
    if (bit_of(m, MCUSR, WDRF))
        set |= 1u << WDE;
    m->data[WDTCSR] = (u8)(kept | set | flag | (value & 1u << WDIE));
    m->watchdog_window = value >> WDCE & 1 && value >> WDE & 1 ? at + TIMED_WINDOW : 0;
    if ((old ^ m->data[WDTCSR]) & 0x6F)
        watchdog_restart(m, at);
}

static void io_clock_stops(struct avr *m, u64 at)
{
    timers_sync(m, at);
    m->sleep_from = at;
    timers_schedule(m);
}

static void shift_due(struct avr *m, u32 event, u64 by)
{
    if (m->due[event] != NEVER)
        m->due[event] += by;
}

static void io_clock_runs(struct avr *m, u64 at)
{
    u64 stood = at - m->sleep_from;
    m->sleep_from = NEVER;
    for (u32 p = 0; p < 2; p++)
        m->prescaler_start[p] += stood;
    for (u32 n = 0; n < TIMERS; n++)
        m->timer_at[n] += stood;
    shift_due(m, EVENT_UART_SENT, stood);
    timers_schedule(m);
}

static void pause_search(struct avr *m, u64 cycle);

// Execute SLEEP: stop the clocks of the selected mode.
static void fall_asleep(struct avr *m, u64 at)
{
    u32 mode = m->data[SMCR] >> 1 & 7;
    if (!(m->data[SMCR] & 1))
        return;
    if (m->tracing)
        pause_search(m, at); // a program that sleeps does not wait in loops
    m->asleep = (u8)(mode + 1);
    if (mode != IDLE)
        io_clock_stops(m, at);
    if (mode == ADC_NOISE_REDUCTION && bit_of(m, ADCSRA, ADEN) && !bit_of(m, ADCSRA, ADSC))
        adc_write(m, m->data[ADCSRA] | 1u << ADSC, at);
    m->deadline = 0;
}

static u32 waking_vectors(const struct avr *m)
{
    u32 pins = 1u << V_INT0 | 1u << V_INT1 | 1u << V_PCINT0 | 1u << V_PCINT1 | 1u << V_PCINT2 | 1u << V_WDT;
    switch (m->asleep - 1) {
    case IDLE:
        return ~0u;
    case ADC_NOISE_REDUCTION:
        return pins | 1u << V_ADC | 1u << V_EE_READY | 1u << V_SPM_READY;
    default:
        return pins;
    }
}

static u64 wake_up_cycles(const struct avr *m)
{
    return WAKE_CYCLES + (m->asleep > POWER_DOWN ? START_UP_CYCLES : 0);
}

// Continue after the wake-up time: start the clocks that the sleep mode has stopped.
static void resume(struct avr *m)
{
    m->asleep = 0;
    if (m->sleep_from != NEVER)
        io_clock_runs(m, m->cycle);
}

// Reset by watchdog or at power-on: registers of the devices get their initial values, memories keep theirs.
static void reset_cpu(struct avr *m, u32 cause)
{
    for (u32 address = IO_START; address < RAM_START; address++)
        m->data[address] = 0;
    for (u32 event = EVENT_INPUT + 1; event < EVENTS; event++)
        m->due[event] = NEVER;
    m->data[MCUSR] = (u8)cause;
    m->data[SPL] = RAMEND & 0xFF, m->data[SPH] = RAMEND >> 8;
    m->stack_low = RAMEND + 1;
    m->data[UCSR0A] = 1u << UDRE, m->data[UCSR0C] = 6;
    m->data[OSCCAL] = 0x80;
    m->pc = m->starts_in_boot ? m->boot_start : 0;
    m->asleep = m->shadow = m->halted = m->started = 0;
    m->sleep_from = NEVER, m->stalled_until = 0;
    for (u32 n = 0; n < TIMERS; n++) {
        m->timer_at[n] = m->cycle, m->timer_position[n] = m->timer_turn[n] = 0, m->timer_blocked[n] = 0;
        m->timer_compare[2 * n] = m->timer_compare[2 * n + 1] = 0;
        m->timer_buffer[2 * n] = m->timer_buffer[2 * n + 1] = 0;
    }
    m->prescaler_start[0] = m->prescaler_start[1] = m->cycle;
    m->timer_capture = m->timer_temp = 0;
    m->comparator_out = m->adc_locked = m->adc_warm = 0;
    m->uart_shifting = m->uart_has_next = m->uart_fifo_count = 0;
    m->eeprom_window = m->spm_window = m->watchdog_window = m->clock_window = m->vector_window = 0;
    if (m->lit)
        m->lit = 0, m->light_changed = 1, m->light_cycle = m->cycle, m->deadline = 0;
    for (u32 port = 0; port < 3; port++)
        port_update(m, port, m->cycle);
    erase_page_buffer(m);
    if (cause >> WDRF & 1) { // WDRF keeps the watchdog on, with the shortest time
        m->data[WDTCSR] = 1u << WDE;
        watchdog_restart(m, m->cycle);
    }
    comparator_update(m, m->cycle);
}

static void watchdog_done(struct avr *m, u64 at)
{
    if (bit_of(m, WDTCSR, WDIE)) {
        set_bit(m, WDTCSR, WDIF, 1);
        watchdog_restart(m, at);
        return;
    }
    m->due[EVENT_WATCHDOG] = NEVER;
    m->must_reset = 1; // the event may come within an instruction, which ends first
    m->deadline = 0;
}

static void watchdog_reset(struct avr *m)
{
    u32 cause = m->data[MCUSR] | 1u << WDRF;
    m->must_reset = 0;
    m->resets++;
    reset_cpu(m, cause);
    log_change(m, MCUSR, m->data[MCUSR], m->cycle);
}
