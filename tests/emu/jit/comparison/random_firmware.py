"""Random firmware: legal instructions of every row in a loop, with interrupts at random times, traps and all modes.

Two machines with different engines run it in parallel; their whole records are compared at random stops.
"""

from __future__ import annotations

import random
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from emu.chips.chip import Chip
from emu.chips.dspic30f6014a import DSPIC30F6014A
from emu.dspic30f.isa import codec, table
from emu.dspic30f.isa.fields import Operands
from emu.dspic30f.isa.row import Row
from emu.machine.machine import Machine

CODE, ISR, HANDLER, LEAF = 0x200, 0x1000, 0x1100, 0x1180
"""Program addresses of the body, the interrupt handlers, the trap handler and a callee."""
BODY_WORDS = 60
STACK = 0x2000
"""Data address of the stack, for chips whose RAM includes it."""
TRAP_COUNT = 0x1FF0
"""Address of a counter in RAM. After 32 traps the trap handler restarts the program instead of returning, in case PC
is wrong."""

FLOWS = ("BRA", "CALL", "GOTO", "RCALL", "DO", "REPEAT", "RETURN", "RETFIE", "RETLW")
LEFT_OUT = ("RESET", "PWRSAV")
"""Rows that end the run or only wait; other tests cover them."""

DEVICE_REGISTERS = (
    "TMR1", "TMR2", "TMR3", "PR1", "PR2", "PR3", "LATA", "LATD", "LATF", "PORTA", "PORTB", "PORTD", "TRISD",
)  # fmt: skip
"""Registers with native accesses, and registers that change how these are accessed."""

ROWS = [row for row in table.ROWS if row.mnemonic not in LEFT_OUT]
BY_SYNTAX = {row.syntax: row for row in table.ROWS}


def words_of(syntax: str, **fields: int) -> list[int]:
    """Return the words of one instruction with the given syntax and fields."""
    return list(codec.encode(BY_SYNTAX[syntax], Operands(**fields)))


def literal(value: int, register: int) -> list[int]:
    """Return MOV #value,Wn."""
    return words_of("MOV{.W} #lit16, Wnd", k=value, d=register)


def to_sfr(name: str, value: int, chip: Chip = DSPIC30F6014A) -> list[int]:
    """Return code that writes a register through W0."""
    return literal(value, 0) + words_of("MOV{.W} Wns, f", s=0, f=chip.sfrs[name].address)


@dataclass
class Firmware:
    """Program words by address, and the seed from which they are generated."""

    seed: int
    flash: dict[int, int] = field(default_factory=dict)
    end: int = -1
    """Address at which a pass through the program ends, or -1 if there is none."""
    ram: dict[int, int] = field(default_factory=dict)
    """Words of RAM with fixed initial values; all others are random."""

    def put(self, address: int, words: list[int]) -> int:
        """Place words. Return the address after them."""
        for word in words:
            self.flash[address] = word
            address += 2
        return address


def random_words(row: Row, generator: random.Random, at: int, end: int, ram: range) -> list[int] | None:
    """Return a legal instruction of `row` at address `at` with static targets in the body, or None."""
    mask, value = row.pattern.mask, row.pattern.value
    words = [v | generator.getrandbits(24) & ~m & 0xFFFFFF for m, v in zip(mask, value, strict=True)]
    x = Operands(**{f.letter: f.get(*words) for f in row.pattern.fields})
    if "t" in row.fields and "v" in row.fields:
        x.v = generator.randrange(0, 14, 2)
        x.t = x.v + 1
    if "f" in row.fields and generator.random() < 0.8:
        near = generator.randrange(ram.start, min(ram.stop, 0x1FFE))
        x.f = generator.choice((generator.randrange(0, 0x20), near)) & ~1
    if "n" in row.fields:
        if row.mnemonic in ("CALL", "GOTO"):
            x.n = LEAF if row.mnemonic == "CALL" else generator.randrange(CODE, end, 2)
        elif row.mnemonic == "RCALL":
            x.n = (LEAF - at - 2) // 2
        elif row.mnemonic == "DO":
            x.n = generator.randrange(2, 7)
        else:
            x.n = generator.randrange(-6, 10)
    if row.mnemonic == "REPEAT" and "k" in row.fields:
        x.k = generator.choice((0, 1, 2, 5, 17, 17, 40))
    if row.mnemonic in ("DO", "DISI") and "k" in row.fields:
        x.k = generator.randrange(0, 6)
    if row.broken(x):
        return None
    return list(codec.encode(row, x))


