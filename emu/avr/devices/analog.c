// Analog-to-digital converter and analog comparator (data sheet, chapters of these names).
//
// The board sets the voltages of the inputs. A conversion uses the voltage at its sampling time.

enum { ADEN = 7, ADSC = 6, ADATE = 5, ADIF = 4, ADIE = 3 };             // ADCSRA
enum { ACME = 6 };                                                      // ADCSRB
enum { ACD = 7, ACBG = 6, ACO = 5, ACI = 4, ACIE = 3, ACIC = 2 };       // ACSR
enum { BY_COMPARATOR = 1, EXTENDED_CLOCKS = 25, NORMAL_CLOCKS = 13 };
enum { SYNCHRONISATION = 3 }; // CPU cycles between a trigger and the start of its conversion

static u32 adc_shift(const struct avr *m)
{
    u32 select = m->data[ADCSRA] & 7;
    return select ? select : 1;
}

static u32 input_uv(struct avr *m, u32 channel)
{
    u32 level = m->analog_uv[channel], noise = m->noise_uv[channel];
    return noise ? level + random_bits(m) % noise : level;
}

static u32 converted(struct avr *m, u32 channel)
{
    u32 reference = m->adc_channel >> 6;
    u64 full = reference == 3 ? BANDGAP_UV : reference == 1 ? m->avcc_uv : m->aref_uv;
    u64 uv = channel <= CH_TEMPERATURE ? input_uv(m, channel) : channel == 14 ? BANDGAP_UV : 0;
    u64 counts = full ? uv * 1024 / full : 1023;
    return counts > 1023 ? 1023 : (u32)counts;
}

// Start a conversion at cycle `start`: sample after `sample`, store the result after `result` half-periods of the clock.
static void convert(struct avr *m, u64 start, u32 sample, u32 result)
{
    u32 shift = adc_shift(m);
    if (!m->adc_warm)
        sample = 27, result = 2 * EXTENDED_CLOCKS;
    m->adc_warm = 1;
    m->adc_channel = m->data[ADMUX];
    set_bit(m, ADCSRA, ADSC, 1);
    schedule(m, EVENT_ADC_SAMPLE, start + (((u64)sample << shift) >> 1));
    schedule(m, EVENT_ADC_DONE, start + (((u64)result << shift) >> 1));
}

// Handle a rising edge of trigger source `source` (ADTS): start a conversion if the program has selected it.
static void start_conversion_by(struct avr *m, u32 source, u64 at)
{
    if (!bit_of(m, ADCSRA, ADEN) || !bit_of(m, ADCSRA, ADATE) || (m->data[ADCSRB] & 7u) != source)
        return;
    if (bit_of(m, ADCSRA, ADSC))
        return; // a conversion is running
    m->adc_clock_start = at + SYNCHRONISATION;
    convert(m, at + SYNCHRONISATION, 4, 27);
}

static void adc_sample(struct avr *m)
{
    m->due[EVENT_ADC_SAMPLE] = NEVER;
    m->adc_value = (u16)converted(m, m->adc_channel & 15);
}

static void adc_done(struct avr *m, u64 at)
{
    m->due[EVENT_ADC_DONE] = NEVER;
    if (!m->adc_locked) {
        u32 value = m->adc_channel & 0x20 ? (u32)m->adc_value << 6 : m->adc_value; // ADLAR
        m->data[ADCL] = (u8)value, m->data[ADCH] = (u8)(value >> 8);
    }
    set_bit(m, ADCSRA, ADIF, 1);
    set_bit(m, ADCSRA, ADSC, 0);
    if (bit_of(m, ADCSRA, ADATE) && (m->data[ADCSRB] & 7) == 0)
        convert(m, at, 3, 2 * NORMAL_CLOCKS); // free running
}

static u32 adc_read(struct avr *m, u32 address)
{
    if (address == ADCL || address == ADCH)
        m->adc_locked = address == ADCL;
    return m->data[address];
}

static void adc_write(struct avr *m, u32 value, u64 at)
{
    u32 old = m->data[ADCSRA];
    u32 flag = old & ~value & 1u << ADIF; // writing 1 clears it
    m->data[ADCSRA] = (u8)((value & ~(1u << ADIF | 1u << ADSC)) | flag | (old & 1u << ADSC));
    if (!(value >> ADEN & 1)) {
        set_bit(m, ADCSRA, ADSC, 0);
        m->due[EVENT_ADC_SAMPLE] = m->due[EVENT_ADC_DONE] = NEVER;
        m->adc_warm = 0;
        return;
    }
    if (!(old >> ADEN & 1))
        m->adc_clock_start = at, m->adc_warm = 0;
    if (value >> ADSC & 1 && !(old >> ADSC & 1)) {
        u32 shift = adc_shift(m);
        u64 since = at - m->adc_clock_start, edge = (since + (1u << shift) - 1) >> shift << shift;
        convert(m, m->adc_clock_start + edge, 3, 2 * NORMAL_CLOCKS);
    }
}

static void comparator_edge(struct avr *m, int rising, u64 at)
{
    u32 mode = m->data[ACSR] & 3;
    if (mode == 0 || mode == (rising ? 3 : 2)) {
        int was_set = bit_of(m, ACSR, ACI);
        set_bit(m, ACSR, ACI, 1);
        if (!was_set)
            start_conversion_by(m, BY_COMPARATOR, at);
    }
    if (bit_of(m, ACSR, ACIC) && (bit_of(m, TCCR1B, 6) == rising))
        timer_capture(m, at);
}

// Compare the inputs after one has changed. The board's delay includes the synchroniser's one or two cycles.
static void comparator_update(struct avr *m, u64 at)
{
    if (bit_of(m, ACSR, ACD))
        return;
    int by_mux = bit_of(m, ADCSRB, ACME) && !bit_of(m, ADCSRA, ADEN);
    u32 plus = bit_of(m, ACSR, ACBG) ? BANDGAP_UV : m->analog_uv[CH_AIN0];
    u32 minus = m->analog_uv[by_mux ? m->data[ADMUX] & 7 : CH_AIN1];
    int out = plus > minus;
    if (out == m->comparator_out)
        return;
    m->comparator_out = (u8)out;
    set_bit(m, ACSR, ACO, (u32)out);
    comparator_edge(m, out, at);
}

static void comparator_write(struct avr *m, u32 value, u64 at)
{
    u32 kept = m->data[ACSR] & (1u << ACO | (~value & 1u << ACI));
    m->data[ACSR] = (u8)((value & ~(1u << ACO | 1u << ACI)) | kept);
    if (value >> ACD & 1)
        m->comparator_out = 0, set_bit(m, ACSR, ACO, 0);
    comparator_update(m, at);
}
