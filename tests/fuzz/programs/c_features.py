"""Rarely used constructs of C for the programs of `c_shapes.py`. Each family adds declarations, definitions and
statements.

The statements have the same effect on the chip and on the host. Families: structs of odd sizes as variable arguments;
unions with bit-fields; function pointers; computed goto; setjmp; floating point and its conversions; wide switches;
_Atomic objects; recursion; inline assembly with constraints; objects in near, far, X, Y and constant memory.
"""

from __future__ import annotations

import random
from collections.abc import Callable

Value = Callable[[str], str]
"""Function that returns an expression of a type from the objects in scope."""

HEADER = """
#include <setjmp.h>
#include <stdarg.h>
#include <stdatomic.h>
struct odd3 { u8 a[3]; }; struct odd5 { u8 a[5]; }; struct odd7 { u16 a; u8 b[4]; }; struct one { u8 a; };
union view { u32 w; u16 h[2]; u8 b[4]; struct { u16 a : 3, b : 7, c : 6; u16 d : 11, e : 5; } f;
             struct { i16 s : 5, t : 9; } g; };
typedef u32 (*work)(u16, u32);
#ifdef HOST
typedef float real32; typedef double real64;
#define ARG_WORD(list) ((u16)va_arg(list, int))
#define NEAR
#define FAR
#define XDATA
#define YDATA
#define ROM
static inline u16 asm_add(u16 a, u16 b) { return (u16)(a + b); }
static inline u32 asm_mul(u16 a, u16 b) { return (u32)a * b; }
static inline u16 asm_swap(u16 a) { return (u16)(a << 8 | a >> 8); }
static inline u16 asm_plus_5(u16 a) { return (u16)(a + 5); }
static inline u16 asm_busy(u16 a, u16 b) { return (u16)(a ^ b); }
static inline void asm_store(u16 *p, u16 a) { *p = a; }
static inline u32 asm_add32(u32 a, u32 b) { return a + b; }
#else
typedef float real32; typedef long double real64;
#define ARG_WORD(list) va_arg(list, u16)
#define NEAR __attribute__((near))
#define FAR __attribute__((far))
#define XDATA __attribute__((space(xmemory)))
#define YDATA __attribute__((space(ymemory), far))
#define ROM __attribute__((space(auto_psv)))
static inline u16 asm_add(u16 a, u16 b) { u16 r; __asm__("add %1,%2,%0" : "=r"(r) : "r"(a), "r"(b)); return r; }
static inline u32 asm_mul(u16 a, u16 b) { u32 r; __asm__("mul.uu %1,%2,%0" : "=r"(r) : "r"(a), "r"(b)); return r; }
static inline u16 asm_swap(u16 a) { __asm__("swap %0" : "+r"(a)); return a; }
static inline u16 asm_plus_5(u16 a) { u16 r; __asm__("add %1,#%2,%0" : "=&r"(r) : "r"(a), "i"(5)); return r; }
/* A macro, because the front end reads a file three times that names such registers. */
#define asm_busy(a, b) ({ \\
    u16 busy; \\
    __asm__("mov %1,w5\\n mov %2,w9\\n xor w5,w9,%0" : "=r"(busy) : "r"((u16)(a)), "r"((u16)(b)) : "w5", "w9", "cc"); \\
    busy; \\
})
static inline void asm_store(u16 *p, u16 a) { __asm__ volatile("mov %1,[%0]" : : "r"(p), "r"(a) : "memory"); }
static inline u32 asm_add32(u32 a, u32 b)
{
    __asm__("add %0,%1,%0\\n addc %d0,%d1,%d0" : "+r"(a) : "r"(b) : "cc");
    return a;
}
#endif
/* A float as a number, every not-a-number as one, and conversions where they are defined. */
static inline u32 bits32(real32 x) { u32 w; __builtin_memcpy(&w, &x, 4); return x != x ? 0x7FC00000ul : w; }
static inline u32 bits64(real64 x)
{
    u64 w;
    __builtin_memcpy(&w, &x, 8);
    return x != x ? 0x7FF80000ul : (u32)(w >> 32) ^ (u32)w;
}
static inline i32 whole32(real32 x) { return x > -2e9f && x < 2e9f ? (i32)x : 77; }
static inline u16 whole16(real32 x) { return x > -0.5f && x < 65000.0f ? (u16)x : 78; }
static inline i64 whole64(real64 x) { return x > -9e18L && x < 9e18L ? (i64)x : 79; }
static inline u64 natural64(real64 x) { return x > -0.5L && x < 1.8e19L ? (u64)x : 80; }
u32 gather(const char *what, ...);
"""

