"""Drills: very short random programs, many per image, that access device registers in all modes of access.

A drill has a few instructions and a branch to itself. They access registers by address or by pointer, as words and
bytes, plainly, under REPEAT, in a DO loop or around Idle. Interrupt handlers do the same. Every row of the
instruction table that reads or writes data memory is used. The targets of pointers are in the W registers at the
start of a run, so the same native code accesses many registers. Seed and chip determine everything.
"""

from __future__ import annotations

import random
from dataclasses import dataclass, field
from functools import cache, partial
from typing import Any, Final

from emu.chips.chip import Chip
from emu.dspic30f.isa import codec, table
from emu.dspic30f.isa.fields import Operands
from emu.dspic30f.isa.row import Row
from tests.emu.jit.comparison.random_firmware import words_of

from .device_programs import CHIPS, family
from .device_scenes import SCENES, Scene

CODE: Final = 0x200
DRILLS: Final = 40
"""Number of drills per image."""
KINDS: Final = {"plain": 4, "REPEAT": 3, "DO": 4, "handler": 4, "stack": 2, "nap": 1, "program": 0.3}
"""Kinds of drills, with their weights."""
HANDLERS: Final = 4
ROW: Final = 64
"""Program addresses per row of flash (dspic30f6014a.md §16)."""
MODES: Final = ("CORCON", "MODCON", "XBREV", "SPLIM", "INTCON1", "SR", "DOSTARTL", "DOENDL")
"""Registers drawn less often, because every value of a processor mode needs separate native code."""
CONTROL: Final = ("OSCCON", "RCON", "NVMCON", "PMD1", "PMD2", "PMD3")
"""Registers drawn less often, because they stop, reset or disable all other devices."""
_FLOWS: Final = ("BRA", "CALL", "GOTO", "RCALL", "DO", "REPEAT", "RETURN", "RETFIE", "RETLW", "RESET", "PWRSAV", "LNK",
                 "ULNK", "DISI", "CPSEQ", "CPSNE", "CPSGT", "CPSLT")  # fmt: skip
MEMORY: Final = [row for row in table.ROWS if row.mnemonic not in _FLOWS and set("pqghofi") & set(row.fields)]
"""Rows that can access data memory and continue with the next instruction or skip it."""
BY_ADDRESS: Final = [row for row in MEMORY if "f" in row.fields]
BY_POINTER: Final = [row for row in MEMORY if "f" not in row.fields and "i" not in row.fields]
PREFETCHING: Final = [row for row in MEMORY if "i" in row.fields]
PLAIN: Final = [row for row in BY_ADDRESS + BY_POINTER if not row.mnemonic.startswith(("BTSS", "BTSC"))]
_REGISTERS_FIRST: Final = 0x20
"""First data address after the memory-mapped W registers (isa.md §1.2)."""


@cache
def registers_of(chip: str) -> list[Any]:
    """Return all registers of a chip, including those of the CPU, without W registers."""
    return [sfr for sfr in CHIPS[chip].sfrs.values() if sfr.size == 2 and sfr.address >= _REGISTERS_FIRST]


@dataclass
class Image:
    """Program words by address, addresses of the drills, and uses of the W registers."""

    chip: Chip
    words: dict[int, int] = field(default_factory=dict)
    drills: list[tuple[int, str]] = field(default_factory=list)
    """Start address and kind of each drill."""
    rest: int = 0
    """Address of a branch to itself."""
    handlers: range = range(0)
    """Program addresses of the interrupt handlers."""
    end: int = 0
    row: int = 0
    """Address of a flash row whose code the drills reprogram and call."""
    scenes: list[Scene] = field(default_factory=list)
    """Settings of active devices; a base state uses one or more of them."""
    pool: list[Any] = field(default_factory=list)
    """Registers that the image accesses most."""
    pointers: list[int] = field(default_factory=list)
    index: int = 0
    data: list[int] = field(default_factory=list)
    """W registers that hold data."""

    def stretches(self) -> dict[int, list[int]]:
        """Return consecutive words as lists, by first address."""
        found: dict[int, list[int]] = {}
        start = -2
        for address in sorted(self.words):
            if start < 0 or address != start + 2 * len(found[start]):
                start = address
                found[start] = []
            found[start].append(self.words[address])
        return found


