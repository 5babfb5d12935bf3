// Timer/counters 0, 1 and 2 (data sheet, chapters on 8-bit and 16-bit timers and on the prescaler).
//
// A timer costs nothing while it runs: its count is computed when it is read or written, or when an enabled interrupt
// is due. The phase of a single-slope timer is its count; that of a dual-slope one runs from 0 over TOP to 2 TOP. There
// `timer_turn` keeps the count at which it turned: TOP may change while it counts down.

enum { OVERFLOW = 1, COMPARE_A = 2, COMPARE_B = 4, CAPTURE = 32 }; // bits of TIFRn and TIMSKn

enum { NORMAL, CTC, FAST_PWM, PHASE_PWM, FREQUENCY_PWM };

static const u8 control[TIMERS] = {TCCR0A, TCCR1A, TCCR2A};
static const u8 clock_shifts[2][8] = {{0, 0, 3, 6, 8, 10, 0, 0}, {0, 0, 3, 5, 6, 7, 8, 10}};
static const u8 power_bits[TIMERS] = {5, 3, 6};

struct waveform {
    u32 kind, top, max;
};

static struct waveform waveform_of(const struct avr *m, u32 n)
{
    static const u8 kinds8[8] = {NORMAL, PHASE_PWM, CTC, FAST_PWM, NORMAL, PHASE_PWM, NORMAL, FAST_PWM};
    static const u8 kinds16[16] = {NORMAL, PHASE_PWM, PHASE_PWM, PHASE_PWM, CTC, FAST_PWM, FAST_PWM, FAST_PWM,
                                   FREQUENCY_PWM, FREQUENCY_PWM, PHASE_PWM, PHASE_PWM, CTC, NORMAL, FAST_PWM, FAST_PWM};
    u32 a = m->data[control[n]], b = m->data[control[n] + 1], mode = (a & 3) | (n == 1 ? b >> 1 & 12 : b >> 1 & 4);
    if (n != 1) {
        int by_compare = mode == 2 || mode == 5 || mode == 7;
        return (struct waveform){kinds8[mode], by_compare ? m->timer_compare[2 * n] : 0xFF, 0xFF};
    }
    u32 top = 0xFFFF;
    if ((mode & 3) != 0 && mode < 8)
        top = mode & 1 ? (mode & 2 ? 0x3FF : 0xFF) : 0x1FF;
    if (mode == 4 || mode == 9 || mode == 11 || mode == 15)
        top = m->timer_compare[2];
    if (mode == 8 || mode == 10 || mode == 12 || mode == 14)
        top = m->timer_capture;
    return (struct waveform){kinds16[mode], top, 0xFFFF};
}

// Return the binary logarithm of the CPU cycles of a tick, or -1 if the timer is stopped.
static int tick_shift(const struct avr *m, u32 n)
{
    u32 select = m->data[control[n] + 1] & 7;
    if (select == 0 || (n != 2 && select > 5) || m->data[PRR] >> power_bits[n] & 1)
        return -1;
    int held = m->data[GTCCR] >> 7 && m->data[GTCCR] >> (n == 2) & 1; // TSM holds the prescaler in reset
    return held ? -1 : clock_shifts[n == 2][select];
}

static u64 ticks_until(const struct avr *m, u32 n, int shift, u64 at)
{
    return (at - m->prescaler_start[n == 2]) >> shift;
}

// Return the count at which a dual-slope timer turns or has turned.
static u32 turn_of(const struct avr *m, u32 n, const struct waveform *w)
{
    return m->timer_turn[n] ? m->timer_turn[n] : w->top ? w->top : 1;
}

enum { AT_BOTTOM = 1, AT_TOP = 2 };

// The next point of the period at which flags change, in `ticks` from now. There the flags `flags` are set, and the
// compare values written meanwhile take effect if `updates`. At the bottom the position becomes 0.
struct milestone {
    u64 ticks;
    u32 flags, updates, place;
};

static void consider(struct milestone *next, u64 ticks, u32 flags, u32 updates, u32 place)
{
    if (ticks > next->ticks)
        return;
    if (ticks < next->ticks)
        *next = (struct milestone){ticks, 0, 0, 0};
    next->flags |= flags, next->updates |= updates, next->place |= place;
}