GATHER = """
APART u32 gather(const char *what, ...)
{
    u32 sum = 7;
    va_list list;
    va_start(list, what);
    for (; *what; what++) {
        switch (*what) {
        case 'w': sum = sum * 31u + ARG_WORD(list); break;
        case 'l': sum = sum * 31u + va_arg(list, u32); break;
        case 'q': { u64 v = va_arg(list, u64); sum = sum * 31u + (u32)v + (u32)(v >> 32); break; }
        case '1': { struct one v = va_arg(list, struct one); sum = sum * 31u + v.a; break; }
        case '3': { struct odd3 v = va_arg(list, struct odd3); sum = sum * 31u + v.a[0] + 3u * v.a[1] + 5u * v.a[2]; break; }
        case '5': { struct odd5 v = va_arg(list, struct odd5); sum = sum * 31u + v.a[0] + 3u * v.a[2] + 5u * v.a[4]; break; }
        case '7': { struct odd7 v = va_arg(list, struct odd7); sum = sum * 31u + v.a + 3u * v.b[0] + 5u * v.b[3]; break; }
        }
    }
    va_end(list);
    return sum;
}
"""  # noqa: E501
ARGUMENTS = {
    "w": ("u16", "{0}"), "l": ("u32", "{0}"), "q": ("u64", "{0}"), "1": ("u8", "(struct one){{{0}}}"),
    "3": ("u8", "(struct odd3){{{{{0}, 2, 3}}}}"), "5": ("u8", "(struct odd5){{{{{0}, 2, 3, 4, 5}}}}"),
    "7": ("u16", "(struct odd7){{{0}, {{1, 2, 3, 4}}}}"),
}  # fmt: skip
PLACES = ("NEAR", "FAR", "XDATA", "YDATA", "")
WIDE = (0, 1, 2, 0x10000, 0x10001, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF, 0x12345678)
HUGE = (0, 1, 0x100000000, 0x100000001, 0xFFFFFFFFFFFFFFFF, 0x8000000000000000, 0xFFFFFFFF)


