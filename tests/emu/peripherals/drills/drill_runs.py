"""Runs of drills on all engines: one machine per engine for all images, and each run starts from a restored base
state.

A run restores a base state, in which devices are active and processor modes are set. It sets the W registers, flags,
interrupt requests, and timers that match in the next cycles. Then it runs a drill for some tens of Tcy, divided at
random cycles. Finally records, stops and sent bytes are compared.
"""

from __future__ import annotations

import random
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import cache, partial
from typing import Final

from emu.boards.epuck.board import Epuck
from emu.chips.chip import Chip
from emu.chips.dspic30f6014a import DSPIC30F6014A
from emu.dspic30f.isa import text
from emu.dspic30f.isa.codec import decode_for_execution
from emu.dspic30f.jit.engine import JitEngine
from emu.dspic30f.state.state import PSV
from emu.machine.machine import Machine
from emu.machine.stops import Stop
from tests.emu.jit.comparison.engine_pair import QuickCompiler
from tests.emu.jit.comparison.random_firmware import words_of

from .access_census import Census
from .device_drills import CONTROL, DRILLS, MODES, Image, image_of, registers_of
from .device_programs import CHIPS
from .device_programs import words_of as sfrs_of

ENGINES: Final = ("plain", "jit")
BASES: Final = 3
"""Number of base states per image."""
ROUNDS: Final = 30
"""Number of runs of each drill."""
REGIONS: Final = 260
"""Number of compiled regions after which an image is abandoned, because every processor mode needs separate code."""
SLEPT: Final = 40_000
"""Number of Tcy after which the run of a sleeping machine ends."""
VALUES: Final = (0, 1, 2, 5, 0x00FF, 0x7FFF, 0x8000, 0xA000, 0xFFFF)
_INPUTS: Final = ("RD4", "RF6", "RC3", "RC14", "RA12", "RA13", "RD8", "RD9", "RG2", "RC1", "RC2", "RF7", "RB5")
NO_WATCHDOG: Final = 0x7FFF
"""FWDT with FWDTEN clear (dspic30f6014a.md §17)."""


Kept = tuple[bytes, Callable[[], None]]
"""A machine's record, and a function that restores its state outside of the record."""


class Crew:
    """Machines of one kind, one per engine, and the bytes that each has sent."""

    def __init__(self, chip: Chip, robot: bool, slip: int, engines: tuple[str, ...] = ENGINES) -> None:
        self.chip: Final = chip
        self.engines: Final = engines
        board = partial(Epuck, camera="PO8030D", selector=3, seed=7) if robot else None
        self.machines: Final = [Machine(chip, engine=name, ipl_slip=slip, board=board) for name in engines]
        self.heard: Final[list[list[tuple[int, int, int]]]] = [[] for _ in engines]
        self.census: Final = Census(self.machines[0])
        self.clean: Final[list[Kept]] = []
        for machine, heard in zip(self.machines, self.heard, strict=True):
            runner = machine.runner
            if isinstance(runner, JitEngine):
                runner.threshold, runner.wait, runner.compiler = 1, True, QuickCompiler(0)
            machine.stop_on_fault = False
            for port in machine.uart:
                machine.uart[port].on_byte = lambda byte, cycle, p=port, h=heard: h.append((p, byte, cycle))
            self.clean.append((machine.snapshot(), machine.save_host_state()))

    @property
    def regions(self) -> int:
        """Return the number of regions of native code compiled so far."""
        return sum(m.runner.counts.regions for m in self.machines if isinstance(m.runner, JitEngine))

    def load(self, image: Image, watched: bool, switching: bool) -> None:
        """Reset all machines to power-on state with an image in flash."""
        self.census.handlers = image.handlers
        for machine, (state, put_back) in zip(self.machines, self.clean, strict=True):
            machine.restore(state)
            put_back()
            machine.program.put(self.chip.config["FWDT"].address, 0x8000 if watched else NO_WATCHDOG)
            machine.program.put(self.chip.config["FOSC"].address, 0x7FE6 if switching else 0xFFE6)
            machine.reset("POR")
            for address, words in image.stretches().items():
                machine.program.put_flash(address, words)

    def keep(self) -> list[Kept]:
        """Return the current state of all machines."""
        return [(machine.snapshot(), machine.save_host_state()) for machine in self.machines]

    def back(self, kept: list[Kept]) -> None:
        """Restore all machines to a state returned by `keep`."""
        for machine, heard, (state, put_back) in zip(self.machines, self.heard, kept, strict=True):
            machine.restore_state(state)
            put_back()
            heard.clear()

    def compare(self) -> str:
        """Return the difference between the first machine and another one, or "" if there is none."""
        first, *others = self.machines
        state = first.snapshot()
        for machine, name, heard in zip(others, self.engines[1:], self.heard[1:], strict=True):
            other = machine.snapshot()
            if other != state:
                names = {sfr.address: sfr.name for sfr in sfrs_of(self.chip.name)}
                places = [i for i, (a, b) in enumerate(zip(state, other, strict=True)) if a != b]
                field_at = first.record.field_at
                bytes_shown = [
                    f"{field_at(i)} {names.get(i & ~1, '')} {state[i]:02x} {other[i]:02x}" for i in places[:12]
                ]
                return f"{name} differs in {', '.join(bytes_shown)}"
            if heard != self.heard[0]:
                return f"{name} sends {heard[-3:]} instead of {self.heard[0][-3:]}"
        return ""


