"""Random programs that mainly access device registers, and their comparison between engines.

Every register of every device is accessed: as words and bytes, by address and by pointer, read, written and modified.
The accesses are plain, under REPEAT, in DO loops (also as their last instruction), or in handlers. They occur with
the module on or off, and after Idle and Sleep. Short timer periods place events on every cycle of the accesses. The
chip is bare or on a robot. External bytes, edges, levels and light arrive at random cycles. Seed and chip determine
everything.
"""

from __future__ import annotations

import random
from collections import Counter
from dataclasses import dataclass, field
from functools import cache, partial
from itertools import takewhile
from typing import Any

import numpy as np

from emu.boards.epuck.board import Epuck
from emu.chips.chip import Chip
from emu.chips.dspic30f6014a import DSPIC30F6014A
from emu.dspic30f.jit.engine import BLOCK_LEVEL, HOT_LEVEL, STEP_LEVEL, JitEngine
from emu.machine.machine import Machine
from emu.machine.stops import Stop
from emu.peripherals.i2c.bus import I2cDevice
from emu.peripherals.i2c.slave import ExternalMaster
from tests.emu.chips.made_up import CHIPS
from tests.emu.cpu.cpu_rig import START, assemble
from tests.emu.jit.comparison.engine_pair import QuickCompiler

from .device_scenes import SCENES

LENGTH = 45
"""Number of statements in the loop of a program."""
CHUNKS = 14
"""Number of comparisons of the machines, some hundred to a few thousand Tcy apart."""
REGIONS = 40
"""Number of compiled regions after which a program is abandoned: it changes processor modes, and each mode needs
separate code."""
BUFFER = 0x1000
_CONTROL = ("OSCCON", "RCON", "NVMCON", "PMD1", "PMD2", "PMD3")
"""Registers drawn less often, because they stop, reset or disable all other devices."""
_FAMILIES = ({"TMR", "PR", "T"}, {"PORT", "LAT", "TRIS", "CNEN", "CNPU"}, {"IFS", "IEC", "IPC", "INTCON"},
             {"ADCON", "ADCBUF", "ADCHS", "ADCSSL", "ADPCFG"}, {"NVMCON", "NVMADR", "NVMADRU", "NVMKEY"},
             {"DCICON", "DCISTAT", "TSCON", "RSCON", "RXBUF", "TXBUF"})  # fmt: skip
"""Name stems of registers that belong to one device. The registers of other devices have the letters before the
number in common."""
HOT = 14
"""Number of registers that a program accesses most."""
CORE = ("DCOUNT", "DCOUNT", "DCOUNT", "RCOUNT", "RCOUNT", "SR", "SR", "CORCON", "DOSTARTL", "DOENDL", "DOENDH",
        "PSVPAG", "TBLPAG")  # fmt: skip
"""CPU registers that control execution, repeated according to their weight."""
_INPUTS = ("RD4", "RF6", "RC3", "RC14", "RA12", "RA13", "RD8", "RD9", "RF2", "RF3", "RG2", "RG3", "RC1", "RC2", "RF0",
           "RG13", "RF7", "RB5", "RB12")  # fmt: skip


@cache
def words_of(chip: str) -> list[Any]:
    """Return the 16-bit registers of all devices of a chip in CHIPS."""
    first = CHIPS[chip].sfrs["INTCON1"].address
    return [sfr for sfr in CHIPS[chip].sfrs.values() if sfr.size == 2 and sfr.address >= first]


def stack_of(chip: Chip) -> int:
    """Return the start address of a program's stack: the last eighth of RAM."""
    ram = chip.data["ram"]
    return ram.end - (ram.end - ram.start) // 8


