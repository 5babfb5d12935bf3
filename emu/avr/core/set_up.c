// Decoding of the program, power-on, and inputs.

static u32 row_of(u32 word)
{
    for (u32 op = 0; op < OP_ILLEGAL; op++)
        if ((word & rows[op].mask) == rows[op].match)
            return op;
    return OP_ILLEGAL;
}

// Decode words `first` to `last` of the flash of `m` into `code`. It has an entry per word, two after the end of flash,
// and one for the instruction at address 0: OP_RESTART replaces it, because it must report jumps to the reset vector.
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
    int ends = code[0].op == OP_RJMP && code[0].k == 0; // the whole program is a jump to itself
    if (!first && !ends)
        code[PC_MASK + 3].op = code[0].op, code[0].op = OP_RESTART;
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

// Add an input at cycle `at`. Return 0, or -1 if there is no room. Inputs with a past cycle take effect immediately. A
// second voltage of a channel at the same cycle replaces the first: a paused machine accepts any number of them.
i64 avr_input(struct avr *m, u64 at, i64 kind, i64 value)
{
    u32 last = (m->input_first + m->input_count + INPUT_ROOM - 1) % INPUT_ROOM;
    if (m->input_count && kind >= INPUT_ANALOG && m->input_kind[last] == kind && m->input_cycle[last] == at) {
        m->input_value[last] = (u32)value;
        return 0;
    }
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
