"""Random C programs with the constructs of firmware, in several files.

Constructs: large frames, addresses selected by conditions, escaping locals, volatile registers, bit-fields,
interrupts, structs by value, near bytes, and those of `c_features.py`. Every program has the same result on any
machine: all arithmetic is truncated to fixed widths, shift distances and divisors are in range, and every object is
written before it is read. The same files compile for the host, where `shapes.h` replaces registers and interrupts by
a model that logs each access; sanitizers find no fault there.
"""

from __future__ import annotations

import random
from dataclasses import dataclass, field

from tests.fuzz.programs import c_features

UNSIGNED = ("u8", "u16", "u32")
SIGNED = ("i8", "i16", "i32")
TYPES = UNSIGNED * 2 + SIGNED * 2 + ("u64", "i64")
WORK = {"u8": "unsigned", "i8": "unsigned", "u16": "unsigned", "i16": "unsigned", "u32": "u32", "i32": "u32",
        "u64": "u64", "i64": "u64"}  # fmt: skip
BITS = {"u8": 8, "i8": 8, "u16": 16, "i16": 16, "u32": 32, "i32": 32, "u64": 64, "i64": 64}
SUFFIX = {8: "u", 16: "u", 32: "ul", 64: "ull"}
STRUCTS: dict[str, list[tuple[str, str]]] = {
    "rgb": [("r", "u8"), ("g", "u8"), ("b", "u8")],
    "pair": [("x", "i16"), ("y", "i16")],
    "mixed": [("c", "u8"), ("l", "i32"), ("d", "i8")],
    "tagged": [("t", "u8"), ("w", "u16")],
    "triple": [("x", "u16"), ("y", "u16"), ("z", "u16")],
    "flags": [("a:3", "unsigned"), ("b:7", "unsigned"), ("c:5", "unsigned"), ("d:11", "unsigned")],
    "large": [("x", "u32"), ("y", "u32"), ("z", "u16"), ("t", "u8")],
}
PORTS = 9  # number of ports, which are the registers PR1, (PR2, PR3), (PR4, PR5), (OC1RS, OC1R), (OC2RS, OC2R)
PAIRS = (1, 3, 5, 7)  # ports that form a 32-bit object together with the next port

