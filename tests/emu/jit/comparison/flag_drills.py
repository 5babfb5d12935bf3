"""Short programs (drills) of instructions that write flags and instructions that read them, cut at every cycle.

The instruction table states which rows write the flags C, Z, OV, N and DC; a builder that records accesses finds the
rows that read them. A drill has two pairs of a writer and a reader, taken from the list of all pairs in turn, and
more such instructions in random order. They use words and bytes, registers and memory. Branches and skips jump over
some of them, and some instructions leave native code. `check` runs an image of drills on all engines, with many
values of registers and SR, a cut after every number of cycles, interrupts and hooks.
"""

from __future__ import annotations

import itertools
import random
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cache
from typing import Any, Final

from emu.dspic30f.isa import codec
from emu.dspic30f.isa.fields import Operands
from emu.dspic30f.isa.row import Insn, Row
from emu.dspic30f.isa.table import ROWS
from emu.dspic30f.jit.engine import BLOCK_LEVEL, HOT_LEVEL, STEP_LEVEL, JitEngine
from emu.machine.machine import Machine
from tests.emu.jit.comparison.engine_pair import QuickCompiler
from tests.emu.jit.comparison.random_firmware import difference, words_of
from tests.emu.rowmachine import SR, RowMachine

ENGINES: Final = ("plain", "jit")
FLAGS: Final = ("C", "Z", "OV", "N", "DC")
DRILLS: Final = 24
"""Number of drills per image."""
FIRST, ROOM = 0x400, 0x40
"""Program address of the first drill, and program addresses reserved for each drill."""
HANDLER, TRAP = 0x200, 0x280
IFS0, TMR1, PORTD = 0x84, 0x100, 0x2D2
NO_WATCHDOG: Final = 0x7FFF
VALUES: Final = (0, 1, 0x0F, 0x10, 0x7F, 0x80, 0x99, 0xFF, 0x100, 0x7FFF, 0x8000, 0x80FF, 0xFF00, 0xFFFF)
DATA, POINTERS, ELSEWHERE = range(8), range(8, 13), 13
"""Registers by use: numbers, addresses in RAM, a random address."""
LEFT_OUT: Final = ("RETFIE", "RETURN", "RETLW", "RESET", "PWRSAV", "DO", "CALL", "RCALL", "GOTO", "LNK", "ULNK")

BY_NUMBER: Final = {row.id: row for row in ROWS}

Kind = tuple[int, int]
"""Number of a row, and 1 for its byte form."""


class _Noting(RowMachine):
    """Builder that records the flags that an instruction reads."""

    def __init__(self, word: int) -> None:
        super().__init__({0x1000: word})
        self.asked: set[str] = set()
        self.shadow = dict.fromkeys(("SRS", *(f"W{n}S" for n in range(4))), 0)

    def flag(self, name: str) -> int:
        self.asked.add(name)
        return super().flag(name)

    def load(self, ea: int, size: int, side: str = "src", ptr: int | None = None) -> int:
        self.asked.update(FLAGS if ea & ~1 == SR else ())
        return super().load(ea, size, side, ptr)


def asked(insn: Insn) -> frozenset[str]:
    """Return the flags that an instruction reads, from the flag bits or from SR as data."""
    machine = _Noting(insn.word1)
    machine.pc = 0x1000
    insn.row.does(machine, insn.x)  # type: ignore[arg-type]
    return frozenset(machine.asked & set(FLAGS))


def written(insn: Insn) -> frozenset[str]:
    """Return the flags that an instruction changes."""
    return frozenset(name.partition("=")[0] for name in insn.row.flags.split()) & frozenset(FLAGS)


def kind(insn: Insn) -> Kind:
    """Return the number of the row, and whether it is the byte form."""
    return insn.row.id, getattr(insn.x, "B", 0)


def instruction(draw: random.Random, row: Row, size: int | None = None) -> Insn:
    """Return a legal instruction of a row, in byte form if `size` is 1. Its pointers lead to RAM, and its file
    operands to RAM, W registers or SR."""
    while True:
        x = Operands(**{f.letter: f.get(draw.getrandbits(24), draw.getrandbits(24)) for f in row.pattern.fields})
        for mode, register in (("p", "s"), ("g", "s"), ("q", "d"), ("h", "d")):
            if mode in row.fields and draw.random() < 0.6:
                setattr(x, mode, 0)
            if register in row.fields:
                is_pointer = mode in row.fields and getattr(x, mode)
                if mode in row.fields or register not in "sd" or not {"p", "g", "q", "h"} & set(row.fields):
                    setattr(x, register, draw.choice(POINTERS if is_pointer else DATA) & -row.fields[register].scale)
        if "w" in row.fields:
            x.w = draw.choice(DATA)
        if "f" in row.fields:
            place = draw.choice((*[0x900] * 6, 0, SR))
            x.f = place + draw.randrange(2 if place == SR else 16) & -row.fields["f"].scale
        if "n" in row.fields:
            x.n = draw.randrange(1, 4)
        if "v" in row.fields and "t" in row.fields:
            x.v = draw.choice((2, 4, 6))
            x.t = x.v + 1
        if row.mnemonic == "REPEAT" and "k" in row.fields:
            x.k = draw.choice((0, 1, 2, 17))
        if size is not None and "B" in row.fields:
            x.B = size
        if row.broken(x):
            continue
        insn = codec.decode(*codec.encode(row, x))
        if insn is not None and insn.row is row:
            return insn


