"""Long random firmware that is mostly straight and keeps its pointers valid: thousands of distinct legal
instructions.

Control flow is forward: branches, skips, calls of leaf functions, computed jumps, DO and REPEAT. A pass ends where it
began. Timers interrupt at changing periods. Trap handlers clear the trap and return; after a reset the next section
runs.
"""

from __future__ import annotations

import random

from emu.chips.dspic30f6014a import DSPIC30F6014A
from emu.dspic30f.isa import codec
from emu.dspic30f.isa.fields import Operands
from tests.emu.jit.comparison.random_firmware import (
    BY_SYNTAX,
    CODE,
    HANDLER,
    ISR,
    TRAP_COUNT,
    Firmware,
    literal,
    to_sfr,
    words_of,
)
from tests.emu.jit.comparison.straight_body import (
    BODY,
    LEAF_COUNT,
    LEAF_WORDS,
    LEAVES,
    MODE_CORCON,
    PROGRESS,
    BodyWriter,
    Shape,
)

STACK_TRAP, MATH_TRAP = HANDLER + 0x40, HANDLER + 0x60
TRAP_HANDLERS = {"StackError": STACK_TRAP, "MathError": MATH_TRAP}


def straight_firmware(seed: int, shape: Shape | None = None) -> Firmware:
    """Return a program that repeats its body for ever. The last GOTO or RESET of a pass is at `Firmware.end`."""
    shape = shape or Shape()
    generator = random.Random(seed)
    firmware = Firmware(seed)
    firmware.put(0, words_of("GOTO Expr", n=0x100))
    for vector in DSPIC30F6014A.vectors:
        trap = vector.level or vector.irq is None
        target = TRAP_HANDLERS.get(vector.name, HANDLER) if trap else ISR + 0x20 * (vector.irq % 4)
        firmware.put(vector.ivt, [target])
        firmware.put(vector.aivt, [target])
    corcon = generator.getrandbits(16) & MODE_CORCON
    _start(firmware, generator, shape, corcon)
    writer = BodyWriter(firmware, generator, shape, corcon)
    writer.body()
    firmware.end = writer.at
    resets = not shape.calm and generator.random() < 0.6
    firmware.put(firmware.end, words_of("RESET") if resets else words_of("GOTO Expr", n=CODE))
    _handlers(firmware, generator)
    return firmware


def _start(firmware: Firmware, generator: random.Random, shape: Shape, corcon: int) -> None:
    """Emit the start-up code: timers at 0x100, and at CODE the state that each pass destroys."""
    low, high = shape.periods
    at = 0x100
    for n in range(15):
        at = firmware.put(at, literal(generator.randrange(0x900, 0x2600, 2), n))
    for sfr, value in (
        ("PR1", generator.randrange(low, high)),
        ("PR2", generator.randrange(low, high)),
        ("PR3", generator.randrange(low, high)),
        ("IPC0", generator.choice((0x4444, 0x5123, 0x1444))),
        ("IPC1", generator.choice((0x4444, 0x0521, 0x0026))),
        ("IEC0", 0x00C8),
        ("T1CON", 0x8000),
        ("T2CON", 0x8000),
        ("T3CON", 0x8000),
        ("TBLPAG", 0),
    ):
        at = firmware.put(at, to_sfr(sfr, value))
    if generator.random() < 0.5:
        at = firmware.put(at, to_sfr("SPLIM", 0x2700))
    firmware.put(at, words_of("GOTO Expr", n=CODE))
    at = CODE
    modulo = generator.random() < 0.4
    for sfr, value in (
        ("CORCON", corcon),
        ("PSVPAG", 0),
        ("XMODSRT", 0x1000),
        ("XMODEND", 0x103F),
        ("YMODSRT", 0x1900),
        ("YMODEND", 0x191F),
        ("XBREV", generator.choice((0x8008, 0x8010, 8)) if modulo else 0),
        ("MODCON", generator.getrandbits(16) if modulo else 0),
        ("T1CON", 0x8000),
        ("T2CON", 0x8000),
        ("T3CON", 0x8000),
        ("IEC0", 0x00C8),
        ("SR", 0),
    ):
        at = firmware.put(at, to_sfr(sfr, value))
    firmware.put(at, words_of("MOV{.W} f, Wnd", f=PROGRESS, d=0) + words_of("GOTO Wn", s=0))
    firmware.ram[PROGRESS] = BODY


def _handlers(firmware: Firmware, generator: random.Random) -> None:
    sfrs = DSPIC30F6014A.sfrs
    for number in range(4):
        at = ISR + 0x20 * number
        for _ in range(generator.randrange(3)):
            x = Operands(B=0, f=generator.randrange(0x2500, 0x2540, 2) & 0x1FFE)
            at = firmware.put(at, list(codec.encode(BY_SYNTAX["INC{.B} f"], x)))
        for flag in (3, 6, 7):
            at = firmware.put(at, words_of("BCLR{.B} f, #bit4", f=sfrs["IFS0"].address, b=flag))
        firmware.put(at, words_of("RETFIE"))
    clear = words_of("CLR{.B} f", B=1, f=sfrs["INTCON1"].address)
    count = words_of("INC{.B} f", B=0, f=TRAP_COUNT) + words_of("BTSC{.B} f, #bit4", f=TRAP_COUNT, b=6)
    firmware.put(HANDLER, clear + count + words_of("RESET") + words_of("RETFIE"))
    firmware.put(STACK_TRAP, clear + words_of("RESET"))
    firmware.put(MATH_TRAP, words_of("CLR{.B} f", B=0, f=sfrs["INTCON1"].address) + words_of("RETFIE"))
    for number in range(LEAF_COUNT):
        at = LEAVES + 2 * LEAF_WORDS * number
        for _ in range(generator.randrange(3)):
            at = firmware.put(at, words_of("BTG{.B} f, #bit4", f=0x900 + number, b=generator.randrange(8)))
        back = words_of("RETLW{.B} #lit10, Wn", B=0, k=generator.getrandbits(10), d=generator.randrange(8))
        firmware.put(at, back if number % 2 else words_of("RETURN"))