HEADER = """#ifndef SHAPES_H
#define SHAPES_H
#ifdef HOST
#include <stdint.h>
#include <stdio.h>
typedef uint8_t u8; typedef int8_t i8; typedef uint16_t u16; typedef int16_t i16; typedef uint32_t u32;
typedef int32_t i32; typedef uint64_t u64; typedef int64_t i64;
extern u16 ports[9];
void seen(int port, char what);
static inline u16 port_read(int k) { seen(k, 'r'); return ports[k]; }
static inline void port_write(int k, u16 v) { ports[k] = v; seen(k, 'w'); }
#define PORT(k) port_read(k)
#define SET_PORT(k, v) port_write(k, (u16)(v))
#define CHANGE_PORT(k, op, v) port_write(k, (u16)(port_read(k) op (u16)(v)))
static inline u32 wide_read(int k) { u16 l = port_read(k); return l | (u32)port_read(k + 1) << 16; }
static inline void wide_write(int k, u32 v) { port_write(k, (u16)v); port_write(k + 1, (u16)(v >> 16)); }
#define WIDE(k) wide_read(k)
#define SET_WIDE(k, v) wide_write(k, v)
#define CHANGE_WIDE(k, op, v) wide_write(k, wide_read(k) op (u32)(v))
typedef int port_pointer;
#define PORT_ADDRESS(k) (k)
#define AT(p, n) port_read((p) + (n))
#define SET_AT(p, n, v) port_write((p) + (n), (u16)(v))
#define CHANGE_AT(p, n, op, v) port_write((p) + (n), (u16)(port_read((p) + (n)) op (u16)(v)))
#define WIDE_AT(p) wide_read(p)
#define SET_WIDE_AT(p, v) wide_write(p, v)
void handler(void);
#define INTERRUPT() handler()
#define HANDLER(...) void handler(void)
#define HANDLED() (void)0
#else
typedef unsigned char u8; typedef signed char i8; typedef unsigned u16; typedef int i16; typedef unsigned long u32;
typedef long i32; typedef unsigned long long u64; typedef long long i64;
#include <dspic30f6014a.h>
#define ADDRESS(k) ((k) == 0 ? 0x0102u : (k) < 3 ? 0x010Au + 2 * (k) : (k) < 5 ? 0x0114u + 2 * (k) : \\
                    (k) < 7 ? 0x0176u + 2 * (k) : 0x0178u + 2 * (k))
#define PORT(k) (*(volatile u16 *)ADDRESS(k))
#define SET_PORT(k, v) (PORT(k) = (v))
#define CHANGE_PORT(k, op, v) (PORT(k) op##= (v))
#define WIDE(k) (*(volatile u32 *)ADDRESS(k))
#define SET_WIDE(k, v) (WIDE(k) = (v))
#define CHANGE_WIDE(k, op, v) (WIDE(k) op##= (v))
typedef volatile u16 *port_pointer;
#define PORT_ADDRESS(k) ((volatile u16 *)ADDRESS(k))
#define AT(p, n) ((p)[n])
#define SET_AT(p, n, v) ((p)[n] = (v))
#define CHANGE_AT(p, n, op, v) ((p)[n] op##= (v))
#define WIDE_AT(p) (*(volatile u32 *)(p))
#define SET_WIDE_AT(p, v) (*(volatile u32 *)(p) = (v))
#define INTERRUPT() \\
    do { \\
        IFS0bits.T1IF = 1; \\
        __asm__ volatile("nop\\n nop\\n nop\\n nop" ::: "memory"); \\
    } while (0)
#define HANDLER(...) void __attribute__((__VA_ARGS__)) _T1Interrupt(void)
#define HANDLED() (IFS0bits.T1IF = 0)
#endif
#define APART __attribute__((noinline))
void mix(u32 value);
"""
MAIN = """#include "shapes.h"
volatile u32 checksum;
static u32 sum = 1;
APART void mix(u32 value) { sum = (u32)((sum << 5 | sum >> 27) ^ value) * 40503u + 1u; }
#ifdef HOST
u16 ports[9];
static int quiet;
void seen(int port, char what) { if (!quiet) printf("%d%c ", port, what); }
#endif
int main(void)
{
#ifndef HOST
    IPC0bits.T1IP = 4;
    IEC0bits.T1IE = 1;
#endif
    SET_PORT(0, 11u); SET_PORT(1, 22u); SET_PORT(2, 33u); SET_PORT(3, 44u); SET_PORT(4, 55u);
    SET_PORT(5, 66u); SET_PORT(6, 77u); SET_PORT(7, 88u); SET_PORT(8, 99u);
    start();
    checksum = sum;
#ifdef HOST
    printf("\\n%08lx\\n", (unsigned long)sum);
#endif
    return 0;
}
"""


@dataclass
class Scope:
    """Objects that a statement may use: assignable scalars, and arrays with their element types and lengths."""

    scalars: list[tuple[str, str]] = field(default_factory=list)
    arrays: list[tuple[str, str, int]] = field(default_factory=list)
    pointers: list[tuple[str, str, int]] = field(default_factory=list)
    structs: list[tuple[str, str]] = field(default_factory=list)
    port: str = ""
    counters: list[str] = field(default_factory=list)
    quiet: bool = False
    """Whether the statement is in an interrupt function."""


@dataclass(frozen=True)
class Signature:
    """Name, result type and parameter types of a function; a struct type is given by its name."""

    name: str
    result: str
    parameters: tuple[str, ...]


