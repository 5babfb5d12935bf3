"""Random (instruction, context) pairs and random programs, run on the plain engine and on another.

No difference is allowed. Contexts include registers, SR, CORCON modes, modulo and bit-reversed addressing, stack
limit, REPEAT and DO state, the stall mask, and memory. Programs contain all rows, with loops, calls, skips, REPEAT,
DO and timer interrupts, and are compared at random cycles. The seed determines everything.
"""

from __future__ import annotations

import random

from emu.chips.chip import Chip
from emu.chips.dspic30f6014a import DSPIC30F6014A
from emu.dspic30f.isa.codec import EncodeError, decode, encode
from emu.dspic30f.isa.facts import facts_of
from emu.dspic30f.isa.flow import Branch, Call, Do, Goto, Repeat, Reset, Return, Skip, Sleep
from emu.dspic30f.isa.row import Insn, Row
from emu.dspic30f.isa.table import ROWS
from emu.dspic30f.jit.engine import JitEngine
from emu.machine.machine import Machine
from emu.machine.stops import Stop
from tests.emu.jit.comparison.engine_pair import QuickCompiler

PC = 0x4000
INTERESTING = (0, 1, 2, 0x7F, 0x80, 0xFF, 0x100, 0x7FFF, 0x8000, 0xFFFE, 0xFFFF)
TIMERS = (1, 2)
RAM_START = DSPIC30F6014A.data["ram"].start
TRAP_VECTORS = range(0x04, 0x14, 2)
HANDLER, TRAP_HANDLER, SUBROUTINE = 0x8000, 0x8100, 0x8200


class Difference(Exception):
    """Two engines disagree; the message contains what is needed to reproduce it."""


def random_insn(rng: random.Random, row: Row, ram: int = DSPIC30F6014A.data["ram"].start) -> Insn:
    """Return a random legal instruction of a row of the instruction table. Most file operands are at `ram` or above."""
    while True:
        fields = {}
        for letter, field in row.fields.items():
            low, high = field.limits
            fields[letter] = rng.randrange(low, high + 1, field.scale)
            if letter == "f" and rng.random() < 0.7:
                fields[letter] = ram + rng.randrange(0, 0x1000) // field.scale * field.scale
        try:
            insn = decode(*encode(row, fields))
        except EncodeError:
            continue
        if insn is not None and insn.row is row:
            return insn


def machines(engine: str, chip: Chip = DSPIC30F6014A) -> tuple[Machine, Machine]:
    """Return a machine with the plain engine and one with the engine under test, which compiles code before it runs
    it."""
    pair = Machine(chip, engine="plain"), Machine(chip, engine=engine)
    for machine in pair:
        machine.program.put(chip.config["FWDT"].address, 0x7FFF)  # FWDT: no watchdog
        machine.reset("POR")
        if isinstance(machine.runner, JitEngine):
            machine.runner.threshold, machine.runner.wait = 1, True
            machine.runner.compiler = QuickCompiler(0)
    return pair


def difference(plain: Machine, other: Machine) -> str:
    """Return the first differences between two states, empty if they are equal."""
    a, b = plain.snapshot(), other.snapshot()
    if a == b:
        return ""
    places = [i for i in range(len(a)) if a[i] != b[i]]
    named = [f"{plain.record.field_at(i)}: {a[i]:02x} != {b[i]:02x}" for i in places[:8]]
    return f"{len(places)} bytes, " + "; ".join(named)


