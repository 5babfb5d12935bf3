// The interpreter: executes decoded instructions until the deadline, then handles events, sleep and interrupts.

enum { RUN_LIMIT, RUN_FAULT, RUN_HALT, RUN_LOG, RUN_PROGRAM, RUN_LIGHT }; // results of avr_run

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
        cycle += count_down(m, &s, &c, cycle, deadline); \
    } \
    NEXT(1); \
} \
do_RESTART : { \
    START(0, 1); \
    if (m->started && m->watched[RESTARTED]) { \
        SAVE(); \
        log_change(m, RESTARTED, 0, cycle); \
        RESUME(); \
    } \
    m->started = 1; \
    goto *labels[code[PC_MASK + 3].op]; \
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
        if (pc == m->trace_pc || cycle >= m->trace_end) { \
            data[SREG_AT] = s; \
            if (!trace_on(m, cycle, pc)) \
                goto leave; \
        } \
        DISPATCH(); \
    } while (0)

// As `interpret`, but also search for a waiting loop: instructions after which the CPU, data memory and devices are in
// the same state again as at the anchor (waiting.c).
static void interpret_and_trace(struct avr *m, const struct insn *code)
{
    INSTRUCTION_LABELS
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