@dataclass
class Writer:
    """Generator of the statements of one program; it counts the modes in which they access registers."""

    draw: random.Random
    chip: Chip
    pool: list[Any]
    touched: Counter[tuple[str, str]] = field(default_factory=Counter)
    """Number of accesses by register and mode."""
    loops: int = 0

    def sfr(self) -> Any:
        """Return a random register, mostly one of the devices that this program uses."""
        everything = words_of(self.chip.name)
        chosen = self.draw.choice(self.pool if self.draw.random() < 0.85 else everything)
        return self.draw.choice(everything) if chosen.name in _CONTROL and self.draw.random() < 0.9 else chosen

    def note(self, sfr: Any, way: str) -> str:
        """Count an access to a register and return its address as text."""
        self.touched[sfr.name, way] += 1
        return f"{sfr.address:#x}"

    def data(self) -> str:
        """Return a random W register of the main program that holds data."""
        return f"w{self.draw.randrange(8)}"

    def direct(self, place: str) -> str:
        """Return a one-word instruction that accesses a register by address."""
        draw, sfr, w = self.draw, self.sfr(), self.data()
        odd = draw.randrange(2)
        bit, bit8 = draw.randrange(16), draw.randrange(8)
        low = sfr.address < 0x1FFE
        word, byte = self.note(sfr, f"{place} word"), f"{sfr.address + odd:#x}"
        forms = [f"mov {w}, {word}", f"mov {word}, {w}", f"mov {w}, {word}", f"mov {word}, {w}", f"push {word}",
                 f"pop {word}"]  # fmt: skip
        if low:
            forms += [f"inc {word}", f"xor {word}", f"btg {word}, #{bit}", f"cp0 {word}", f"ior {word}, WREG",
                      f"setm {word}", f"sl {word}"]  # fmt: skip
            if draw.random() < 0.45:
                self.note(sfr, f"{place} byte")
                forms = [f"mov.b {byte}, WREG", f"mov.b WREG, {byte}", f"bset.b {byte}, #{bit8}", f"clr.b {byte}"]
                forms += [f"bclr.b {byte}, #{bit8}", f"inc.b {byte}", f"com.b {byte}, WREG", f"and.b {byte}"]
        return draw.choice(forms)

    def pointer(self, place: str, p: str = "w8", q: str = "w9") -> list[str]:
        """Return instructions that load a pointer to a register and access the register through it."""
        draw, sfr, w = self.draw, self.sfr(), self.data()
        start = draw.choice((0, 0, 2, -2))
        moved = {0: f"[{p}]", 2: draw.choice((f"[--{p}]", f"[{p}-2]")), -2: f"[++{p}]"}[start]
        if start == 0 and draw.random() < 0.5:
            moved = draw.choice((f"[{p}++]", f"[{p}--]"))
        offset = moved.endswith("-2]")
        if draw.random() < 0.4 and start == 0:
            self.note(sfr, f"{place} pointer byte")
            start = draw.randrange(2)
            forms = [f"mov.b {w}, {moved}", f"mov.b {moved}, {w}", f"inc.b {moved}, {w}", f"ior.b {w}, #5, {moved}"]
            if "+" not in moved and "--" not in moved:
                forms += [f"bset.b [{p}], #{draw.randrange(8)}", f"inc.b [{p}], [{p}]"]
        else:
            self.note(sfr, f"{place} pointer word")
            forms = [f"mov {w}, {moved}", f"mov {moved}, {w}"]
            if not offset:
                forms += [f"add {w}, {moved}, {w}", f"mov {moved}, [{q}]", f"mov [{q}], {moved}", f"cp0 {moved}"]
            if start == 0:
                forms += [f"btg [{p}], #{draw.randrange(16)}", f"inc [{p}], [{p}]", f"btss [{p}], #3"]
                forms += [f"mov.d [{p}], w2", f"mov.d w4, [{p}]"]
        target = BUFFER + 2 * draw.randrange(64)
        return [f"mov #{sfr.address + start:#x}, {p}", f"mov #{target:#x}, {q}", draw.choice(forms)]

    def core(self, place: str) -> str:
        """Return a one-word instruction with a register of the CPU.

        Counts mostly decrease, so that the program makes progress.
        """
        draw, name, w = self.draw, self.draw.choice(CORE), self.data()
        word = self.note(self.chip.sfrs[name], f"{place} core")
        forms = [f"mov {w}, {word}", f"mov {word}, {w}", f"clr {word}", f"lsr {word}", f"clr.b {word}",
                 f"lsr.b {word}", f"btg {word}, #{draw.randrange(16)}", f"push {word}", f"pop {word}",
                 f"mov.b {word}, WREG"]  # fmt: skip
        if name == "CORCON":
            forms += [f"btg {word}, #2", f"bclr {word}, #3", f"btg {word}, #11"]  # PSV, IPL3, EDT
        if name == "SR":
            forms += [f"bset.b {word}, #{draw.randrange(5, 8)}", f"inc {word}"]
        return draw.choice(forms)

    def repeated(self, place: str) -> list[str]:
        """Return REPEAT and an access, by address or through an incremented pointer."""
        draw, sfr, count = self.draw, self.sfr(), self.draw.choice((0, 1, 2, 3, 7, 15))
        if draw.random() < 0.15:
            return [f"repeat #{count}", self.core(f"{place} REPEAT")]
        self.note(sfr, f"{place} REPEAT")
        word = f"{sfr.address:#x}"
        head = f"repeat #{count}"
        if draw.random() < 0.5:
            forms = (f"mov {word}, w1", f"mov w1, {word}", f"inc {word}", f"btg.b {word}, #1", f"push {word}")
            return [head, draw.choice(forms)]
        form = draw.choice(("mov [w8++], [w9++]", "mov [w9++], [w8++]", "mov [w8], [w9++]", "mov.b [w8++], [w9++]",
                            "mov w3, [w8++]", "inc [w8], [w8++]", "add w0, [w8++], w0"))  # fmt: skip
        return [f"mov #{sfr.address:#x}, w8", f"mov #{BUFFER + 0x100:#x}, w9", head, form]

    def loop(self) -> list[str]:
        """Return a DO loop. Its last instruction is an access too: by address, by pointer, or to the loop's own
        registers."""
        self.loops += 1
        label = f"end{self.loops}"
        body = [line for _ in range(self.draw.randrange(1, 4)) for line in self.statement("DO", plain=True)]
        kind = self.draw.random()
        access = self.core if kind < 0.6 else self.direct
        *before, last = self.pointer("DO end") if kind < 0.25 else [access("DO end")]
        if last.startswith("btss"):
            last = "nop"
        return [f"do #{self.draw.choice((0, 1, 2, 5))}, {label}", *body, *before, "nop", f"{label}: {last}"]

    def statement(self, place: str = "", plain: bool = False) -> list[str]:
        """Return one random statement as lines."""
        draw, kind = self.draw, self.draw.random()
        if kind < 0.42:
            return [self.direct(place)]
        if kind < 0.66:
            return self.pointer(place)
        if kind < 0.74:
            return self.repeated(place)
        if kind < 0.80:
            return [f"btss {self.note(self.sfr(), 'skip')}, #{draw.randrange(8)}", self.direct(place)]
        if kind < 0.83:
            return [self.core(place)]
        if plain:
            return ["nop"] * draw.randrange(3)
        if kind < 0.88:
            return self.loop()
        if kind < 0.90:
            return [f"repeat #{draw.randrange(40)}", "nop"]
        if kind < 0.91:
            return self.nap()
        if kind < 0.94:
            return [draw.choice((f"disi #{draw.randrange(20)}", "clrwdt", f"mov w{draw.randrange(8)}, 0x42"))]
        if kind < 0.955:
            return [draw.choice(("tblwtl w1, [w9++]", "tblwth.b w1, [w9]", "tblrdl [w9++], w2"))]
        if kind < 0.96:
            name = draw.choice(("PMD1", "PMD2"))
            return [f"mov #{draw.choice((0, 0, draw.randrange(0x10000)))}, w0", f"mov w0, {self.at(name)}"]
        if kind < 0.97:
            return self.setting()
        if kind < 0.98:
            return self.clock()
        return [f"add {self.data()}, {self.data()}, {self.data()}"]

    def nap(self) -> list[str]:
        """Return code that enters Idle until timer 1 matches, rarely Sleep until an external INT0 edge."""
        wake = [f"mov #{self.draw.choice((3, 20, 60, 150))}, w0", f"mov w0, {self.at('PR1')}",
                f"bclr {self.at('PMD1')}, #11", "mov #0x8000, w0", f"mov w0, {self.at('T1CON')}"]  # fmt: skip
        sources = {source.name: source for source in self.chip.interrupts.values()}
        for name in ("T1", "INT0"):
            word, bit = sources[name].enable
            levels = self.at(sources[name].priority[0])
            wake += [f"bset {self.at(word)}, #{bit}", "mov #0x4444, w0", f"mov w0, {levels}"]
        return [*wake, "pwrsav #0" if self.draw.random() < 0.04 else "pwrsav #1"]

    def clock(self) -> list[str]:
        """Return a write of OSCCON with its key, which may select another clock source and Tcy (§3)."""
        low, high = f"{self.note(self.chip.sfrs['OSCCON'], 'keyed'):s}", f"{self.chip.sfrs['OSCCON'].address + 1:#x}"
        address, first, second = self.draw.choice(((low, 0x46, 0x57), (low, 0x46, 0x57), (high, 0x78, 0x9A)))
        value = self.draw.choice((0, 1, 1, 0x40, 0x41, 0x80, 0x02))
        return [f"mov #{address}, w8", f"mov #{first:#x}, w0", f"mov #{second:#x}, w1", f"mov #{value:#x}, w2",
                "mov.b w0, [w8]", "mov.b w1, [w8]", "mov.b w2, [w8]"]  # fmt: skip

    def setting(self) -> list[str]:
        """Return code that sets up a random device."""
        return self.written(SCENES[self.draw.choice(sorted(SCENES))](self.draw))

    def written(self, settings: list[tuple[str, int]]) -> list[str]:
        """Return code that writes values to registers in order; registers that the chip lacks are omitted."""
        lines = []
        for name, value in settings:
            if name in self.chip.sfrs:
                lines += [f"mov #{value:#x}, w0", f"mov w0, {self.note(self.chip.sfrs[name], 'setting')}"]
        return lines

    def at(self, name: str) -> str:
        """Return the address of a register as text."""
        return f"{self.chip.sfrs[name].address:#x}"

    def handler(self, number: int) -> list[str]:
        """Return a handler that accesses devices through its own W registers and clears all flags, by words or
        bytes."""
        lines = [f"handler{number}: inc w11, w11"]
        for _ in range(self.draw.randrange(4)):
            way = self.draw.random()
            direct = self.direct("handler") if way > 0.15 else self.core("handler")
            if way < 0.5 and "WREG" not in direct and not direct.startswith(("push", "pop")):
                lines.append(direct)
            else:
                lines += [line for line in self.pointer("handler", "w12", "w13") if "w4" not in line]
        clear = self.draw.choice(("clr", "clr", "clr.b"))
        for name in ("IFS0", "IFS1", "IFS2"):
            lines.append(f"{clear} {self.at(name)}")
            if clear == "clr.b":
                lines.append(f"clr.b {self.chip.sfrs[name].address + 1:#x}")
        return [*lines, "retfie"]