@dataclass
class Tally:
    """Counts of executed items that were equal in all engines."""

    images: int = 0
    runs: int = 0
    programs: int = 0
    """Number of different programs: they differ in their instructions or in the contents of W registers."""
    cycles: int = 0
    left: int = 0
    """Number of images that were abandoned early."""
    kinds: Counter[str] = field(default_factory=Counter)
    accesses: Counter[tuple[str, int, bool, int, int]] = field(default_factory=Counter)
    """Number of accesses, by chip and by the keys of `Census`."""

    def add(self, other: Tally) -> None:
        """Add the counts of another tally."""
        for name in ("images", "runs", "programs", "cycles", "left"):
            setattr(self, name, getattr(self, name) + getattr(other, name))
        self.kinds.update(other.kinds)
        self.accesses.update(other.accesses)


@cache
def crew_of(chip: str, robot: bool, slip: int, engines: tuple[str, ...]) -> Crew:
    """Return the machines of one kind, which are constructed once."""
    return Crew(CHIPS[chip], robot, slip, engines)


def random_address(draw: random.Random, machine: Machine, image: Image) -> int:
    """Return a random data address: usually a register or the word beside one."""
    ram, kind = image.chip.data["ram"], draw.random()
    window = machine.peek("CORCON") & PSV
    if kind < 0.04 + (0.25 if window else 0):
        edges = (0x8000, 0x8001, 0xFFFE, 0xFFFF, 0x8000 | draw.randrange(0x8000))
        return draw.choice(edges if window else (0, 2, 0x1E, ram.end - 2, ram.end, *edges))
    if kind < 0.34 and machine.peek("MODCON") & 0xC000:
        return machine.peek(draw.choice(("XMODSRT", "XMODEND"))) + draw.choice((0, 1, -1, -2, 2))
    if kind < 0.16:
        return draw.randrange(ram.start, ram.end) & ~1
    while True:
        sfr = draw.choice(image.pool if draw.random() < 0.7 else registers_of(image.chip.name))
        if sfr.name not in MODES + CONTROL or draw.random() < 0.3:
            break
    return sfr.address + draw.choice((0, 0, 0, 0, 2, -2, 2, 1))


def modes(draw: random.Random, machine: Machine, image: Image) -> None:
    """Set processor modes, pages and a stack limit, on which native code depends (isa.md §2.4, §2.5, §7.7, §7.8,
    §10.2)."""
    ram = image.chip.data["ram"]
    machine.write("CORCON", draw.choice((0x0020, 0x0024, 0x0024, draw.randrange(0x10000) & 0x10F7)))
    if draw.random() < 0.6:
        pointers = [number for number in image.pointers if number < 15]
        machine.write("MODCON", draw.choice((0x8000, 0xC000, 0x4000)) | draw.choice((*pointers, 15)) << 8
                      | draw.choice((10, 11, 15)) << 4 | draw.choice((*pointers, 15)))  # fmt: skip
        start = draw.choice((draw.choice(image.pool).address, ram.start + draw.randrange(ram.size - 64))) & ~1
        for name, value in (("XMODSRT", start), ("XMODEND", start + draw.choice((7, 11, 31)))):
            machine.write(name, value)
        machine.write("YMODSRT", image.chip.data["yram"].start)
        machine.write("YMODEND", image.chip.data["yram"].start + draw.choice((7, 31)))
        machine.write("XBREV", draw.choice((0, 0x8008, 0x8004, 0x8001)))
    if draw.random() < 0.6:
        machine.write("SPLIM", ram.end - draw.choice((16, 64, 256)))
    machine.write("TBLPAG", draw.choice((0, 1, 2, 0x7F, 0x80, 0xF8, 0xFF)))
    machine.write("PSVPAG", draw.choice((0, 1, 2, 0x7F, 0xFF)))
    machine.write("INTCON1", draw.choice((0, 0, 0x0700, 0x8000)))
    machine.run(2)