def timer_bits(chip: Chip, kind: str) -> list[tuple[int, int]]:
    """Return the data address and bit of "flag" or "enable" of timers 1 to 3."""
    bits = [getattr(chip.interrupts[timer.irq], kind) for timer in chip.timers[:3]]
    return [(chip.sfrs[name].address + bit // 8, bit % 8) for name, bit in bits]


def interrupt_words(generator: random.Random, chip: Chip = DSPIC30F6014A) -> list[int]:
    """Return an instruction that changes IPL, interrupt flags or enables."""
    status = [(chip.sfrs["SR"].address, bit) for bit in (5, 6, 7)]
    address, bit = generator.choice(generator.choice((status, timer_bits(chip, "flag"), timer_bits(chip, "enable"))))
    syntax = generator.choice(("BSET{.B} f, #bit4", "BCLR{.B} f, #bit4", "BTG{.B} f, #bit4"))
    return words_of(syntax, f=address, b=bit, B=1)


def device_words(generator: random.Random, chip: Chip = DSPIC30F6014A) -> list[int]:
    """Return an access to a timer or port that is native."""
    name = generator.choice(DEVICE_REGISTERS)
    address = chip.sfrs[name].address
    if generator.random() < 0.4:
        return words_of("MOV{.W} f, Wnd", f=address, d=generator.randrange(8))
    if name.startswith(("TMR", "PR")) or generator.random() < 0.5:
        return literal(generator.randrange(20, 600), 7) + words_of("MOV{.W} Wns, f", s=7, f=address)
    syntax = generator.choice(("BSET{.B} f, #bit4", "BCLR{.B} f, #bit4", "BTG{.B} f, #bit4", "BTSC{.B} f, #bit4"))
    return words_of(syntax, f=address + generator.randrange(2), b=generator.randrange(8))


def mode_words(generator: random.Random, chip: Chip = DSPIC30F6014A) -> list[int]:
    """Return a write to a mode register, or to the state of a DO loop."""
    name = generator.choice(("CORCON", "MODCON", "XBREV", "DOENDL", "DOSTARTL", "DCOUNT", "PSVPAG", "SPLIM"))
    values = {
        "DOENDL": CODE + generator.randrange(0, 2 * BODY_WORDS, 2), "DOSTARTL": CODE, "DCOUNT": 2,
        "SPLIM": chip.data["ram"].end - 0x200, "CORCON": generator.getrandbits(16) & 0x10F7,
    }  # fmt: skip
    value = values.get(name, generator.getrandbits(16))
    return literal(value, 7) + words_of("MOV{.W} Wns, f", s=7, f=chip.sfrs[name].address)


def core_words(generator: random.Random, chip: Chip = DSPIC30F6014A) -> list[int]:
    """Return code that accesses a register that controls execution: at the end of a DO loop, under REPEAT, or alone."""
    name = generator.choice(("DCOUNT", "DCOUNT", "RCOUNT", "SR", "CORCON", "DOSTARTL", "DOENDL"))
    address = chip.sfrs[name].address
    one = generator.choice((
        words_of("MOV{.W} Wns, f", s=generator.randrange(8), f=address), words_of("LSR{.B} f", B=0, f=address),
        words_of("MOV{.W} f, Wnd", d=generator.randrange(8), f=address), words_of("CLR{.B} f", B=1, f=address),
        words_of("BTG{.B} f, #bit4", f=address + generator.randrange(2), b=generator.randrange(8), B=1)))  # fmt: skip
    way = generator.random()
    if way < 0.4:
        return [*words_of("DO #lit14, Expr", k=generator.randrange(6), n=2), 0, 0, *one]
    return words_of("REPEAT #lit14", k=generator.randrange(6)) + one if way < 0.6 else one


def _enabled(chip: Chip, generator: random.Random) -> list[tuple[str, int]]:
    """Return register values that enable the interrupts of timers 1 to 3 at random priorities."""
    sources = [chip.interrupts[timer.irq] for timer in chip.timers[:3]]
    groups = sorted({source.priority[0] for source in sources})
    enables: dict[str, int] = {}
    for source in sources:
        enables[source.enable[0]] = enables.get(source.enable[0], 0) | 1 << source.enable[1]
    return [(name, generator.getrandbits(16)) for name in groups] + sorted(enables.items())


def random_firmware(seed: int, chip: Chip = DSPIC30F6014A) -> Firmware:
    """Return a program that ends only through a reset after a fault."""
    generator = random.Random(seed)
    firmware = Firmware(seed)
    whole, y = chip.data["ram"], chip.data["yram"].start
    ram = range(whole.start, whole.end)
    stack = min(STACK, whole.end - 0x600)
    traps = stack - 0x10
    firmware.put(0, words_of("GOTO Expr", n=0x100))
    for vector in chip.vectors:
        target = HANDLER if vector.level or vector.irq is None else ISR + 0x20 * (vector.irq % 4)
        firmware.put(vector.ivt, [target])
        firmware.put(vector.aivt, [target])
    at = 0x100
    for sfr, value in (
        ("PR1", generator.randrange(20, 900)),
        ("PR2", generator.randrange(30, 400)),
        ("PR3", generator.randrange(300)),
        *_enabled(chip, generator),
        ("T1CON", 0x8000),
        ("T2CON", 0x8000 | generator.choice((0, 0x10))),
        ("T3CON", 0x8000),
        ("CORCON", generator.getrandbits(16) & 0x10F7),
        ("PSVPAG", 0),
        ("TBLPAG", 0),
    ):
        at = firmware.put(at, to_sfr(sfr, value, chip))
    if generator.random() < 0.2:
        for sfr, value in (
            ("XMODSRT", 0x1000),
            ("XMODEND", 0x103F),
            ("YMODSRT", y),
            ("YMODEND", y + 0x1F),
            ("XBREV", generator.choice((0x8008, 0))),
            ("MODCON", generator.getrandbits(16)),
        ):
            at = firmware.put(at, to_sfr(sfr, value, chip))
    if generator.random() < 0.5:
        at = firmware.put(at, to_sfr("SPLIM", whole.end - 0x200, chip))
    firmware.put(at, words_of("GOTO Expr", n=CODE - 0x40))
    at = CODE - 0x40
    for n in range(15):
        value = generator.randrange(0x1000, whole.end - 0x200) & ~1
        value = value if generator.random() < 0.7 else generator.getrandbits(16)
        at = firmware.put(at, literal(value, n))
    firmware.put(at, literal(stack, 15))
    at = CODE
    end = CODE + 2 * BODY_WORDS
    while at < end:
        row = generator.choice(ROWS)
        words = random_words(row, generator, at, end, ram)
        if generator.random() < 0.2:
            words = generator.choice((interrupt_words, device_words, mode_words, core_words))(generator, chip)
        if words is not None:
            at = firmware.put(at, words)
    firmware.put(at, words_of("GOTO Expr", n=CODE - 0x40 if generator.random() < 0.8 else CODE - 2))
    for number in range(4):
        at = ISR + 0x20 * number
        for _ in range(generator.randrange(3)):
            at = firmware.put(at, random_words(BY_SYNTAX["INC{.B} f"], generator, at, end, ram) or [0])
        for address, bit in timer_bits(chip, "flag"):
            at = firmware.put(at, words_of("BCLR{.B} f, #bit4", f=address, b=bit, B=1))
        firmware.put(at, words_of("RETFIE"))
    at = firmware.put(HANDLER, words_of("CLR{.B} f", B=0, f=chip.sfrs["INTCON1"].address))
    at = firmware.put(at, words_of("INC{.B} f", B=0, f=traps) + words_of("BTSS{.B} f, #bit4", f=traps, b=5))
    at = firmware.put(at, words_of("RETFIE") + words_of("CLR{.B} f", B=0, f=traps))
    at = firmware.put(at, literal(stack, 15))
    firmware.put(at, words_of("GOTO Expr", n=0x100))
    firmware.put(LEAF, words_of("RETURN"))
    return firmware


T1_HANDLER = 0x1000


def started(
    registers: Mapping[int, int], sfrs: Iterable[tuple[str, int]] = (), handler: list[int] | None = None, seed: int = 0
) -> tuple[Firmware, int]:
    """Return firmware that sets W registers and device registers in order, and the address after these instructions.

    `handler` is the code of T1's handler before RETFIE; without it the handler clears T1IF only."""
    firmware = Firmware(seed)
    firmware.put(0, words_of("GOTO Expr", n=0x100))
    firmware.put(0x1A, [T1_HANDLER])
    firmware.put(T1_HANDLER, (handler or []) + words_of("BCLR{.B} f, #bit4", f=0x84, b=3) + words_of("RETFIE"))
    at = 0x100
    for register, value in registers.items():
        at = firmware.put(at, literal(value, register))
    for sfr, value in sfrs:
        at = firmware.put(at, to_sfr(sfr, value))
    return firmware, at


def load(machine: Machine, firmware: Firmware) -> None:
    """Load the program and random data into a machine and reset it."""
    start, words = 0, []
    for address, word in sorted(firmware.flash.items()):
        if address != start + 2 * len(words):
            machine.program.put_flash(start, words)
            start, words = address, []
        words.append(word)
    machine.program.put_flash(start, words)
    machine.reset("POR")
    generator = random.Random(firmware.seed + 1)
    for address in range(machine.chip.data["ram"].start, machine.chip.data["ram"].end, 2):
        machine.poke(address, generator.getrandbits(16))
    for address, word in firmware.ram.items():
        machine.poke(address, word)


def difference(one: Machine, other: Machine) -> str:
    """Return the differences between the states of two machines, empty if there are none."""
    a, b = one.snapshot(), other.snapshot()
    if a == b:
        return ""
    places = dict.fromkeys(one.record.field_at(i) for i in range(len(a)) if a[i] != b[i])
    return f"pc {one.pc:06X} {other.pc:06X} cycle {one.cycle} {other.cycle}: " + ", ".join(list(places)[:12])
