"""Random C programs whose interrupts delay each other.

Constructs: IPL raised, lowered and restored, DISI and DISICNT, no nesting, nested handlers, recurring traps, Idle,
all of them also in functions, loops and conditions. Each of three timers interrupts once, at the cycle in its
variable. A bit of the variable `chance` decides each condition, so four numbers determine a run. INTERRUPT_LEVEL
states the priorities.
"""

from __future__ import annotations

import random
from collections import Counter
from collections.abc import Callable

TIMERS = ("T1", "T2", "T3")
VARIABLES = tuple(f"when{timer[1]}" for timer in TIMERS)
HEAD = """#include <dspic30f6014a.h>
#include <bounds.h>
volatile unsigned chance __attribute__((used)), out, when1 = 900, when2 = 900, when3 = 900;
static const unsigned constants[8] = {3, 1, 4, 1, 5, 9, 2, 6};
"""
BEGIN = """__attribute__((noinline)) static void begin(void)
{
    IPC0bits.T1IP = @T1@; IPC1bits.T2IP = @T2@; IPC1bits.T3IP = @T3@;
    PR1 = when1; PR2 = when2; PR3 = when3;
    TMR1 = TMR2 = TMR3 = 0;
    IFS0 = 0;
    IEC0bits.T1IE = IEC0bits.T2IE = IEC0bits.T3IE = 1;
    @nesting@T1CONbits.TON = 1;
    T2CONbits.TON = 1;
    T3CONbits.TON = 1;
}
"""
TRAP = """void __attribute__((interrupt, no_auto_psv)) _MathError(void)
{
    INTCON1bits.MATHERR = 0;
    @body@}
"""
HANDLER = """void __attribute__((interrupt, auto_psv)) _@name@Interrupt(void)
{
    @name@CON = 0;
    IFS0bits.@name@IF = 0;
    @body@}
"""
DEPTH = 3


class Program:
    """`text` of the source file, priority `levels` of the timers, and the generated `kinds` of constructs. Equal
    seeds give equal programs."""

    def __init__(self, seed: int) -> None:
        self.rng = random.Random(seed ^ 0x1A7E)
        rng = self.rng
        self.kinds: Counter[str] = Counter()
        self.levels = {timer: rng.randrange(1, 8) for timer in TIMERS}
        self._functions: list[str] = []
        self._chances = 0
        nesting = ""
        if rng.random() < 0.15:
            self.kinds["no nesting"] += 1
            nesting = "INTCON1bits.NSTDIS = 1;\n    "
        if len(set(self.levels.values())) < len(TIMERS):
            self.kinds["equal levels"] += 1
        traps = rng.random() < 0.25
        handlers = [HANDLER.replace("@body@", self._body(self.levels[timer], 2)).replace("@name@", timer)
                    for timer in TIMERS]  # fmt: skip
        rounds = self._body(0, 5, main=True)
        if traps:
            self.kinds["trap"] += 1
            handlers.append(TRAP.replace("@body@", self._work()))
            rounds += '__asm__ volatile("clr w3\\n repeat #17\\n div.u w0,w3\\n nop" ::: "w0", "w1", "w3");\n'
        notes = "".join(f"INTERRUPT_LEVEL({timer}, {level});\n" for timer, level in self.levels.items())
        begin = BEGIN.replace("@nesting@", nesting)
        for timer, level in self.levels.items():
            begin = begin.replace(f"@{timer}@", str(level))
        main = "int main(void)\n{\n    begin();\n    for (;;) {\n" + rounds + "    }\n}\n"
        self.text = HEAD + notes + "".join(self._functions) + begin + "".join(handlers) + main

    def phases(self, count: int) -> list[dict[str, int]]:
        """Return the variables of `count` runs: the cycles of the timers, which are close together in most runs, and
        the conditions."""
        rng = self.rng
        found = []
        for _ in range(count):
            first = rng.randrange(100, 900)
            apart = rng.choice((8, 60, 300))
            phase = {name: first + rng.randrange(apart) for name in VARIABLES}
            found.append(phase | {"chance": rng.getrandbits(16)})
        return found

    def _body(self, level: int, most: int, depth: int = 0, main: bool = False) -> str:
        """Return statements for code that runs at priority `level` and ends at the same priority."""
        pieces: list[Callable[[Program, int, int], str]] = [
            _work, _work, _constant, _divide, _masked, _put_back, _disi, _disi, _counter,
        ]  # fmt: skip
        pieces += [_call, _if, _loop, _room] if depth < DEPTH else []
        pieces += [_idle] if main else []
        pieces += [_lowered, _tail] if level else []
        return "".join(self.rng.choice(pieces)(self, level, depth) for _ in range(self.rng.randrange(1, most + 1)))

    def made(self, kind: str, text: str) -> str:
        """Count a construct and return its text."""
        self.kinds[kind] += 1
        return text

    def _work(self) -> str:
        return f'__asm__ volatile("repeat #{self.rng.choice((0, 1, 3, 17, 60, 150))}\\n nop");\n'

    def function(self, body: str) -> str:
        """Define a new function and return a call of it."""
        name = f"part{len(self._functions)}"
        room = self.rng.choice((0, 0, 1, 5, 20))
        lines = f"    volatile unsigned room[{room}];\n    room[{room - 1}] = out;\n" if room else ""
        self._functions.append(f"__attribute__((noinline)) static void {name}(void)\n{{\n{lines}{body}}}\n")
        return f"{name}();\n"

    def condition(self) -> str:
        """Return a condition that a bit of `chance` decides."""
        self._chances = (self._chances + 1) % 16
        return f"chance >> {self._chances} & 1"


