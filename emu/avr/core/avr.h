// One ATmega328P: bits, vectors, and helpers that all parts use. Python declares `struct avr` (state.py) and the addresses of
// registers (addresses.py).
//
// Source: ATmega328P data sheet (docs/reference/avr.md names its sections). A write in cycle t acts from cycle t + 1.

enum { PC_MASK = FLASH_BYTES / 2 - 1, IO_START = 0x20, RAMEND = DATA_BYTES - 1 };
#define NEVER (~(u64)0)

// Vectors by number; vector n is at word 2 n.
enum {
    V_RESET, V_INT0, V_INT1, V_PCINT0, V_PCINT1, V_PCINT2, V_WDT, V_T2_COMPA, V_T2_COMPB, V_T2_OVF, V_T1_CAPT,
    V_T1_COMPA, V_T1_COMPB, V_T1_OVF, V_T0_COMPA, V_T0_COMPB, V_T0_OVF, V_SPI, V_UART_RX, V_UART_UDRE, V_UART_TX,
    V_ADC, V_EE_READY, V_COMPARATOR, V_TWI, V_SPM_READY, VECTORS
};

enum { FLAG_C = 1, FLAG_Z = 2, FLAG_N = 4, FLAG_V = 8, FLAG_S = 16, FLAG_H = 32, FLAG_T = 64, FLAG_I = 128 };

enum { // kinds of fault (machine.py)
    FAULT_NONE, FAULT_ILLEGAL, FAULT_LOAD, FAULT_STORE, FAULT_STACK, FAULT_END, FAULT_FLASH, FAULT_VECTOR
};

// Kinds of input. Values: port << 16 | driven << 8 | level; a byte; microvolts of channel INPUT_ANALOG + n.
enum { INPUT_PIN, INPUT_UART, INPUT_ANALOG };

enum { CH_TEMPERATURE = 8, CH_AIN0, CH_AIN1 }; // indices in analog_uv
enum { BANDGAP_UV = 1100000, LARGE_FRAME = 64 };

static int bit_of(const struct avr *m, u32 address, u32 bit)
{
    return m->data[address] >> bit & 1;
}

static void set_bit(struct avr *m, u32 address, u32 bit, u32 on)
{
    m->data[address] = (u8)((m->data[address] & ~(1u << bit)) | on << bit);
}

static u32 word_at(const struct avr *m, u32 address)
{
    return m->data[address] | (u32)m->data[address + 1] << 8;
}

static void log_change(struct avr *m, u32 address, u32 value, u64 at)
{
    if (m->log_count == LOG_ROOM)
        return;
    m->log_cycle[m->log_count] = at;
    m->log_register[m->log_count] = (u8)address;
    m->log_value[m->log_count] = (u8)value;
    if (++m->log_count >= LOG_ROOM / 2)
        m->deadline = 0; // the caller empties the log
}

// Set the due cycle of an event. The next due cycle can only become earlier here; `find_next_due` recomputes it.
static void schedule(struct avr *m, u32 event, u64 at)
{
    m->due[event] = at;
    if (at < m->next_due)
        m->next_due = at;
}

// Record that a push has written address `at`. An address far below the previous ones belongs to the stack of a thread.
static inline void note_stack(struct avr *m, u32 at, u32 pc, u64 cycle)
{
    if (at >= m->stack_low || at + LARGE_FRAME < m->stack_low)
        return;
    m->stack_low = (u16)at;
    if (at <= m->data_end && !m->overflow_at)
        m->overflow_at = cycle, m->overflow_pc = (u16)pc;
}

static u32 random_bits(struct avr *m)
{
    m->random ^= m->random << 13;
    m->random ^= m->random >> 17;
    m->random ^= m->random << 5;
    return m->random;
}
