// Work between two instructions: faults, interrupts, sleep.

enum { INTERRUPT_CYCLES = 4 };

static void fault(struct avr *m, u32 kind, u32 address)
{
    m->fault = (u16)kind, m->fault_address = (u16)address;
}

static u32 flash_word(const struct avr *m, u32 pc)
{
    return m->flash[2 * (pc & PC_MASK)] | (u32)m->flash[2 * (pc & PC_MASK) + 1] << 8;
}

// Return the target of a JMP or RJMP at `pc`, or -1 for another instruction.
static int jump_target(const struct avr *m, u32 pc)
{
    u32 word = flash_word(m, pc);
    if ((word & 0xFE0E) == 0x940C)
        return (int)(flash_word(m, pc + 1) & PC_MASK);
    return word >> 12 == 0xC ? (int)((pc + 1 + (word & 0xFFF) - (word >> 11 & 1 ? 0x1000 : 0)) & PC_MASK) : -1;
}

// Whether the program has no handler for a vector. avr-gcc then lets it jump to the same code as the other unused
// vectors, which jumps to the reset vector.
static int is_unhandled(const struct avr *m, u32 base, u32 vector)
{
    int target = jump_target(m, base + 2 * vector);
    if (target < 0 || jump_target(m, (u32)target) != (int)base)
        return 0;
    u32 others = 0;
    for (u32 other = 1; other < VECTORS; other++)
        others += other != vector && jump_target(m, base + 2 * other) == target;
    return others > 0;
}

static void enter_interrupt(struct avr *m, u32 pending)
{
    u32 vector = (u32)__builtin_ctz(pending), sp = word_at(m, SPL), base = m->data[MCUCR] & 2 ? m->boot_start : 0;
    if (is_unhandled(m, base, vector)) {
        m->fault_pc = m->pc;
        fault(m, FAULT_VECTOR, vector);
        return;
    }
    if (sp < RAM_START + 1 || sp > RAMEND) {
        m->fault_pc = m->pc;
        fault(m, FAULT_STACK, sp);
        return;
    }
    m->data[sp] = (u8)m->pc, m->data[sp - 1] = (u8)(m->pc >> 8);
    note_stack(m, sp - 1, m->pc, m->cycle);
    set_pair(m->data + SPL, sp - 2);
    m->data[SREG_AT] &= (u8)~FLAG_I;
    m->pc = (u16)(base + 2 * vector);
    m->tracing = 0, m->round = 0, m->counts_until = 0;
    m->cycle += INTERRUPT_CYCLES;
    m->interrupts++;
    acknowledge(m, vector);
}

// Whether an event can wake the CPU or end a jump to itself. With interrupts off, only a watchdog reset can.
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

// Advance a CPU that wakes up or waits for the flash, at most to the end of the run: light may still arrive after it.
static void stall_on(struct avr *m)
{
    if (m->cycle < m->stalled_until) {
        m->cycle = m->stalled_until < m->until ? m->stalled_until : m->until;
        return;
    }
    m->stalled_until = 0;
    if (m->asleep) {
        resume(m);
        find_next_due(m);
    }
}

// Begin to wake the sleeping CPU, or advance to the next event that may wake it. Return 0 if nothing can.
static int sleep_on(struct avr *m)
{
    u64 from = m->cycle;
    if (m->data[SREG_AT] & FLAG_I && pending_vectors(m) & waking_vectors(m)) {
        m->resting = 0, m->counts_until = 0;
        m->stalled_until = m->cycle + wake_up_cycles(m);
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
        m->deadline = m->until; // withdraws earlier requests to leave the interpreter's loop
        if (m->fault || m->cycle >= m->until || m->halted || m->program_changed || m->light_changed ||
            m->log_count >= LOG_ROOM / 2)
            return 0;
        apply_events(m, m->cycle);
        if (m->must_reset) {
            watchdog_reset(m);
            find_next_due(m);
            continue;
        }
        if (m->stalled_until) {
            stall_on(m);
            continue;
        }
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
            if (m->cycle >= m->deadline)
                continue;
        }
        if (m->shadow && m->cycle + 1 < m->deadline)
            m->deadline = m->cycle + 1;
        m->shadow = 0;
        return 1;
    }
}
