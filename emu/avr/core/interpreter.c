// The interpreter: executes decoded instructions until the deadline, then handles events, sleep and interrupts.
//
// The meanings of the instructions come from the table (isa/rows.py); the macros here are their vocabulary.

enum { RUN_LIMIT, RUN_FAULT, RUN_HALT, RUN_LOG, RUN_PROGRAM, RUN_LIGHT }; // results of avr_run

enum { INTERRUPT_CYCLES = 4, SREG_BITS = FLAG_S | FLAG_V | FLAG_N | FLAG_Z | FLAG_C };

static u32 sign_flags(u32 result, u32 overflow)
{
    u32 negative = result >> 7 & 1;
    return negative << 2 | overflow << 3 | (negative ^ overflow) << 4;
}

static inline u8 add_bytes(u8 *s, u32 a, u32 b, u32 carry)
{
    u32 r = a + b + carry, out = (a & b) | ((a | b) & ~r), flags = sign_flags(r, ((a ^ r) & (b ^ r)) >> 7 & 1);
    *s = (u8)((*s & 0xC0) | flags | (out >> 7 & 1) | (out & 8) << 2 | ((r & 0xFF) == 0) << 1);
    return (u8)r;
}

static inline u8 sub_bytes(u8 *s, u32 a, u32 b, u32 carry, u32 zero)
{
    u32 r = a - b - carry, out = (~a & b) | ((~a | b) & r), flags = sign_flags(r, ((a ^ b) & (a ^ r)) >> 7 & 1);
    *s = (u8)((*s & 0xC0) | flags | (out >> 7 & 1) | (out & 8) << 2 | (((r & 0xFF) == 0) & zero) << 1);
    return (u8)r;
}

static inline u16 word_flags(u8 *s, u32 after, u32 carry, u32 overflow)
{
    u32 flags = sign_flags(after >> 8 & 0xFF, overflow);
    *s = (u8)((*s & ~SREG_BITS) | flags | carry | ((after & 0xFFFF) == 0) << 1);
    return (u16)after;
}

static inline u8 logic_flags(u8 *s, u32 r)
{
    *s = (u8)((*s & ~(SREG_BITS & ~FLAG_C)) | sign_flags(r, 0) | ((r & 0xFF) == 0) << 1);
    return (u8)r;
}

static inline u8 shift_flags(u8 *s, u32 r, u32 carry)
{
    u32 negative = r >> 7 & 1;
    *s = (u8)((*s & ~SREG_BITS) | sign_flags(r, negative ^ carry) | carry | ((r & 0xFF) == 0) << 1);
    return (u8)r;
}

static inline u8 step_flags(u8 *s, u32 r, u32 overflow)
{
    *s = (u8)((*s & ~(SREG_BITS & ~FLAG_C)) | sign_flags(r, (r & 0xFF) == overflow) | ((r & 0xFF) == 0) << 1);
    return (u8)r;
}

static inline u16 product_flags(u8 *s, u32 r, u32 shift)
{
    u32 shifted = r << shift;
    *s = (u8)((*s & ~(FLAG_Z | FLAG_C)) | (r >> 15 & 1) | ((shifted & 0xFFFF) == 0) << 1);
    return (u16)shifted;
}

static inline u32 pair_at(const u8 *p)
{
    return p[0] | (u32)p[1] << 8;
}

static inline void set_pair(u8 *p, u32 value)
{
    p[0] = (u8)value, p[1] = (u8)(value >> 8);
}

static void fault(struct avr *m, u32 kind, u32 address)
{
    m->fault = (u16)kind, m->fault_address = (u16)address;
}

static void enter_interrupt(struct avr *m, u32 pending)
{
    u32 vector = (u32)__builtin_ctz(pending), sp = word_at(m, SPL);
    if (sp < RAM_START + 1 || sp > RAMEND) {
        m->fault_pc = m->pc;
        fault(m, FAULT_STACK, sp);
        return;
    }
    m->data[sp] = (u8)m->pc, m->data[sp - 1] = (u8)(m->pc >> 8);
    set_pair(m->data + SPL, sp - 2);
    m->data[SREG_AT] &= (u8)~FLAG_I;
    m->pc = (u16)(2 * vector + (m->data[MCUCR] & 2 ? m->boot_start : 0));
    m->tracing = 0, m->round = 0;
    m->cycle += INTERRUPT_CYCLES;
    acknowledge(m, vector);
}

