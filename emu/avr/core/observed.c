// A run instruction by instruction, for the profile and the debugger. It ends at breakpoints and at changes of a watched
// range, and counts cycles by instruction. It skips no iterations of waiting loops; the result equals that of `avr_run`.

enum { WORDS = FLASH_BYTES / 2, WATCH_BYTES = 64, RUN_BREAK = 6 };
enum { STOP_NONE, STOP_PLACE, STOP_STEP, STOP_WRITE }; // reasons of RUN_BREAK

struct observation {
    u64 steps;      // steps after which the run ends, 0: no limit. A step is an instruction or an interrupt entry
    u64 last_cycle; // first cycle of the last instruction or interrupt entry
    u64 passed;     // cycle of the last stop at a place; the run does not stop there again
    u32 reason;     // reason of the stop; the caller sets it to STOP_NONE before it continues
    u16 watch_from, watch_count; // range of data memory, at most WATCH_BYTES; a count of 0: none
    u16 site;       // word address of the last instruction, or of the interrupt's vector
    u8 counting;    // 1: count cycles
    u8 places[WORDS]; // 1: stop before the instruction at this word address
    u64 cycles[WORDS]; // cycles of the instructions at each word address; an interrupt's entry counts for its vector
};

// Whether an instruction executes next: the CPU is awake, and no interrupt or reset comes before.
static int executes_next(struct avr *m)
{
    apply_events(m, m->cycle);
    u32 pending = m->data[SREG_AT] & FLAG_I ? pending_vectors(m) : 0;
    return !m->asleep && !m->must_reset && !(pending && !m->shadow);
}

i64 avr_run_observed(struct avr *m, const struct insn *code, u64 until, struct observation *o)
{
    i64 result = RUN_LIMIT;
    u8 before[WATCH_BYTES];
    while (m->cycle < until && result == RUN_LIMIT && !o->reason) {
        if (m->pc < WORDS && o->places[m->pc] && o->passed != m->cycle && !o->steps && !m->halted && executes_next(m)) {
            o->passed = m->cycle;
            o->reason = STOP_PLACE;
            break;
        }
        u64 from = m->cycle, end = from + 1, cycles;
        u32 pc = m->pc, interrupts = m->interrupts, resets = m->resets, slept = m->asleep;
        if (slept && m->next_due > end)
            end = m->next_due < until ? m->next_due : until;
        __builtin_memcpy(before, m->data + o->watch_from, o->watch_count);
        result = avr_run(m, code, end);
        cycles = m->cycle - from;
        if (m->interrupts != interrupts)
            pc = m->pc, cycles = INTERRUPT_CYCLES;
        else if (slept)
            continue; // sleeping and waking up are not counted as steps
        else if (m->resets != resets)
            pc = m->starts_in_boot ? m->boot_start : 0;
        o->site = (u16)pc, o->last_cycle = from;
        if (o->counting)
            o->cycles[pc & PC_MASK] += cycles;
        if (o->watch_count && __builtin_memcmp(before, m->data + o->watch_from, o->watch_count))
            o->reason = STOP_WRITE;
        if (o->steps && !--o->steps)
            o->reason = STOP_STEP;
    }
    return o->reason && result == RUN_LIMIT ? RUN_BREAK : result;
}