@cache
def rows() -> tuple[list[Row], list[Row], list[Row]]:
    """Return three lists of rows without control flow: those that write a flag, those that read one other than
    through SR, and all others."""
    writers, readers, others = [], [], []
    draw = random.Random(0)
    for row in ROWS:
        if row.words > 1 or row.mnemonic in LEFT_OUT or row.syntax in ("BRA Expr", "BRA Wn") or set(row.fields) & {"i"}:
            continue
        insn = instruction(draw, row)
        while getattr(insn.x, "f", 0) & ~1 == SR:
            insn = instruction(draw, row)
        (writers if written(insn) else []).append(row)
        (readers if asked(insn) else []).append(row)
        if not written(insn) and not asked(insn):
            others.append(row)
    return writers, readers, others


def away(draw: random.Random) -> list[int]:
    """Return instructions that may leave native code: a read of an address that may not be RAM, a shadow register, a
    device register, a repeated instruction."""
    return draw.choice((
        words_of("MOV{.B} Ws, Wd", B=draw.randrange(2), s=ELSEWHERE, g=1, d=draw.choice(DATA), h=0, w=0),
        words_of("MOV{.W} f, Wnd", f=draw.choice((SR, TMR1, PORTD, IFS0)), d=draw.choice(DATA)),
        words_of("MOV{.W} Wns, f", f=SR, s=draw.choice(DATA)), words_of("PUSH f", f=SR), words_of("POP f", f=SR),
        words_of("BTG{.B} f, #bit4", f=SR, b=draw.randrange(4), B=1), words_of("PUSH.S"), words_of("POP.S"),
        words_of("REPEAT #lit14", k=draw.choice((1, 3))), words_of("DISI #lit14", k=2),
    ))  # fmt: skip


@dataclass
class Tally:
    """Counts of executed items that were equal in all engines."""

    runs: int = 0
    pairs: Counter[tuple[Kind, str, Kind]] = field(default_factory=Counter)
    """Number of drills, by writer, flag and reader."""
    python: int = 0
    """Number of instructions of the native machine that Python executed."""
    executed: int = 0
    """Number of instructions that the plain machine executed."""

    def add(self, other: Tally) -> None:
        """Add the counts of another tally."""
        self.runs += other.runs
        self.pairs.update(other.pairs)
        self.python += other.python
        self.executed += other.executed


@cache
def all_pairs() -> tuple[tuple[Kind, str, Kind], ...]:
    """Return every pair of a row that writes a flag and a row that reads it, as words and bytes, in random order.
    Reads through the address of SR are excluded."""
    draw = random.Random(0)
    ends: dict[bool, set[tuple[str, Kind]]] = {True: set(), False: set()}
    for is_writer, among in zip((True, False), rows()[:2], strict=True):
        for row, size in itertools.product(among, (0, 1)):
            insn = instruction(draw, row, size)
            while getattr(insn.x, "f", 0) & ~1 == SR:
                insn = instruction(draw, row, size)
            ends[is_writer] |= {(name, kind(insn)) for name in (written if is_writer else asked)(insn)}
    found = sorted((a, name, b) for name, a in ends[True] for other, b in ends[False] if name == other)
    draw.shuffle(found)
    return tuple(found)


def drill(draw: random.Random, turn: int) -> tuple[list[int], list[Insn]]:
    """Return the words and the instructions of a drill that contains the given pairs and ends by itself."""
    among = all_pairs()
    words: list[int] = []
    for writer, _, reader in (among[2 * turn % len(among)], among[(2 * turn + 1) % len(among)]):
        words += [instruction(draw, BY_NUMBER[number], size).word1 for number, size in (writer, reader)]
    for _ in range(draw.randrange(4)):
        some = draw.choices(rows(), (4, 4, 1))[0]
        at = draw.choice((0, 2, 4))  # a place between two pairs
        words[at:at] = away(draw) if draw.random() < 0.3 else [instruction(draw, draw.choice(some)).word1]
    words += [0, 0, 0, *words_of("BRA Expr", n=-1)]  # branches at the end lead into the NOPs
    insns = [codec.decode_for_execution(word, 0) for word in words[:-4]]
    return words, [insn for insn in insns if insn is not None]


def pairs_of(insns: list[Insn]) -> Iterator[tuple[Kind, str, Kind]]:
    """Yield the pairs of an instruction that writes a flag and the next instruction that reads it."""
    last: dict[str, Kind] = {}
    for insn in insns:
        for name in asked(insn):
            if name in last:
                yield last[name], name, kind(insn)
        for name in written(insn):
            last[name] = kind(insn)