def family(name: str) -> frozenset[str]:
    """Return the family of devices to which a register belongs, by the letters at the beginning of its name."""
    letters = "".join(takewhile(str.isalpha, name)) if not name.startswith(("PORT", "LAT", "TRIS")) else name[:-1]
    return frozenset(next((one for one in _FAMILIES if letters in one), {letters}))


def program(seed: int, chip: Chip = DSPIC30F6014A) -> tuple[str, Writer]:
    """Return assembly text and its writer: several active devices whose registers are accessed repeatedly."""
    draw = random.Random(seed)
    writer, words, stack = Writer(draw, chip, []), words_of(chip.name), stack_of(chip)
    lines = [f"mov #{stack:#x}, w15", "clr 0x42"]
    set_up: set[str] = set()
    for name in draw.sample(sorted(SCENES), draw.choice((1, 2, 2, 3))):
        settings = SCENES[name](draw)
        set_up |= {register for register, _ in settings}
        lines += writer.written(settings)
    devices = {family(name) for name in set_up} | {family(draw.choice(words).name)}
    pool = [sfr for sfr in words if family(sfr.name) in devices]
    writer.pool[:] = draw.sample(pool, min(HOT, len(pool)))
    for name in ("IEC0", "IEC1", "IEC2"):
        lines += [f"mov #{draw.choice((0, 0xFFFF, draw.randrange(0x10000)))}, w0", f"mov w0, {writer.at(name)}"]
    for number in range(draw.randrange(4)):
        lines += [f"mov #{draw.randrange(0x10000)}, w0", f"mov w0, {writer.at(f'IPC{3 * number}')}"]
    values = (0x8000, 0xA000, 0x8030, 0xFFFF, draw.randrange(0x10000), draw.randrange(64))
    lines += [f"mov #{draw.choice(values)}, w{number}" for number in range(8)]
    lines += [f"mov #{BUFFER:#x}, w{number}" for number in (8, 9, 12, 13)]
    lines += [f"loop: mov #{stack:#x}, w15", "inc w10, w10"]
    if draw.random() < 0.8:
        lines.append("clr.b 0x42")
    for _ in range(LENGTH):
        lines += writer.statement("main")
    lines.append("goto loop")
    for number in range(2):
        lines += writer.handler(number)
    lines += [f"trap: clr {writer.at('INTCON1')}", f"mov #{stack:#x}, w15", "clr 0x42", "clr 0x44", "goto loop"]
    return "\n".join(lines), writer


