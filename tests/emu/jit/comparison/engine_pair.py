"""Two machines with different engines in lockstep: native code is compared with the plain interpreter, and counted.

`Tally` counts only what was compared without a difference. Instructions that the native machine left to Python are
counted and subtracted.
"""

from __future__ import annotations

import ctypes
import itertools
import random
from array import array
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, ClassVar

from emu.chips.chip import Chip
from emu.chips.dspic30f6014a import DSPIC30F6014A
from emu.dspic30f.exceptions.faults import DebuggerWord, IllegalOpcode
from emu.dspic30f.isa.flow import Branch, Return, Skip, Sleep
from emu.dspic30f.jit.compiler import Compiler, LoadedCode
from emu.dspic30f.jit.engine import BLOCK_LEVEL, HOT_LEVEL, STEP_LEVEL, JitEngine
from emu.dspic30f.jit.worker import Backend
from emu.dspic30f.state.state import DA, NOT_REPEATING, RA
from emu.machine.machine import Machine
from tests.emu.jit.comparison.random_firmware import BODY_WORDS, CODE, Firmware, difference, load, random_firmware
from tests.emu.jit.comparison.straight_body import BODY, Shape
from tests.emu.jit.comparison.straight_firmware import straight_firmware

MODE_BITS = 0x10F7
"""CORCON bits that select processor modes (isa.md §2.4)."""
NO_WATCHDOG = 0x7FFF
"""FWDT with FWDTEN clear (dspic30f6014a.md §17)."""
LOST = 6000
"""Number of cycles without a new address after which the rig resets a straight program by the reset pin."""
FRUITLESS = 30
"""Number of consecutive resets without a new address after which a pass is abandoned, because its data may make it
loop for ever."""


class Difference(Exception):
    """Two engines disagree."""


@dataclass
class Tally:
    """Counts of executed items that were equal in both engines."""

    programs: Counter[str] = field(default_factory=Counter)
    instructions: Counter[str] = field(default_factory=Counter)
    """Number of executed instructions, by campaign."""
    stops: int = 0
    exchanges: int = 0
    """Number of stops at which each machine continued from the snapshot of the other."""
    hooks: int = 0
    """Number of arrivals at hooked addresses."""
    entries: Counter[str] = field(default_factory=Counter)
    """Number of exception entries, by campaign."""
    places: Counter[str] = field(default_factory=Counter)
    """Number of exception entries in single steps, by the kinds of place that they interrupted; one entry may count
    for several kinds."""
    rows: Counter[str] = field(default_factory=Counter)
    native_rows: Counter[str] = field(default_factory=Counter)
    seen: set[int] = field(default_factory=set)
    native: set[int] = field(default_factory=set)
    """(word, modes) pairs that were executed. `native`: executed by native code."""
    both: set[int] = field(default_factory=set)
    """Pairs that both block code and exact code have executed."""

    def executed(self) -> int:
        """Return the number of instructions of all campaigns."""
        return sum(self.instructions[kind] for kind in self.programs)

    def as_json(self) -> dict[str, Any]:
        """Return the counts by name."""
        names = ("programs", "instructions", "entries", "places", "rows", "native_rows")
        return {name: dict(getattr(self, name)) for name in names} | {
            "executed": self.executed(), "stops": self.stops, "exchanges": self.exchanges, "hooks": self.hooks,
            "pairs": len(self.seen), "native_pairs": len(self.native), "exact_pairs": len(self.both),
        }  # fmt: skip

    def add(self, other: Tally) -> None:
        """Add the counts of another tally."""
        for name in ("programs", "instructions", "entries", "places", "rows", "native_rows"):
            getattr(self, name).update(getattr(other, name))
        self.stops += other.stops
        self.exchanges += other.exchanges
        self.hooks += other.hooks
        for name in ("seen", "native", "both"):
            getattr(self, name).update(getattr(other, name))

    def packed(self) -> dict[str, bytes]:
        """Return the sets as arrays of 64-bit words."""
        return {name: array("Q", getattr(self, name)).tobytes() for name in ("seen", "native", "both")}

    def unpack(self, counts: dict[str, Any], sets: dict[str, bytes]) -> None:
        """Restore a tally from the results of `as_json` and `packed`."""
        for name in ("programs", "instructions", "entries", "places", "rows", "native_rows"):
            setattr(self, name, Counter(counts[name]))
        self.stops, self.exchanges, self.hooks = counts["stops"], counts["exchanges"], counts.get("hooks", 0)
        for name, data in sets.items():
            words = array("Q")
            words.frombytes(data)
            setattr(self, name, set(words))


class _NoCache:
    """Cache that stores nothing, so that programs share no code."""

    stores = hits = 0

    def __init__(self) -> None:
        self._numbers = itertools.count()

    def key(self, *_parts: bytes) -> str:
        return str(next(self._numbers))

    def get(self, _key: str) -> None:
        return None

    def put(self, _key: str, _code: bytes) -> None:
        pass