// Whether an event can wake the CPU or end its loop. With interrupts off only a reset can.
static int can_continue(const struct avr *m)
{
    if (m->data[SREG_AT] & FLAG_I)
        return m->next_due != NEVER;
    return bit_of(m, WDTCSR, WDE) && m->due[EVENT_WATCHDOG] != NEVER;
}

static void halt(struct avr *m)
{
    m->halted = 1;
    m->halted_at = m->cycle;
}

// Pass the time of a sleeping CPU. Return 0 if the run ends.
static int sleep_on(struct avr *m)
{
    u64 from = m->cycle;
    if (m->data[SREG_AT] & FLAG_I && pending_vectors(m) & waking_vectors(m)) {
        wake_up(m);
        return 1;
    }
    if (!can_continue(m)) {
        halt(m);
        return 0;
    }
    m->resting = 1;
    m->cycle = m->next_due < m->until ? m->next_due : m->until;
    m->slept += m->cycle - from;
    return 1;
}

// Work between two instructions. Return 1 and a deadline, or 0 if the run ends.
static int boundary(struct avr *m)
{
    for (;;) {
        m->deadline = m->until; // until then nothing asks for an early return
        if (m->fault || m->cycle >= m->until || m->halted || m->program_changed || m->light_changed ||
            m->log_count >= LOG_ROOM / 2)
            return 0;
        apply_events(m, m->cycle);
        if (m->asleep) {
            if (!sleep_on(m))
                return 0;
            continue;
        }
        u32 pending = m->data[SREG_AT] & FLAG_I ? pending_vectors(m) : 0;
        if (pending && !m->shadow) {
            enter_interrupt(m, pending);
            continue;
        }
        m->deadline = m->next_due < m->until ? m->next_due : m->until;
        if (m->round && !m->shadow) {
            u64 passed = (m->deadline - m->cycle) / m->round * m->round;
            m->cycle += passed, m->skipped += passed;
            if (m->cycle >= m->until)
                continue;
        }
        if (m->shadow && m->cycle + 1 < m->deadline)
            m->deadline = m->cycle + 1;
        m->shadow = 0;
        return 1;
    }
}

// Vocabulary of the meanings.
#define C (s & 1u)
#define T (s >> 6 & 1u)
#define SREG ((u32)s)
#define X 26
#define Y 28
#define Z 30
#define SIGNED(v) ((i32)(i8)(v))
#define PAIR(n) pair_at(data + (n))
#define SET_PAIR(n, v) set_pair(data + (n), (v))
#define add(a, b, c) add_bytes(&s, (a), (b), (c))
#define sub(a, b, c) sub_bytes(&s, (a), (b), (c), 1)
#define sub_with_carry(a, b) sub_bytes(&s, (a), (b), C, s >> 1 & 1u)
#define add_word(a, b) word_sum(&s, (a), (b))
#define sub_word(a, b) word_difference(&s, (a), (b))
#define logic(r) logic_flags(&s, (u32)(r) & 0xFF)
#define shifted(r, carry) shift_flags(&s, (u32)(r) & 0xFF, (u32)(carry))
#define step(r, overflow) step_flags(&s, (u32)(r), (overflow))
#define product(r, shift) product_flags(&s, (u32)(r), (shift))
#define SET_C(v) (s = (u8)((s & ~1u) | (v)))
#define SET_T(v) (s = (u8)((s & ~64u) | (u32)(v) << 6))
#define SET_SREG(v) \
    do { \
        u8 new_ = (u8)(v); \
        if (new_ & ~s & FLAG_I) \
            m->shadow = 1, deadline = 0; \
        s = new_; \
    } while (0)
#define ENABLE_INTERRUPTS() (s |= FLAG_I, m->shadow = 1, deadline = 0)

#define SAVE() (m->cycle = cycle + ACCESS, data[SREG_AT] = s, m->pc = (u16)pc, m->deadline = deadline)
#define RESUME() (cycle = m->cycle - ACCESS, s = data[SREG_AT], deadline = m->deadline)
#define FAIL(kind, address) \
    do { \
        fault(m, (kind), (address)); \
        goto failed; \
    } while (0)

