"""The native engine: translated regions, found by PC and processor modes, run between two boundaries.

Python only sees what native code hands back: instructions with side effects, events, and addresses that have no code
yet. Code arrives from the disk cache at once or from the compile process later; until then the interpreter runs.
"""

from __future__ import annotations

import ctypes
import hashlib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import partial
from time import perf_counter
from typing import Any, Final
from weakref import WeakValueDictionary

from emu.dspic30f.core import Core
from emu.dspic30f.cycle_accounting import STRETCH, Ledger
from emu.dspic30f.isa.builder import Context
from emu.dspic30f.isa.codec import decode_for_execution
from emu.dspic30f.isa.facts import facts_of
from emu.dspic30f.isa.row import Insn
from emu.dspic30f.jit.cold_runner import ColdRunner
from emu.dspic30f.jit.compiler import Loaded, shared_compiler
from emu.dspic30f.jit.exit_reasons import (
    DEADLINE,
    ENTERS,
    HOOK,
    INTERPRET,
    MISS,
    RETFIE,
    SERVICE,
    Surroundings,
    identity_of,
    offsets,
    surroundings_of,
    wiring_of,
)
from emu.dspic30f.jit.runtime import (
    BLOCKS,
    BOUNDARY,
    ENTERED,
    ENV_WORDS,
    FRESH,
    LAST,
    LIMIT,
    NOTED,
    NOTES,
    PERIOD,
    ROOM,
    STEPS,
    dispatch_text,
)
from emu.dspic30f.jit.translate.cycle_counters import LEDGER, BoundaryCounting, Counting, RowOf
from emu.dspic30f.jit.translate.function import NOWHERE, RESUME, Translator
from emu.dspic30f.jit.translate.indirect_sfr import POINTED, pointed_text
from emu.dspic30f.jit.translate.region import Region, discover
from emu.dspic30f.state.modes import Key, Modes
from emu.dspic30f.state.state import IPL3, NOT_REPEATING, RUN
from emu.system.native_handle import FRESH_ROOM, Native, Run
from emu.system.rules import Rule

BLOCK_LEVEL, STEP_LEVEL = 2, 0
"""LLVM effort for blocks and for single-step code."""

COLD_CYCLES: Final = 1000
"""Longest cold run before native code is looked for again, in Tcy."""

NATIVE_CYCLES: Final = 30_000_000
"""Longest native run before Python can handle signals, in Tcy."""

NATIVE_FIELDS: Final = {"cycle": "cpu.cycle", "now": "events.now", "deadline": "events.deadline", "pc": "cpu.pc",
                        "mode": "cpu.mode"}  # fmt: skip
NATIVE_SFRS: Final = {"corcon": "CORCON", "ie0": "IEC0", "ie1": "IEC1", "ie2": "IEC2"}
"""Where in the record `Native` has what it names."""

Call = ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_void_p, ctypes.c_void_p)


@dataclass(eq=False)
class Code:
    """Native code for one set of processor modes: tables of addresses by program word, and what they came from.

    Machines of one kind with the same program share it: what one of them has met is there for all.
    """

    context: Context
    around: Surroundings
    identity: bytes
    """Hash of all that code depends on apart from program words."""
    pointed: Loaded
    """The function for registers that are reached by pointer."""
    blocks: Any
    steps: Any
    held: list[Loaded] = field(default_factory=list)
    """What the tables point into."""
    regions: dict[int, Region] = field(default_factory=dict)
    """Requested regions by where they start."""
    entries: set[int] = field(default_factory=set)
    """Leaders of all requested regions."""
    heat: dict[int, int] = field(default_factory=dict)
    """How often an address without code was reached."""


_shared: Final[WeakValueDictionary[object, Code]] = WeakValueDictionary()
"""For as long as a machine uses it: by all it depends on."""


@dataclass
class Counts:
    """How often native code came back, and why (`emu run --stats`)."""

    runs: int = 0
    interpreted: int = 0
    cold: int = 0
    regions: int = 0