class QuickCompiler(Compiler):
    """Compiler in this process that compiles block code at a given LLVM level and shares no objects."""

    backend: ClassVar[Backend] = Backend()
    dispatchers: ClassVar[dict[str, bytes]] = {}
    """Compiled dispatch loops, by their source text."""

    def __init__(self, block_level: int) -> None:
        super().__init__(_NoCache())  # type: ignore[arg-type]
        self._block_level = block_level
        self._backend = self.backend

    def compile_now(self, text: str, level: int, key: str, entries: Any = ()) -> LoadedCode:
        if not entries:
            code = self.dispatchers.get(text) or self.dispatchers.setdefault(text, self.backend.compile(text, level))
            return self.load(code, key, ())
        return super().compile_now(text, self._block_level if level else STEP_LEVEL, key, entries)


class InstructionObserver:
    """Counter of the instructions of a plain machine, and of those of the native machine that Python executes."""

    def __init__(self, plain: Machine, native: Machine) -> None:
        self.plain = plain
        self.ran: Counter[int] = Counter()
        """Number of executions by `(PC, modes)`."""
        self.python: Counter[int] = Counter()
        self.addresses: set[int] = set()
        self.instructions = 0
        self.tally = Tally()
        self.last = 0
        self.stalled = False
        self._count(plain, self.ran)
        self._follow_plain(plain)
        runner = native.runner
        assert isinstance(runner, JitEngine)
        counted = self._count(native, self.python)
        runner._interpret = counted
        runner._run_cold = lambda _limit: counted()

    def _count(self, machine: Machine, counter: Counter[int]) -> Callable[[], None]:
        record, at, execute = machine.record, machine.state.at, machine.core.sequencer.execute
        u16, u32 = record.u16, record.u32
        pc, corcon, modcon, xbrev, intcon1 = (at[n] for n in ("cpu.pc", "CORCON", "MODCON", "XBREV", "INTCON1"))

        def counted() -> None:
            modes = u16[corcon] & MODE_BITS | u16[modcon] << 13 | u16[xbrev] >> 15 << 29 | (u16[intcon1] & 0x700) << 22
            counter[u32[pc] << 33 | modes] += 1
            execute()

        machine.core.sequencer.execute = counted  # type: ignore[method-assign]
        return counted

    def _follow_plain(self, machine: Machine) -> None:
        sequencer, enter = machine.core.sequencer, machine.core.exceptions.enter
        counted = sequencer.execute
        state, at = machine.state, machine.state.at
        u16, u32 = machine.record.u16, machine.record.u32
        pc_at, stall_at = at["cpu.pc"], at["cpu.stall"]
        addresses, places = self.addresses, self.tally.places
        mask = 0

        def followed() -> None:
            nonlocal mask
            self.last = u32[pc_at]
            mask = u16[stall_at]
            addresses.add(self.last)
            self.instructions += 1
            counted()

        def entered(accepted: Any, last: int) -> None:
            found = ["all", "traps" if accepted.vector.irq is None else "interrupts"]
            found += ["inside REPEAT"] * bool(state.sr & RA or state.repeat != NOT_REPEATING)
            found += ["inside DO"] * bool(state.sr & DA)
            found += ["inside a handler"] * bool(state.ipl)
            step = self._step(self.last)
            if step is not None:
                flow = step.facts.flow
                away = state.pc != step.next_pc
                found += ["on a skip taken"] * (flow is Skip and away)
                found += ["on a branch taken"] * (flow is Branch and away)
                found += ["on a return"] * (flow is Return)
                found += ["out of Idle"] * (flow is Sleep)
                found += ["on a stalled instruction"] * bool(mask & step.facts.source_pointers)
            following = self._step(state.pc)
            if following is not None:
                found += ["in front of a stall"] * bool(state.stall & following.facts.source_pointers)
            places.update(found)
            enter(accepted, last)

        sequencer.execute = followed  # type: ignore[method-assign]
        machine.core.exceptions.enter = entered  # type: ignore[method-assign]

    def _step(self, pc: int) -> Any:
        try:
            return self.plain.core.sequencer.fetch(pc) if self.plain.program.executable(pc) else None
        except (IllegalOpcode, DebuggerWord):
            return None

    def native_now(self) -> set[int]:
        """Return the keys of `ran` that native code has executed at least once."""
        python = self.python
        return {key for key, count in self.ran.items() if count > python[key]}

    def close(self, campaign: str) -> Tally:
        """Return all counts of this observer. Called after a comparison without a difference."""
        tally, steps = self.tally, {}
        tally.programs[campaign] += 1
        tally.instructions[campaign] += self.instructions
        tally.entries[campaign] += tally.places["all"]
        for key, count in self.ran.items():
            pc = key >> 33
            if pc not in steps:
                steps[pc] = self._step(pc)
            if steps[pc] is None:
                continue
            pair, row = self.pair(key), steps[pc].insn.row
            name = f"{row.id} {row.syntax}"
            natively = count - self.python[key]
            tally.rows[name] += count
            tally.seen.add(pair)
            if natively > 0:
                tally.native_rows[name] += natively
                tally.native.add(pair)
        return tally

    def pair(self, key: int) -> int:
        """Return (program word, modes) for (PC, modes)."""
        return self.plain.program.word(key >> 33) << 33 | key & (1 << 33) - 1


