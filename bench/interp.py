"""Speed of the interpreters on three programs: an ALU loop, a memory copy, and a timer interrupt every 100 cycles.

    python bench/interp.py [--cycles N] [--json]

Prints simulated cycles per second of host time for the specialised and the plain interpreter, and their ratio. Each
figure is the best of three runs after a warm-up, so compiling is not part of it; the first run is shown beside it.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from emu.dspic30f.isa.text import parse
from emu.machine.machine import Machine

START = 0x200

ALU = """
        mov #0x1234, w0
        mov #0x0101, w1
        mov #0, w2
loop:   add w0, w1, w3
        xor w3, w2, w2
        rlc w2, w2
        subb w3, w1, w4
        mul.uu w4, w1, w6
        add w6, w7, w0
        asr w0, #3, w5
        cp w5, w2
        bra ltu, even
        inc w1, w1
even:   dec2 w2, w2
        bra loop
"""

COPY = """
        mov #0x0900, w15
again:  mov #0x1000, w1
        mov #0x1800, w2
        mov #255, w3
loop:   mov [w1++], [w2++]
        dec w3, w3
        bra nz, loop
        mov #0x1000, w1
        mov #0x1800, w2
        repeat #255
        mov [w1++], [w2++]
        bra again
"""

INTERRUPTS = """
        mov #0x0900, w15
        mov #99, w0
        mov w0, 0x102
        mov #0x8000, w0
        mov w0, 0x104
        bset 0x8C, #3
        mov #0x1000, w8
loop:   add w1, w2, w3
        mov w3, [w8]
        add w2, #1, w2
        cp w2, w3
        bra z, loop
        xor w1, w2, w1
        bra loop
isr:    push w0
        push w1
        bclr 0x84, #3
        mov 0x1200, w0
        inc w0, w0
        mov w0, 0x1200
        pop w1
        pop w0
        retfie
"""

PROGRAMS = {"ALU loop": ALU, "memory copy": COPY, "interrupt every 100 cycles": INTERRUPTS}
T1_VECTOR = 0x1A


class _Value:
    def __init__(self, value: int) -> None:
        self.value = value


def assemble(text: str) -> tuple[list[int], dict[str, int]]:
    """Words from START on, and labels."""
    labels: dict[str, int] = {}

    def value(token: str) -> _Value:
        return _Value(labels[token] if token in labels else 0 if token[0].isalpha() else int(token, 0))

    lines = []
    pc = START
    for line in filter(None, map(str.strip, text.splitlines())):
        label, colon, rest = line.rpartition(":")
        if colon:
            labels[label] = pc
        lines.append((pc, rest.strip()))
        pc += 2 * parse(rest.strip(), value).words
    return [word for at, line in lines for word in parse(line, value).encode(at)], labels


def machine_for(text: str, engine: str) -> Machine:
    """A machine at the start of a program."""
    machine = Machine(engine=engine)
    words, labels = assemble(text)
    machine.program.put(0xF80002, 0x7FFF)  # FWDT: no watchdog
    machine.program.put_flash(START, words)
    if "isr" in labels:
        machine.program.put(T1_VECTOR, labels["isr"])
    machine.reset("POR")
    machine.pc = START
    for number in range(15):
        machine.w[number] = 0x1000
    return machine


def measure(text: str, engine: str, cycles: int) -> tuple[float, float]:
    """Cycles per second: of the first run, and the best of three more."""
    machine = machine_for(text, engine)
    rates = []
    for _round in range(4):
        before = time.perf_counter()
        start = machine.cycle
        stop = machine.run(cycles)
        if stop.reason != "limit":
            raise SystemExit(f"{engine}: the program ended: {stop}")
        rates.append((machine.cycle - start) / (time.perf_counter() - before))
    return rates[0], max(rates[1:])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cycles", type=int, default=1_000_000, help="length of a run in Tcy (default %(default)s)")
    parser.add_argument("--json", action="store_true", help="print one JSON object instead of a table")
    options = parser.parse_args()
    table = {}
    for title, text in PROGRAMS.items():
        first, best = measure(text, "interp", options.cycles)
        _first, plain = measure(text, "plain", options.cycles // 5)
        table[title] = {"interp": best, "interp_first_run": first, "plain": plain, "ratio": best / plain}
    if options.json:
        print(json.dumps(table))
        return
    print(f"{'cycles per second':28} {'specialised':>12} {'first run':>12} {'plain':>12} {'ratio':>6}")
    for title, row in table.items():
        print(
            f"{title:28} {row['interp']:12,.0f} {row['interp_first_run']:12,.0f} {row['plain']:12,.0f}"
            f" {row['ratio']:6.1f}"
        )


if __name__ == "__main__":
    main()