#define READ_IO(address) \
    ({ \
        u32 at_ = (address), v_; \
        if (plain[at_] & PLAIN_READ) \
            v_ = data[at_]; \
        else { \
            SAVE(); \
            v_ = io_read(m, at_); \
            reschedule(m); \
            RESUME(); \
        } \
        (u8) v_; \
    })
#define WRITE_IO(address, value) \
    do { \
        u32 at_ = (address); \
        if (plain[at_] & PLAIN_WRITE) \
            data[at_] = (value); \
        else { \
            SAVE(); \
            io_write(m, at_, (value)); \
            RESUME(); \
        } \
    } while (0)
#define IN(A) READ_IO(A)
#define OUT(A, v) WRITE_IO(A, v)
#define SET_BIT(A, b, on) \
    do { \
        if (plain[A] & PLAIN_WRITE) \
            data[A] = (u8)((data[A] & ~(1u << (b))) | (on) << (b)); \
        else { \
            SAVE(); \
            io_set_bit(m, A, b, on); \
            RESUME(); \
        } \
    } while (0)
#define LOAD(address) \
    ({ \
        u32 a_ = (u16)(address); \
        u8 w_; \
        if (a_ - RAM_START < DATA_BYTES - RAM_START || a_ < IO_START) \
            w_ = data[a_]; \
        else if (a_ < RAM_START) \
            w_ = READ_IO(a_); \
        else \
            FAIL(FAULT_LOAD, a_); \
        w_; \
    })
#define STORE(address, value) \
    do { \
        u32 a_ = (u16)(address); \
        if (a_ - RAM_START < DATA_BYTES - RAM_START || a_ < IO_START) \
            data[a_] = (value); \
        else if (a_ < RAM_START) \
            WRITE_IO(a_, (value)); \
        else \
            FAIL(FAULT_STORE, a_); \
    } while (0)
#define PUSH(value) \
    do { \
        u32 sp_ = PAIR(SPL); \
        if (sp_ - RAM_START >= DATA_BYTES - RAM_START) \
            FAIL(FAULT_STACK, sp_); \
        data[sp_] = (value); \
        SET_PAIR(SPL, sp_ - 1); \
    } while (0)
#define POP() \
    ({ \
        u32 sp_ = PAIR(SPL) + 1; \
        if (sp_ - RAM_START >= DATA_BYTES - RAM_START) \
            FAIL(FAULT_STACK, sp_); \
        SET_PAIR(SPL, sp_); \
        data[sp_]; \
    })
#define FLASH(address) \
    ({ \
        u32 z_ = (address); \
        u8 w_; \
        if (data[SPMCSR] & (1u << SIGRD | 1u << BLBSET)) \
            w_ = (u8)special_row(m, z_); \
        else if (z_ >= FLASH_BYTES) \
            FAIL(FAULT_FLASH, z_); \
        else \
            w_ = m->flash[z_]; \
        w_; \
    })

#define JUMP(target) \
    do { \
        u32 to_ = (target) & PC_MASK; \
        if (to_ == (u32)(insn - code)) \
            deadline = 0, m->looping = ACCESS + 1; \
        pc = to_; \
    } while (0)
#define BRANCH(condition) \
    do { \
        if (condition) \
            pc = insn->k, cycle++; \
    } while (0)
#define SKIP(condition) \
    do { \
        if (condition) { \
            u32 words_ = code[pc].words; \
            pc += words_, cycle += words_; \
        } \
    } while (0)
#define CALL(target) \
    do { \
        u32 to_ = (target) & PC_MASK, sp_ = PAIR(SPL); \
        if (sp_ < RAM_START + 1 || sp_ > RAMEND) \
            FAIL(FAULT_STACK, sp_); \
        data[sp_] = (u8)pc, data[sp_ - 1] = (u8)(pc >> 8); \
        SET_PAIR(SPL, sp_ - 2); \
        pc = to_; \
    } while (0)
