// Functions and macros that the meanings in the instruction table (isa/rows.py) use: results, flags and accesses.

enum { SREG_BITS = FLAG_S | FLAG_V | FLAG_N | FLAG_Z | FLAG_C };

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
        note_stack(m, sp_, (u32)(insn - code), cycle); \
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
        if (data[SPMCSR] & (1u << SIGRD | 1u << BLBSET) && cycle <= m->spm_window) \
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
        note_stack(m, sp_ - 1, (u32)(insn - code), cycle); \
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
        find_next_due(m); \
        RESUME(); \
    } while (0)
#define RESET_WATCHDOG() \
    do { \
        SAVE(); \
        watchdog_restart(m, cycle + 1); \
        m->touched |= m->due[EVENT_WATCHDOG] != NEVER; \
        reschedule(m); \
        RESUME(); \
    } while (0)
#define PROGRAM() \
    do { \
        SAVE(); \
        program_flash(m, (u32)(insn - code)); \
        RESUME(); \
    } while (0)
#define BREAK() (void)0 // the chip ignores it unless a hardware debugger is connected

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