// Return the ticks after which a position of the period is reached next, at least 1.
static u64 ticks_to(u32 from, u32 to, u32 period)
{
    u32 target = to % period;
    return target > from ? target - from : target + period - from;
}

static struct milestone next_milestone(const struct avr *m, u32 n, const struct waveform *w)
{
    struct milestone next = {NEVER, 0, 0, 0};
    u32 position = m->timer_position[n];
    if (w->kind < PHASE_PWM) { // single slope; a flag is set when the count leaves the compare value
        u32 last = position <= w->top ? w->top : w->max;
        int at_max = last == w->max;
        consider(&next, last - position + 1, w->kind == FAST_PWM || at_max ? OVERFLOW : 0, w->kind == FAST_PWM, AT_BOTTOM);
        for (u32 c = 0; c < 2; c++)
            if (m->timer_compare[2 * n + c] >= position && m->timer_compare[2 * n + c] <= last)
                consider(&next, m->timer_compare[2 * n + c] - position + 1, COMPARE_A << c, 0, 0);
        return next;
    }
    u32 top = turn_of(m, n, w), period = 2 * top;
    consider(&next, ticks_to(position, 0, period), 0, w->kind == FREQUENCY_PWM, AT_BOTTOM);
    consider(&next, ticks_to(position, top, period), 0, w->kind == PHASE_PWM, AT_TOP);
    consider(&next, ticks_to(position, 1, period), OVERFLOW, 0, 0);
    for (u32 c = 0; c < 2; c++) {
        u32 value = m->timer_compare[2 * n + c];
        if (value <= top) {
            consider(&next, ticks_to(position, value + 1, period), COMPARE_A << c, 0, 0);
            consider(&next, ticks_to(position, period - value + 1, period), COMPARE_A << c, 0, 0);
        }
    }
    return next;
}

static void start_conversion_by(struct avr *m, u32 source, u64 at);

static void move_to(struct avr *m, u32 n, const struct milestone *next)
{
    m->timer_position[n] = next->place & AT_BOTTOM ? 0 : m->timer_position[n] + (u32)next->ticks;
    if (next->place)
        m->timer_turn[n] = next->place & AT_TOP ? (u16)m->timer_position[n] : 0;
    if (next->updates)
        for (u32 c = 0; c < 2; c++)
            m->timer_compare[2 * n + c] = m->timer_buffer[2 * n + c];
}

static void pass_milestone(struct avr *m, u32 n, const struct milestone *next, u64 at)
{
    u32 flags = next->flags & ~(m->timer_blocked[n] && next->ticks == 1 ? (u32)(COMPARE_A | COMPARE_B) : 0);
    u32 rising = flags & ~m->data[TIFR0 + n];
    m->data[TIFR0 + n] |= (u8)flags;
    move_to(m, n, next);
    if (n == 0 && rising & COMPARE_A)
        start_conversion_by(m, 3, at);
    if (n == 0 && rising & OVERFLOW)
        start_conversion_by(m, 4, at);
    if (n == 1 && rising & COMPARE_B)
        start_conversion_by(m, 5, at);
    if (n == 1 && rising & OVERFLOW)
        start_conversion_by(m, 6, at);
}

static void count_ticks(struct avr *m, u32 n, u64 ticks, u64 first, int shift)
{
    u64 done = 0;
    while (ticks) {
        struct waveform w = waveform_of(m, n);
        u64 period = w.kind < PHASE_PWM ? (u64)w.top + 1 : 2 * (u64)turn_of(m, n, &w);
        int same_top = w.kind < PHASE_PWM || turn_of(m, n, &w) == w.top;
        int settled = same_top && m->timer_position[n] < period && m->timer_compare[2 * n] == m->timer_buffer[2 * n] &&
                      m->timer_compare[2 * n + 1] == m->timer_buffer[2 * n + 1];
        if (settled && ticks > 3 * period) { // skip whole periods: the two that remain set the same flags
            u64 whole = (ticks - 2 * period) / period * period;
            ticks -= whole, done += whole;
            m->timer_blocked[n] = 0;
        }
        struct milestone next = next_milestone(m, n, &w);
        if (next.ticks > ticks) {
            m->timer_position[n] += (u32)ticks;
            m->timer_blocked[n] = 0;
            return;
        }
        done += next.ticks, ticks -= next.ticks;
        pass_milestone(m, n, &next, m->prescaler_start[n == 2] + ((first + done) << shift));
        m->timer_blocked[n] = 0;
    }
}

