"""The specialised interpreter: functions generated per stretch of program, plain steps everywhere else.

What is generated depends on the program words and on processor modes (`_Modes`); code for other modes is kept apart.
A block runs only if no event is due and no limit falls before it ends, so inside it nothing but its own instructions
can happen. Everything else goes through the sequencer, one instruction at a time.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Final

from emu.dspic30f.core import Core
from emu.dspic30f.interpreter.arithmetic import ctz16, div_trunc, rem_trunc
from emu.dspic30f.isa.codec import decode_for_execution
from emu.dspic30f.isa.row import Insn
from emu.dspic30f.layout import places_of
from emu.dspic30f.specialised.blocks import LENGTH, Block, BlockWriter, make_function, write_repeat
from emu.dspic30f.specialised.source import PLAIN, Source, Unsupported
from emu.dspic30f.state.modes import Key, Modes
from emu.dspic30f.state.state import LAST, RA
from emu.system.native_handle import Run

MODES_KEPT: Final = 64
"""Combinations of processor modes (a DO loop counts as one) whose functions are kept."""
WARM: Final = 16
"""Times an address is reached before a function is written for it."""


@dataclass
class _Modes:
    """Functions for one combination of processor modes."""

    blocks: dict[int, Block | None] = field(default_factory=dict)
    singles: dict[int, Block | None] = field(default_factory=dict)
    """Blocks of one instruction, for what is left before an event or a limit."""
    repeats: dict[int, Block | None] = field(default_factory=dict)
    loop: tuple[int, int] | None = None


class SpecialisedEngine:
    """`Engine` on generated Python functions."""

    name = "interp"

    def __init__(self, core: Core, pc_hooks: Mapping[int, Any], warm: int = WARM) -> None:
        self._core: Final = core
        self._hooks: Final = pc_hooks
        self.warm = warm
        """Times an address is reached before a function is written for it."""
        self.length = LENGTH
        """Longest block in instructions."""
        self._state: Final = core.state
        self._sequencer: Final = core.sequencer
        self._places = places_of(core)
        record = core.record
        self._names: Final = {
            "u8": record.u8,
            "u16": record.u16,
            "u32": record.u32,
            "u64": record.u64,
            "read": core.bus.read,
            "write": core.bus.write,
            "finish": core.sequencer.finish_retfie,
            "div_trunc": div_trunc,
            "rem_trunc": rem_trunc,
            "ctz16": ctz16,
        }
        self._by_modes: Final[dict[object, _Modes]] = {}
        self._heat: Final[dict[tuple[int, int], int]] = {}
        self._modes = _Modes()
        self._now: Final = Modes(core.state)
        self._key: Key = self._now.key()
        core.program.changed.append(self._flash_changed)

    def run(self, limit: int) -> None:
        """Functions and plain steps until a boundary has work, a hooked PC or `limit` is reached."""
        u16, u32, u64 = self._core.record.u16, self._core.record.u32, self._core.record.u64
        at = self._state.at
        cycle_at, pc_at, repeat_at, edt_at = at["cpu.cycle"], at["cpu.pc"], at["cpu.repeat"], at["cpu.edt"]
        deadline_at, hooks = self._core.events.deadline_index, self._hooks
        self._select()
        while True:
            cycle, pc, deadline = u64[cycle_at], u32[pc_at], u64[deadline_at]
            if u16[edt_at]:
                block = None
            elif u16[repeat_at]:
                block = self._repeat(pc)
            else:
                block = self._modes.blocks.get(pc) or self._block(self._modes.blocks, pc, self.length)
                if block and (cycle + block.reach > deadline or cycle + block.last_start >= limit):
                    block = self._modes.singles.get(pc) or self._block(self._modes.singles, pc, 1)
            if block is None or cycle + block.reach > deadline or cycle + block.last_start >= limit:
                status = PLAIN
            else:
                status = block.run(min(limit, deadline))
            if status:
                if status == PLAIN:
                    self._sequencer.execute()
                self._select()
            cycle = u64[cycle_at]
            if cycle >= limit or u64[deadline_at] < cycle or (hooks and u32[pc_at] in hooks):
                return

    def natively(self, limit: int) -> bool:
        """Nothing is native."""
        return False

    def pass_limits(self, period: int, last: int) -> None:
        """As `Engine.pass_limits`: no limit is passed."""

    def passed(self) -> list[int]:
        """As `Engine.passed`."""
        return []

    def lend(self, run: Run) -> None:
        """As `Engine.lend`: there is nothing to lend."""

    def forget(self) -> None:
        """Hooks have changed: write everything anew."""
        self._places = places_of(self._core)
        self._by_modes.clear()
        self._modes = _Modes()

    def _flash_changed(self, _start: int, _end: int) -> None:
        self.forget()
        self._heat.clear()

    def _select(self) -> None:
        """Make the functions for the present processor modes current."""
        key = self._key = self._now.key()
        modes = self._by_modes.get(key)
        if modes is None:
            if len(self._by_modes) >= MODES_KEPT:
                self._by_modes.clear()
            modes = self._by_modes[key] = _Modes(loop=key.loop)
        self._modes = modes

    def _source(self) -> Source:
        key = self._key
        return Source(self._places, key.context, key.initialised, bool(key.limit_armed))

    def _fetch(self, pc: int) -> Insn | None:
        """Decoded instruction; None where the sequencer must look itself."""
        program = self._core.program
        if not program.executable(pc):
            return None
        return decode_for_execution(program.word(pc), program.word(pc + 2))

    def _block(self, blocks: dict[int, Block | None], pc: int, length: int) -> Block | None:
        """The block at `pc` of at most `length` instructions, written when it has been asked for often enough."""
        if pc in blocks:
            return None
        heat = self._heat[pc, length] = self._heat.get((pc, length), 0) + 1
        if heat < self.warm:
            return None
        source = self._source()
        times = BlockWriter(source, self._fetch, self._hooks.__contains__, self._modes.loop, length).write(pc)
        block = None if times is None else Block(make_function(source, self._names), *times)
        blocks[pc] = block
        return block

    def _repeat(self, pc: int) -> Block | None:
        """The loop of the REPEAT target at `pc`, if it can run as one now."""
        state, modes = self._state, self._modes
        counting = bool(state.sr & RA)
        if counting != bool(state.rcount) or (not counting and state.repeat != LAST):
            return None
        if pc not in modes.repeats:
            modes.repeats[pc] = self._write_repeat(pc)
        return modes.repeats[pc]

    def _write_repeat(self, pc: int) -> Block | None:
        insn = self._fetch(pc)
        last_of_loop = self._modes.loop is not None and pc == self._modes.loop[1]
        if insn is None or last_of_loop or pc in self._hooks:  # an iteration is an arrival
            return None
        source = self._source()
        try:
            cycles = write_repeat(source, insn, pc)
        except Unsupported:
            return None
        return Block(make_function(source, self._names), cycles, cycles)
