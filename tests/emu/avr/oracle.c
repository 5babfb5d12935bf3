/* The AVR core beside simavr: single instructions with random operands and states, and whole programs in lock step.
 *
 * The test compiles this file after the declaration of `struct avr` and passes the core's functions as pointers. */
#include <sim_avr.h>
#include <sim_core.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef i64 (*run_function)(struct avr *m, const struct insn *code, u64 until);
typedef void (*decode_function)(const struct avr *m, struct insn *code, i64 first, i64 last);

enum { SP_AT = 0x5D, SREG_AT = 0x5F, WORDS = FLASH_BYTES / 2 };

struct pair {
    avr_t *theirs;
    struct avr *ours;
    struct insn *code;
    run_function run;
    decode_function decode;
    u64 random;
    char difference[400]; /* the first difference */
};

static u32 draw(struct pair *p)
{
    p->random ^= p->random << 13;
    p->random ^= p->random >> 7;
    p->random ^= p->random << 17;
    return (u32)(p->random >> 16);
}

static void quiet(avr_t *avr, const int level, const char *format, va_list arguments)
{
    (void)avr, (void)level, (void)format, (void)arguments;
}

struct pair *pair_open(struct avr *ours, struct insn *code, run_function run, decode_function decode)
{
    struct pair *p = calloc(1, sizeof *p);
    avr_global_logger_set(quiet);
    p->theirs = avr_make_mcu_by_name("atmega328p");
    if (p->theirs == NULL || avr_init(p->theirs) != 0)
        return NULL;
    p->theirs->frequency = 8000000;
    memset(p->theirs->flash, 0xFF, FLASH_BYTES), memset(ours->flash, 0xFF, FLASH_BYTES);
    p->ours = ours, p->code = code, p->run = run, p->decode = decode;
    return p;
}

void pair_close(struct pair *p)
{
    avr_terminate(p->theirs);
    free(p);
}

const char *pair_difference(const struct pair *p)
{
    return p->difference;
}

static u32 sreg_of(const avr_t *avr)
{
    u32 found = 0;
    for (u32 bit = 0; bit < 8; bit++)
        found |= (u32)(avr->sreg[bit] != 0) << bit;
    return found;
}

static void set_sreg(avr_t *avr, u32 value)
{
    for (u32 bit = 0; bit < 8; bit++)
        avr->sreg[bit] = value >> bit & 1;
    avr->data[SREG_AT] = (u8)value;
}

static int differ(struct pair *p, u32 word, u64 step, u64 theirs, u64 ours)
{
    const avr_t *a = p->theirs;
    const struct avr *m = p->ours;
    const char *what = NULL;
    u32 at = 0;
    if (a->pc != 2u * m->pc)
        what = "pc";
    else if (theirs != ours)
        what = "cycles";
    else if (sreg_of(a) != m->data[SREG_AT])
        what = "SREG";
    for (at = 0; what == NULL && at < 32; at++)
        if (a->data[at] != m->data[at])
            what = "register";
    if (what == NULL && memcmp(a->data + SP_AT, m->data + SP_AT, 2) != 0)
        what = "SP";
    if (what == NULL)
        return 0;
    snprintf(p->difference, sizeof p->difference,
             "%s after step %llu, word %04x: simavr pc %04x cycles %llu SREG %02x r%u=%02x, emulator pc %04x cycles"
             " %llu SREG %02x r%u=%02x fault %u",
             what, (unsigned long long)step, word, a->pc, (unsigned long long)theirs, sreg_of(a), at ? at - 1 : 0,
             a->data[at ? at - 1 : 0], 2u * m->pc, (unsigned long long)ours, m->data[SREG_AT], at ? at - 1 : 0,
             m->data[at ? at - 1 : 0], m->fault);
    return 1;
}

static int memories_differ(struct pair *p, u32 word, u64 step)
{
    const u8 *theirs = p->theirs->data + RAM_START, *ours = p->ours->data + RAM_START;
    for (u32 at = 0; at < DATA_BYTES - RAM_START; at++)
        if (theirs[at] != ours[at]) {
            snprintf(p->difference, sizeof p->difference,
                     "RAM %04x after step %llu, word %04x: simavr %02x, emulator %02x",
                     at + RAM_START, (unsigned long long)step, word, theirs[at], ours[at]);
            return 1;
        }
    return 0;
}

static void set_pointer(u8 *data, u32 at, u32 value)
{
    data[at] = (u8)value, data[at + 1] = (u8)(value >> 8);
}