class Program:
    """Random program; `files` are its sources by name."""

    def __init__(self, seed: int, *, has_features: bool = True) -> None:
        """Generate the program. `has_features`: also use the constructs of `c_features.py`."""
        self.rng = random.Random(seed)
        self.serial = 0
        self.globals: Scope = Scope()
        self.functions: list[Signature] = []
        self.calls_left = 0
        self.features = c_features.Features(self.rng, self.fresh)
        self.feature_weight = 24 if has_features else 0
        self.files = self._make()

    # -- expressions --------------------------------------------------------------------------------------------------

    def fresh(self, stem: str) -> str:
        """Return a new name."""
        self.serial += 1
        return f"{stem}{self.serial}"

    def pick(self, items: list[str] | tuple[str, ...]) -> str:
        """Return a random item."""
        return self.rng.choice(items)

    def constant(self, t: str) -> str:
        """Return a constant of type `t`; extreme values are frequent."""
        bits = BITS[t]
        value = self.rng.choice((0, 1, 2, 5, (1 << bits) - 1, 1 << (bits - 1), (1 << (bits - 1)) - 1,
                                 self.rng.randrange(1 << bits), self.rng.randrange(64)))  # fmt: skip
        return f"({t}){value}{SUFFIX[bits]}"

    def expression(self, t: str, s: Scope, depth: int = 3) -> str:
        """Return an expression of type `t` that changes no plain memory but may read ports."""
        if depth == 0 or self.rng.random() < 0.15:
            return self.leaf(t, s)
        a, n = self.expression(t, s, depth - 1), self.rng.randrange(BITS[t])
        work = WORK[t]
        match self.rng.randrange(11):
            case 0 | 1 | 2:
                op = self.pick(("+", "-", "*", "&", "|", "^"))
                return f"({t})(({work}){a} {op} ({work}){self.expression(t, s, depth - 1)})"
            case 3:
                return f"({t})({a} >> {n})"
            case 4:
                return f"({t})(({work})({'u' + t[1:]}){a} << {n % 16})"
            case 5:
                unsigned = "u" + t[1:]
                return (
                    f"({t})(({unsigned}){a} {self.pick(('/', '%'))} ({unsigned})(({self.leaf(unsigned, s)} & 63) + 1))"
                )
            case 6:
                return f"({t})({self.condition(s, depth - 1)} ? {a} : {self.expression(t, s, depth - 1)})"
            case 7:
                other = self.pick(TYPES)
                return f"({t}){self.expression(other, s, depth - 1)}"
            case 8:
                return f"({t}){self.condition(s, depth - 1)}"
            case 9:
                unsigned = "u" + t[1:]
                k = self.pick(("3", "5", "7", "10", "12", "100"))
                return f"({t})(({unsigned}){a} {self.pick(('/', '%'))} {k}u)"
            case _:
                return f"({t})~({work}){a}" if self.rng.random() < 0.5 else f"({t})(0u - ({work}){a})"

    def condition(self, s: Scope, depth: int) -> str:
        """Return a random condition."""
        t = self.pick(TYPES)
        op = self.pick(("<", ">", "<=", ">=", "==", "!="))
        right = self.leaf(t, s) if self.rng.random() < 0.6 else self.constant(t)
        simple = f"({self.expression(t, s, min(depth, 1))} {op} {right})"
        if depth > 1 and self.rng.random() < 0.3:
            return f"({simple} {self.pick(('&&', '||'))} {self.condition(s, depth - 1)})"
        return simple

    def leaf(self, t: str, s: Scope) -> str:
        """Return a readable object or a constant as an expression of type `t`."""
        roll = self.rng.random()
        g = self.globals
        if roll < 0.35 and s.scalars + g.scalars:
            name, _ = self.rng.choice(s.scalars + g.scalars)
            return f"({t}){name}"
        if roll < 0.55 and s.arrays + g.arrays + s.pointers:
            name, _, n = self.rng.choice(s.arrays + s.pointers + g.arrays)
            return f"({t}){name}[{self.index(s, n)}]"
        if roll < 0.7 and s.structs + g.structs:
            name, kind = self.rng.choice(s.structs + g.structs)
            member = self.rng.choice(STRUCTS[kind])[0].partition(":")[0]
            return f"({t}){name}.{member}"
        if roll < 0.75 and s.counters:
            return f"({t}){self.pick(s.counters)}"
        return self.constant(t)

    def index(self, s: Scope, n: int) -> str:
        """Return an index expression below n."""
        if s.counters and self.rng.random() < 0.4 and n >= 8:
            return self.pick(s.counters)
        if self.rng.random() < 0.5:
            return str(self.rng.randrange(n))
        return f"(u16){self.expression('u16', Scope(s.scalars), 1)} % {n}u"

    # -- statements ---------------------------------------------------------------------------------------------------

    def block(self, s: Scope, count: int, depth: int, calls: list[Signature], indent: str) -> list[str]:
        """Return `count` random statements as lines."""
        out: list[str] = []
        for _ in range(count):
            out += [indent + line for line in self.statement(s, depth, calls)]
        return out

    def statement(self, s: Scope, depth: int, calls: list[Signature]) -> list[str]:
        """Return one random statement, possibly of several lines."""
        kind = self.rng.choices(
            ("scalar", "array", "pointer", "select", "escape", "struct", "field", "port", "interrupt", "if", "loop",
             "switch", "call", "memory", "mix", "sized", "feature"),
            (14, 12, 8, 8, 6, 8, 10, 14, 4, 8, 6, 3, 8, 4, 6, 2, self.feature_weight))[0]  # fmt: skip
        if kind in ("if", "loop", "switch", "sized") and depth == 0:
            kind = "scalar"
        made: list[str] = getattr(self, f"_{kind}")(s, depth, calls)
        return made or [f"mix({self.expression('u32', s, 2)});"]

    def _scalar(self, s: Scope, depth: int, calls: list[Signature]) -> list[str]:
        name, t = self.rng.choice(s.scalars + self.globals.scalars)
        if self.rng.random() < 0.3:
            op = self.pick(("+", "-", "&", "|", "^"))
            return [f"{name} = ({t})(({WORK[t]}){name} {op} ({WORK[t]}){self.expression(t, s, 1)});"]
        return [f"{name} = {self.expression(t, s)};"]

    def _array(self, s: Scope, depth: int, calls: list[Signature]) -> list[str]:
        name, t, n = self.rng.choice(s.arrays + self.globals.arrays)
        return [f"{name}[{self.index(s, n)}] = {self.expression(t, s, 2)};"]

    def _pointer(self, s: Scope, depth: int, calls: list[Signature]) -> list[str]:
        if not s.pointers:
            return []
        name, t, n = self.rng.choice(s.pointers)
        return [f"{name}[{self.index(s, n)}] = {self.expression(t, s, 2)};"]

    def _select(self, s: Scope, depth: int, calls: list[Signature]) -> list[str]:
        """Return statements that set a pointer to one of several arrays, selected by a condition."""
        if not s.pointers:
            return []
        name, t, n = self.rng.choice(s.pointers)
        fit = [a for a, kind, size in s.arrays + self.globals.arrays if kind == t and size >= n]
        if len(fit) < 2:
            return []
        one, two = self.rng.sample(fit, 2)
        value = f"{self.condition(s, 1)} ? {one} : {two}"
        if len(fit) > 2 and self.rng.random() < 0.3:
            value = f"{self.condition(s, 1)} ? {self.pick(fit)} : {value}"
        if self.rng.random() < 0.3:
            return [f"if {self.condition(s, 1)} {name} = {one}; else {name} = {two};"]
        return [f"{name} = {value};"]

    def _escape(self, s: Scope, depth: int, calls: list[Signature]) -> list[str]:
        """Return statements that pass the address of a local variable to another file, which writes through it."""
        choice = [(a, t, n) for a, t, n in s.arrays if t in ("u8", "u16", "i32")] + [
            (f"&{name}", t, 1) for name, t in s.scalars if t in ("u8", "u16", "i32") and name[0] == "v"
        ]
        if not choice:
            return []
        name, t, n = self.rng.choice(choice)
        lines = [f"keep_{t}({name}, {n});", f"touch_{t}({self.expression('u16', s, 1)});"]
        return lines[: self.rng.choice((1, 2, 2))]

    def _struct(self, s: Scope, depth: int, calls: list[Signature]) -> list[str]:
        """Return a statement that copies a struct."""
        places = s.structs + self.globals.structs
        name, kind = self.rng.choice(places)
        same = [other for other, k in places if k == kind and other != name]
        return [f"{name} = {self.pick(same)};"] if same else []

    def _field(self, s: Scope, depth: int, calls: list[Signature]) -> list[str]:
        name, kind = self.rng.choice(s.structs + self.globals.structs)
        member, t = self.rng.choice(STRUCTS[kind])
        plain, _, bits = member.partition(":")
        if bits:
            mask = f"{(1 << int(bits)) - 1}u"
            op = self.pick(("+", "^", "|", "&"))
            value = f"{name}.{plain} {op} " if self.rng.random() < 0.4 else ""
            return [f"{name}.{plain} = ({value}{self.expression('u16', s, 1)}) & {mask};"]
        return [f"{name}.{plain} = {self.expression(t, s, 2)};"]

    def _port(self, s: Scope, depth: int, calls: list[Signature]) -> list[str]:
        """Return statements that access volatile registers; the compiler must keep their order."""
        out = []
        for _ in range(self.rng.choice((1, 1, 2, 3))):
            out.append(self._access(s))
        return out

    def _access(self, s: Scope) -> str:
        k, wide = self.rng.randrange(PORTS), self.rng.choice(PAIRS)
        value = self.expression("u16", s, 1)
        op = self.pick(("|", "&", "^", "+"))
        operand = f"{1 << self.rng.randrange(16)}u" if self.rng.random() < 0.4 else value
        name, t = self.rng.choice(s.scalars)
        n = self.rng.randrange(2)
        forms = [
            f"SET_PORT({k}, {value});", f"{name} = ({t})PORT({k});", f"CHANGE_PORT({k}, {op}, {operand});",
            f"SET_WIDE({wide}, {self.expression('u32', s, 1)});", f"{name} = ({t})WIDE({wide});",
            f"CHANGE_WIDE({wide}, {op}, {self.expression('u32', s, 1)});", f"(void)PORT({k});", f"(void)WIDE({wide});",
            f"if (PORT({k}) & {1 << self.rng.randrange(16)}u) {name} = {self.constant(t)};",
        ]  # fmt: skip
        if s.port:
            forms += [
                f"SET_AT({s.port}, {n}, {value});", f"{name} = ({t})AT({s.port}, {n});",
                f"CHANGE_AT({s.port}, {n}, {op}, {operand});", f"{name} = ({t})WIDE_AT({s.port});",
                f"SET_WIDE_AT({s.port}, {self.expression('u32', s, 1)});",
                f"SET_AT({s.port}, 1, {value}); SET_AT({s.port}, 0, {operand});",
            ]  # fmt: skip
        return self.pick(forms)

    def _interrupt(self, s: Scope, depth: int, calls: list[Signature]) -> list[str]:
        return ["INTERRUPT();"] if self.rng.random() < 0.7 else []

    def _if(self, s: Scope, depth: int, calls: list[Signature]) -> list[str]:
        out = [f"if {self.condition(s, 2)} {{"]
        out += self.block(s, self.rng.randrange(1, 4), depth - 1, calls, "    ")
        if self.rng.random() < 0.5:
            out += ["} else {", *self.block(s, self.rng.randrange(1, 3), depth - 1, calls, "    ")]
        return [*out, "}"]

    def _loop(self, s: Scope, depth: int, calls: list[Signature]) -> list[str]:
        k = self.fresh("k")
        inner = Scope(s.scalars, s.arrays, s.pointers, s.structs, s.port, [*s.counters, k], s.quiet)
        step = self.rng.randrange(2)
        head = f"for (u16 {k} = 0; {k} < {self.rng.randrange(2, 8)}; {k}++) {{"
        if step:
            head = f"for (u16 {k} = {self.rng.randrange(2, 8)}; {k}-- > 0;) {{"
        body = self.block(inner, self.rng.randrange(1, 4), min(depth - 1, 1), [], "    ")
        if self.rng.random() < 0.2:
            body.append(f"    if {self.condition(inner, 1)} break;")
        return [head, *body, "}"]

    def _switch(self, s: Scope, depth: int, calls: list[Signature]) -> list[str]:
        out = [f"switch (({self.expression('u16', s, 1)}) % {self.rng.randrange(4, 9)}u) {{"]
        for k in range(self.rng.randrange(2, 6)):
            body = self.block(s, 1, 0, [], "    ")
            out += [f"case {k}:", *body, *(["    break;"] if self.rng.random() < 0.8 else [])]
        return [*out, "default:", *self.block(s, 1, 0, [], "    "), "}"]

    def _call(self, s: Scope, depth: int, calls: list[Signature]) -> list[str]:
        if not calls or not self.calls_left:
            return []
        self.calls_left -= 1
        f = self.rng.choice(calls)
        arguments = []
        for p in f.parameters:
            if p in STRUCTS:
                found = [name for name, kind in s.structs + self.globals.structs if kind == p]
                if not found:
                    return []
                arguments.append(self.pick(found))
            elif p == "port_pointer":
                arguments.append(f"PORT_ADDRESS({self.rng.choice(PAIRS)})")
            else:
                arguments.append(self.expression(p, s, 2))
        text = f"{f.name}({', '.join(arguments)})"
        if f.result in STRUCTS:
            places = [name for name, kind in s.structs + self.globals.structs if kind == f.result]
            return [f"{self.pick(places)} = {text};"] if places else [f"{text};"]
        name, t = self.rng.choice(s.scalars + self.globals.scalars)
        return [f"{name} = ({t}){text};"]

    def _memory(self, s: Scope, depth: int, calls: list[Signature]) -> list[str]:
        """Return a call of memset or memcpy on a whole array or a part."""
        name, t, n = self.rng.choice(s.arrays + self.globals.arrays)
        size = BITS[t] // 8
        same = [(a, m) for a, kind, m in s.arrays + self.globals.arrays if kind == t and a != name]
        if same and self.rng.random() < 0.5:
            other, m = self.rng.choice(same)
            return [f"__builtin_memcpy({name}, {other}, {self.rng.randrange(1, min(n, m) + 1) * size});"]
        return [f"__builtin_memset({name}, {self.rng.randrange(256)}, {self.rng.randrange(1, n + 1) * size});"]

    def _mix(self, s: Scope, depth: int, calls: list[Signature]) -> list[str]:
        return [f"mix({self.expression('u32', s, 2)});"]

    def _feature(self, s: Scope, depth: int, calls: list[Signature]) -> list[str]:
        """Return statements that use a construct of `c_features.py`; none in interrupt functions."""
        if s.quiet:
            return []
        name = self.fresh("r")
        lines = self.features.use(lambda t: self.expression(t, s, 1), name)
        return [f"{{   u32 {name} = 1;", *(f"    {line}" for line in lines), f"    mix({name});", "}"]

    def _sized(self, s: Scope, depth: int, calls: list[Signature]) -> list[str]:
        """Return statements with an array of computed length or alloca, so that W14 is the frame pointer."""
        if not s.port and not s.pointers:
            return []  # keeps the frames of interrupt functions and of start() small
        name, n, k, t = self.fresh("q"), self.fresh("n"), self.fresh("k"), self.pick(("u8", "u16", "i32"))
        room = f"{t} {name}[{n}];" if self.rng.random() < 0.5 else f"{t} *{name} = __builtin_alloca({n} * sizeof({t}));"
        inner = Scope(s.scalars, s.arrays, s.pointers, s.structs, s.port, s.counters, s.quiet)
        return [
            f"{{   u16 {n} = ({self.expression('u16', s, 1)} & 7) + 1;", f"    {room}",
            f"    for (u16 {k} = 0; {k} < {n}; {k}++) {name}[{k}] = ({t})({k} * 3u);",
            *self.block(inner, self.rng.randrange(1, 4), 0, [], "    "),
            f"    mix((u32){name}[(u16){self.expression('u16', s, 1)} % {n}]);", "}",
        ]  # fmt: skip

    # -- functions and files ------------------------------------------------------------------------------------------

    def function(self, f: Signature, calls: list[Signature]) -> str:
        """Return the definition of one function."""
        s = Scope()
        parameters = []
        for p in f.parameters:
            name = self.fresh("p")
            parameters.append(f"{p} {name}" if p not in STRUCTS else f"struct {p} {name}")
            if p in STRUCTS:
                s.structs.append((name, p))
            elif p == "port_pointer":
                s.port = name
            else:
                s.scalars.append((name, p))
        lines = []
        for _ in range(self.rng.randrange(2, 5)):
            t, name = self.pick(TYPES), self.fresh("v")
            lines.append(f"{t} {name} = {self.constant(t) if not s.scalars else self.expression(t, s, 1)};")
            s.scalars.append((name, t))
        self._locals(s, lines)
        self.calls_left = 2
        lines += self.block(s, self.rng.randrange(4, 12), 2, calls, "")
        lines += [f"mix((u32){name});" for name, _ in s.scalars]
        k = self.fresh("k")
        lines += [f"for (u16 {k} = 0; {k} < {n}; {k}++) mix((u32){name}[{k}]);" for name, _, n in s.arrays]
        lines += ["forget();"]
        if f.result in STRUCTS:
            value = self.fresh("s")
            lines.insert(0, f"struct {f.result} {value} = {{0}};")
            lines.append(f"return {self.pick([n for n, kind in [*s.structs, (value, f.result)] if kind == f.result])};")
        else:
            lines.append(f"return {self.expression(f.result, s, 2)};")
        apart = "APART " if self.rng.random() < 0.6 else ""
        result = f"struct {f.result}" if f.result in STRUCTS else f.result
        body = "\n".join("    " + line for line in lines)
        return f"{apart}{result} {f.name}({', '.join(parameters) or 'void'})\n{{\n{body}\n}}\n"

    def _locals(self, s: Scope, lines: list[str]) -> None:
        """Define local arrays, pointers to them and structs; sometimes the frame exceeds every short offset."""
        t = self.pick(("u8", "i8", "u16", "u16", "i32"))
        huge = self.rng.random() < 0.15
        for _ in range(self.rng.choice((0, 2, 2, 3))):
            n = self.rng.choice((3, 8, 17, 33, 40, 70)) if not huge else self.rng.choice((130, 260))
            name, k = self.fresh("a"), self.fresh("k")
            lines.append(f"{t} {name}[{n}];")
            start = self.rng.randrange(256)
            lines.append(f"for (u16 {k} = 0; {k} < {n}; {k}++) {name}[{k}] = ({t})({k} * 7u + {start}u);")
            s.arrays.append((name, t, n))
        if len(s.arrays) > 1:
            name = self.fresh("q")
            lines.append(f"{t} *{name} = {s.arrays[0][0]};")
            s.pointers.append((name, t, min(n for _, _, n in s.arrays)))
        if not s.arrays:
            lines.append(f"u8 {(one := self.fresh('a'))}[4] = {{1, 2, 3, 4}};")
            s.arrays.append((one, "u8", 4))
        for _ in range(self.rng.randrange(1, 3)):
            kind, name = self.pick(list(STRUCTS)), self.fresh("s")
            lines.append(f"struct {kind} {name} = {{0}};")
            s.structs.append((name, kind))
        lines.append("(void)0;")

    def _make(self) -> dict[str, str]:
        rng = self.rng
        structs = [
            f"struct {name} {{ {' '.join(f'{t} {m};' for m, t in members)} }};" for name, members in STRUCTS.items()
        ]
        declared, defined = [], []
        for _ in range(rng.randrange(4, 8)):
            t, name = self.pick(TYPES), self.fresh("g")
            declared.append(f"extern {t} {name};")
            defined.append(f"{t} {name}{' = ' + self.constant(t) if rng.random() < 0.5 else ''};")
            self.globals.scalars.append((name, t))
        for t, n in (("u8", 9), (self.pick(TYPES), 20), ("u16", 40), ("i32", 12)):
            name = self.fresh("t")
            declared.append(f"extern {t} {name}[{n}];")
            defined.append(f"{t} {name}[{n}] = {{1, 2, 3}};")
            self.globals.arrays.append((name, t, n))
        for kind in STRUCTS:
            for _ in range(rng.randrange(1, 3)):
                name = self.fresh("z")
                declared.append(f"extern struct {kind} {name};")
                defined.append(f"struct {kind} {name} = {{1, 2}};")
                self.globals.structs.append((name, kind))
        for _ in range(rng.randrange(3, 7)):
            parameters = [self.pick((*TYPES, *STRUCTS)) for _ in range(rng.randrange(0, 5))]
            if rng.random() < 0.5:
                parameters.insert(rng.randrange(len(parameters) + 1), "port_pointer")
            self.functions.append(Signature(self.fresh("f"), self.pick((*TYPES, *STRUCTS)), tuple(parameters)))
        for f in self.functions:
            result = f"struct {f.result}" if f.result in STRUCTS else f.result
            kinds = [f"struct {p}" if p in STRUCTS else p for p in f.parameters]
            declared.append(f"{result} {f.name}({', '.join(kinds) or 'void'});")
        bodies = [self.function(f, self.functions[k + 1 :]) for k, f in enumerate(self.functions)]
        declared += ["void start(void);", "void forget(void);"]
        declared += [f"void keep_{t}({t} *p, u16 n);\nvoid touch_{t}(u16 v);" for t in ("u8", "u16", "i32")]
        header = "\n".join([HEADER, c_features.HEADER, *structs, *self.features.declared, *declared, "#endif\n"])
        include = '#include "shapes.h"\n'
        return {
            "shapes.h": header,
            "one.c": include + "\n".join(bodies[::2]),
            "two.c": include + "\n".join(bodies[1::2]) + self._keepers(),
            "three.c": MAIN + "\n".join([*defined, *self.features.defined]) + "\n" + self._handler() + self._start(),
        }

    def _keepers(self) -> str:
        """Return functions that keep the address of a caller's local variable for a while and write through it."""
        out = []
        for t in ("u8", "u16", "i32"):
            out.append(
                f"static {t} spare_{t}[1], *kept_{t} = spare_{t};\nstatic u16 size_{t} = 1;\n"
                f"APART void keep_{t}({t} *p, u16 n) {{ kept_{t} = p; size_{t} = n; }}\n"
                f"APART void touch_{t}(u16 v) {{ kept_{t}[v % size_{t}] = ({t})(u16)(v * 3u); }}\n"
            )
        reset = " ".join(f"kept_{t} = spare_{t}; size_{t} = 1;" for t in ("u8", "u16", "i32"))
        return "\n".join([*out, f"APART void forget(void) {{ {reset} }}\n"])

    def _handler(self) -> str:
        """Return the interrupt function, which accesses globals and ports."""
        s = Scope(self.globals.scalars, self.globals.arrays, [], self.globals.structs, quiet=True)
        body = self.block(s, self.rng.randrange(2, 6), 1, [], "    ")
        body = [line for line in body if "INTERRUPT" not in line]
        kind = self.pick(("interrupt, auto_psv", "interrupt, no_auto_psv", "interrupt, shadow, auto_psv",
                          "interrupt(save(spared)), auto_psv"))  # fmt: skip
        return f"HANDLER({kind})\n{{\n    HANDLED();\n" + "\n".join(body) + "\n}\n"

    def _start(self) -> str:
        s = Scope(self.globals.scalars, self.globals.arrays, [], self.globals.structs)
        lines = []
        for _ in range(2):
            self.calls_left = 3
            for f in self.functions[:3]:
                lines += self._call(s, 0, [f])
            lines += self.block(s, 3, 1, [], "")
        lines += [f"mix((u32){name});" for name, _ in self.globals.scalars]
        for name, _, n in self.globals.arrays:
            k = self.fresh("k")
            lines.append(f"for (u16 {k} = 0; {k} < {n}; {k}++) mix((u32){name}[{k}]);")
        for name, kind in self.globals.structs:
            lines += [f"mix((u32){name}.{m.partition(':')[0]});" for m, _ in STRUCTS[kind]]
        return "APART void start(void)\n{\n" + "\n".join("    " + line for line in lines) + "\n}\n"