def _work(p: Program, level: int, depth: int) -> str:
    return p._work()


def _constant(p: Program, level: int, depth: int) -> str:
    return p.made("constant", f"out += constants[(out + {p.rng.randrange(8)}) & 7];\n")


def _divide(p: Program, level: int, depth: int) -> str:
    return p.made("division", "out = 999 / (out | 1);\n")


def _masked(p: Program, level: int, depth: int) -> str:
    kind = "IPL raised" if not level else "IPL raised in a handler"
    return p.made(kind, f"SRbits.IPL = {p.rng.randrange(level, 8)};\n{p._body(7, 2, depth + 1)}SRbits.IPL = {level};\n")


def _put_back(p: Program, level: int, depth: int) -> str:
    up = p.rng.randrange(level, 8)
    inside = p._body(up, 2, depth + 1)
    return p.made("SR put back", f"{{ unsigned was = SR;\nSRbits.IPL = {up};\n{inside}SR = was; }}\n")


def _disi(p: Program, level: int, depth: int) -> str:
    end = p.rng.choice(("", "", "DISICNT = 0;\n"))
    return p.made("DISI", f'__asm__ volatile("disi #{p.rng.choice((0, 1, 2, 9, 80, 400))}");\n{p._work()}{end}')


def _counter(p: Program, level: int, depth: int) -> str:
    return p.made("DISICNT", f"DISICNT = {p.rng.choice((1, 30, 200))};\n{p._work()}")


def _call(p: Program, level: int, depth: int) -> str:
    return p.made("function", p.function(p._body(level, 3, depth + 1)))


def _if(p: Program, level: int, depth: int) -> str:
    one, other = (p._body(level, 2, depth + 1) for _ in range(2))
    return p.made("condition", f"if ({p.condition()}) {{\n{one}}} else {{\n{other}}}\n")


def _loop(p: Program, level: int, depth: int) -> str:
    body = p._body(level, 2, depth + 2)
    return p.made("loop", f"for (unsigned i = 0; i < {p.rng.randrange(1, 5)}; i++) {{\n{body}}}\n")


def _room(p: Program, level: int, depth: int) -> str:
    words = p.rng.randrange(1, 9)
    return p.made("stack", f'__asm__ volatile("repeat #{words - 1}\\n push w0\\n nop\\n sub #{2 * words},w15");\n')


def _idle(p: Program, level: int, depth: int) -> str:
    up = p.rng.choice((0, p.rng.randrange(8)))
    text = '__asm__ volatile("pwrsav #1");\n'
    return p.made("Idle", f"SRbits.IPL = {up};\n{text}{p._work()}SRbits.IPL = 0;\n")


def _lowered(p: Program, level: int, depth: int) -> str:
    down = p.rng.randrange(level)
    inside = p._body(down, 2, depth + 1)
    return p.made("IPL lowered", f"SRbits.IPL = {down};\n{inside}SRbits.IPL = {level};\n")


def _tail(p: Program, level: int, depth: int) -> str:
    return p.made("DISI at an end", f'__asm__ volatile("disi #{p.rng.choice((5, 50, 300))}");\n')


KINDS = frozenset((
    "no nesting", "equal levels", "trap", "constant", "division", "IPL raised", "IPL raised in a handler",
    "SR put back", "DISI", "DISICNT", "function", "condition", "loop", "stack", "Idle", "IPL lowered", "DISI at an end",
))  # fmt: skip
"""Kinds of constructs; a long campaign must contain all of them."""