@dataclass
class Subject:
    """Machine with a program, and its recorded outputs."""

    machine: Machine
    heard: list[tuple[int, int, int]] = field(default_factory=list)
    rendered: list[tuple[int, int]] = field(default_factory=list)
    master: ExternalMaster | None = None


@dataclass
class Scribe(I2cDevice):
    """I2C device that acknowledges some bytes and records all events."""

    subject: Subject

    def start(self, read: bool, cycle: int) -> bool:
        self.subject.heard.append((-1, int(read), cycle))
        return True

    def write(self, byte: int, cycle: int) -> bool:
        self.subject.heard.append((-2, byte, cycle))
        return bool(byte & 7)

    def read(self, cycle: int) -> int:
        self.subject.heard.append((-3, 0, cycle))
        return cycle & 0xFF

    def stop(self, cycle: int) -> None:
        self.subject.heard.append((-4, 0, cycle))


def flash(text: str, chip: Chip = DSPIC30F6014A) -> dict[int, list[int]]:
    """Return consecutive program words by address, including vectors."""
    words, labels = assemble(text)
    words |= {0: 0x040000 | START, 2: 0}
    for irq in chip.interrupts:
        words[chip.vectors[irq + 8].ivt] = words[chip.vectors[irq + 8].aivt] = labels[f"handler{irq >> 1 & 1}"]
    for vector in chip.vectors[:8]:
        words[vector.ivt] = words[vector.aivt] = labels["trap"]
    stretches: dict[int, list[int]] = {}
    start = -1
    for address in sorted(words):
        if start < 0 or address != start + 2 * len(stretches[start]):
            start = address
            stretches[start] = []
        stretches[start].append(words[address])
    return stretches


