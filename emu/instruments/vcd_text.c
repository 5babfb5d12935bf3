/* Changes of variables as text of a VCD file: "#" and the time, then a line for each variable with a new value. */
typedef unsigned char u8;
typedef unsigned long long u64;
typedef long long i64;

enum { NAME = 8, LINE = 128 };

typedef struct { u8 is_scalar, length, name[NAME - 2]; } Variable; /* `name` is the identifier code */
typedef struct { u64 time, variable, value; } Change;

static u8 *put_time(u8 *out, u64 time) {
    u8 digits[24];
    int count = 0;
    do digits[count++] = (u8)('0' + time % 10); while (time /= 10);
    *out++ = '#';
    while (count) *out++ = digits[--count];
    *out++ = '\n';
    return out;
}

static u8 *put_value(u8 *out, const Variable *variable, u64 value) {
    if (variable->is_scalar) {
        *out++ = value ? '1' : '0';
    } else {
        *out++ = 'b';
        for (int bit = value ? 63 - __builtin_clzll(value) : 0; bit >= 0; bit--) *out++ = (u8)('0' + (value >> bit & 1));
        *out++ = ' ';
    }
    for (int i = 0; i < variable->length; i++) *out++ = variable->name[i];
    *out++ = '\n';
    return out;
}

/* Writes changes[at..count-1] to `out`, which has `room` bytes. Updates the last values in `seen` and the last time that
   is written. Returns the index of the first change without room. */
i64 vcd_text(const Variable *variables, u64 *seen, u64 *last, const Change *changes, i64 at, i64 count, u8 *out,
             i64 room, i64 *used) {
    u8 *begin = out, *end = out + room - LINE;
    for (; at < count && out <= end; at++) {
        const Change *change = &changes[at];
        if (seen[change->variable] == change->value) continue;
        seen[change->variable] = change->value;
        if (change->time != *last) out = put_time(out, *last = change->time);
        out = put_value(out, &variables[change->variable], change->value);
    }
    *used = out - begin;
    return at;
}
