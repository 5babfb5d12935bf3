"""The native engine: looks up translated regions by PC and processor modes, and runs them between two boundaries.

Native code returns to Python for instructions with side effects, for events, and at addresses that have no code yet.
Code comes immediately from the disk cache or later from the compile process; until then the interpreter runs.
"""

from __future__ import annotations

import ctypes
import hashlib
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from time import perf_counter
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Final
from weakref import WeakValueDictionary

from emu.dspic30f.core import ONE_INSTRUMENT, Core
from emu.dspic30f.isa.codec import decode_for_execution
from emu.dspic30f.isa.facts import facts_of
from emu.dspic30f.isa.row import Insn
from emu.dspic30f.jit.code_table import CodeTable, EngineStatistics
from emu.dspic30f.jit.cold_runner import ColdRunner
from emu.dspic30f.jit.compiler import LoadedCode, shared_compiler
from emu.dspic30f.jit.environment import (
    ACCOUNTING,
    ARRIVALS,
    AT_BOUNDARY,
    BLOCKS,
    ENV_WORDS,
    INDIRECT_SFR,
    INTERRUPTS,
    LAST_LIMIT,
    LIMIT,
    NOWHERE,
    PASSED,
    PASSED_COUNT,
    PASSED_ROOM,
    PERIOD,
    REFRESHED,
    RESUME,
    SEEN,
    STEPS,
)
from emu.dspic30f.jit.exit_reasons import BOUNDARY_WORK, DEADLINE, HOOK, INTERPRET, MISS, RETFIE, UNFINISHED
from emu.dspic30f.jit.hot_regions import SAMPLE_CYCLES
from emu.dspic30f.jit.machine_layout import (
    MachineLayout,
    machine_layout,
    record_offsets,
    translation_hash,
    wiring_hash,
)
from emu.dspic30f.jit.translate.region import Region, discover
from emu.dspic30f.state.modes import Key, Modes
from emu.dspic30f.state.state import IPL3, NOT_REPEATING, RUN
from emu.system.arrivals import ArrivalHook, ArrivalLog, Recording
from emu.system.events import NEVER
from emu.system.hook_filters import Filter
from emu.system.native_handle import FRESH_ROOM, Native, Run
from emu.system.rules import Rule

if TYPE_CHECKING:
    from emu.dspic30f.jit.counting import Counting

STEP_LEVEL, BLOCK_LEVEL, HOT_LEVEL = 0, 1, 3
"""LLVM optimisation levels: exact code, block code, block code of hot regions and the dispatch loop."""

WARM_UP: Final = 10_000
"""Cycles after power-on that the first machine of a process interprets, in Tcy.

Importing the translator and loading the first code takes longer than interpreting these cycles.
"""

COLD_CYCLES: Final = 1000
"""Maximum length of an interpreted run in Tcy before native code is looked up again."""

NATIVE_CYCLES: Final = 30_000_000
"""Maximum length of a native run in Tcy before Python handles signals."""

TRANSLATOR: Final = "emu.dspic30f.jit.translate.function"
"""Module that is imported at the first translation."""

NATIVE_FIELDS: Final = {"cycle": "cpu.cycle", "now": "events.now", "deadline": "events.deadline", "pc": "cpu.pc",
                        "mode": "cpu.mode"}  # fmt: skip
NATIVE_SFRS: Final = {"corcon": "CORCON"}
"""Record fields and registers by the names of the fields in `Native`."""

Call = ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_void_p, ctypes.c_void_p)


_shared: Final[WeakValueDictionary[object, CodeTable]] = WeakValueDictionary()
"""Code tables in use, by the inputs of their code."""