/* `tries` random cases of the `count` words of a row. Returns how many cases were compared, or -1 at a difference. */
i64 pair_row(struct pair *p, const u16 *words, i64 count, i64 tries, u64 seed)
{
    avr_t *a = p->theirs;
    struct avr *m = p->ours;
    p->random = seed * 0x9E3779B97F4A7C15ULL + 1;
    for (i64 n = 0; n < tries; n++) {
        u32 word = words[draw(p) % (u32)count];
        u32 pc = 0x100 + draw(p) % 0x3E00, sp = 0x180 + draw(p) % 0x700;
        u32 next = draw(p) & 1 ? 0x9000 | (draw(p) & 0x1F0) : 0; /* LDS: two words, or NOP */
        u32 data_address = 0x100 + draw(p) % 0x800;
        u8 state[32];
        for (u32 r = 0; r < 32; r += 4) {
            u32 bits = draw(p);
            memcpy(state + r, &bits, 4);
        }
        for (u32 r = 0; r < 32; r++) /* values at which carries and signs change */
            if (draw(p) % 8 == 0)
                state[r] = (u8)"\0\1\x7f\x80\xff\xf\x10\xfe"[draw(p) % 8];
        set_pointer(state, 26, 0x180 + draw(p) % 0x700);
        set_pointer(state, 28, 0x180 + draw(p) % 0x700);
        set_pointer(state, 30, 0x180 + draw(p) % 0x700);
        int two = (word & 0xFC0F) == 0x9000;
        int call = (word & 0xFE0C) == 0x940C;
        u32 second = two ? data_address : call ? draw(p) & 0x3FFF : next;
        u8 flash[6] = {(u8)word, (u8)(word >> 8), (u8)second, (u8)(second >> 8), (u8)next, (u8)(next >> 8)};
        memcpy(a->flash + 2 * pc, flash, 6);
        memcpy(m->flash + 2 * pc, flash, 6);
        p->decode(m, p->code, pc, pc + 2);
        u32 sreg = draw(p) & 0xFF;
        for (u32 at = 0; at < 8; at++) { /* what pointers and stack reach */
            u32 place = 0x100 + draw(p) % 0x800;
            a->data[place] = m->data[place] = (u8)draw(p);
        }
        for (u32 at = 0; at < 3; at++)
            a->data[sp + at] = m->data[sp + at] = (u8)draw(p);
        a->data[sp + 1] &= 0x3F, m->data[sp + 1] &= 0x3F; /* a return address in flash */
        memcpy(a->data, state, 32), memcpy(m->data, state, 32);
        set_pointer(a->data, SP_AT, sp), set_pointer(m->data, SP_AT, sp);
        set_sreg(a, sreg), m->data[SREG_AT] = (u8)sreg;
        a->pc = 2 * pc, m->pc = (u16)pc;
        a->state = cpu_Running, m->shadow = 0, m->looping = 0, m->asleep = 0, m->halted = 0;
        u64 before = a->cycle, start = m->cycle;
        a->pc = avr_run_one(a);
        p->run(m, p->code, m->cycle + 1);
        m->halted = 0;
        if (differ(p, word, (u64)n, a->cycle - before, m->cycle - start) ||
            (n % 64 == 0 && memories_differ(p, word, (u64)n)))
            return -1;
    }
    return memories_differ(p, words[0], (u64)tries) ? -1 : tries;
}

/* Load `size` bytes of flash into both and start at 0. */
void pair_load(struct pair *p, const u8 *flash, i64 size)
{
    memcpy(p->theirs->flash, flash, (size_t)size);
    memcpy(p->ours->flash, flash, (size_t)size);
    p->decode(p->ours, p->code, 0, WORDS - 1);
    memset(p->theirs->data + RAM_START, 0, DATA_BYTES - RAM_START);
    memset(p->ours->data + RAM_START, 0, DATA_BYTES - RAM_START);
    memset(p->theirs->data, 0, 32), memset(p->ours->data, 0, 32);
    set_pointer(p->theirs->data, SP_AT, DATA_BYTES - 1), set_pointer(p->ours->data, SP_AT, DATA_BYTES - 1);
    set_sreg(p->theirs, 0), p->ours->data[SREG_AT] = 0;
    p->theirs->pc = 0, p->ours->pc = 0;
    p->theirs->state = cpu_Running, p->ours->shadow = p->ours->looping = p->ours->halted = 0;
}

/* Execute `steps` instructions in lock step; a program that ends is started again. Returns how many, or -1. */
i64 pair_lockstep(struct pair *p, i64 steps)
{
    avr_t *a = p->theirs;
    struct avr *m = p->ours;
    for (i64 n = 0; n < steps; n++) {
        u64 before = a->cycle, start = m->cycle;
        u32 pc = a->pc, word = a->flash[pc] | (u32)a->flash[pc + 1] << 8;
        if (word == 0xCFFF) { /* the end of the program: rjmp to itself */
            if (memories_differ(p, word, (u64)n))
                return -1;
            set_pointer(a->data, SP_AT, DATA_BYTES - 1), set_pointer(m->data, SP_AT, DATA_BYTES - 1);
            a->pc = 0, m->pc = 0;
            continue;
        }
        a->pc = avr_run_one(a);
        p->run(m, p->code, m->cycle + 1);
        if (differ(p, word, (u64)n, a->cycle - before, m->cycle - start) ||
            (n % 65536 == 0 && memories_differ(p, word, (u64)n)))
            return -1;
    }
    return memories_differ(p, 0, (u64)steps) ? -1 : steps;
}
