// Waiting loops: the interpreter adds the cycles of many iterations instead of executing them.

// Advance a jump to itself to the next event. If no event can end the loop, the program has ended.
static void loop_on_itself(struct avr *m)
{
    u32 cycles = m->looping;
    m->looping = 0;
    apply_events(m, m->cycle);
    if (m->must_reset || m->shadow || (m->data[SREG_AT] & FLAG_I && pending_vectors(m)))
        return;
    if (!can_continue(m)) {
        halt(m);
        return;
    }
    m->resting = 1;
    u64 end = m->next_due < m->until ? m->next_due : m->until;
    if (end > m->cycle) {
        u64 rounds = (end - m->cycle + cycles - 1) / cycles;
        m->cycle += rounds * cycles, m->skipped += rounds * cycles;
    }
}

// A loop that only counts registers down: SBIW, DEC or SUBI with SBCI, and BRNE back to it.
struct countdown {
    u64 cycles;  // cycles of an iteration
    u32 bytes;   // size of the counter
    u32 is_word; // whether SBIW counts a register pair
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
    if (branch->op != OP_BRBC || branch->r != 1 || branch->k >= pc || !branch->k || length > 4)
        return 0;
    if (length == 1)
        return first->op == OP_DEC || (first->op == OP_SBIW && first->k == 1);
    if (first->op != OP_SUBI || first->k != 1)
        return 0;
    u32 used = 1u << first->d;
    for (const struct insn *i = first + 1; i < branch; i++) {
        if (i->op != OP_SBCI || i->k != 0 || used >> i->d & 1)
            return 0;
        used |= 1u << i->d;
    }
    return 1;
}

// Skip the iterations of a countdown that end before `deadline`, except the last one, which the interpreter executes.
// The branch at its end is taken at `cycle`. Return the cycles that were skipped.
static u64 count_down(struct avr *m, u8 *s, const struct countdown *c, u64 cycle, u64 deadline)
{
    u8 *const data = m->data;
    u64 value = 0, rounds = deadline > cycle + 1 ? (deadline - cycle - 1) / c->cycles : 0;
    for (u32 n = 0; n < c->bytes; n++)
        value |= (u64)data[c->registers[n]] << 8 * n;
    m->counts_until = cycle + value * c->cycles;
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
    u64 passed = rounds * c->cycles;
    m->skipped += passed, m->trace_end += passed;
    return passed;
}

enum { TRACE_LEAST = 1000, TRACE_WINDOW = 256, TRACE_MOST = 16384, TRACE_PAUSE = 16384, TRACE_PAUSES = 8 };

// Return the cycles that were neither skipped nor slept. Windows and pauses of the search count these cycles, because
// they cost host time.
static u64 executed(const struct avr *m, u64 cycle)
{
    return cycle - m->skipped - m->slept;
}

// End the search; begin the next one after a pause that is longer after each failure.
static void pause_search(struct avr *m, u64 cycle)
{
    m->tracing = 0;
    m->trace_after = executed(m, cycle) + ((u64)TRACE_PAUSE << m->trace_failures);
    m->trace_failures += m->trace_failures < TRACE_PAUSES;
}

static void anchor(struct avr *m, u64 cycle, u32 pc)
{
    m->trace_from = cycle, m->trace_pc = (u16)pc, m->touched = 0;
    m->trace_end = cycle + m->trace_window;
    __builtin_memcpy(m->trace_data, m->data, DATA_BYTES);
}

// Whether the interpreter should look for a round that repeats. The search starts only if no event is due soon.
static int traces(struct avr *m)
{
    if (m->tracing)
        return 1;
    if (m->round || executed(m, m->cycle) < m->trace_after || m->next_due - m->cycle < TRACE_LEAST)
        return 0;
    m->tracing = 1, m->trace_window = TRACE_WINDOW;
    anchor(m, m->cycle, m->pc);
    return 1;
}

// Compare the state with that at the anchor; at the end of the window, move the anchor or pause the search. Return 1 if
// the search continues.
static int trace_on(struct avr *m, u64 cycle, u32 pc)
{
    if (pc == m->trace_pc && !m->touched && !__builtin_memcmp(m->trace_data, m->data, DATA_BYTES)) {
        m->round = (u32)(cycle - m->trace_from);
        m->tracing = 0, m->resting = 1, m->trace_failures = 0;
        return 0;
    }
    if (cycle < m->trace_end)
        return 1;
    if (m->trace_window >= TRACE_MOST) {
        pause_search(m, cycle);
        return 0;
    }
    m->trace_window *= 2;
    anchor(m, cycle, pc);
    return 1;
}