class Contexts:
    """Generator of random processor states, which it writes into a record."""

    def __init__(self, rng: random.Random, chip: Chip = DSPIC30F6014A) -> None:
        self._rng = rng
        self._ram = chip.data["ram"]
        self._memory = rng.randbytes(4 * self._ram.size)

    def modes(self, machine: Machine) -> None:
        """Set the state on which translations depend: CORCON, MODCON, XBREV, stack limit, traps."""
        rng = self._rng
        machine.poke(
            "CORCON", rng.choice((0x0020, 0x0000, rng.randrange(0x10000) & 0x10F3, rng.randrange(0x10000) & 0x10F7))
        )
        modulo = rng.random() < 0.4
        machine.poke("MODCON", rng.randrange(0x10000) & 0xCFFF if modulo else 0)
        start = self._ram.start + rng.randrange(self._ram.size // 4) * 2
        for name in ("XMODSRT", "YMODSRT"):
            machine.poke(name, start)
        for name in ("XMODEND", "YMODEND"):
            machine.poke(name, start + rng.choice((15, 31, 63, 127)))
        machine.poke("XBREV", rng.choice((0, 0x8008, 0x8010, 0x0008)))
        machine.poke("INTCON1", rng.choice((0, 0, 0, 0x0700)))
        machine.state.limit_armed = rng.random() < 0.5
        anywhere = self._ram.start + rng.randrange(self._ram.size - 2) & ~1
        machine.poke("SPLIM", rng.choice((self._ram.end - 16, 0x1800, anywhere)))
        machine.state.initialised = 0xFFFF if rng.random() < 0.8 else rng.randrange(0x10000) | 0x8000

    def data(self, machine: Machine) -> None:
        """Set registers, flags and memory."""
        rng = self._rng
        ram = self._ram
        offset = rng.randrange(3 * ram.size)
        machine.record.bytes[ram.start : ram.end] = self._memory[offset : offset + ram.size]
        for number in range(16):
            machine.record.u16[number] = self.word()
        stack = ram.start + rng.randrange(ram.size - 16) & ~1 if rng.random() < 0.9 else self.word() & ~1
        machine.record.u16[15] = stack
        machine.poke("SR", rng.randrange(0x10000) & 0xFDEF)
        for accumulator in ("ACCA", "ACCB"):
            value = rng.choice((rng.randrange(1 << 40), rng.randrange(-(1 << 32), 1 << 32) & (1 << 40) - 1))
            for part, shift in (("L", 0), ("H", 16), ("U", 32)):
                machine.poke(accumulator + part, value >> shift & (0xFF if part == "U" else 0xFFFF))
        for name in ("TBLPAG", "PSVPAG"):
            machine.poke(name, rng.choice((0, 0, 1, 0x7F)))
        machine.state.stall = rng.choice((0, 0, rng.randrange(0x10000)))
        machine.state.pc = PC

    def word(self) -> int:
        """Return a register value: an address in RAM, a boundary value, or a random one."""
        rng = self._rng
        kind = rng.random()
        if kind < 0.6:
            return self._ram.start + rng.randrange(self._ram.size) & (~1 if rng.random() < 0.9 else ~0)
        if kind < 0.8:
            return rng.choice(INTERESTING)
        return rng.randrange(0x10000)


def check_pairs(seed: int, instructions: int, contexts: int, engine: str = "jit", chip: Chip = DSPIC30F6014A) -> int:
    """Run `instructions` random instructions, each in `contexts` contexts of the same modes. Return the pairs run.

    Rows take turns, so each row is tested equally often. Raises Difference.
    """
    rng = random.Random(seed)
    plain, other = machines(engine, chip=chip)
    used = plain.record.used
    base = plain.record.snapshot()
    source = Contexts(rng, chip)
    pairs = 0
    for number in range(instructions):
        row = ROWS[number % len(ROWS)]
        insn = random_insn(rng, row, chip.data["ram"].start)
        repeated = row.repeat_ok and rng.random() < 0.3
        for machine in (plain, other):
            machine.record.bytes[:used] = base
            for index, word in enumerate((insn.word1, insn.word2)[: insn.words]):
                machine.program.put(PC + 2 * index, word)
        source.modes(plain)
        kept = plain.record.snapshot()
        for _round in range(contexts):
            plain.record.bytes[:used] = kept
            source.data(plain)
            if repeated:
                plain.poke("RCOUNT", rng.choice((1, 2, 5, 17)))
                plain.state.sr |= 0x10
                plain.state.repeat = rng.choice((1, 2))
            state = plain.record.snapshot()
            other.record.bytes[:used] = state
            stops = [machine.run_until(1 + (12 if repeated else 0)) for machine in (plain, other)]
            pairs += 1
            wrong = difference(plain, other)
            if wrong or stops[0] != stops[1]:
                raise Difference(
                    f"seed {seed}, instruction {number} ({insn.word1:06x} {insn.word2:06x} {row.syntax}: {insn.x}),"
                    f" repeated {repeated}: {wrong} {stops}"
                )
    return pairs


FLOWS = (Branch, Call, Do, Goto, Repeat, Reset, Return, Skip, Sleep)
PLAIN_ROWS = tuple(
    row for row in ROWS if not row.word2 and facts_of(random_insn(random.Random(row.id), row)).flow not in FLOWS
)
BY_TEXT = {row.syntax: row for row in ROWS}
CONDITIONS = tuple(row for row in ROWS if row.syntax.startswith("BRA ") and "," in row.syntax)
SKIPS = tuple(row for row in ROWS if row.mnemonic in ("BTSS", "BTSC", "CPSEQ", "CPSNE", "CPSGT", "CPSLT"))


CORE = ("DCOUNT", "DCOUNT", "RCOUNT", "SR", "CORCON", "DOSTARTL", "DOENDL", "DOENDH", "PSVPAG", "TBLPAG")
"""CPU registers that control execution; repeated names are more frequent."""


class Program:
    """Random code of roughly `length` instructions that ends in a loop back to its start."""

    def __init__(self, rng: random.Random, length: int) -> None:
        self._rng = rng
        self.words: list[int] = []
        while len(self.words) < length:
            rng.choices(
                (
                    self._straight, self._branch, self._skip, self._repeat, self._do, self._call, self._disi,
                    self._status, self._core, self._idle,
                ),
                (60, 8, 8, 8, 4, 4, 2, 2, 2, 1),
            )[0]()  # fmt: skip
        self._add("BRA Expr", n=-len(self.words) - 1)

    def _add(self, syntax: str, **fields: int) -> None:
        self.words += encode(BY_TEXT[syntax], fields)

    def _one(self, rows: tuple[Row, ...] = PLAIN_ROWS) -> None:
        rng = self._rng
        while True:
            insn = random_insn(rng, rng.choice(rows))
            x = insn.x
            if 15 in (getattr(x, "d", 0), getattr(x, "s", 0)) and rng.random() < 0.95:
                continue  # usually leaves the stack pointer unchanged
            if getattr(x, "f", RAM_START) < RAM_START and rng.random() < 0.9:
                continue
            self.words += (insn.word1, insn.word2)[: insn.words]
            return

    def _straight(self) -> None:
        for _ in range(self._rng.randrange(1, 6)):
            self._one()

    def _branch(self) -> None:
        """Emit a forward branch over a few instructions."""
        inner = self._nested(4)
        self.words += encode(self._rng.choice(CONDITIONS), {"n": len(inner)})
        self.words += inner

    def _skip(self) -> None:
        self._one(SKIPS)
        if self._rng.random() < 0.3:
            self._add("GOTO Expr", n=PC)
        else:
            self._one()

    def _repeat(self) -> None:
        self._add("REPEAT #lit14", k=self._rng.choice((0, 1, 2, 7, 17)))
        if self._rng.random() < 0.25:
            self._core()
        else:
            self._one(tuple(row for row in PLAIN_ROWS if row.repeat_ok))

    def _core(self) -> None:
        """Emit an access to a register that controls execution. Counts mostly decrease, so that loops end."""
        rng = self._rng
        f, byte = DSPIC30F6014A.sfrs[rng.choice(CORE)].address, int(rng.random() < 0.3)
        way = rng.random()
        if way < 0.3:
            self._add(rng.choice(("MOV{.W} Wns, f", "MOV{.W} f, Wnd")), f=f, s=rng.randrange(8), d=rng.randrange(8))
        elif way < 0.6:
            self._add("BTG{.B} f, #bit4", f=f + rng.randrange(2), b=rng.randrange(8), B=1)
        else:
            self._add(rng.choice(("CLR{.B} f", "LSR{.B} f")), f=f, B=byte)

    def _do(self) -> None:
        inner = self._nested(6)
        while len(inner) < 3:
            inner += encode(BY_TEXT["NOP"], {})
        inner += encode(BY_TEXT["NOP"], {})
        kept, self.words = self.words, []
        if self._rng.random() < 0.5:
            self._core()
        else:
            while not self.words or len(self.words) > 1:
                self.words = []
                self._one()
        inner, self.words = inner + self.words, kept
        self._add("DO #lit14, Expr", k=self._rng.randrange(4), n=len(inner) - 1)
        self.words += inner

    def _nested(self, most: int) -> list[int]:
        kept, self.words = self.words, []
        for _ in range(self._rng.randrange(1, most)):
            self._one()
        inner, self.words = self.words, kept
        return inner

    def _call(self) -> None:
        self._add("CALL Expr", n=SUBROUTINE)

    def _disi(self) -> None:
        self._add("DISI #lit14", k=self._rng.randrange(12))

    def _idle(self) -> None:
        self._add("PWRSAV #lit1", k=1)

    def _status(self) -> None:
        """Emit a critical section like those of kernels: by the IPL in SR, or by an enable bit."""
        if self._rng.random() < 0.5:
            self._add("MOV{.B} WREG, f", f=0x42, B=1)
        else:
            self._add(self._rng.choice(("BSET{.B} f, #bit4", "BCLR{.B} f, #bit4")), f=0x8C, b=3, B=1)


def _subroutine() -> list[int]:
    return [
        *encode(BY_TEXT["LNK #lit14"], {"k": 4}),
        *encode(BY_TEXT["INC{.B} f"], {"f": 0x1000, "B": 0}),
        *encode(BY_TEXT["ULNK"], {}),
        *encode(BY_TEXT["RETURN"], {}),
    ]


def _handler(bits: list[tuple[int, int]]) -> list[int]:
    """Return a handler that clears flags (byte address, bit)."""
    words = [*encode(BY_TEXT["PUSH.S"], {})]
    for address, bit in bits:
        words += encode(BY_TEXT["BCLR{.B} f, #bit4"], {"f": address + bit // 8, "b": bit % 8, "B": 1})
    return [*words, *encode(BY_TEXT["POP.S"], {}), *encode(BY_TEXT["RETFIE"], {})]


def prepare(rng: random.Random, start: bytes, plain: Machine, other: Machine) -> list[int]:
    """Load one random program and context into both machines. Return the cycles at which the machines are compared."""
    program = Program(rng, rng.randrange(10, 80))
    slip = rng.randrange(2)
    chip = plain.chip
    irqs = [timer.irq for timer in chip.timers if timer.number in TIMERS]
    flags, enables = ([getattr(chip.interrupts[irq], kind) for irq in irqs] for kind in ("flag", "enable"))
    for machine in (plain, other):
        machine.restore(start)
        machine.core.exceptions.ipl_slip = slip
        machine.program.put_flash(0, [*encode(BY_TEXT["GOTO Expr"], {"n": PC})])
        machine.program.put_flash(PC, program.words)
        machine.program.put_flash(SUBROUTINE, _subroutine())
        machine.program.put_flash(HANDLER, _handler([(chip.sfrs[name].address, bit) for name, bit in flags]))
        machine.program.put_flash(TRAP_HANDLER, _handler([(chip.sfrs["INTCON1"].address, bit) for bit in (1, 2, 3, 4)]))
        for irq in irqs:
            machine.program.put(chip.vectors[irq + 8].ivt, HANDLER)
        for vector in TRAP_VECTORS:
            machine.program.put(vector, TRAP_HANDLER)
        machine.stop_on_fault = False
    contexts = Contexts(rng, chip)
    contexts.modes(plain)
    contexts.data(plain)
    plain.state.stall = 0
    plain.record.u16[15] = chip.data["ram"].start + 0x100
    if rng.random() < 0.7:
        plain.state.initialised = 0xFFFF
        plain.poke("SPLIM", chip.data["ram"].end - 0x100)
    other.record.bytes[: plain.record.used] = plain.record.bytes[: plain.record.used]
    for machine in (plain, other):
        machine.program.announce_all()
    periods = [rng.randrange(20, 300) for _ in range(2)]
    for machine in (plain, other):
        for timer, (register, bit), period in zip(TIMERS, enables, periods, strict=True):
            machine.write(f"PR{timer}", period)
            machine.write(f"T{timer}CON", 0x8000)
            machine.write(register, machine.peek(register) | 1 << bit)
    stops, cycle = [], 0
    for _ in range(rng.randrange(3, 10)):
        cycle += rng.choice((1, 2, 3, rng.randrange(1, 40), rng.randrange(1, 400)))
        stops.append(cycle)
    return stops


def check_programs(seed: int, count: int, engine: str = "jit", chip: Chip = DSPIC30F6014A) -> int:
    """Run `count` random programs. Return the number of cycles simulated on each engine. Raises Difference."""
    rng = random.Random(seed)
    plain, other = machines(engine, chip=chip)
    start = plain.snapshot()
    total = 0
    for number in range(count):
        stops = prepare(rng, start, plain, other)
        for cycle in stops:
            ends: list[Stop | None] = [machine.run_until(cycle) for machine in (plain, other)]
            wrong = difference(plain, other)
            if wrong or ends[0] != ends[1]:
                raise Difference(f"seed {seed}, program {number}, cycle {cycle}: {wrong} {ends}")
            if ends[0] is not None and ends[0].reason == "halt":
                break
        total += plain.cycle
    return total