#define RETURN() \
    do { \
        u32 sp_ = PAIR(SPL); \
        if (sp_ < RAM_START - 1 || sp_ > RAMEND - 2) \
            FAIL(FAULT_STACK, sp_ + 1); \
        pc = ((u32)data[sp_ + 1] << 8 | data[sp_ + 2]) & PC_MASK; \
        SET_PAIR(SPL, sp_ + 2); \
    } while (0)
#define SLEEP() \
    do { \
        SAVE(); \
        fall_asleep(m, cycle + 1); \
        RESUME(); \
    } while (0)
#define RESET_WATCHDOG() \
    do { \
        SAVE(); \
        watchdog_restart(m, cycle + 1); \
        reschedule(m); \
        RESUME(); \
    } while (0)
#define PROGRAM() \
    do { \
        SAVE(); \
        program_flash(m, (u32)(insn - code)); \
        RESUME(); \
    } while (0)
#define BREAK() (void)0 // without a debugger it does nothing

#define START(words, cycles) \
    enum { ACCESS = (cycles) - 1 }; \
    (void)ACCESS; \
    pc += (words)
#define DISPATCH() \
    do { \
        insn = code + pc; \
        goto *labels[insn->op]; \
    } while (0)
#define NEXT(cycles) \
    do { \
        cycle += (cycles); \
        if (cycle >= deadline) \
            goto leave; \
        DISPATCH(); \
    } while (0)

static inline u16 word_sum(u8 *s, u32 a, u32 b)
{
    u32 r = (a + b) & 0xFFFF;
    return word_flags(s, r, (~r & a) >> 15 & 1, (r & ~a) >> 15 & 1);
}

static inline u16 word_difference(u8 *s, u32 a, u32 b)
{
    u32 r = (a - b) & 0xFFFF;
    return word_flags(s, r, (r & ~a) >> 15 & 1, (~r & a) >> 15 & 1);
}

static i64 result_of(const struct avr *m)
{
    if (m->fault)
        return RUN_FAULT;
    if (m->halted)
        return RUN_HALT;
    if (m->program_changed)
        return RUN_PROGRAM;
    if (m->light_changed)
        return RUN_LIGHT;
    return m->log_count >= LOG_ROOM / 2 ? RUN_LOG : RUN_LIMIT;
}

// A jump to itself. Without a wake-up source the program has ended; otherwise it repeats up to the next event.
static void loop_on_itself(struct avr *m)
{
    u32 cycles = m->looping;
    m->looping = 0;
    apply_events(m, m->cycle);
    if (m->shadow || (m->data[SREG_AT] & FLAG_I && pending_vectors(m)))
        return;
    if (!can_continue(m)) {
        halt(m);
        return;
    }
    u64 end = m->next_due < m->until ? m->next_due : m->until;
    if (end > m->cycle) {
        u64 rounds = (end - m->cycle + cycles - 1) / cycles;
        m->cycle += rounds * cycles, m->skipped += rounds * cycles;
    }
}

// A loop that only counts registers down: SBIW, DEC or SUBI with SBCI, and BRNE back to it.
struct countdown {
    u64 cycles; // of a round
    u32 bytes;  // of the counter
    u32 is_word; // counted by SBIW
    u8 registers[4];
};

static struct countdown countdown_of(const struct insn *code, const struct insn *branch)
{
    const struct insn *first = code + branch->k;
    struct countdown c = {0, 0, 0, {0}};
    if (first->op == OP_DEC)
        c = (struct countdown){3, 1, 0, {first->d}};
    else if (first->op == OP_SBIW)
        c = (struct countdown){4, 2, 1, {first->d, (u8)(first->d + 1)}};
    else
        for (const struct insn *i = first; i < branch; i++)
            c.registers[c.bytes++] = i->d, c.cycles = c.bytes + 2;
    return c;
}

static int is_countdown(const struct insn *code, u32 pc)
{
    const struct insn *branch = code + pc, *first = code + branch->k;
    u32 length = pc - branch->k;
    if (branch->op != OP_BRBC || branch->r != 1 || branch->k >= pc || length > 4)
        return 0;
    if (length == 1)
        return first->op == OP_DEC || (first->op == OP_SBIW && first->k == 1);
    if (first->op != OP_SUBI || first->k != 1)
        return 0;
    for (const struct insn *i = first + 1; i < branch; i++)
        if (i->op != OP_SBCI || i->k != 0 || i->d == first->d || (i > first + 1 && i->d <= i[-1].d))
            return 0;
    return 1;
}