def outside(draw: random.Random, machine: Machine) -> None:
    """Apply a random external input."""
    kind = draw.randrange(4)
    if kind == 0:
        machine.uart[draw.choice(sorted(machine.uart))].feed(draw.randbytes(3), machine.cycle + draw.randrange(99))
    elif kind == 1:
        for name in draw.sample(_INPUTS, 3):
            machine.pins.set(name, draw.randrange(2), machine.cycle)
    elif kind == 2:
        machine.peripherals.spi[draw.choice(sorted(machine.peripherals.spi))].clock_word(draw.randrange(0x10000))


def base(seed: int, number: int, machine: Machine, image: Image) -> None:
    """Set up devices and run for some time, which gives base state `number`."""
    draw = random.Random(f"{seed} base {number}")
    machine.core.state.initialised = 0xFFFF
    machine.pc = image.rest
    for scene in draw.sample(image.scenes, draw.choice((1, 1, 2, 3))):
        for name, value in scene:
            if name in image.chip.sfrs:
                machine.write(name, value)
        machine.run(draw.randrange(1, 60))
    outside(draw, machine)
    machine.run(draw.randrange(1, draw.choice((20, 400, 1500))))
    if draw.random() < 0.25:
        modes(draw, machine, image)
    machine.pc = image.rest


def prepare(draw: random.Random, machine: Machine, image: Image, start: int, kind: str) -> tuple[int, ...]:
    """Set W registers, flags, requests, and timers that match in the next cycles. Return the contents of the W
    registers."""
    chip, state = image.chip, machine.state
    ram = chip.data["ram"]
    held = [0] * 16
    for number in image.data:
        held[number] = draw.choice(VALUES) if draw.random() < 0.6 else draw.randrange(0x10000)
    for number in image.pointers:
        held[number] = random_address(draw, machine, image)
    held[image.index] = draw.choice((0, 0, 2, 2, 4, 0xFFFE, 1))
    held[15] = ram.end - (ram.end - ram.start) // 8
    if draw.random() < (0.6 if kind == "stack" else 0.05):
        limit = machine.peek("SPLIM") if state.limit_armed else ram.end
        held[15] = draw.choice((limit, limit, ram.start)) + draw.randrange(-12, 8, 2)
    for number, value in enumerate(held):
        machine.w[number] = value
    machine.poke("SR", machine.peek("SR") & ~0xEF | draw.choice((0, draw.randrange(16), 0x20 * draw.randrange(8))))
    state.initialised = 0xFFFF
    if machine.is_asleep:
        state.mode = 0
    if draw.random() < 0.6:
        for name in draw.sample(("IEC0", "IEC1", "IEC2", "IFS0", "IFS1", "IFS2", "IPC0", "IPC1", "IPC2"), 3):
            machine.write(name, draw.choice((0xFFFF, draw.randrange(0x10000), 0x4444)))
    for timer in draw.sample(chip.timers, draw.choice((0, 1, 2, 2))):
        source, n = chip.interrupts[timer.irq], timer.number
        ahead = draw.choice((draw.randrange(1, 6), draw.randrange(1, 15)))
        period = draw.choice((ahead, ahead + 1, 20, 200))
        machine.write(f"PR{n}", period)
        machine.write(f"T{n}CON", 0x8000)
        machine.write(f"TMR{n}", (period - ahead) & 0xFFFF)
        if draw.random() < 0.6:
            word, bit = source.enable
            machine.write(word, machine.peek(word) | 1 << bit)
    if kind == "program":
        program(draw, machine, image)
    machine.pc = start
    return tuple(held)


def program(draw: random.Random, machine: Machine, image: Image) -> None:
    """Select a row of flash or EEPROM, and fill the latches so that some instructions of the row are kept."""
    machine.write("NVMCON", draw.choice((0x4041, 0x4001, 0x4001, 0x4045, 0x4005, 0x4004, 0x4044, 0x0001)))
    eeprom = image.chip.program["eedata"].start
    address = draw.choice((image.row, image.row, image.row + 6, eeprom, draw.randrange(0x1000000) & ~1))
    machine.write("NVMADR", address & 0xFFFF)
    machine.write("NVMADRU", address >> 16)
    for index in range(len(machine.program.flash_latch)):
        machine.program.flash_latch[index] = draw.choice((0xFFFFFF, 0xFFFFFF, 0xFFFFFF, 0xFF0FFF, 0))