class JitEngine:
    """Engine that runs native code, and interprets code that is not translated yet."""

    name = "jit"

    def __init__(
        self,
        core: Core,
        pc_hooks: Mapping[int, Any],
        pc_filters: Mapping[int, Sequence[Filter | None]] = MappingProxyType({}),
    ) -> None:
        self._core: Final = core
        self._hooks: Final = pc_hooks
        self._pc_filters: Final = pc_filters
        self.threshold = 4
        """How often an address without code must be reached before it is translated."""
        self.wait = False
        """Whether code is compiled before it runs, for tests and benchmarks."""
        self.share_group: object = None
        """Machines with equal values share translations. Tests that change translations set a unique object."""
        self._longest = NATIVE_CYCLES
        self._unsampled = 0
        """Tcy of native runs since the last sample of `HotRegions`."""
        self._warm_at = 0 if TRANSLATOR in sys.modules else WARM_UP
        self._counting: Counting | None = None
        self._arrivals: ArrivalLog | None = None
        """Log of arrivals to which native code appends."""
        self._count_key: object = None
        """Value that distinguishes code translated after one call of `start_counting` from all other code."""
        self._state: Final = core.state
        self._u16: Final = core.record.u16
        self._words: Final = core.chip.program["flash"].end // 2
        self.compiler = shared_compiler()
        self._computed: Final[dict[int, int]] = {}
        self._refreshed: Final[set[int]] = set()
        self._env: Final = (ctypes.c_uint64 * ENV_WORDS)()
        self._env[SEEN] = NEVER
        self._env_address: Final = ctypes.addressof(self._env)
        self._codes: Final[dict[object, CodeTable]] = {}
        self._indirect_sfr: Final[dict[object, LoadedCode]] = {}
        self._code: CodeTable | None = None
        self._key: object = None
        self._dispatch: Any = None
        self._dispatcher: LoadedCode | None = None
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
        self._offset: Final = record_offsets(core)
        self._wiring: tuple[list[Rule | None], bytes] = [], b""
        self.counts: Final = EngineStatistics()
        self.seconds: dict[str, float] | None = None
        """Host seconds by activity; filled after a call of `measure_time`."""
        core.program.changed.append(self._flash_changed)

    # -- the engine -------------------------------------------------------------------------------------------------
    def run(self, limit: int) -> None:
        """Run at least one instruction, natively where possible."""
        state = self._state
        if self._counting is not None:
            self._counting.after_hooks()
        if self._arrivals is not None:
            self._env[ARRIVALS] = 0 if self._core.events.quiet else self._arrivals.address
        if state.edt or self._core.events.deadline < state.cycle:  # a hook called `kick` after the boundary
            self._core.sequencer.execute()
            return
        if state.cycle < self._warm_at and not self.wait:
            self._run_cold(min(limit, self._warm_at))
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
        reason = self._native(self._core.record.address, self._env_address)
        self._env[RESUME] = NOWHERE
        self.counts.runs += 1
        self._sample(state.cycle - start)
        self._after_run(reason, start, limit)

    def _after_run(self, reason: int, start: int, limit: int) -> None:
        """Do the work for which native code returned to `run`."""
        state, sequencer = self._state, self._core.sequencer
        if reason == RETFIE:
            sequencer.after_retfie()
        elif reason == UNFINISHED:
            sequencer.boundary(limit)
        elif (reason == INTERPRET and (state.cycle == start or state.pc not in self._hooks)) or (
            reason == HOOK and state.cycle == start  # the block after the hook did not fit; exact code stops there too
        ):
            self.counts.interpreted += 1
            self._interpret()
        elif reason in (MISS, DEADLINE):
            cycle = state.cycle
            quiet = cycle < limit and self._core.events.deadline >= cycle and state.pc not in self._hooks
            if cycle == start or quiet:
                self._miss(limit)

    def natively(self, limit: int) -> bool:
        """Run native code as `Engine.natively` specifies. Calls are often short, so it reads the record directly."""
        start = self._u64[self._now]
        if self._dispatch is None or not start or self._u16[self._edt]:  # a native boundary needs a preceding cycle
            return False
        if self._counting is not None and self._counting.is_exact:
            return False
        if self._arrivals is not None:
            self._env[ARRIVALS] = 0 if self._core.events.quiet else self._arrivals.address
        if self.compiler.busy:
            self._collect()
        self._select()
        reason, cycle, limit = self._run_native(start, limit)
        if reason == INTERPRET and self._u32[self._pc] not in self._hooks:
            self.counts.interpreted += 1
            self._interpret()
            return True
        if reason == RETFIE:
            self._core.sequencer.after_retfie()
            return True
        if reason == UNFINISHED:
            self._core.sequencer.boundary(limit)
            return True
        return cycle >= limit or (reason != BOUNDARY_WORK and cycle != start)

    def _run_native(self, start: int, limit: int) -> tuple[int, int, int]:
        """Run native code from the boundary at cycle `start`, as long as Python need not interpret an instruction.

        Return the last exit reason, its cycle, and the limit, which native code may have passed.
        """
        u64, now, env = self._u64, self._now, self._env
        record, environment = self._core.record.address, self._env_address
        native = self._native if self._lent is None or self._native is not self._dispatch else self._lent
        env[LIMIT] = min(limit, start + self._longest)
        env[AT_BOUNDARY] = 1
        reason, before = native(record, environment), start
        limit = max(limit, env[LIMIT]) if env[LAST_LIMIT] else limit
        while before != (cycle := u64[now]) < limit and self._continue(reason, cycle):
            before = cycle
            reason = native(record, environment)
            env[AT_BOUNDARY] = 1
            limit = max(limit, env[LIMIT]) if env[LAST_LIMIT] else limit
            self.counts.runs += 1
        env[AT_BOUNDARY] = 0
        self.counts.runs += 1
        self._sample(cycle - start)
        return reason, cycle, limit

    def _continue(self, reason: int, cycle: int) -> bool:
        """Fire events or update a device if native code returned for that. Return whether native code may run again."""
        if reason == BOUNDARY_WORK:  # usually a device's event is due
            self._core.events.fire_until(cycle if self._u16[self._mode] != RUN else cycle - 1)
            return not self._core.sequencer.power.signals.interrupted()
        if reason == INTERPRET and self._refresh(self._u32[self._pc], cycle):
            self._env[AT_BOUNDARY] = 0  # the instruction boundary has been processed
            return True
        return False

    def _sample(self, cycles: int) -> None:
        """Count the Tcy of a native run that has just ended, and compile its region again if it is hot."""
        self._unsampled += cycles
        if self._unsampled >= SAMPLE_CYCLES and self._code is not None and self._counting is None:
            region = self._code.hot.sample(self._u32[self._pc], self._unsampled)
            self._unsampled = 0
            if region is not None:
                self.counts.hot += 1
                self._compile(self._code, region, exact=False, level=HOT_LEVEL)

    def skip_hooks_at(self, cycle: int) -> None:
        """Implement `Engine.skip_hooks_at`."""
        self._env[SEEN] = cycle

    def pass_limits(self, period: int, last: int) -> None:
        """Let native code pass limits without returning, as `Engine.pass_limits` specifies."""
        self._env[PERIOD], self._env[LAST_LIMIT] = period, last

    def passed(self) -> list[int]:
        """Return the first boundary (Tcy) at or after each limit passed since the last call."""
        count = self._env[PASSED_COUNT]
        if not count:
            return []
        self._env[PASSED_COUNT] = 0
        return list(self._env[PASSED : PASSED + count])

    def attach_runner(self, run: Run) -> Native:
        """Implement `Engine.attach_runner`."""
        core, env, record = self._core, self._env_address, self._core.record
        at = {name: record.address + record.fields[field].offset for name, field in NATIVE_FIELDS.items()}
        at |= {name: record.address + core.chip.sfrs[sfr].address for name, sfr in NATIVE_SFRS.items()}
        words = {
            "begins": AT_BOUNDARY,
            "limit": LIMIT,
            "last": LAST_LIMIT,
            "noted": PASSED_COUNT,
            "notes": PASSED,
            "fresh": REFRESHED,
        }
        at |= {name: env + 8 * word for name, word in words.items()}
        self._run = run
        self._lent_as = Native(record=record.address, env=env, room=PASSED_ROOM, interpret=INTERPRET,
                               service=BOUNDARY_WORK, awake=RUN, trap=IPL3, **at)  # fmt: skip
        self._publish_native_handle()
        return self._lent_as

    def _publish_native_handle(self) -> None:
        """Publish the dispatch loop to the host program that calls native code."""
        if self._run is not None and self._lent_as is not None and self._dispatcher is not None:
            self._lent, self._lent_as.entry = partial(self._run, self._dispatch), self._dispatcher.address

    def _refresh(self, pc: int, cycle: int) -> bool:
        """Let a device update the register in the record that the instruction at `pc` reads.

        Return whether native code can then run that instruction.
        """
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
            self._remember_refresh(pc | word << 32)
        return True

    def _remember_refresh(self, instruction: int) -> None:
        """Record an instruction whose register a device must update, for the host program that calls native code."""
        count = len(self._refreshed)
        if instruction not in self._refreshed and count < FRESH_ROOM - 1:
            self._refreshed.add(instruction)
            self._env[REFRESHED + count] = instruction

    def _forget_computed(self) -> None:
        self._computed.clear()
        self._refreshed.clear()
        self._env[REFRESHED : REFRESHED + FRESH_ROOM] = [0] * FRESH_ROOM

    def _computed_word(self, pc: int) -> int:
        """Return the index of the register that the one-cycle instruction at `pc` reads by its address.

        Return 0 if native code cannot read it.
        """
        insn = self._fetch(pc)
        if insn is None or insn.row.cycles != 1 or self._code is None:
            return 0
        words = [address >> 1 for address in facts_of(insn).reads]
        return words[0] if words and 2 * words[0] in self._code.layout.rules else 0

    def start_counting(self, counting: Counting) -> Callable[[], None]:
        """Count what all code does. Return the function that ends it.

        Until then, all code is compiled before it runs, and the sequencer runs code that is not compiled. Raises
        ValueError if the engine already counts.
        """
        if self._counting is not None:
            raise ValueError(ONE_INSTRUMENT)
        saved = self._interpret, self._run_cold, self.wait, self._native

        def run(record: int, env: int) -> Any:
            counting.before_run()
            reason = self._dispatch(record, env)
            if reason != RETFIE:  # after a RETFIE, the cycle of the last log entry may still change
                counting.after_run(reason)
            return reason

        counting.start()
        execute = self._core.sequencer.execute
        self._interpret, self._run_cold, self.wait, self._native = execute, lambda _limit: execute(), True, run
        self._counting, self._longest, self._dispatch = counting, counting.longest or NATIVE_CYCLES, None
        self._count_key = object()
        self._env[ACCOUNTING] = counting.address
        self.forget()

        def stop() -> None:
            counting.stop()
            self._interpret, self._run_cold, self.wait, self._native = saved
            self._counting, self._longest, self._dispatch = None, NATIVE_CYCLES, None
            self._count_key = None
            self.forget()

        return stop

    def measure_time(self) -> None:
        """Start to measure the host time of each activity (`emu run --stats`)."""
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
        """Discard the translations, because the hooked addresses at which native code returns have changed."""
        hooks = (hook for hooks in self._hooks.values() for hook in hooks if isinstance(hook, ArrivalHook))
        self._arrivals = next((hook.log for hook in hooks), None)
        self._codes.clear()
        self._forget_computed()
        self._key = None

    def translated(self) -> Iterable[CodeTable]:
        """Return the code tables of all sets of processor modes."""
        return self._codes.values()

    @property
    def interrupts(self) -> int:
        """Return the number of interrupts that native code has entered."""
        return int(self._env[INTERRUPTS])

    def _miss(self, limit: int) -> None:
        """Handle a PC without code: run the interpreter, and request a translation if the PC is reached often."""
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
            if code.steps[pc >> 1] and pc not in self._hooks:  # the hook at PC has already been called
                return
        self.counts.cold += 1
        self._run_cold(min(limit, self._state.cycle + COLD_CYCLES))

    # -- modes ------------------------------------------------------------------------------------------------------
    def _select(self) -> None:
        """Select the code tables for the current processor modes."""
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
        self._env[INDIRECT_SFR] = code.indirect_sfr.address

    def _new_code(self, key: Key) -> CodeTable:
        core = self._core
        layout = machine_layout(core, key, frozenset(self._hooks), self._offset, self._filters(), self._recorded())
        if self._wiring[0] != core.bus.rules:
            self._wiring = core.bus.rules[:], wiring_hash(layout)
        identity = translation_hash(key.context, layout, self._wiring[1])
        program = hashlib.sha256(core.program.flash).digest()
        switches = core.bus.off, frozenset(core.bus.watched), self.wait, self._count_key, self.share_group
        hooked = layout.hooks, frozenset(layout.filters.items()), frozenset(layout.recorded.items())
        shared = identity, program, *hooked, *switches
        code = _shared.get(shared)
        if code is None:
            table = ctypes.c_uint64 * self._words
            helper = self._indirect_sfr_code(layout)
            code = _shared[shared] = CodeTable(key.context, layout, identity, helper, table(), table())
        return code

    def _filters(self) -> dict[int, tuple[Filter, ...]]:
        """Return the filters of the addresses at which every hook has one."""
        known = {pc: tuple(one for one in filters if one is not None) for pc, filters in self._pc_filters.items()}
        return {pc: some for pc, some in known.items() if some and len(some) == len(self._pc_filters[pc])}

    def _recorded(self) -> dict[int, Recording]:
        """Return what native code records at the addresses whose only hook belongs to the log of arrivals."""
        only = {pc: hooks[0] for pc, hooks in self._hooks.items() if len(hooks) == 1}
        return {
            pc: hook.recording
            for pc, hook in only.items()
            if isinstance(hook, ArrivalHook) and hook.log is self._arrivals
        }

    def _indirect_sfr_code(self, layout: MachineLayout) -> LoadedCode:
        """Return the helper for indirect SFR access."""
        bus = self._core.bus
        key = bus.off, frozenset(bus.watched), layout.limit_armed
        if key not in self._indirect_sfr:
            from emu.dspic30f.jit.ir.indirect_sfr import indirect_sfr_text

            text = indirect_sfr_text(self._core, layout)
            self._indirect_sfr[key] = self._at_once(text, STEP_LEVEL)
        return self._indirect_sfr[key]

    # -- translation ------------------------------------------------------------------------------------------------
    def _prepare(self) -> None:
        from emu.dspic30f.jit.runtime import dispatch_text  # imported here, as the translator: slow to import

        counter = None if self._counting is None else self._counting.boundary_counter()
        text = dispatch_text(self._core, 2 * self._words, counter)
        self._dispatcher = self._at_once(text, HOT_LEVEL)
        self._dispatch = Call(self._dispatcher.address)
        self._publish_native_handle()
        if self.seconds is None and self._counting is None:
            self._native = self._dispatch

    def _at_once(self, text: str, level: int) -> LoadedCode:
        """Compile and return code that the engine needs at its start."""
        key = self.compiler.key(level, text.encode())
        return self.compiler.lookup(key) or self.compiler.compile_now(text, level, key)

    def _fetch(self, pc: int) -> Insn | None:
        """Return the decoded instruction at `pc` for the translator, None if none can be executed there."""
        if pc >> 1 >= self._words or not self._core.program.executable(pc):
            return None
        flash = self._core.program.flash
        second = flash[(pc >> 1) + 1] if (pc >> 1) + 1 < self._words else 0
        return decode_for_execution(flash[pc >> 1], second)

    def _request(self, code: CodeTable, pc: int) -> None:
        """Find the region at `pc` and install or request its code."""
        region = discover(pc, self._fetch, code.entries, self._hooks)
        code.regions[pc] = region
        if not region.steps:
            return
        code.entries |= region.leaders
        self.counts.regions += 1
        for exact, level in ((True, STEP_LEVEL), (False, BLOCK_LEVEL)):
            if self._counting is None or exact or not self._counting.is_exact:
                self._compile(code, region, exact, level)

    def _compile(self, code: CodeTable, region: Region, exact: bool, level: int) -> None:
        """Install code of a region, at `level` or better, or request it from the compile process."""
        from emu.dspic30f.jit.translate.function import Translator

        known_at, counting = {**code.layout.filters, **code.layout.recorded}, self._counting
        hooked = [(pc, known_at.get(pc)) for pc in sorted(code.layout.hooks & region.steps.keys())]
        counted = counting.identity(region) if counting is not None else None
        identity = repr((region.words(), sorted(region.leaders), region.start, hooked, counted)).encode()
        kind = b"exact" if exact else b"block"
        keys = {each: self.compiler.key(each, kind, code.identity, identity) for each in (HOT_LEVEL, level)}
        for each, key in keys.items():
            known = self.compiler.lookup(key)
            if known is not None:
                self._install((code, exact, each), known)
                return
        counter = counting.counter() if counting is not None else None
        translator = Translator(region, code.layout, code.context, exact, counter)
        text, entries = translator.text(), translator.entries
        if self.wait:
            self._install((code, exact, level), self.compiler.compile_now(text, level, keys[level], entries))
        else:
            self.compiler.request(text, level, keys[level], entries, (code, exact, level))

    def _collect(self) -> None:
        """Install all code that the compile process has finished, for any machine, and send it the next request."""
        for tag, loaded in self.compiler.poll():
            self._install(tag, loaded)

    def _install(self, tag: Any, loaded: LoadedCode) -> None:
        code, exact, level = tag
        code.loaded.append(loaded)
        table = code.steps if exact else code.blocks
        for pc in loaded.entries:
            if level == HOT_LEVEL or not table[pc >> 1]:
                table[pc >> 1] = loaded.address

    def _flash_changed(self, start: int, end: int) -> None:
        """Discard the translations, because the program words in [start, end) have changed."""
        self._codes.clear()
        self._forget_computed()
        self._key = None