// Pass as many rounds of a countdown as end before `deadline`, and leave one. Return the cycles that pass.
static u64 count_down(u8 *data, u8 *s, const struct countdown *c, u64 time)
{
    u64 value = 0, rounds = time / c->cycles;
    for (u32 n = 0; n < c->bytes; n++)
        value |= (u64)data[c->registers[n]] << 8 * n;
    if (value < 2 || !rounds)
        return 0;
    if (rounds > value - 1)
        rounds = value - 1;
    value -= rounds;
    if (c->bytes == 1) // DEC
        step_flags(s, (u32)value, 0x7F);
    else if (c->is_word)
        word_difference(s, (u32)value + 1, 1);
    else
        for (u32 n = 0; n < c->bytes; n++)
            sub_bytes(s, (u32)((value + 1) >> 8 * n) & 0xFF, n ? 0 : 1, n ? *s & 1u : 0, n ? *s >> 1 & 1u : 1);
    for (u32 n = 0; n < c->bytes; n++)
        data[c->registers[n]] = (u8)(value >> 8 * n);
    return rounds * c->cycles;
}

enum { TRACE_LEAST = 1000, TRACE_WINDOW = 256, TRACE_MOST = 16384, TRACE_PAUSE = 16384, TRACE_PAUSES = 8 };

static void anchor(struct avr *m, u64 cycle, u32 pc)
{
    m->trace_from = cycle, m->trace_pc = (u16)pc, m->touched = 0;
    __builtin_memcpy(m->trace_data, m->data, DATA_BYTES);
}

// Before a stretch without events: should the interpreter look for a round that repeats?
static int traces(struct avr *m)
{
    if (m->tracing)
        return 1;
    if (m->round || m->cycle < m->trace_after || m->next_due - m->cycle < TRACE_LEAST)
        return 0;
    m->tracing = 1, m->trace_window = TRACE_WINDOW;
    anchor(m, m->cycle, m->pc);
    return 1;
}

// At the anchor again, or its window is over. Return 1 if the search goes on.
static int trace_on(struct avr *m, u64 cycle, u32 pc)
{
    if (pc == m->trace_pc && !m->touched && !__builtin_memcmp(m->trace_data, m->data, DATA_BYTES)) {
        m->round = (u32)(cycle - m->trace_from);
        m->tracing = 0, m->resting = 1, m->trace_failures = 0;
        return 0;
    }
    if (cycle - m->trace_from < m->trace_window)
        return 1;
    if (m->trace_window >= TRACE_MOST) { // pause, longer after each failure
        m->tracing = 0;
        m->trace_after = cycle + ((u64)TRACE_PAUSE << m->trace_failures);
        m->trace_failures += m->trace_failures < TRACE_PAUSES;
        return 0;
    }
    m->trace_window *= 2;
    anchor(m, cycle, pc);
    return 1;
}

#define INTERPRETER_BEGIN() \
    u8 *const data = m->data; \
    const struct insn *insn; \
    u64 cycle = m->cycle, deadline = m->deadline; \
    u32 pc = m->pc; \
    u8 s = data[SREG_AT]; \
    DISPATCH()
#define INTERPRETER_END() \
do_COUNT_DOWN : { \
    START(1, 1); \
    if (!(s & FLAG_Z)) { \
        struct countdown c = countdown_of(code, insn); \
        pc = insn->k, cycle++; \
        if (deadline > cycle + 1) \
            passed = count_down(data, &s, &c, deadline - cycle - 1), cycle += passed, m->skipped += passed; \
    } \
    NEXT(1); \
} \
do_ILLEGAL: \
    FAIL(FAULT_ILLEGAL, insn->word); \
do_END: \
    FAIL(FAULT_END, 0); \
failed: \
    m->fault_pc = m->pc = (u16)(insn - code); \
    m->cycle = cycle, data[SREG_AT] = s; \
    return; \