def run(draw: random.Random, machine: Machine, cycles: int) -> list[Stop | int | None]:
    """Run for `cycles` Tcy in one to three calls, or with `run_past`. A sleeping machine runs longer, and as long again
    after a flash row was programmed. Return the result of each call, and the ends of the periods of `run_past`."""
    end, way = machine.cycle + cycles, draw.random()
    ended: list[Stop | int | None] = []
    if way < 0.4:
        ended.append(machine.run_until(machine.cycle + draw.randrange(1, 30)))
    if way < 0.7:
        ended.append(machine.run_until(end))
    else:
        cuts: list[int] = []
        ended.append(machine.run_past(machine.cycle + draw.randrange(1, 9), draw.randrange(1, 13), end, cuts))
        ended += cuts
    while machine.is_asleep and machine.cycle < end + SLEPT and not isinstance(ended[-1], Stop):
        ended.append(machine.run_until(machine.cycle + draw.choice((1, 20, 400, 3000))))
    if machine.cycle > end + SLEPT // 2:
        ended.append(machine.run_until(machine.cycle + cycles))
    return ended


def base_states(seed: int, crew: Crew, image: Image) -> Iterator[list[Kept] | str]:
    """Yield each base state of an image, set up on all machines, or the first difference."""
    loaded = crew.keep()
    for number in range(BASES):
        crew.back(loaded)
        for machine in crew.machines:
            base(seed, number, machine, image)
        if found := crew.compare():
            yield f"base {number}: {found}"
            return
        yield crew.keep()


def check(
    seed: int,
    chip: Chip = DSPIC30F6014A,
    tally: Tally | None = None,
    *,
    engines: tuple[str, ...] = ENGINES,
    drills: int = DRILLS,
    rounds: int = ROUNDS,
) -> str | None:
    """Run the first `drills` drills of an image `rounds` times each on `engines`. Return the first difference, or
    None."""
    tally = Tally() if tally is None else tally
    draw = random.Random(f"{seed} kind")
    image = image_of(seed, chip)
    robot, slip = chip is DSPIC30F6014A and draw.random() < 0.4, int(draw.random() < 0.2)
    crew = crew_of(chip.name, robot, slip, engines)
    crew.load(image, draw.random() < 0.1, draw.random() < 0.4)
    crew.census.counts.clear()
    before, programs = crew.regions, set()
    bases = []
    for kept in base_states(seed, crew, image):
        if isinstance(kept, str):
            return kept
        bases.append(kept)
    for drill, (start, kind) in enumerate(image.drills[:drills]):
        for number in range(rounds):
            name = f"{seed} {drill} {number}"
            draw = random.Random(name)
            crew.back(draw.choice(bases))
            cycles = draw.randrange(12, 50)
            held: tuple[int, ...] = ()
            ends = []
            for place, machine in enumerate(crew.machines):
                held = prepare(random.Random(f"{name} prepare"), machine, image, start, kind)
                crew.census.open = not place
                ends.append(run(random.Random(f"{name} cut"), machine, cycles))
                crew.census.open = False
            found = crew.compare()
            if found or any(end != ends[0] for end in ends):
                finding = f"{found} {ends}" if found else str(ends)
                return f"drill {drill} ({kind}), round {number}: {finding}\n{listing(image, start)}"
            tally.runs += 1
            tally.cycles += cycles
            tally.kinds[kind] += 1
            programs.add((drill, held))
        if crew.regions - before > REGIONS:
            tally.left += 1
            break
    tally.images += 1
    tally.programs += len(programs)
    for key, count in crew.census.counts.items():
        tally.accesses[chip.name, *key] += count
    return None


def listing(image: Image, start: int) -> str:
    """Return the instructions of a drill, for the report of a difference."""
    lines = []
    at = start
    while at in image.words and image.words[at] != words_of("BRA Expr", n=-1)[0]:
        insn = decode_for_execution(image.words[at], image.words.get(at + 2, 0))
        assert insn is not None
        lines.append(f"{at:06x} {text.format(insn, at)}")
        at += 2 * insn.words
    return "\n".join(lines)
