"""The sequencer defines the order and timing of the dsPIC30F core. Every engine behaves as this module.

Time. An instruction that starts in cycle s occupies cycles s..e: first a RAW stall (isa.md §13.2), then its base cycles
(§13.1), then PSV cycles (§13.3). A taken branch or a skip adds cycles after its data access. Data accesses happen in e
(of two, the first in e - 1). Devices advance to the cycle of an access before the access happens. A write in cycle t
affects them from t + 1 (engines.md §4.2; UNVERIFIED on silicon).

Boundaries. Between two instructions, after last cycle e, the engine handles the boundary if an event is due by e or
`kick` was called (`Events.deadline` <= e). Due events fire. Then an acceptable exception is entered; its handler starts
in max(c + 4, e + 3) (isa.md §14.3, interrupts.py). Another boundary follows the entry, so that an exception of higher
priority can be entered immediately. RETURN, RETLW and RETFIE check one cycle early: they take 2 cycles instead of 3 if
an exception is acceptable then.

Loops. Within REPEAT, PC stays at the target, and a boundary follows every iteration. RA is 0 during the last
iteration (isa.md §7.5, UNVERIFIED). If the instruction at DOEND does not change the flow, the loop continues or ends
(§7.6). The rules in flow_rules.py define the register effects of REPEAT, DO, RETFIE and DISI, and the cost of skips and
stalls. A flow change out of a REPEAT target, or by the last instruction of a DO loop, is executed (undefined on
silicon).

Faults. An address error inhibits the stores of its instruction, which otherwise completes. Stack and math errors are
visible from e + 1, hard traps from e. An illegal opcode, an uninitialised pointer and a trap conflict reset the device.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from emu.dspic30f.exceptions.faults import DebuggerWord, DeviceReset, IllegalOpcode, TrapConflict
from emu.dspic30f.exceptions.interrupts import Exceptions
from emu.dspic30f.exceptions.power import PowerSaving, Sleeping
from emu.dspic30f.interpreter import flow_rules
from emu.dspic30f.interpreter.plain import Interpreter
from emu.dspic30f.interpreter.rule_paths import function_of
from emu.dspic30f.isa.codec import decode_for_execution
from emu.dspic30f.isa.debugger_words import is_debug_word
from emu.dspic30f.isa.facts import Facts, facts_of
from emu.dspic30f.isa.flow import (
    PC_MASK,
    Branch,
    Call,
    ClearWatchdog,
    Disi,
    Do,
    Flow,
    Goto,
    Repeat,
    Reset,
    Return,
    Skip,
    Sleep,
)
from emu.dspic30f.isa.row import Insn
from emu.dspic30f.state.state import DA, IDLE, MIDDLE, NOT_REPEATING, RA, RUN, SLEEP, State
from emu.system.events import Events
from emu.system.program import ProgramMemory


@dataclass(frozen=True, slots=True)
class Step:
    """A decoded instruction, its facts and the address after it."""

    insn: Insn
    facts: Facts
    next_pc: int


class Sequencer:
    """Fetches, decodes and runs instructions one at a time: the plain engine, and the fallback of native code."""

    def __init__(
        self,
        state: State,
        events: Events,
        program: ProgramMemory,
        exceptions: Exceptions,
        builder: Interpreter,
    ) -> None:
        self.state: Final = state
        self.events: Final = events
        self.program: Final = program
        self.exceptions: Final = exceptions
        self.builder: Final = builder
        self.power: Final = PowerSaving(state, events, exceptions)
        self._hold: Final = state.record.reserve("cpu.hold", "Q").index
        self._steps: Final[dict[int, Step]] = {}
        program.changed.append(self._forget)
        operands, record = flow_rules.operands_of(state), state.record
        self._repeat: Final = function_of(record, flow_rules.execute_repeat, operands, "count")
        self._repeated: Final = function_of(record, flow_rules.end_iteration, operands, "counting")
        self._do: Final = function_of(record, flow_rules.execute_do, operands, "count", "start", "end")
        self._loop_again: Final = function_of(record, flow_rules.end_loop_iteration, operands)
        self._resume: Final = function_of(record, flow_rules.execute_retfie, operands, "srl", "ipl3")
        self._disi: Final = function_of(record, flow_rules.execute_disi, operands, "count", "after")

    def _forget(self, start: int, end: int) -> None:
        """Discard decoded instructions because the flash words in [start, end) have changed."""
        for pc in [pc for pc in self._steps if start - 2 <= pc < end]:
            del self._steps[pc]

    def hold_until(self, cycle: int) -> None:
        """Stall the CPU until `cycle`, while flash is programmed (dspic30f6014a.md §16)."""
        self.state.record.u64[self._hold] = cycle
        self.events.kick()

    # Boundaries

    def boundary(self, limit: int) -> bool:
        """Handle the boundary between two instructions. Return False if the CPU sleeps and no source can wake it.

        While the CPU sleeps, time passes up to `limit`.
        """
        state, events = self.state, self.events
        hold = state.record.u64[self._hold]
        if hold:
            state.cycle = max(state.cycle, hold)
            state.record.u64[self._hold] = 0
        while True:
            if state.mode != RUN:
                sleeping = self.power.pass_time(limit)
                if sleeping is not Sleeping.ENDED:
                    return sleeping is Sleeping.GOES_ON
            last = state.cycle - 1
            if events.deadline > last >= 0:
                return True
            events.settle(last)
            accepted = self.exceptions.acceptable(last)
            if accepted is None:
                return True
            self.exceptions.enter(accepted, last)
            events.kick()

    # Instructions

    def fetch(self, pc: int) -> Step:
        """Return the decoded instruction at `pc`. Raises IllegalOpcode, or DebuggerWord for a debugger word."""
        step = self._steps.get(pc)
        if step is None:
            word1 = self.program.word(pc)
            insn = decode_for_execution(word1, self.program.word(pc + 2 & PC_MASK))
            if insn is None:
                if is_debug_word(word1):
                    raise DebuggerWord(f"debugger word {word1:06X}")
                raise IllegalOpcode(word1)
            step = self._steps[pc] = Step(insn, facts_of(insn), pc + 2 * insn.words & PC_MASK)
        return step

    def execute(self) -> None:
        """Execute the instruction at PC, from its stall to its last cycle.

        Raises DeviceReset, with PC at the faulting instruction. Raises DebuggerWord, with PC and cycle after the word.
        """
        state = self.state
        pc = state.pc
        if not self.program.executable(pc):
            self._fetch_error()
            return
        try:
            step = self.fetch(pc)
        except DebuggerWord:
            state.pc = pc + 2
            state.cycle += 1
            state.stall = 0
            raise
        facts, builder = step.facts, self.builder
        start = state.cycle + flow_rules.stall(state.stall, facts.source_pointers)
        repeat = state.repeat
        extra = facts.window_cycles if repeat == NOT_REPEATING else 0 if repeat == MIDDLE else 2
        builder.begin(pc, start + facts.access, facts.loads, extra)
        try:
            state.pc = step.next_pc
            flow = step.insn.row.does(builder, step.insn.x)
            builder.commit()
        except DeviceReset:
            state.pc = pc
            raise
        last = builder.last if flow is None else self._follow(flow, pc, builder.last)
        if builder.math or builder.stack_error:
            builder.request_soft_traps(last)
        if state.sr & RA or repeat != NOT_REPEATING:
            last = self._after_target(step, flow, pc, last)
        if state.sr & DA and pc == state.pair("DOENDL") and state.pc == step.next_pc and self._loop_again():
            state.pc = state.pair("DOSTARTL")
        if state.edt and state.edt < flow_rules.EDT_MATURE:
            state.edt += 1
        state.cycle = last + 1

    def _fetch_error(self) -> None:
        """Request a hard trap at this boundary: no instruction can be fetched at PC (isa.md §14.4, causes 4 and 5).

        UNVERIFIED: if a trap of equal or higher level is in progress, the device resets. No boundary precedes cycle 0,
        so a fetch error in cycle 0 counts as one in cycle 1.
        """
        state = self.state
        state.cycle = max(state.cycle, 1)
        traps = self.exceptions.traps
        if state.ipl >= traps.address.vector.level:
            entered = self.exceptions.last_entered()
            origin = f", after {entered}" if entered else ""
            raise TrapConflict(f"no instruction can be fetched at {state.pc:06X}{origin}")
        traps.request(traps.address, state.cycle - 1)

    # Flow of control

    def _follow(self, flow: Flow, pc: int, last: int) -> int:
        """Apply a row's flow to PC and the loop registers. Return the last cycle of the instruction."""
        state = self.state
        match flow:
            case Branch(cond, target):
                if cond:
                    state.pc = target
                    last += flow_rules.TAKEN
            case Skip(cond):
                if cond:
                    last += self._skip()
            case Goto(target) | Call(target):
                state.pc = target
            case Return():
                return self._return(flow, last)
            case Repeat(count):
                self._repeat(count)
            case Do(count, end):
                self._do(count, state.pc, end)
            case Disi(count):
                self._disi(count, last + 1)
                self.events.kick()
            case ClearWatchdog():
                self.events.arrive(last)
                self.power.signals.clear_watchdog()
            case Sleep(mode):
                self.power.stop(IDLE if mode == "idle" else SLEEP, last)
            case Reset():
                state.cycle = last + 1
                state.pc = pc
                raise DeviceReset("SWR", "RESET instruction", fault=False)
        return last

    def _skip(self) -> int:
        """Skip the next instruction. Return the additional cycles."""
        pc = self.state.pc
        insn = decode_for_execution(self.program.word(pc), self.program.word(pc + 2 & PC_MASK))
        words = flow_rules.words_skipped(insn)
        self.state.pc = pc + 2 * words & PC_MASK
        return words

    def _return(self, flow: Return, second: int) -> int:
        """Execute RETURN, RETLW or RETFIE and return its last cycle.

        It is `second` if an exception can be entered then, otherwise the next one.
        """
        if flow.kind == "retfie":
            self._resume(flow.srl, flow.ipl3)
            self.events.kick()
        self.state.pc = flow.target
        return second if self._exception_at(second) else second + 1

    def after_retfie(self) -> None:
        """Complete a RETFIE of which native code has run two cycles: add the third unless an exception is entered."""
        if not self._exception_at(self.state.cycle - 1):
            self.state.cycle += 1

    def _exception_at(self, last: int) -> bool:
        """Return whether an exception can be entered after cycle `last`.

        In that case the boundary there will check again.
        """
        if self.events.deadline > last:
            return False
        self.events.settle(last)
        if self.exceptions.acceptable(last) is None:
            return False
        self.events.kick()
        return True

    def _after_target(self, step: Step, flow: Flow, pc: int, last: int) -> int:
        """End an iteration of a REPEAT target. Return its last cycle, which a PSV read may delay (isa.md §13.3)."""
        state = self.state
        if isinstance(flow, Repeat | Return) or state.pc != step.next_pc:
            return last
        middle, counting = state.repeat == MIDDLE, state.sr & RA
        if self._repeated(counting):
            state.pc = pc
        if counting and self.builder.window and middle and self._exception_at(last):
            last += 2
        return last