leave: \
    m->cycle = cycle, m->pc = (u16)pc, data[SREG_AT] = s

// Execute instructions up to the deadline.
static void interpret(struct avr *m, const struct insn *code)
{
    INSTRUCTION_LABELS
    u64 passed;
    INTERPRETER_BEGIN();
    INSTRUCTION_BODIES
    INTERPRETER_END();
}

#undef NEXT
#define NEXT(cycles) \
    do { \
        cycle += (cycles); \
        if (cycle >= deadline) \
            goto leave; \
        if (pc == m->trace_pc || cycle - m->trace_from >= m->trace_window) { \
            data[SREG_AT] = s; \
            if (!trace_on(m, cycle, pc)) \
                goto leave; \
        } \
        DISPATCH(); \
    } while (0)

// The same, and look for a round: the state of the CPU, of data memory and of the devices is as at the anchor.
static void interpret_and_trace(struct avr *m, const struct insn *code)
{
    INSTRUCTION_LABELS
    u64 passed;
    INTERPRETER_BEGIN();
    INSTRUCTION_BODIES
    INTERPRETER_END();
}

// Run until cycle `until` is reached or passed, the log is half full, or the program stops.
i64 avr_run(struct avr *m, const struct insn *code, u64 until)
{
    m->until = until;
    while (!m->halted && boundary(m)) {
        if (traces(m))
            interpret_and_trace(m, code);
        else
            interpret(m, code);
        if (m->looping)
            loop_on_itself(m);
    }
    return result_of(m);
}

static u32 row_of(u32 word)
{
    for (u32 op = 0; op < OP_ILLEGAL; op++)
        if ((word & rows[op].mask) == rows[op].match)
            return op;
    return OP_ILLEGAL;
}

// Decode words `first` to `last` of the flash of `m` into `code`, which has an entry per word and two behind the end.
void avr_decode(const struct avr *m, struct insn *code, i64 first, i64 last)
{
    for (u32 pc = (u32)first; pc <= (u32)last; pc++) {
        u32 word = pair_at(m->flash + 2 * pc), next = (pc + 1) & PC_MASK, second = pair_at(m->flash + 2 * next);
        if (word == ERASED)
            word = ERASED_BITS;
        u32 op = row_of(word);
        code[pc] = (struct insn){.op = (u8)op, .words = op < OP_ILLEGAL ? rows[op].words : 1, .word = (u16)word};
        operands_of(code + pc, op, word, second, pc);
    }
    for (u32 pc = (u32)first; pc <= (u32)last; pc++)
        if (is_countdown(code, pc))
            code[pc].op = OP_COUNT_DOWN;
    for (u32 n = 1; n <= 2; n++)
        code[PC_MASK + n] = (struct insn){.op = OP_END, .words = 1};
}

// Power on: clear all but the inputs, the fuses and the memories that keep their content.
void avr_power_on(struct avr *m)
{
    for (u32 address = 0; address < DATA_BYTES; address++)
        m->data[address] = 0;
    for (u32 event = 0; event < EVENTS; event++)
        m->due[event] = NEVER;
    m->cycle = 0;
    if (!m->random)
        m->random = 1;
    reset_cpu(m, 1); // PORF
    find_next_due(m);
}

// Add an input at cycle `at`. Return 0, or -1 if there is no room. Inputs of the past come at once.
i64 avr_input(struct avr *m, u64 at, i64 kind, i64 value)
{
    if (m->input_count == INPUT_ROOM)
        return -1;
    u32 place = m->input_count++;
    while (place) {
        u32 before = (m->input_first + place - 1) % INPUT_ROOM, here = (before + 1) % INPUT_ROOM;
        if (m->input_cycle[before] <= at)
            break;
        m->input_cycle[here] = m->input_cycle[before];
        m->input_kind[here] = m->input_kind[before], m->input_value[here] = m->input_value[before];
        place--;
    }
    u32 here = (m->input_first + place) % INPUT_ROOM;
    m->input_cycle[here] = at, m->input_kind[here] = (u8)kind, m->input_value[here] = (u32)value;
    m->due[EVENT_INPUT] = m->input_cycle[m->input_first];
    m->halted = 0;
    find_next_due(m);
    return 0;
}