def subject(seed: int, engine: str, stretches: dict[int, list[int]], chip: Chip = DSPIC30F6014A) -> Subject:
    """Return a machine about to run the program: a bare chip, or a robot, if the chip fits one, whose camera records
    the rendered lines."""
    draw = random.Random(seed ^ 0x5EED)
    robot = draw.random() < 0.6 and chip is DSPIC30F6014A
    camera = draw.choice(("PO6030K", "PO8030D", "PO3030K", None))
    board = partial(Epuck, camera=camera, selector=draw.randrange(16), seed=seed & 0xFFFF) if robot else None
    machine = Machine(chip, engine=engine, ipl_slip=int(draw.random() < 0.2), board=board)
    made = Subject(machine)
    if isinstance(machine.runner, JitEngine):
        machine.runner.threshold, machine.runner.wait = 1, True
        machine.runner.compiler = QuickCompiler({5: HOT_LEVEL, 21: BLOCK_LEVEL}.get(seed % 32, STEP_LEVEL))
    machine.stop_on_fault = False
    if draw.random() < 0.9:
        machine.program.put(0xF80002, 0x7FFF)  # FWDT: no watchdog
    if draw.random() < 0.4:
        machine.program.put(0xF80000, draw.choice((0x7FE6, 0x3FE6)))  # FCKSM: clock switching is enabled
    machine.reset("POR")
    if not robot and machine.peripherals.i2c is not None:
        machine.peripherals.i2c.wire.attach(0x6E, Scribe(made))
        made.master = ExternalMaster(machine.peripherals.i2c.slave, machine.events)
    for address, words in stretches.items():
        machine.program.put_flash(address, words)
    for port in machine.uart:
        machine.uart[port].on_byte = lambda byte, cycle, p=port: made.heard.append((p, byte, cycle))

    def row(y: int, columns: np.ndarray, cycle: int) -> np.ndarray:
        made.rendered.append((y, cycle))
        return np.full((len(columns), 3), y & 0xFF, np.uint8)

    if robot and camera is not None:
        machine.board.camera.show_pixels(row)
        machine.board.camera.align(3_000 + draw.randrange(3_000), 0)
    return made