// Advance a timer to cycle `at`: its count and its flags.
static void timer_sync(struct avr *m, u32 n, u64 at)
{
    int shift = tick_shift(m, n);
    if (at <= m->timer_at[n] || m->sleep_from != NEVER)
        return;
    if (shift >= 0) {
        u64 first = ticks_until(m, n, shift, m->timer_at[n]);
        count_ticks(m, n, ticks_until(m, n, shift, at) - first, first, shift);
    }
    m->timer_at[n] = at;
}

static u32 wanted_flags(const struct avr *m, u32 n)
{
    u32 wanted = m->data[TIMSK0 + n];
    u32 source = m->data[ADCSRA] & 0x20 ? m->data[ADCSRB] & 7 : 0;
    if (n == 0)
        wanted |= source == 3 ? COMPARE_A : source == 4 ? OVERFLOW : 0;
    if (n == 1)
        wanted |= source == 5 ? COMPARE_B : source == 6 ? OVERFLOW : 0;
    return wanted & (OVERFLOW | COMPARE_A | COMPARE_B) & ~(u32)m->data[TIFR0 + n];
}

// Post the event at which the timer next sets a flag that an interrupt or the ADC waits for.
static void timer_schedule(struct avr *m, u32 n)
{
    int shift = tick_shift(m, n);
    u32 wanted = wanted_flags(m, n);
    m->due[EVENT_TIMER0 + n] = NEVER;
    if (shift < 0 || !wanted || m->sleep_from != NEVER)
        return;
    u32 position = m->timer_position[n], blocked = m->timer_blocked[n];
    u16 turn = m->timer_turn[n], compare[2] = {m->timer_compare[2 * n], m->timer_compare[2 * n + 1]};
    u64 ticks = 0;
    for (int tries = 0; tries < 16; tries++) {
        struct waveform w = waveform_of(m, n);
        struct milestone next = next_milestone(m, n, &w);
        u32 flags = next.flags & ~(m->timer_blocked[n] && next.ticks == 1 ? (u32)(COMPARE_A | COMPARE_B) : 0);
        ticks += next.ticks;
        if (flags & wanted) {
            u64 first = ticks_until(m, n, shift, m->timer_at[n]);
            schedule(m, EVENT_TIMER0 + n, m->prescaler_start[n == 2] + ((first + ticks) << shift));
            break;
        }
        m->timer_blocked[n] = 0;
        move_to(m, n, &next);
    }
    m->timer_position[n] = position, m->timer_blocked[n] = (u8)blocked; // the search must leave the timer unchanged
    m->timer_turn[n] = turn;
    m->timer_compare[2 * n] = compare[0], m->timer_compare[2 * n + 1] = compare[1];
}

static void timers_sync(struct avr *m, u64 at)
{
    for (u32 n = 0; n < TIMERS; n++)
        timer_sync(m, n, at);
}

static void timers_schedule(struct avr *m)
{
    for (u32 n = 0; n < TIMERS; n++)
        timer_schedule(m, n);
}

static u32 timer_count(const struct avr *m, u32 n)
{
    struct waveform w = waveform_of(m, n);
    u32 position = m->timer_position[n], turn = turn_of(m, n, &w);
    return w.kind < PHASE_PWM || position <= turn ? position : 2 * turn - position;
}

static void set_count(struct avr *m, u32 n, u32 value)
{
    m->timer_position[n] = value, m->timer_turn[n] = 0;
    m->timer_blocked[n] = 1;
}

// Write a compare value. In the PWM modes it takes effect at the end of the period.
static void set_compare(struct avr *m, u32 n, u32 channel, u32 value)
{
    m->timer_buffer[2 * n + channel] = (u16)value;
    if (waveform_of(m, n).kind < FAST_PWM)
        m->timer_compare[2 * n + channel] = (u16)value;
}