class Hooks:
    """Hooks at random addresses in two machines, and a log of (PC, cycle) for each machine."""

    def __init__(self, machines: tuple[Machine, Machine], addresses: range, generator: random.Random) -> None:
        self._arrivals: tuple[list[Any], list[Any]] = ([], [])
        for address in generator.sample(addresses, 8):
            for machine, seen in zip(machines, self._arrivals, strict=True):
                machine.hook_pc(address, lambda m=machine, s=seen: s.append((m.pc, m.cycle)))  # type: ignore[misc]

    def compare(self, tally: Tally) -> None:
        """Compare the logs since the last call. Raises Difference unless they are equal."""
        one, other = self._arrivals
        if one != other:
            raise Difference(f"arrivals at hooks {one[-3:]} {other[-3:]}")
        tally.hooks += len(one)
        one.clear()
        other.clear()


def engine_pair(
    firmware: Firmware, ipl_slip: int, block_level: int, chip: Chip = DSPIC30F6014A
) -> tuple[Machine, Machine]:
    """Return a plain machine, and a native machine that compiles each address before it runs it."""
    plain, native = (Machine(chip, engine=engine, ipl_slip=ipl_slip) for engine in ("plain", "jit"))
    runner = native.runner
    assert isinstance(runner, JitEngine)
    runner.threshold, runner.wait, runner.compiler = 1, True, QuickCompiler(block_level)
    for machine in (plain, native):
        machine.stop_on_fault = False
        if firmware.seed & 2:  # otherwise the watchdog runs, and Python handles Idle
            machine.program.put(machine.chip.config["FWDT"].address, NO_WATCHDOG)
        load(machine, firmware)
    return plain, native


def advance(one: Machine, other: Machine, cycles: int, tally: Tally, exchange: bool = False) -> None:
    """Run both machines and compare their whole state. Raises Difference."""
    a, b = one.run(cycles), other.run(cycles)
    found = difference(one, other)
    if a != b or found:
        raise Difference(f"{a} {b} {found}")
    tally.stops += 1
    if exchange:
        first, second = one.snapshot(), other.snapshot()
        one.restore(second)
        other.restore(first)
        tally.exchanges += 1


def check_straight(seed: int, shape: Shape | None = None) -> Tally:
    """Check a long straight program in block code and exact code, then in exact code alone."""
    firmware = straight_firmware(seed, shape)
    generator = random.Random(seed)
    plain, native = engine_pair(firmware, seed & 1, {5: HOT_LEVEL, 21: BLOCK_LEVEL}.get(seed % 32, STEP_LEVEL))
    watch, runner = InstructionObserver(plain, native), native.runner
    assert isinstance(runner, JitEngine)
    hooks = Hooks((plain, native), range(BODY, firmware.end, 2), generator) if seed % 3 == 0 else None
    runner.share_group = object()
    for exact_only in (False, True):
        before = watch.native_now()
        ran = Counter(watch.ran)
        python = Counter(watch.python)
        watch.addresses.clear()
        news, since, resets = 0, plain.cycle, 0
        while firmware.end not in watch.addresses and resets < FRUITLESS:
            if exact_only:
                for code in runner._codes.values():
                    ctypes.memset(ctypes.addressof(code.blocks), 0, ctypes.sizeof(code.blocks))
            advance(plain, native, generator.randrange(1, 1200), watch.tally, generator.random() < 0.1)
            if hooks is not None:
                hooks.compare(watch.tally)
            if len(watch.addresses) > news:
                news, since, resets = len(watch.addresses), plain.cycle, 0
            elif plain.cycle - since > LOST:
                plain.reset("EXTR")
                native.reset("EXTR")
                since, resets = plain.cycle, resets + 1
        if exact_only:
            again = {key for key in before if watch.ran[key] - ran[key] > watch.python[key] - python[key]}
            watch.tally.both |= {watch.pair(key) for key in again}
    return watch.close("straight")


def check_wild(seed: int, stops: int = 20, chip: Chip = DSPIC30F6014A) -> Tally:
    """Check a short program with jumps, traps and mode changes at random places; one program in three has hooks."""
    generator = random.Random(seed)
    plain, native = engine_pair(random_firmware(seed, chip), seed & 1, 2 if seed % 4 == 1 else 0, chip)
    watch = InstructionObserver(plain, native)
    hooks = Hooks((plain, native), range(CODE, CODE + 2 * BODY_WORDS, 2), generator) if seed % 3 == 0 else None
    for _ in range(stops):
        advance(plain, native, generator.randrange(1, 600), watch.tally, generator.random() < 0.1)
        if hooks is not None:
            hooks.compare(watch.tally)
    return watch.close("wild")
