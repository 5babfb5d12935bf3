// A run instruction by instruction, for the profile and the debugger. It ends at breakpoints and at changes of a watched
// range, counts cycles by instruction, and logs inputs. It skips no iterations of waiting loops; the result equals that
// of `avr_run`.

enum { WORDS = FLASH_BYTES / 2, WATCH_BYTES = 64, INPUT_LOG_ROOM = 512, RUN_BREAK = 6 };
enum { STOP_NONE, STOP_PLACE, STOP_STEP, STOP_WRITE, STOP_LIMIT, STOP_INPUTS }; // reasons of RUN_BREAK

struct logged_input {
    u64 given, at; // cycle at which the machine was given the input, and cycle from which it acts
    u32 kind, value;
};

struct observation {
    u64 steps;      // steps after which the run ends, 0: no limit. A step is an instruction or an interrupt entry
    u64 last_cycle; // first cycle of the last instruction or interrupt entry
    u64 passed;     // cycle of the last stop at a place; the run does not stop there again
    u64 last;       // the run ends at the first instruction boundary at or after this cycle
    u32 reason;     // reason of the stop; the caller sets it to STOP_NONE before it continues
    u16 watch_from, watch_count; // range of data memory, at most WATCH_BYTES; a count of 0: none
    u16 site;       // word address of the last instruction, or of the interrupt's vector
    u8 counting;    // 1: count cycles
    u8 logging;     // 1: log the inputs of `avr_input_observed`
    u8 places[WORDS]; // 1: stop before the instruction at this word address
    u64 cycles[WORDS]; // cycles of the instructions at each word address; an interrupt's entry counts for its vector
    u64 input_count;   // logged inputs; the run ends before there is no room, and the caller empties the log
    struct logged_input inputs[INPUT_LOG_ROOM];
};

// As `avr_input`, and log the input.
i64 avr_input_observed(struct avr *m, u64 at, i64 kind, i64 value, struct observation *o)
{
    if (o->logging) {
        if (o->input_count == INPUT_LOG_ROOM)
            return -1;
        o->inputs[o->input_count++] = (struct logged_input){m->cycle, at, (u32)kind, (u32)value};
    }
    return avr_input(m, at, kind, value);
}

// Apply the events that are due, as a run does before the next instruction. Two stops at one cycle then show one state.
void avr_apply_due(struct avr *m)
{
    apply_events(m, m->cycle);
}

// Whether the CPU sleeps, wakes up or waits for the flash.
static int is_idle(const struct avr *m)
{
    return m->asleep || m->stalled_until > m->cycle;
}

// Whether an instruction executes next: the CPU is not idle, and no interrupt or reset comes before.
static int executes_next(struct avr *m)
{
    avr_apply_due(m);
    u32 pending = m->data[SREG_AT] & FLAG_I ? pending_vectors(m) : 0;
    return !is_idle(m) && !m->must_reset && !(pending && !m->shadow);
}

i64 avr_run_observed(struct avr *m, const struct insn *code, u64 until, struct observation *o)
{
    i64 result = RUN_LIMIT;
    u64 last = o->last < until ? o->last : until;
    u8 before[WATCH_BYTES];
    if (!o->reason && o->input_count > INPUT_LOG_ROOM / 2)
        o->reason = STOP_INPUTS;
    while (m->cycle < last && result == RUN_LIMIT && !o->reason) {
        if (m->pc < WORDS && o->places[m->pc] && o->passed != m->cycle && !o->steps && !m->halted && executes_next(m)) {
            o->passed = m->cycle;
            o->reason = STOP_PLACE;
            break;
        }
        u64 from = m->cycle, end = from + 1, cycles;
        u32 pc = m->pc, interrupts = m->interrupts, resets = m->resets, idle = is_idle(m);
        u64 next = m->stalled_until ? m->stalled_until : m->next_due;
        if (idle && next > end)
            end = next < last ? next : last;
        __builtin_memcpy(before, m->data + o->watch_from, o->watch_count);
        result = avr_run(m, code, end);
        cycles = m->cycle - from;
        if (m->interrupts != interrupts)
            pc = m->pc, cycles = INTERRUPT_CYCLES;
        else if (idle)
            continue; // idle cycles are not counted as steps
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
    if (last < until && !o->reason && (m->cycle >= last || result == RUN_HALT)) {
        if (m->cycle < last)
            m->cycle = last; // only an input can wake it
        o->reason = STOP_LIMIT;
        result = result == RUN_HALT ? RUN_LIMIT : result;
    }
    return o->reason && result == RUN_LIMIT ? RUN_BREAK : result;
}
