/* Text of an instruction trace, made from the entries of emu/dspic30f/instruction_log.py.

   An entry is the state before an instruction or a boundary; the next entry shows what has changed. An entry with cycle
   and PC of the next one is omitted, because nothing has happened between them. */
typedef unsigned char u8;
typedef unsigned short u16;
typedef unsigned int u32;
typedef unsigned long long u64;
typedef long long i64;

enum { CORE = 44, NAME = 16, SLOT = 320, COLUMNS = 55, LINE = 1024, LOW = 10000, LOW_DIGITS = 4, HIGH_DIGITS = 8 };

typedef struct { u64 cycle, pc; u16 core[CORE]; } Entry;
typedef struct {
    const i64 *offset; /* place in `texts` of the text of each program word; -1 if the caller has not provided it */
    u64 words;         /* number of offsets */
    const u8 *texts;   /* slots of SLOT bytes: length (u16), a space, the text, spaces up to COLUMNS at least */
    const u8 *names;   /* for each core register NAME bytes: length, name and "="; length 0 for one that is omitted */
} Texts;
typedef struct { u64 value; u8 digits[24]; int count; } High;

/* Writes a cycle, right-aligned. Its upper digits are kept in `high`, because they seldom change. */
static u8 *put_cycle(u8 *out, u64 cycle, High *high) {
    u64 upper = cycle / LOW;
    u32 low = (u32)(cycle % LOW);
    if (upper != high->value) {
        u8 digits[24];
        int count = 0, place = 0;
        for (u64 rest = upper; rest; rest /= 10) digits[count++] = (u8)('0' + rest % 10);
        while (place + count < HIGH_DIGITS) high->digits[place++] = ' ';
        while (count) high->digits[place++] = digits[--count];
        high->count = place;
        high->value = upper;
    }
    for (int i = 0; i < high->count; i++) *out++ = high->digits[i];
    for (int i = LOW_DIGITS - 1; i >= 0; i--, low /= 10) out[i] = low || upper || i == LOW_DIGITS - 1 ? (u8)('0' + low % 10) : ' ';
    return out + LOW_DIGITS;
}

static u8 *put_register(u8 *out, const u8 *name, u32 value) {
    static const u8 hex[] = "0123456789ABCDEF";
    *out++ = ' ';
    __builtin_memcpy(out, name + 1, NAME - 1);
    out += name[0];
    for (int shift = 12; shift >= 0; shift -= 4) *out++ = hex[value >> shift & 15];
    return out;
}

static u8 *put_registers(u8 *out, const Texts *t, const u16 *before, const u16 *after) {
    u8 *end = out++;
    for (int group = 0; group < CORE; group += 4) {
        u64 old, new;
        __builtin_memcpy(&old, before + group, sizeof old);
        __builtin_memcpy(&new, after + group, sizeof new);
        if (old == new) continue;
        for (int word = group; word < group + 4; word++)
            if (before[word] != after[word] && t->names[word * NAME]) end = out = put_register(out, t->names + word * NAME, after[word]);
    }
    return end;
}

/* Writes the lines of entries[at..count-2] to `out`, which has `room` bytes. Returns the index of the first entry that
   is not written: the last one, one of a boundary or outside flash, one whose text is missing, or one without room. */
i64 trace_text(const Texts *t, const Entry *entries, i64 at, i64 count, u8 *out, i64 room, i64 *used) {
    u8 *begin = out, *last = out + room - LINE;
    High high = {~0ull, {0}, 0};
    for (; at + 1 < count && out <= last; at++) {
        const Entry *e = &entries[at], *next = e + 1;
        if (e->cycle == next->cycle && (u32)e->pc == (u32)next->pc) continue;
        if (e->pc >> 1 >= t->words || t->offset[e->pc >> 1] < 0) break;
        const u8 *text = t->texts + t->offset[e->pc >> 1];
        int length = text[0] | text[1] << 8;
        u8 *column = put_cycle(out, e->cycle, &high);
        __builtin_memcpy(column, text + 2, 64);
        for (int i = 64; i < length; i++) column[i] = text[2 + i];
        u8 *registers = column + (length > COLUMNS ? length : COLUMNS);
        u8 *end = put_registers(registers, t, e->core, next->core);
        if (end == registers) end = column + length;
        *end = '\n';
        out = end + 1;
    }
    *used = out - begin;
    return at;
}