class ImageWriter:
    """Generator of one image."""

    def __init__(self, seed: int, chip: Chip) -> None:
        self.draw: Final = random.Random(f"{seed} drills")
        self.image: Final = Image(chip)
        self.at = CODE
        self.leaves: list[int] = []
        draw, image = self.draw, self.image
        everything = registers_of(chip.name)
        names = draw.sample(sorted(SCENES), 4)
        image.scenes = [SCENES[name](draw) for name in names]
        about = {family(name) for scene in image.scenes for name, _ in scene}
        image.pool = everything
        choice = draw.random()
        if choice < 0.5:
            image.pool = [sfr for sfr in everything if family(sfr.name) in about] or everything
        elif choice < 0.6:  # accesses W registers as memory
            image.pool = [sfr for sfr in chip.sfrs.values() if sfr.address < _REGISTERS_FIRST]
        registers = list(range(15))
        draw.shuffle(registers)
        if draw.random() < 0.5:
            registers.sort(key=lambda number: number not in (8, 9, 10, 11, 13))
        image.pointers, image.index, image.data = registers[:7], registers[7], registers[8:]

    def register(self) -> Any:
        """Return a random register for an instruction."""
        draw = self.draw
        while True:
            sfr = draw.choice(self.image.pool if draw.random() < 0.8 else registers_of(self.image.chip.name))
            if sfr.name in MODES + CONTROL and draw.random() < 0.7:
                continue
            return sfr

    def put(self, words: list[int]) -> None:
        """Append words at the current address."""
        for word in words:
            self.image.words[self.at] = word
            self.at += 2

    def access(self, rows: list[Row] | None = None, repeated: bool = False) -> list[int]:
        """Return the words of one instruction that reads or writes data memory."""
        draw = self.draw
        while True:
            kind = draw.random()
            chosen = rows or (BY_ADDRESS if kind < 0.45 else BY_POINTER if kind < 0.95 else PREFETCHING)
            row = draw.choice(chosen)
            if repeated and not row.repeat_ok:
                continue
            x = self.operands(row)
            if x is not None:
                return list(codec.encode(row, x))

    def operands(self, row: Row) -> Operands | None:
        """Return random fields of `row`, with pointers for its addresses; None if the fields are illegal."""
        draw, image, fields = self.draw, self.image, row.fields
        x = Operands(**{f.letter: f.get(*[draw.getrandbits(24) for _ in row.pattern.mask]) for f in row.pattern.fields})
        if "z" in fields:
            x.z = 0
        if "f" in fields:
            byte = fields["f"].scale == 1 and getattr(x, "B", 1)
            where = draw.random()
            address = self.register().address if where < 0.95 else draw.randrange(0, 32)
            x.f = address & ~1 | (draw.randrange(2) if byte else 0)
        if draw.random() < 0.07:  # also the stack pointer, and one register in several roles
            return None if row.broken(x) else x
        for letter in "pqgh":
            if letter in fields and draw.random() < 0.2:
                setattr(x, letter, 0)
        offset = "o" in fields
        loads, stores = offset and row.syntax.endswith("Wnd"), offset and not row.syntax.endswith("Wnd")
        for register, modes, indexed in (("s", "pg", loads), ("d", "qh", stores)):
            if register in fields:
                pointing = indexed or any(letter in fields and getattr(x, letter) for letter in modes)
                number = draw.choice(image.pointers if pointing else image.data)
                setattr(x, register, number // fields[register].scale * fields[register].scale)
        if "w" in fields:
            wanted = ("g" in fields and x.g >= 6) or ("h" in fields and x.h >= 6)
            x.w = image.index if wanted else draw.choice(image.data)
        if offset:
            x.o = draw.choice((0, 1, -1, 2, draw.randrange(-20, 20)))
        return None if row.broken(x) else x

    def loop_end(self) -> None:
        """Append an access that may be the last instruction of a DO loop."""
        self.put(self.access(PLAIN))

    def drill(self) -> None:
        """Append one drill of a random kind."""
        draw, start = self.draw, self.at
        kind = draw.choices(*zip(*KINDS.items(), strict=True))[0]
        if kind == "plain":
            for _ in range(draw.randrange(2, 6)):
                self.put(self.access())
        elif kind == "REPEAT":
            for _ in range(2):
                if draw.random() < 0.7:
                    self.put(words_of("REPEAT #lit14", k=draw.choice((0, 1, 2, 3, 7))))
                else:
                    self.put(words_of("REPEAT Wn", s=draw.choice((self.image.index, draw.choice(self.image.data)))))
                self.put(self.access(repeated=True))
        elif kind == "DO":
            self.loop()
        elif kind == "stack":
            for _ in range(draw.randrange(2, 5)):
                self.put(self.stacking())
        elif kind == "program":
            self.programming()
        elif kind == "nap":
            self.put(self.access())
            self.put(words_of("PWRSAV #lit1", k=int(draw.random() < 0.8)))
            self.put(self.access())
        else:  # the interrupt handlers make the accesses
            self.put(words_of("NOP") * draw.randrange(3))
            self.put(words_of("DISI #lit14", k=draw.randrange(6)) if draw.random() < 0.3 else [])
            self.put(self.access())
            self.put(words_of("NOP") * 2)
        self.put(words_of("BRA Expr", n=-1))
        self.image.drills.append((start, kind))

    def loop(self) -> None:
        """Append a DO loop of accesses, also as its last instruction."""
        draw, start = self.draw, self.at
        self.put([0, 0])
        for _ in range(draw.randrange(1, 4)):
            if draw.random() < 0.2:
                self.put(words_of("REPEAT #lit14", k=draw.randrange(3)))
                self.put(self.access(repeated=True))
            else:
                self.put(self.access())
        self.put(words_of("NOP"))
        self.loop_end()
        length = (self.at - 2 - start - 4) // 2
        for word in words_of("DO #lit14, Expr", k=draw.choice((0, 1, 2)), n=length):
            self.image.words[start] = word
            start += 2

    def programming(self) -> None:
        """Append a key sequence and a write of WR, sometimes wrong, and a call into the flash row (dspic30f6014a.md
        §16)."""
        draw, sfrs = self.draw, self.image.chip.sfrs
        w = draw.choice(self.image.data)
        for key in (0x55, 0xAA):
            self.put(words_of("MOV{.W} #lit16, Wnd", k=key, d=w))
            self.put(words_of("MOV{.W} Wns, f", s=w, f=sfrs["NVMKEY"].address))
            self.put(words_of("NOP") * (draw.random() < 0.1))
        if draw.random() < 0.8:
            self.put(words_of("BSET{.B} f, #bit4", f=sfrs["NVMCON"].address + 1, b=7))
        else:
            self.put(words_of("MOV{.W} Wns, f", s=draw.choice(self.image.data), f=sfrs["NVMCON"].address))
        self.put(words_of("NOP") * draw.randrange(3))
        self.put(words_of("CALL Expr", n=self.image.row + 2 * draw.choice((0, 0, 1, 2))))
        self.put(self.access(PLAIN))

    def programmed_row(self) -> None:
        """Append a flash row of accesses and literals that ends in RETURN, and a RETURN after it for the case that
        the row is erased."""
        while self.at % ROW:
            self.put(words_of("NOP"))
        self.image.row = self.at
        while self.at < self.image.row + ROW - 4:
            if self.draw.random() < 0.4:
                self.put(words_of("MOV{.W} #lit16, Wnd", k=0xFFFF, d=self.draw.choice(self.image.data)))
            else:
                self.put(self.access([row for row in PLAIN if not row.word2]))
        self.put(words_of("RETURN"))
        self.put(words_of("NOP"))
        self.put(words_of("RETURN"))

    def stacking(self) -> list[int]:
        """Return one use of the stack: pushes, pops, calls and frames of every form (isa.md §10)."""
        draw = self.draw
        w, even = draw.randrange(15), draw.randrange(0, 14, 2)
        leaf = draw.choice(self.leaves)
        return draw.choice((
            partial(words_of, "PUSH f", f=self.register().address),
            partial(words_of, "POP f", f=self.register().address),
            partial(words_of, "MOV{.B} Ws, Wd", s=w, g=0, d=15, h=3, w=0, B=0),
            partial(words_of, "MOV{.B} Ws, Wd", s=w, g=0, d=15, h=5, w=0, B=draw.randrange(2)),
            partial(words_of, "MOV{.B} Ws, Wd", s=15, g=4, d=w, h=0, w=0, B=0),
            partial(words_of, "MOV{.B} Ws, Wd", s=15, g=4, d=15, h=3, w=0, B=0),
            partial(words_of, "MOV.D Wns, Wd", s=even, d=15, q=3),
            partial(words_of, "MOV.D Ws, Wnd", s=15, p=4, d=even),
            partial(words_of, "INC{.B} Ws, Wd", s=w, p=0, d=15, q=3, B=0),
            partial(words_of, "MOV{.B} Wns, [Wd+Slit10]", s=w, d=15, o=draw.randrange(-4, 5), B=0),
            partial(words_of, "PUSH.S"),
            partial(words_of, "POP.S"),
            partial(words_of, "LNK #lit14", k=draw.randrange(0, 12, 2)),
            partial(words_of, "ULNK"),
            partial(words_of, "RCALL Expr", n=(leaf - self.at - 2) // 2),
            partial(words_of, "CALL Expr", n=leaf),
            partial(words_of, "RCALL Expr", n=0),
        ))()  # fmt: skip

    def leaf(self) -> int:
        """Append a callee and return its address."""
        start = self.at
        self.put(self.access(PLAIN))
        end = self.draw.choice(("RETURN", "RETLW{.B} #lit10, Wn", "RETFIE"))
        self.put(words_of(end, d=self.draw.choice(self.image.data), k=17, B=0) if "RETLW" in end else words_of(end))
        return start

    def handler(self, number: int) -> int:
        """Append an interrupt handler that makes accesses and, for even `number`, clears all flags. Return its
        address."""
        start = self.at
        for _ in range(self.draw.randrange(1, 4)):
            if self.draw.random() < 0.15:
                self.put(words_of("REPEAT #lit14", k=self.draw.randrange(4)))
                self.put(self.access(PLAIN, repeated=True))
            else:
                self.put(self.access(PLAIN))
        if not number & 1:
            for name in ("IFS0", "IFS1", "IFS2"):
                self.put(words_of("CLR{.B} f", B=0, f=self.image.chip.sfrs[name].address))
        self.put(words_of("RETFIE"))
        return start

    def write(self) -> Image:
        """Generate the whole image."""
        image, chip = self.image, self.image.chip
        image.words |= {0: 0x040000 | CODE, 2: 0}
        image.rest = self.at
        self.put(words_of("BRA Expr", n=-1))
        self.leaves = [self.leaf() for _ in range(3)]
        handlers = [self.handler(number) for number in range(HANDLERS)]
        trap = self.at
        image.handlers = range(handlers[0], trap, 2)
        self.put(words_of("CLR{.B} f", B=0, f=chip.sfrs["INTCON1"].address))
        self.put(words_of("CLR{.B} f", B=0, f=chip.sfrs["CORCON"].address) if self.draw.random() < 0.5 else [])
        self.put(words_of("RETFIE"))
        for irq in chip.interrupts:
            vector = chip.vectors[irq + 8]
            image.words[vector.ivt] = image.words[vector.aivt] = handlers[irq % HANDLERS]
        for vector in chip.vectors[:8]:
            image.words[vector.ivt] = image.words[vector.aivt] = trap
        self.programmed_row()
        for _ in range(DRILLS):
            self.drill()
        image.end = self.at
        return image


def image_of(seed: int, chip: Chip) -> Image:
    """Return the image of a seed."""
    return ImageWriter(seed, chip).write()
