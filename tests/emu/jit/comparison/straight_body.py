"""The body of a long straight program: sections of ordinary instructions, and sequences for instructions that need
context.

Each section assigns W0..W14 in another way to pointers into RAM (or the PSV window), an index and data registers. Most
accesses therefore succeed natively, while destinations, modes and registers are random.
"""

from __future__ import annotations

import random
from dataclasses import dataclass

from emu.chips.dspic30f6014a import DSPIC30F6014A
from emu.dspic30f.isa import codec, table
from emu.dspic30f.isa.facts import facts_of
from emu.dspic30f.isa.fields import Operands
from emu.dspic30f.isa.row import Row
from tests.emu.jit.comparison.random_firmware import (
    FLOWS,
    STACK,
    TRAP_COUNT,
    Firmware,
    device_words,
    interrupt_words,
    literal,
    to_sfr,
    words_of,
)

BODY, BODY_END = 0x2000, 0xE000
LEAVES, LEAF_WORDS, LEAF_COUNT = 0x1200, 8, 16
"""Callees of a few instructions and RETURN or RETLW: address of the first, words of each, number."""
PROGRESS = 0x27FC
"""Address of a word in RAM that holds the program address at which execution continues after a reset: the section
after the current one."""
MODE_CORCON = 0x10F7
"""CORCON bits that programs change: all but IPL3, the DO level and EDT (isa.md §2.4)."""

SEPARATE = (
    "RETFIE", "RETURN", "RETLW", "RESET", "ULNK", "DIV.S", "DIV.SD", "DIV.U", "DIV.UD", "DIVF", "LNK", "PWRSAV",
    "DISI",
)  # fmt: skip
"""Mnemonics that need surrounding code; rows with control flow also need it."""
ORDINARY = [row for row in table.ROWS if row.mnemonic not in FLOWS + SEPARATE]
PLAIN = [row for row in ORDINARY if not row.mnemonic.startswith(("CPS", "BTSS", "BTSC"))]
"""Rows without control flow."""
COMPUTING = [row for row in PLAIN if not set("pqghofi") & set(row.fields)]
"""Rows that usually access only registers."""
DIVIDES = [row for row in table.ROWS if row.mnemonic.startswith("DIV")]
BRANCHES = [row for row in table.ROWS if row.mnemonic == "BRA" and "n" in row.fields]
BYTE_POINTERS = ("SE", "ZE")
"""Mnemonics whose pointers move by one byte without a size field."""


@dataclass(frozen=True)
class Shape:
    """Parameters of a random program."""

    instructions: int = 5000
    """Approximate number of instructions per pass."""
    periods: tuple[int, int] = (25, 150)
    """Minimum and maximum Tcy between the matches of one timer."""
    loops: tuple[int, int] = (0, 5)
    """Minimum and maximum number of repetitions of DO loops."""
    calm: bool = False
    """Whether the program avoids instructions that Python executes, except DO, for long runs."""