def invalidate(draw: random.Random, subject: Subject) -> None:
    """Apply a random external input in the current cycle or a few cycles later."""
    machine = subject.machine
    kind, cycle, board = draw.randrange(14), machine.cycle, machine.board
    if machine.is_asleep:
        for level in (0, 1, 0):
            machine.pins.set("RF6", level, cycle)
    if kind == 0:
        data = bytes(draw.randrange(256) for _ in range(3))
        machine.uart[draw.choice(sorted(machine.uart))].feed(data, cycle + draw.randrange(99))
    elif kind == 1:
        for name in draw.sample(_INPUTS, 3):
            machine.pins.set(name, draw.randrange(2), cycle)
    elif kind == 2 and board is None:
        machine.peripherals.adc.set_input(draw.randrange(16), draw.randrange(0x10000))
    elif kind == 3 and board is not None:
        board.ir.set_distance(draw.randrange(8), draw.randrange(5, 100))
    elif kind == 4 and board is not None:
        board.remote.press(draw.randrange(64))
    elif kind == 5:
        machine.peripherals.adc.set_references(draw.randrange(0x8000), draw.randrange(0x8000, 0x10001))
    elif kind == 6 and board is not None:
        board.noise.strength = draw.choice((0.0, 0.5, 1.0))
    elif kind == 7 and board is not None:
        board.ir.set_ambient(draw.randrange(8), draw.randrange(4096))
    elif kind == 8 and board is not None:
        period = draw.randrange(2, 1000)
        board.microphones.play(draw.randrange(3), draw.choice((None, lambda now: now % period - period / 2)))
    elif kind == 9 and draw.random() < 0.2:
        machine.reset(draw.choice(("EXTR", "BOR")))
    elif kind == 10:
        machine.peripherals.spi[draw.choice(sorted(machine.peripherals.spi))].clock_word(draw.randrange(0x10000))
    elif kind == 11 and machine.peripherals.lvd is not None:
        machine.peripherals.lvd.set_supply(draw.randrange(1000, 6000))
    elif kind == 13 and subject.master is not None:
        address = 2 * (machine.peek("I2CADD") & 0x7F) if draw.random() < 0.8 else 0
        subject.master.transfer([address, draw.randrange(256)], [address | 1], draw.randrange(3))
    elif kind == 12 and draw.random() < 0.2:
        machine.peripherals.oscillator.fail()