class JitEngine:
    """`Engine` on native code, with the interpreter for what has none yet."""

    name = "jit"

    def __init__(self, core: Core, pc_hooks: Mapping[int, Any]) -> None:
        self._core: Final = core
        self._hooks: Final = pc_hooks
        self.threshold = 4
        """Times an address without code is reached before code is made for it."""
        self.wait = False
        """Let code be compiled before it is run (tests, benchmarks)."""
        self.circle: object = None
        """Translations are shared with machines that have the same here: who changes them sets one of its own."""
        self._longest = NATIVE_CYCLES
        self._ledger: Ledger | None = None
        self._row_of: RowOf = lambda pc: pc
        self._state: Final = core.state
        self._u16: Final = core.record.u16
        self._words: Final = core.chip.program["flash"].end // 2
        self.compiler = shared_compiler()
        self._computed: Final[dict[int, int]] = {}
        self._env: Final = (ctypes.c_uint64 * ENV_WORDS)()
        self._env_address: Final = ctypes.addressof(self._env)
        self._codes: Final[dict[object, Code]] = {}
        self._pointers: Final[dict[object, Loaded]] = {}
        self._code: Code | None = None
        self._key: object = None
        self._dispatch: Any = None
        self._dispatcher: Loaded | None = None
        self._native: Callable[..., Any] = lambda record, env: self._dispatch(record, env)
        self._run: Run | None = None
        self._lent: Callable[..., Any] | None = None
        self._lent_as: Native | None = None
        self._interpret: Callable[[], None] = core.sequencer.execute
        self._run_cold: Callable[[int], None] = ColdRunner(core, pc_hooks).run
        self._u64: Final = core.record.u64
        self._now: Final = core.state.at["cpu.cycle"]
        self._edt: Final = core.state.at["cpu.edt"]
        self._u32: Final = core.record.u32
        self._pc: Final = core.state.at["cpu.pc"]
        self._mode: Final = core.state.at["cpu.mode"]
        self._modes: Final = Modes(core.state)
        self._offset: Final = offsets(core)
        self._wiring: tuple[list[Rule | None], bytes] = [], b""
        self.counts: Final = Counts()
        self.seconds: dict[str, float] | None = None
        """Host seconds by activity once `measure_time` was called."""
        core.program.changed.append(self._flash_changed)

    # -- the engine -------------------------------------------------------------------------------------------------
    def run(self, limit: int) -> None:
        """At least one instruction, natively where possible."""
        state = self._state
        sequencer = self._core.sequencer
        if state.edt:
            sequencer.execute()
            return
        if self.compiler.busy:
            self._collect()
        self._select()
        if self._dispatch is None:
            assert self._code is not None
            if not self._code.regions:
                self._miss(limit)
                return
            self._prepare()
        self._env[LIMIT] = min(limit, state.cycle + self._longest)
        self._env[RESUME] = state.pc
        start = state.cycle
        why = self._native(self._core.record.address, self._env_address)
        self._env[RESUME] = NOWHERE
        self.counts.runs += 1
        if why == RETFIE:
            sequencer.after_retfie()
        elif why == ENTERS:
            sequencer.boundary(limit)
        elif (why == INTERPRET and (state.cycle == start or state.pc not in self._hooks)) or (
            why == HOOK and state.cycle == start  # behind the hook the block did not fit: exact code stops there again
        ):
            self.counts.interpreted += 1
            self._interpret()
        elif why in (MISS, DEADLINE):
            cycle = state.cycle
            quiet = cycle < limit and self._core.events.deadline >= cycle and state.pc not in self._hooks
            if cycle == start or quiet:
                self._miss(limit)

    def natively(self, limit: int) -> bool:
        """As `Engine.natively`. Many runs are short: what is looked at is read from the record directly."""
        u16, u64, now = self._u16, self._u64, self._now
        start = before = u64[now]
        if self._dispatch is None or not start or u16[self._edt]:  # native boundaries count with the cycle before
            return False
        if self.compiler.busy:
            self._collect()
        self._select()
        env, record, surroundings = self._env, self._core.record.address, self._env_address
        native = self._native if self._lent is None or self._native is not self._dispatch else self._lent
        env[LIMIT] = min(limit, start + self._longest)
        env[BOUNDARY] = 1
        why = native(record, surroundings)
        limit = max(limit, env[LIMIT]) if env[LAST] else limit
        interrupted = self._core.sequencer.power.signals.interrupted
        while before != (cycle := u64[now]) < limit:
            before = cycle
            if why == SERVICE:  # most often some device's event is due
                self._core.events.fire_until(cycle if u16[self._mode] != RUN else cycle - 1)
                if interrupted():
                    break
            elif why == INTERPRET and self._refresh(self._u32[self._pc], cycle):
                env[BOUNDARY] = 0  # that of this instruction has been done
            else:
                break
            why = native(record, surroundings)
            env[BOUNDARY] = 1
            limit = max(limit, env[LIMIT]) if env[LAST] else limit
            self.counts.runs += 1
        env[BOUNDARY] = 0
        self.counts.runs += 1
        if why == INTERPRET and self._u32[self._pc] not in self._hooks:
            self.counts.interpreted += 1
            self._interpret()
            return True
        if why == RETFIE:
            self._core.sequencer.after_retfie()
            return True
        if why == ENTERS:
            self._core.sequencer.boundary(limit)
            return True
        return cycle >= limit or (why != SERVICE and cycle != start)

    def pass_limits(self, period: int, last: int) -> None:
        """As `Engine.pass_limits`."""
        self._env[PERIOD], self._env[LAST] = period, last

    def passed(self) -> list[int]:
        """As `Engine.passed`."""
        count = self._env[NOTED]
        if not count:
            return []
        self._env[NOTED] = 0
        return list(self._env[NOTES : NOTES + count])

    def lend(self, run: Run) -> Native:
        """As `Engine.lend`."""
        core, env, record = self._core, self._env_address, self._core.record
        at = {name: record.address + record.fields[field].offset for name, field in NATIVE_FIELDS.items()}
        at |= {name: record.address + core.chip.sfrs[sfr].address for name, sfr in NATIVE_SFRS.items()}
        words = {"begins": BOUNDARY, "limit": LIMIT, "last": LAST, "noted": NOTED, "notes": NOTES, "fresh": FRESH}
        at |= {name: env + 8 * word for name, word in words.items()}
        self._run = run
        self._lent_as = Native(record=record.address, env=env, room=ROOM, interpret=INTERPRET, service=SERVICE,
                               awake=RUN, trap=IPL3, **at)  # fmt: skip
        self._hand_out()
        return self._lent_as

    def _hand_out(self) -> None:
        """Who runs native code gets to know what there is."""
        if self._run is not None and self._lent_as is not None and self._dispatcher is not None:
            self._lent, self._lent_as.entry = partial(self._run, self._dispatch), self._dispatcher.address

    def _refresh(self, pc: int, cycle: int) -> bool:
        """Have a device bring up to date what native code reads from the record, if that is what the instruction at
        `pc` waits for."""
        word = self._computed.get(pc)
        if word is None:
            word = self._computed[pc] = self._computed_word(pc)
        if not word or self._core.events.deadline <= cycle:
            return False
        bus = self._core.bus
        compute, refresh = bus.compute[word], bus.refresh.get(word)
        if compute is None:
            return False
        self._core.events.now = cycle
        if refresh is None or not refresh(cycle):
            compute()
        else:
            self._note_fresh(pc | word << 32)
        return True

    def _note_fresh(self, instruction: int) -> None:
        """Let who runs native code know for what it came back; where there is no room it hears of it each time."""
        fresh = self._env[FRESH : FRESH + FRESH_ROOM]
        place = fresh.index(0)
        if instruction not in fresh and place < FRESH_ROOM - 1:
            self._env[FRESH + place] = instruction

    def _forget_computed(self) -> None:
        self._computed.clear()
        self._env[FRESH : FRESH + FRESH_ROOM] = [0] * FRESH_ROOM

    def _computed_word(self, pc: int) -> int:
        """Index of the register a one-cycle instruction reads by address, if native code can read it; else 0."""
        insn = self._fetch(pc)
        if insn is None or insn.row.cycles != 1 or self._code is None:
            return 0
        words = [address >> 1 for address in facts_of(insn).reads]
        return words[0] if words and 2 * words[0] in self._code.around.rules else 0

    def keep(self, ledger: Ledger, row_of: RowOf) -> Callable[[], None]:
        """Have all that is run counted in `ledger`, lines by their first address; returns how to stop. All code is
        compiled before it is run meanwhile, and what is not compiled is run by the sequencer."""
        kept = self._interpret, self._run_cold, self.wait, self._native

        def run(record: int, env: int) -> Any:
            why = self._dispatch(record, env)
            if why != RETFIE:  # else the cycle of the last note is not sure
                ledger.drain()
            return why

        ledger.open()
        execute = self._core.sequencer.execute
        self._interpret, self._run_cold, self.wait, self._native = execute, lambda _limit: execute(), True, run
        self._ledger, self._row_of, self._longest, self._dispatch = ledger, row_of, STRETCH, None
        self._env[LEDGER] = ledger.address
        self.forget()

        def stop() -> None:
            ledger.close()
            self._interpret, self._run_cold, self.wait, self._native = kept
            self._ledger, self._longest, self._dispatch = None, NATIVE_CYCLES, None
            self.forget()

        return stop

    def measure_time(self) -> None:
        """Note from now on where host time goes (`emu run --stats`); costs a little itself."""
        seconds = self.seconds = dict.fromkeys(("native code", "side effects", "cold code", "translation"), 0.0)

        def timed(activity: str, work: Callable[..., Any]) -> Callable[..., Any]:
            def run(*arguments: Any) -> Any:
                start = perf_counter()
                try:
                    return work(*arguments)
                finally:
                    seconds[activity] += perf_counter() - start

            return run

        self._native = timed("native code", self._native)
        self._interpret = timed("side effects", self._interpret)
        self._run_cold = timed("cold code", self._run_cold)
        self._request = timed("translation", self._request)  # type: ignore[method-assign]

    def forget(self) -> None:
        """Hooked addresses must come back to Python: translate anew around them."""
        self._codes.clear()
        self._forget_computed()
        self._key = None

    def translated(self) -> Iterable[Code]:
        """What was requested so far, for each set of processor modes."""
        return self._codes.values()

    @property
    def interrupts(self) -> int:
        """Interrupts entered natively so far."""
        return int(self._env[ENTERED])

    def _miss(self, limit: int) -> None:
        """No code at PC: ask for some, meanwhile run cold."""
        pc = self._state.pc
        code = self._code
        assert code is not None
        if self._state.repeat != NOT_REPEATING:
            self._core.sequencer.execute()
            return
        heat = code.heat.get(pc, 0) + 1
        code.heat[pc] = heat
        if heat >= self.threshold and pc not in code.regions and pc >> 1 < self._words:
            self._request(code, pc)
            if code.steps[pc >> 1] and pc not in self._hooks:  # a hook has been called and must not be again
                return
        self.counts.cold += 1
        self._run_cold(min(limit, self._state.cycle + COLD_CYCLES))

    # -- modes ------------------------------------------------------------------------------------------------------
    def _select(self) -> None:
        """Make the tables of the present processor modes current."""
        key = (self._modes.key(), self._core.bus.off)
        if key == self._key:
            return
        self._key = key
        code = self._codes.get(key)
        if code is None:
            code = self._codes[key] = self._new_code(key[0])
        self._code = code
        self._env[BLOCKS] = ctypes.addressof(code.blocks)
        self._env[STEPS] = ctypes.addressof(code.steps)
        self._env[POINTED] = code.pointed.address

    def _new_code(self, key: Key) -> Code:
        core = self._core
        around = surroundings_of(core, key, frozenset(self._hooks), self._offset)
        if self._wiring[0] != core.bus.rules:
            self._wiring = core.bus.rules[:], wiring_of(around)
        identity = identity_of(key.context, around, self._wiring[1])
        program = hashlib.sha256(core.program.flash).digest()
        counted = 0 if self._ledger is None else self._env_address  # code that counts names its own ledger
        switches = core.bus.off, frozenset(core.bus.watched), self.wait, counted, self.circle
        shared = identity, program, around.hooks, *switches
        code = _shared.get(shared)
        if code is None:
            table = ctypes.c_uint64 * self._words
            code = _shared[shared] = Code(key.context, around, identity, self._pointed(around), table(), table())
        return code

    def _pointed(self, around: Surroundings) -> Loaded:
        """Native accesses to registers that are reached by pointer."""
        bus = self._core.bus
        key = bus.off, frozenset(bus.watched), around.limit_armed
        if key not in self._pointers:
            text = pointed_text(self._core, around)
            self._pointers[key] = self._at_once(text, STEP_LEVEL)
        return self._pointers[key]

    # -- translation ------------------------------------------------------------------------------------------------
    def _prepare(self) -> None:
        ledger = self._ledger
        counts = None if ledger is None else BoundaryCounting(ledger.words, ledger.tail, ENTERED)
        text = dispatch_text(self._core, 2 * self._words, counts)
        self._dispatcher = self._at_once(text, BLOCK_LEVEL)
        self._dispatch = Call(self._dispatcher.address)
        self._hand_out()
        if self.seconds is None and ledger is None:
            self._native = self._dispatch

    def _at_once(self, text: str, level: int) -> Loaded:
        """Code the engine cannot start without."""
        key = self.compiler.key(level, text.encode())
        return self.compiler.kept(key) or self.compiler.now(text, level, key)

    def _fetch(self, pc: int) -> Insn | None:
        """Decoded instruction for the translator; none where nothing can be run."""
        if pc >> 1 >= self._words or not self._core.program.executable(pc):
            return None
        flash = self._core.program.flash
        second = flash[(pc >> 1) + 1] if (pc >> 1) + 1 < self._words else 0
        return decode_for_execution(flash[pc >> 1], second)

    def _request(self, code: Code, pc: int) -> None:
        """Get native code for the region at `pc`, from disk or from the compile process."""
        region = discover(pc, self._fetch, code.entries, self._hooks)
        code.regions[pc] = region
        if not region.steps:
            return
        code.entries |= region.leaders
        self.counts.regions += 1
        hooked = sorted(code.around.hooks & region.steps.keys())
        ledger = self._ledger
        rows = [self._row_of(at) for at in sorted(region.steps)] if ledger is not None else None
        identity = repr((region.words(), sorted(region.leaders), pc, hooked, rows)).encode()
        for exact, level in ((True, STEP_LEVEL), (False, BLOCK_LEVEL)):
            key = self.compiler.key(level, b"exact" if exact else b"block", code.identity, identity)
            kept = self.compiler.kept(key)
            if kept is not None:
                self._install((code, exact), kept)
                continue
            count = None if ledger is None else Counting(ledger.words, ledger.tail, self._row_of)
            translator = Translator(region, code.around, code.context, exact, count)
            text, entries = translator.text(), translator.entries
            if self.wait:
                self._install((code, exact), self.compiler.now(text, level, key, entries))
            else:
                self.compiler.request(text, level, key, entries, (code, exact))

    def _collect(self) -> None:
        """Install what the compile process has made meanwhile, for whichever machine, and let it go on."""
        for tag, loaded in self.compiler.poll():
            self._install(tag, loaded)

    def _install(self, tag: Any, loaded: Loaded) -> None:
        code, exact = tag
        code.held.append(loaded)
        table = code.steps if exact else code.blocks
        for pc in loaded.entries:
            if not table[pc >> 1]:
                table[pc >> 1] = loaded.address

    def _flash_changed(self, start: int, end: int) -> None:
        """Program words in [start, end) are new: whatever was made from the old ones is stale."""
        self._codes.clear()
        self._forget_computed()
        self._key = None