// Write a control register. The count stays; a mode without buffer uses the written compare values at once.
static void set_control(struct avr *m, u32 n, u32 address, u32 value)
{
    struct waveform before = waveform_of(m, n);
    u32 count = timer_count(m, n);
    m->data[address] = (u8)value;
    struct waveform after = waveform_of(m, n);
    if (before.kind < PHASE_PWM || after.kind < PHASE_PWM || before.top != after.top)
        m->timer_position[n] = count, m->timer_turn[n] = 0; // an up-down timer with the same top keeps its position
    if (waveform_of(m, n).kind < FAST_PWM)
        for (u32 c = 0; c < 2; c++)
            m->timer_compare[2 * n + c] = m->timer_buffer[2 * n + c];
}

// Capture the count of timer 1, at an edge of the comparator or of pin ICP1.
static void timer_capture(struct avr *m, u64 at)
{
    timer_sync(m, 1, at);
    m->timer_capture = (u16)timer_count(m, 1);
    if (!(m->data[TIFR1] & CAPTURE))
        start_conversion_by(m, 7, at);
    m->data[TIFR1] |= CAPTURE;
}

// Count an edge of pin T0 or T1, if the timer counts edges of this direction.
static void timer_edge(struct avr *m, u32 n, int rising, u64 at)
{
    if ((m->data[control[n] + 1] & 7) == (rising ? 7 : 6) && !(m->data[PRR] >> power_bits[n] & 1))
        count_ticks(m, n, 1, at, 0);
}

static u32 timer_read(struct avr *m, u32 address)
{
    switch (address) {
    case TCNT0:
        return timer_count(m, 0);
    case TCNT2:
        return timer_count(m, 2);
    case TCNT1L:
        m->timer_temp = (u8)(timer_count(m, 1) >> 8);
        return timer_count(m, 1) & 0xFF;
    case ICR1L:
        m->timer_temp = (u8)(m->timer_capture >> 8);
        return m->timer_capture & 0xFF;
    case TCNT1H:
    case ICR1H:
        return m->timer_temp;
    default:
        return m->data[address];
    }
}

// Let a dual-slope timer count down if its count is TOP or above.
static void turn_at_top(struct avr *m, u32 n)
{
    struct waveform w = waveform_of(m, n);
    if (w.kind >= PHASE_PWM && !m->timer_turn[n] && m->timer_position[n] >= turn_of(m, n, &w))
        m->timer_turn[n] = (u16)m->timer_position[n];
}

static void timer_write(struct avr *m, u32 address, u32 value)
{
    switch (address) {
    case TCCR0A: case TCCR0B:
        set_control(m, 0, address, address == TCCR0B ? value & 0x0F : value & 0xF3);
        break;
    case TCCR1A: case TCCR1B:
        set_control(m, 1, address, address == TCCR1B ? value & 0xDF : value & 0xF3);
        break;
    case TCCR2A: case TCCR2B:
        set_control(m, 2, address, address == TCCR2B ? value & 0x0F : value & 0xF3);
        break;
    case TCNT0:
        set_count(m, 0, value);
        break;
    case TCNT2:
        set_count(m, 2, value);
        break;
    case OCR0A: case OCR0B:
        m->data[address] = (u8)value;
        set_compare(m, 0, address - OCR0A, value);
        break;
    case OCR2A: case OCR2B:
        m->data[address] = (u8)value;
        set_compare(m, 2, address - OCR2A, value);
        break;
    case TCNT1H: case ICR1H: case OCR1AH: case OCR1BH:
        m->timer_temp = (u8)value;
        break;
    case TCNT1L:
        set_count(m, 1, value | (u32)m->timer_temp << 8);
        break;
    case ICR1L:
        m->timer_capture = (u16)(value | (u32)m->timer_temp << 8);
        break;
    case OCR1AL: case OCR1BL:
        m->data[address] = (u8)value, m->data[address + 1] = m->timer_temp;
        set_compare(m, 1, address == OCR1BL, value | (u32)m->timer_temp << 8);
        break;
    default:
        m->data[address] = (u8)value;
    }
}

// Write GTCCR, which resets the prescalers.
static void prescaler_write(struct avr *m, u32 value, u64 at)
{
    for (u32 p = 0; p < 2; p++)
        if (value >> p & 1)
            m->prescaler_start[p] = at;
    m->data[GTCCR] = (u8)(value & 0x80 ? value & 0x83 : 0);
}