class BodyWriter:
    """Generator of the body of one program."""

    def __init__(self, firmware: Firmware, generator: random.Random, shape: Shape, corcon: int) -> None:
        self.firmware, self.generator, self.shape = firmware, generator, shape
        self.at = BODY
        self.good = 0
        """Bit mask of registers that hold valid even pointers."""
        self.psv_reads = corcon >> 2 & 1
        self.split()

    def put(self, words: list[int]) -> None:
        self.at = self.firmware.put(self.at, words)

    def split(self) -> None:
        """Begin a new section: select registers for pointers, index and data."""
        registers = list(range(15))
        self.generator.shuffle(registers)
        if self.generator.random() < 0.6:
            registers.sort(key=lambda n: n not in (8, 9, 10, 11))
        self.pointers, self.index, self.data = registers[:7], registers[7], registers[8:]
        self.window = self.data.pop() if self.psv_reads else None
        for n in self.pointers:
            if not self.good >> n & 1 or self.generator.random() < 0.3:
                self.point(n)
        self.put(literal(self.generator.randrange(0, 64, 2), self.index))
        if self.window is not None:
            self.put(literal(0x8000 | self.generator.getrandbits(14) << 1, self.window))
        self.good &= sum(1 << n for n in self.pointers)

    def point(self, n: int) -> None:
        """Make Wn point into RAM; W10 and W11 into Y RAM (isa.md §8.1)."""
        low, high = (0x1880, 0x1F80) if n in (10, 11) else (0x0900, 0x1780) if n in (8, 9) else (0x0900, 0x1F80)
        if n not in (10, 11) and self.generator.random() < 0.3:
            low, high = 0x2080, 0x2600
        self.put(literal(self.generator.randrange(low, high, 2), n))
        self.good |= 1 << n

    def file(self, scale: int) -> int:
        """Return an address for a file operand: mostly in RAM, sometimes a W register or random."""
        chance = self.generator.random()
        if chance < 0.9 or self.shape.calm:
            return self.generator.randrange(0x800, 0x1F00) & -scale
        if chance < 0.96:
            return self.generator.randrange(0, 0x1E) & -scale
        return self.generator.randrange(0x20, 0x800) & -scale

    def operands(self, row: Row) -> Operands | None:
        """Return random fields of `row` for the current section, or None if they are illegal."""
        generator = self.generator
        words = [generator.getrandbits(24) for _ in row.pattern.mask]
        x = Operands(**{f.letter: f.get(*words) for f in row.pattern.fields})
        fields = row.fields
        if "z" in fields:
            x.z = 0
        for letter in "pqgh":
            if letter in fields and generator.random() < 0.25:
                setattr(x, letter, 0)
        offset = "o" in fields
        from_memory = ("p" in fields and x.p) or ("g" in fields and x.g) or (offset and row.syntax.endswith("Wnd"))
        to_memory = ("q" in fields and x.q) or ("h" in fields and x.h) or (offset and not row.syntax.endswith("Wnd"))
        if "s" in fields and from_memory:
            scale = fields["s"].scale
            useful = [n for n in self.pointers if n % scale == 0] or self.pointers
            reads_only = not row.mnemonic.startswith(("BSET", "BCLR", "BTG", "BTSTS", "BSW"))
            at_window = self.window is not None and reads_only and not offset and generator.random() < 0.15
            x.s = self.window if at_window and self.window is not None else generator.choice(useful)
        elif "s" in fields and "d" not in fields:
            x.s = generator.choice(self.data)
        if "d" in fields:
            candidates = self.pointers if to_memory else self.data if generator.random() < 0.93 else [x.d]
            x.d = generator.choice(candidates) // fields["d"].scale * fields["d"].scale
        if ("g" in fields and x.g == 6) or ("h" in fields and x.h == 6):
            x.w = self.index
        if offset:
            x.o = generator.randrange(-60, 60)
        if "f" in fields:
            x.f = self.file(1 if fields["f"].scale == 1 and getattr(x, "B", 1) else 2)
        return None if row.broken(x) else x

    def note(self, row: Row, x: Operands, words: list[int]) -> None:
        """Update the set of valid pointers: remove those that the instruction overwrites or makes odd."""
        insn = codec.decode(*words)
        assert insn is not None
        spoilt = facts_of(insn).writes
        bytes_only = getattr(x, "B", 0) == 1 or row.mnemonic in BYTE_POINTERS
        for mode, register in (("p", "s"), ("g", "s"), ("q", "d"), ("h", "d")):
            if mode in row.fields and getattr(x, mode):
                n = getattr(x, register)
                steps = 2 <= getattr(x, mode) <= 5
                spoilt = spoilt | 1 << n if steps and bytes_only else spoilt & ~(1 << n)
        if getattr(x, "a", None) == 1:
            spoilt &= ~(1 << 13)
        if "f" in row.fields and x.f < 0x20:
            spoilt |= 1 << (x.f >> 1)
        self.good &= ~spoilt
        if spoilt >> self.index & 1:
            self.index = self.data[0]
            self.put(literal(self.generator.randrange(0, 64, 2), self.index))

    def one(self, rows: list[Row], after: tuple[str, ...] = ()) -> None:
        """Emit one instruction of one of `rows`."""
        while True:
            row = self.generator.choice(rows)
            if row.mnemonic in after:
                continue
            x = self.operands(row)
            if x is not None:
                break
        words = list(codec.encode(row, x))
        needed = self._needed(row, x)
        for n in needed:
            if not self.good >> n & 1 and self.generator.random() < 0.9:
                self.point(n)
        self.put(words)
        self.note(row, x, words)

    def _needed(self, row: Row, x: Operands) -> list[int]:
        """Return the registers that must hold valid pointers for the instruction."""
        found = []
        for mode, register in (("p", "s"), ("g", "s"), ("q", "d"), ("h", "d")):
            if mode in row.fields and getattr(x, mode) and getattr(x, register) != self.window:
                found.append(getattr(x, register))
        if "o" in row.fields:
            found.append(x.s if row.syntax.endswith("Wnd") else x.d)
        if "i" in row.fields:
            found += [n for n in (8, 9, 10, 11) if n in self.pointers or self.generator.random() < 0.5]
        if getattr(x, "a", None) == 1:
            found.append(13)
        return [n for n in found if n < 15]

    def plain(self, count: int) -> None:
        for _ in range(count):
            self.one(PLAIN)

    def skipped_code(self, count: int) -> None:
        """Emit the instructions that a branch or skip jumps over: often only register operations, which stay in one
        block."""
        rows = COMPUTING if self.generator.random() < 0.5 else PLAIN
        for _ in range(count):
            self.one(rows)

    # -- sequences -----------------------------------------------------------------------------------------------------
    def branch(self) -> None:
        """Emit a forward branch over some of the following instructions."""
        row = self.generator.choice(BRANCHES)
        start = self.at
        self.put([0])
        good = self.good
        self.skipped_code(self.generator.randrange(1, 6))
        self.good &= good
        targets = range(start + 2, self.at + 2, 2)
        self.firmware.put(start, list(codec.encode(row, Operands(n=(self.generator.choice(targets) - start - 2) // 2))))

    def skip(self) -> None:
        self.one([row for row in ORDINARY if row not in PLAIN])
        good = self.good
        self.skipped_code(1) if self.generator.random() < 0.8 else self.call(2)
        self.good &= good

    def call(self, kinds: int = 4) -> None:
        """Emit a call: CALL or RCALL, by address or by register."""
        leaf = LEAVES + 2 * LEAF_WORDS * self.generator.randrange(LEAF_COUNT)
        n = self.generator.choice(self.data)
        kind = self.generator.randrange(kinds)
        if kind == 0:
            self.put(words_of("CALL Expr", n=leaf))
        elif kind == 1:
            self.put(words_of("RCALL Expr", n=(leaf - self.at - 2) // 2))
        elif kind == 2:
            self.put(literal(leaf, n) + words_of("CALL Wn", s=n))
        else:
            self.put(literal((leaf - self.at - 4) // 2 & 0xFFFF, n) + words_of("RCALL Wn", s=n))
        self.good &= ~0xFF  # RETLW writes one of W0..W7

    def jump(self) -> None:
        """Emit GOTO, BRA Wn or GOTO Wn to an address nearby."""
        n, gap = self.generator.choice(self.data), self.generator.randrange(3)
        kind = self.generator.randrange(3)
        if kind == 0:
            self.put(words_of("GOTO Expr", n=self.at + 4 + 2 * gap))
        elif kind == 1:
            self.put(literal(self.at + 4 + 2 * gap, n) + words_of("GOTO Wn", s=n))
        else:
            self.put(literal(gap, n) + words_of("BRA Wn", s=n))
        self.put([self.generator.getrandbits(24) & 0xFFFF for _ in range(gap)])

    def repeat(self) -> None:
        count = self.generator.choice((0, 1, 2, 3, 5, 9, 17, 40))
        if self.generator.random() < 0.5:
            self.put(words_of("REPEAT #lit14", k=count))
        else:
            n = self.generator.choice(self.data)
            self.put(literal(count, n) + words_of("REPEAT Wn", s=n))
        at = self.at
        while True:
            self.at = at
            good, index = self.good, self.index
            row = self.generator.choice(PLAIN)
            x = self.operands(row)
            if x is not None and row.repeat_ok:
                break
            self.good, self.index = good, index
        words = list(codec.encode(row, x))
        self.put(words)
        self.note(row, x, words)

    def divide(self) -> None:
        while True:
            row = self.generator.choice(DIVIDES)
            words = [self.generator.getrandbits(24)]
            x = Operands(**{f.letter: f.get(*words) for f in row.pattern.fields})
            if "t" in row.fields and "v" in row.fields:
                x.v = self.generator.randrange(0, 14, 2)
                x.t = x.v + 1
            if not row.broken(x):
                break
        if self.generator.random() < 0.8:
            self.put(words_of("REPEAT #lit14", k=17))
        self.put(list(codec.encode(row, x)))
        self.good &= ~3

    def frame(self) -> None:
        self.put(words_of("LNK #lit14", k=self.generator.randrange(0, 64, 2)))
        self.put(words_of("ULNK"))

    def loop(self, depth: int = 0) -> None:
        """Emit a DO loop with a body without exits; its last instruction has no control flow."""
        fewest, most = self.shape.loops
        count = self.generator.randrange(fewest, most + 1)
        start, by_register = self.at, self.generator.random() < 0.5
        register = self.generator.choice(self.data)
        if by_register:
            self.put(literal(count, register))
            start = self.at
        self.put([0, 0])
        if not depth and not self.shape.calm and self.generator.random() < 0.2:
            self.loop(1)
        for n in self.pointers:
            self.point(n)
        for _ in range(self.generator.randrange(1, 5)):
            self.generator.choice((self.branch, self.skip, self.repeat, self.divide, lambda: self.plain(3)))()
        if not self.shape.calm and self.generator.random() < 0.1:
            self.end_early()
        self.put([0])  # a NOP, so that no skip reaches beyond the end
        self.one(PLAIN)
        while facts_of(codec.decode(self.firmware.flash[self.at - 2], 0)).flow is not None:  # type: ignore[arg-type]
            self.one(PLAIN)
        n = (self.at - 2 - start - 4) // 2
        words = words_of("DO Wn, Expr", s=register, n=n) if by_register else words_of("DO #lit14, Expr", k=count, n=n)
        self.firmware.put(start, words)
        self.leap()

    def end_early(self) -> None:
        """Emit a change of EDT or of the count of the loop."""
        corcon = DSPIC30F6014A.sfrs["CORCON"]
        edt = words_of("BSET{.B} f, #bit4", f=corcon.address + 1, b=corcon.fields["EDT"][0] - 8)
        other = to_sfr("DCOUNT", self.generator.randrange(3)) if self.generator.random() < 0.2 else edt
        self.put(words_of("BTSC{.B} f, #bit4", f=0x0900 + self.generator.randrange(16), b=0) + edt)
        if other is not edt:
            self.put(other)
            self.good &= ~1

    def leap(self) -> None:
        """Emit a computed jump to the next instruction, which ends the region."""
        n = self.generator.choice(self.data)
        self.put(literal(self.at + 4, n) + words_of("GOTO Wn", s=n))

    def modes(self) -> None:
        """Emit a change of processor modes."""
        generator = self.generator
        name = generator.choice(("CORCON", "CORCON", "MODCON", "XBREV", "INTCON1", "PSVPAG"))
        value = generator.getrandbits(16)
        if name == "CORCON":
            value &= MODE_CORCON
            self.psv_reads = value >> 2 & 1
        elif name == "INTCON1":
            value &= 0x0700
        elif name == "PSVPAG":
            value = generator.randrange(3)
        self.put(to_sfr(name, value))
        self.good &= ~1
        self.leap()

    def extra(self) -> None:
        """Emit an instruction that Python executes, or one that changes interrupts."""
        kind = self.generator.randrange(4)
        if kind == 0:
            self.put(words_of("DISI #lit14", k=self.generator.randrange(12)))
        elif kind == 1:
            self.put(to_sfr("T1CON", 0x8000) + to_sfr("PR1", self.generator.randrange(*self.shape.periods)))
            self.put(to_sfr("IPC0", 0x4444) + to_sfr("IEC0", 0x00C8) + words_of("PWRSAV #lit1", k=1))
        elif kind == 2:
            self.put(interrupt_words(self.generator))
        else:
            self.put(device_words(self.generator))
        self.good &= ~0x81

    def clock(self) -> None:
        """Emit code that sets a new timer period and restores the interrupt registers."""
        timer = self.generator.choice("123")
        self.put(to_sfr(f"PR{timer}", self.generator.randrange(*self.shape.periods)) + to_sfr(f"T{timer}CON", 0x8000))
        self.put(to_sfr("IEC0", 0x00C8) + to_sfr("SR", 0))
        self.good &= ~1

    def body(self) -> None:
        ways = [self.branch, self.skip, self.call, self.jump, self.repeat, self.divide, self.frame]
        weights = [24, 10, 5, 3, 4, 4, 1]
        end = min(BODY_END, BODY + 2 * self.shape.instructions)
        while self.at < end:
            begin = self.at
            self.put(literal(0, 0) + words_of("MOV{.W} Wns, f", s=0, f=PROGRESS))
            self.put(words_of("CLR{.B} f", B=0, f=TRAP_COUNT))
            self.good &= ~1
            if not self.shape.calm and self.generator.random() < 0.1:
                self.modes()
            if not self.shape.calm and self.generator.random() < 0.6:
                self.clock()
            if not self.shape.calm and self.generator.random() < 0.2:
                self.extra()
            if self.generator.random() < (0.5 if self.shape.calm else 0.06):
                self.loop()
            self.split()
            self.put(literal(STACK, 15))
            for _ in range(self.generator.randrange(2, 8)):
                self.plain(self.generator.randrange(1, 8))
                self.generator.choices(ways, weights)[0]()
            self.firmware.put(begin, literal(self.at if self.at < end else BODY, 0))