def image(seed: int) -> tuple[dict[int, int], list[tuple[int, list[Insn]]]]:
    """Return program words by address, and the start address and instructions of each drill."""
    draw = random.Random(seed)
    flash: dict[int, int] = {}

    def put(at: int, words: list[int]) -> None:
        flash.update((at + 2 * place, word) for place, word in enumerate(words))

    put(0, words_of("GOTO Expr", n=0x100))
    put(0x100, words_of("BRA Expr", n=-1))
    for vector in range(0x04, 0x14, 2):
        put(vector, [TRAP])
    put(0x1A, [HANDLER])  # vector of timer 1
    put(TRAP, words_of("CLR{.B} f", B=0, f=0x80) + words_of("BRA Expr", n=-1))
    writers, readers, _ = rows()
    body = [instruction(draw, draw.choice(draw.choice((writers, readers)))).word1 for _ in range(3)]
    put(HANDLER, [*body, 0, 0, 0, *words_of("BCLR{.B} f, #bit4", f=IFS0, b=3, B=1), *words_of("RETFIE")])
    drills = []
    for number in range(DRILLS):
        words, insns = drill(draw, seed * DRILLS + number)
        put(FIRST + number * ROOM, words)
        drills.append((FIRST + number * ROOM, insns))
    return flash, drills


def _prepare(draw: random.Random, machine: Machine, start: int) -> None:
    """Prepare a machine for a drill: registers, flags, memory, and a timer with or without interrupt."""
    for number in DATA:
        machine.w[number] = draw.choice(VALUES) if draw.random() < 0.6 else draw.randrange(0x10000)
    for number in POINTERS:
        machine.w[number] = 0x900 + draw.randrange(0, 64, 2) if draw.random() < 0.95 else SR + draw.randrange(2)
    machine.w[ELSEWHERE] = draw.choice((0x900, 0x901, 0x2800, SR, SR + 1, PORTD, TMR1, 0x8000, 0x44))
    machine.w[14], machine.w[15] = 0x900, 0x1000
    for address in range(0x900, 0x960, 2):
        machine.poke(address, draw.choice(VALUES) if draw.random() < 0.6 else draw.randrange(0x10000))
    machine.state.initialised = 0xFFFF
    machine.state.mode = 0
    machine.poke("CORCON", 0x0020)
    machine.poke("INTCON1", 0)
    machine.write("IEC0", 8 if draw.random() < 0.4 else 0)
    machine.write("PR1", draw.randrange(3, 30))
    machine.write("T1CON", 0x8000)
    machine.poke("SR", draw.randrange(16) | draw.choice((0, 0x100)))
    machine.pc = start


def check(seed: int, tally: Tally, rounds: int = 16) -> str | None:
    """Run the drills of one image. Return the first difference, or None."""
    flash, drills = image(seed)
    draw = random.Random(f"{seed} runs")
    machines = [Machine(engine=name, ipl_slip=seed & 1) for name in ENGINES]
    arrivals: list[list[Any]] = [[] for _ in machines]
    hooked = draw.sample([at for at in flash if at >= FIRST], 6)
    for machine, seen in zip(machines, arrivals, strict=True):
        machine.stop_on_fault = False
        machine.program.put(machine.chip.config["FWDT"].address, NO_WATCHDOG)
        for address, word in flash.items():
            machine.program.put_flash(address, [word])
        machine.reset("POR")
        for address in hooked:
            machine.hook_pc(address, lambda m=machine, s=seen: s.append((m.pc, m.cycle)))  # type: ignore[misc]
        if isinstance(machine.runner, JitEngine):
            machine.runner.threshold, machine.runner.wait = 1, True
            machine.runner.compiler = QuickCompiler({1: HOT_LEVEL, 5: BLOCK_LEVEL}.get(seed % 8, STEP_LEVEL))
    native, executed = machines[-1].runner, machines[0].core.sequencer.execute
    assert isinstance(native, JitEngine)

    def counted() -> None:
        tally.executed += 1
        executed()

    machines[0].core.sequencer.execute = counted  # type: ignore[method-assign]
    for number, (start, insns) in enumerate(drills):
        for cut in range(rounds):
            ended = []
            for machine in machines:
                _prepare(random.Random(f"{seed} {number} {cut}"), machine, start)
                ended.append(machine.run(cut + 1))
            found = [difference(machines[0], machine) for machine in machines[1:]]
            if any(found) or ended.count(ended[0]) < len(ended) or arrivals.count(arrivals[0]) < len(arrivals):
                listing = "; ".join(f"{insn.row.syntax} {insn.x}" for insn in insns)
                return f"drill {number}, {cut + 1} cycles: {ended} {found} {[a[-2:] for a in arrivals]}\n{listing}"
            tally.runs += 1
        tally.pairs.update(pairs_of(insns))
    tally.python += native.counts.interpreted
    return None