class Features:
    """Families of one program. The text of `declared` belongs in the header, that of `defined` in one source file."""

    def __init__(self, rng: random.Random, fresh: Callable[[str], str]) -> None:
        self.rng = rng
        self.fresh = fresh
        self.declared: list[str] = []
        self.defined: list[str] = [GATHER]
        self._workers()
        self._objects()
        self._interpreter()
        self._jumps()
        self._recursion()

    def use(self, value: Value, assign: str) -> list[str]:
        """Return a statement of a random family. `assign` is an assignable u32."""
        family = self.rng.choice(
            (self._variadic, self._union, self._pointer, self._goto, self._setjmp, self._float, self._double,
             self._convert, self._wide_switch, self._atomic, self._recurse, self._assembly, self._place))  # fmt: skip
        return family(value, assign)

    # -- definitions --------------------------------------------------------------------------------------------------

    def _workers(self) -> None:
        """Define functions of one type, in a constant table and in a variable."""
        ops = ("a + b", "b - a", "b << (a & 15)", "b >> (a & 31)", "a * b", "b ^ (u32)a << 16", "b / (a | 1u)",
               "b % (a | 1u)")  # fmt: skip
        names = [self.fresh("w") for _ in range(4)]
        for name in names:
            self.declared.append(f"u32 {name}(u16 a, u32 b);")
            self.defined.append(f"APART u32 {name}(u16 a, u32 b) {{ return (u32)({self.rng.choice(ops)}); }}")
        self.declared.append("extern const work fixed_work[4];\nextern work present_work;")
        self.defined.append(f"const work fixed_work[4] = {{{', '.join(names)}}};\nwork present_work = {names[0]};")

    def _objects(self) -> None:
        """Define objects in every kind of memory, atomic objects, and constants."""
        self.places: list[str] = []
        for k, place in enumerate(PLACES):
            t = self.rng.choice(("u8", "u16", "u32"))
            self.places.append(f"placed{k}")
            self.declared.append(f"extern {t} {place} placed{k}[6];")
            self.defined.append(f"{t} {place} placed{k}[6] = {{{', '.join(str(3 * k + n) for n in range(6))}}};")
        self.declared.append("extern const u16 rom16[8];\nextern const u32 rom32[4];")
        self.declared.append(
            "extern _Atomic u8 atomic8;\nextern _Atomic u16 atomic16;\nextern _Atomic u32 atomic32;\nextern u16 spared;"
        )
        words = [str(self.rng.randrange(1 << 16)) for _ in range(8)]
        longs = [f"{self.rng.randrange(1 << 32)}ul" for _ in range(4)]
        self.defined.append(f"const u16 ROM rom16[8] = {{{', '.join(words)}}};")
        self.defined.append(f"const u32 rom32[4] = {{{', '.join(longs)}}};")
        self.defined.append(
            "_Atomic u8 atomic8 = 1;\n_Atomic u16 atomic16 = 2;\n_Atomic u32 atomic32 = 3;\nu16 spared = 4;"
        )

    def _interpreter(self) -> None:
        """Define a function that interprets a small program with computed goto."""
        ops = ("acc += 3u;", "acc ^= acc >> 5;", "acc *= 17u;", "acc -= *at;", "acc = (acc << 3) | (acc >> 29);")
        chosen = [self.rng.choice(ops) for _ in range(4)]
        cases = "\n".join(f"op{k}: {op} if (--left == 0) return acc; goto *labels[*++at & 3];"
                          for k, op in enumerate(chosen))  # fmt: skip
        self.declared.append("u32 interpret(u32 acc, u16 left);")
        code = ", ".join(str(self.rng.randrange(256)) for _ in range(12))
        self.defined.append(
            f"APART u32 interpret(u32 acc, u16 left)\n{{\n    static const u8 code[12] = {{{code}}};\n"
            "    static void *const labels[4] = {&&op0, &&op1, &&op2, &&op3};\n    const u8 *at = code;\n"
            f"    goto *labels[*at & 3];\n{cases}\n}}"
        )

    def _jumps(self) -> None:
        """Define functions that call setjmp, and longjmp out of nested calls."""
        self.declared.append("u32 attempt(u16 depth, u32 v);")
        self.defined.append(
            "static jmp_buf back;\nAPART static void dive(u16 depth, u32 v)\n{\n"
            "    volatile u16 own[3] = {1, 2, (u16)v};\n    if (depth == 0) longjmp(back, (int)(v & 7) + 1);\n"
            "    dive(depth - 1, v + own[depth % 3]);\n    own[0]++;\n}\n"
            "APART u32 attempt(u16 depth, u32 v)\n{\n    volatile u32 kept = v;\n    u32 first = v * 5u;\n"
            "    int came = setjmp(back);\n    if (came == 0) {\n        kept += first;\n"
            "        dive(depth & 3, v);\n    }\n"
            "    return kept + (u32)came;\n}"
        )

    def _recursion(self) -> None:
        op = self.rng.choice(("+", "^", "-"))
        self.declared.append("u32 descend(u16 n, u32 a, u8 b);")
        self.defined.append(
            "APART u32 descend(u16 n, u32 a, u8 b)\n{\n    if (n == 0) return a + b;\n"
            f"    return (a {op} descend(n - 1, a * 3u + b, (u8)(b + n))) * 5u + n;\n}}"
        )

    # -- statements ---------------------------------------------------------------------------------------------------

    def _variadic(self, value: Value, assign: str) -> list[str]:
        kinds = [self.rng.choice("wlq1357") for _ in range(self.rng.randrange(1, 6))]
        arguments = []
        for kind in kinds:
            t, form = ARGUMENTS[kind]
            arguments.append(form.format(value(t)))
        return [f'{assign} = gather("{"".join(kinds)}", {", ".join(arguments)});']

    def _union(self, value: Value, assign: str) -> list[str]:
        name = self.fresh("un")
        fields = {"a": 7, "b": 127, "c": 63, "d": 2047, "e": 31}
        changes = [f"{name}.f.{(m := self.rng.choice(list(fields)))} = {value('u16')} & {fields[m]}u;",
                   f"{name}.b[{self.rng.randrange(4)}] = {value('u8')};", f"{name}.h[1] ^= {value('u16')};",
                   f"{name}.f.{(m := self.rng.choice(list(fields)))} += {value('u16')} & 3u;",
                   f"{name}.g.s = (i16)({value('u16')} & 15u) - 8;", f"mix((u32)(i32){name}.g.t);"]  # fmt: skip
        self.rng.shuffle(changes)
        return [f"{{   union view {name} = {{{value('u32')}}};", *(f"    {c}" for c in changes[:3]),
                f"    {assign} = {name}.w + {name}.f.{self.rng.choice(list(fields))};", "}"]  # fmt: skip

    def _pointer(self, value: Value, assign: str) -> list[str]:
        call = self.rng.choice((f"fixed_work[{value('u16')} & 3]", "present_work", "(*present_work)"))
        lines = [f"{assign} = {call}({value('u16')}, {value('u32')});"]
        if self.rng.random() < 0.5:
            lines.append(f"present_work = fixed_work[{value('u16')} & 3];")
        return lines

    def _goto(self, value: Value, assign: str) -> list[str]:
        return [f"{assign} = interpret({value('u32')}, ({value('u16')} & 7) + 1);"]

    def _setjmp(self, value: Value, assign: str) -> list[str]:
        return [f"{assign} = attempt({value('u16')}, {value('u32')});"]

    def _floating(self, value: Value, t: str, suffix: str) -> list[str]:
        x, y = self.fresh("x"), self.fresh("x")
        number = self.rng.choice(("0.1", "-3.75", "1.0", "65536.0", "1e-3", "16777217.0"))
        op = self.rng.choice(("+", "-", "*", "/"))
        whole = self.rng.choice(("u8", "i16", "u16", "i32", "u32", "i64", "u64"))
        other = f"({t}){value('i16')} {self.rng.choice('+*')} ({t}){number}{suffix}"
        return [f"{t} {x} = ({t}){value(whole)}, {y} = {other};",
                f"{x} = {x} {op} {y};",
                f"if ({x} {self.rng.choice(('<', '>', '<=', '>=', '==', '!='))} {y}) {x} = -{y};"]  # fmt: skip

    def _float(self, value: Value, assign: str) -> list[str]:
        body = self._floating(value, "real32", "f")
        x = body[0].split()[1]
        result = self.rng.choice((f"bits32({x})", f"(u32)whole32({x})", f"whole16({x})", f"bits64((real64){x})"))
        return ["{", *(f"    {line}" for line in body), f"    {assign} = {result};", "}"]

    def _double(self, value: Value, assign: str) -> list[str]:
        body = self._floating(value, "real64", "L")
        x = body[0].split()[1]
        result = self.rng.choice((f"bits64({x})", f"(u32)whole64({x})", f"(u32)natural64({x})", f"bits32((real32){x})"))
        return ["{", *(f"    {line}" for line in body), f"    {assign} = {result};", "}"]

    def _convert(self, value: Value, assign: str) -> list[str]:
        whole = self.rng.choice(("u8", "i8", "i16", "u16", "i32", "u32", "i64", "u64"))
        to = self.rng.choice(("bits32((real32){})", "bits64((real64){})", "(u32)whole32((real32){} * 0.25f)"))
        return [f"{assign} = {to.format(value(whole))};"]

    def _wide_switch(self, value: Value, assign: str) -> list[str]:
        t, suffix, pool = self.rng.choice((("u32", "ul", WIDE), ("u64", "ull", HUGE)))
        v, cases = self.fresh("c"), self.rng.sample(pool, self.rng.randrange(3, 7))
        chosen = self.rng.choice((value(t), f"(({t}){self.rng.choice(cases)}{suffix} + ({value('u16')} & 1))"))
        lines = [f"{{   {t} {v} = {chosen};", f"    switch ({v}) {{"]
        for k, case in enumerate(cases):
            lines.append(
                f"    case {case}{suffix}: {assign} += {5 * k + 1}u;{' break;' if self.rng.random() < 0.7 else ''}"
            )
        if self.rng.random() < 0.4:
            low = 100 + self.rng.randrange(50)
            lines.append(
                f"    case {low}{suffix} ... {low + self.rng.randrange(1, 2000)}{suffix}: {assign} ^= 9u; break;"
            )
        return [*lines, f"    default: {assign} -= 3u;", "    }", "}"]

    def _atomic(self, value: Value, assign: str) -> list[str]:
        t, name = self.rng.choice((("u8", "atomic8"), ("u16", "atomic16"), ("u32", "atomic32")))
        expected = self.fresh("e")
        return self.rng.choice((
            [f"{name} {self.rng.choice('+-&|^')}= {value(t)};", f"{assign} = {name};"],
            [f"{assign} = atomic_fetch_{self.rng.choice(('add', 'sub', 'or', 'and', 'xor'))}(&{name}, {value(t)});"],
            [f"{assign} = atomic_exchange(&{name}, {value(t)});", f"{name}++;"],
            [f"{{   {t} {expected} = {value(t)};",
             f"    {assign} = atomic_compare_exchange_strong(&{name}, &{expected}, {value(t)});",
             f"    {assign} += {expected};", "}"],
        ))  # fmt: skip

    def _recurse(self, value: Value, assign: str) -> list[str]:
        return [f"{assign} = descend({value('u16')} & 7, {value('u32')}, {value('u8')});"]

    def _assembly(self, value: Value, assign: str) -> list[str]:
        a, b, cell = value("u16"), value("u16"), self.fresh("y")
        return self.rng.choice((
            [f"{assign} = asm_add({a}, {b});"], [f"{assign} = asm_mul({a}, {b});"], [f"{assign} = asm_swap({a});"],
            [f"{assign} = asm_plus_5({a});"], [f"{assign} = (u32)asm_busy({a}, {b}) + asm_swap({b});"],
            [f"{assign} = asm_add32({value('u32')}, {value('u32')});"],
            [f"{{   u16 {cell} = {a};", f"    asm_store(&{cell}, {b});", f"    {assign} = {cell};", "}"],
        ))  # fmt: skip

    def _place(self, value: Value, assign: str) -> list[str]:
        name, k = self.rng.choice(self.places), self.rng.randrange(6)
        index = self.rng.choice((str(k), f"{value('u16')} % 6u"))
        constant = self.rng.choice((f"rom16[{value('u16')} & 7]", f"rom32[{value('u16')} & 3]"))
        return [f"{name}[{index}] {self.rng.choice(('=', '+=', '^='))} {value('u16')};",
                f"{assign} = (u32){name}[{self.rng.randrange(6)}] + {constant};"]  # fmt: skip