def run(machine: Machine, cycles: int, cuts: random.Random | None) -> Stop:
    """Run like `Machine.run`, but in random pieces if `cuts` is given; the pieces must have no effect."""
    limit = machine.cycle + cycles
    stop = machine.run(cycles if cuts is None else min(cycles, cuts.randrange(1, 400)))
    while cuts is not None and stop.reason == "limit" and machine.cycle < limit:
        stop = machine.run(min(limit - machine.cycle, cuts.choice((1, 2, 9, cuts.randrange(1, 400)))))
    return stop


def difference(
    seed: int,
    *engines: str,
    chunks: int = CHUNKS,
    chip: Chip = DSPIC30F6014A,
    tally: Counter[tuple[str, str]] | None = None,
) -> str | None:
    """Compare engines with the plain one, with external bytes, edges and levels. In one of three seeds an engine runs
    in random pieces. Return the first difference, or None."""
    text, writer = program(seed, chip)
    stretches = flash(text, chip)
    subjects = [subject(seed, engine, stretches, chip) for engine in ("plain", *engines)]
    plain = subjects[0].machine
    for chunk in range(chunks):
        draw = random.Random(f"{seed} {chunk}")
        cycles = draw.choice((draw.randrange(1, 300), draw.randrange(1, 3000), 2500))
        cuts = [random.Random(f"{seed} {chunk} cuts {name}") if (seed + number) % 3 == 0 else None
                for number, name in enumerate(("plain", *engines))]  # fmt: skip
        stops = [run(one.machine, cycles, cut) for one, cut in zip(subjects, cuts, strict=True)]
        states = [one.machine.snapshot() for one in subjects]
        for one, name, stop, state in zip(subjects[1:], engines, stops[1:], states[1:], strict=True):
            where = f"by cycle {stops[0].cycle}, chunk {chunk}"
            if stops[0] != stop:
                return f"plain stops with {stops[0]}, {name} with {stop} {where}"
            if states[0] != state:
                field_at = plain.record.field_at
                places = {field_at(i) for i, (a, b) in enumerate(zip(states[0], state, strict=True)) if a != b}
                named = ", ".join(_named(place, chip) for place in sorted(places)[:8])
                return f"{name} differs in {named} {where}"
            if subjects[0].heard != one.heard:
                return f"{name} sends {one.heard[-4:]} instead of {subjects[0].heard[-4:]} {where}"
            if subjects[0].rendered != one.rendered:
                return f"{name} renders {len(one.rendered)} lines instead of {len(subjects[0].rendered)} {where}"
        if any(isinstance(one.machine.runner, JitEngine) and one.machine.runner.counts.regions > REGIONS
               for one in subjects):  # fmt: skip
            break
        for one in subjects:
            invalidate(random.Random(f"{seed} {chunk} outside"), one)
    if tally is not None:
        tally.update(writer.touched)
    return None


def _named(place: str, chip: Chip) -> str:
    """Return a data address together with the name of its register."""
    if place.startswith("data "):
        names = {sfr.address: sfr.name for sfr in words_of(chip.name)}
        return f"{place} {names.get(int(place.split()[1], 0) & ~1, '')}".strip()
    return place
