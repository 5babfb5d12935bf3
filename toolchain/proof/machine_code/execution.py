"""Symbolic execution of a function's machine code on all inputs of one path of the source."""

from __future__ import annotations

from collections.abc import Callable, Set
from typing import Any, Final

import z3

from emu.dspic30f.isa import flow
from emu.dspic30f.isa.rows.multiply import DIVIDE_COUNT
from toolchain.abi.target import RETURN_ADDRESS_BYTES, SP
from toolchain.proof.machine_code.calling_convention import ConventionChecker
from toolchain.proof.machine_code.machine import MachineState, SymbolicMachine
from toolchain.proof.memory import StackFrame
from toolchain.proof.path import Path
from toolchain.proof.problem import PAGE, WORD_UNITS, CompiledFile
from toolchain.proof.solver import Refuted, Undecided, check, feasible
from toolchain.proof.terms import Term, constant_value, holds, vector, word

MAX_STEPS: Final = 6000
"""Greatest number of instructions on one path of the code."""
MAX_TARGETS: Final = 64
"""Greatest number of targets of a computed jump."""


class CodeExecution:
    """Symbolic execution of the code between two program addresses.

    `handler` is the kind of interrupt function (`interrupt_kind`), "" for other functions.
    """

    def __init__(
        self, compiled: CompiledFile, start: int, end: int, frame: StackFrame, path: Path, handler: str = ""
    ) -> None:
        self.compiled: Final = compiled
        self.start: Final = start
        self.end: Final = end
        self.frame: Final = frame
        self.path: Final = path
        self.handler: Final = handler
        page = vector(compiled.symbols.get(PAGE, 0), 16)
        entry = z3.BitVec("PSVPAG", 16) if handler == "auto_psv" else page
        self.state: MachineState
        """The state being executed."""
        self.watched: Set[int] = frozenset()
        """Addresses at which a path records its state in its trace."""
        self.machine: Final = SymbolicMachine(frame, path.events, path.conditions, page, entry)

    def run(
        self,
        registers: list[Term],
        state: MachineState,
        volatile: Set[int],
        at_end: Callable[[MachineState], bool] | None = None,
        moved: bool = False,
    ) -> list[MachineState]:
        """Execute all paths from a state and return their final states.  Raises Refuted, Undecided.

        registers  W0-W14 at the function's entry
        volatile   bytes that may be accessed only where the source accesses them
        at_end     whether the code has reached the end of the source's path, which is a loop head
        moved      whether `at_end` is also evaluated before the first instruction
        """
        self.machine.volatile = volatile
        self.convention = ConventionChecker(self.compiled, self.frame, registers, self.path, self.machine)
        if at_end is not None and moved and self._end(state, at_end):
            return [state]
        work, ended = [state], []
        while work:
            state = self.state = work.pop()
            for _ in range(MAX_STEPS):
                if state.pc in self.watched:
                    state.trace.append(state.copy())
                following = self._sure_step(state)
                if at_end is not None:
                    following = [one for one in following if not self._end(one, at_end)]
                if not following:
                    ended.append(state)
                if len(following) != 1 or following[0] is not state:
                    work += following
                    break
            else:
                raise Undecided(f"more than {MAX_STEPS} instructions on one path")
        return ended

    def _end(self, state: MachineState, at_end: Callable[[MachineState], bool]) -> bool:
        self.machine.state = state
        return at_end(state)

    def _sure_step(self, state: MachineState) -> list[MachineState]:
        """Execute one instruction as `_step` does; a refutation on an infeasible path does not count."""
        try:
            return self._step(state)
        except Refuted as found:
            if found.conditions is not None:
                raise
            conditions = [*self.path.conditions, *state.path]
            possible, _ = check(conditions)
            if possible == z3.unsat:
                return []
            if possible == z3.unknown:
                raise Undecided(f"the solver gave up: {found.what}") from None
            raise Refuted(found.what, conditions) from None

    def _step(self, state: MachineState) -> list[MachineState]:
        """Execute one instruction and return the successor states: the state itself if single, none at the end."""
        if self.path.end_kind == "unreachable" and state.event == len(self.path.events):
            return []  # undefined behaviour: any code is correct
        insn = self.compiled.insn(state.pc)
        if insn is None or not self.start <= state.pc < self.end:
            raise Refuted(f"leaves the function to {state.pc:#x}")
        self.machine.begin(state, insn)
        if self._statement(state):
            return [state]
        if insn.row.syntax.startswith("DIV"):
            raise Refuted(f"a division without REPEAT at {state.pc:#x}")
        asked = insn.row.does(self.machine, insn.x)
        behind = state.pc + WORD_UNITS * insn.words
        match asked:
            case None:
                state.pc = behind
                return [state]
            case flow.Goto():
                return self._jump(state, asked.target)
            case flow.Branch():
                return self._fork(state, holds(asked.cond), asked.target, behind)
            case flow.Skip():
                skipped = self.compiled.insn(behind)
                if skipped is None:
                    raise Refuted(f"skips a word that is no instruction at {behind:#x}")
                return self._fork(state, holds(asked.cond), behind + WORD_UNITS * skipped.words, behind)
            case flow.Call():
                state.w[SP] -= RETURN_ADDRESS_BYTES
                self.convention.call(state, asked.target)
                state.pc = behind
                return [state]
            case flow.Return():
                if (asked.kind == "retfie") != bool(self.handler):
                    raise Refuted(f"ends with {asked.kind.upper()}")
                (self.convention.check_handler_return if self.handler else self.convention.check_return)(state)
                return []
            case flow.Repeat():
                return self._repeat(state, asked.count, behind)
            case flow.Disi() | flow.ClearWatchdog() | flow.Sleep() | flow.Reset():
                raise Refuted(f"{insn.row.syntax} at {state.pc:#x}, which the source does not have")
            case _:
                raise Undecided(f"{insn.row.syntax}")

    def _statement(self, state: MachineState) -> bool:
        """Execute the assembly statement of the source at this address, if any; return whether there is one."""
        e = self.machine.expected()
        if e is None or e.kind != "asm":
            return False
        for statement in self.compiled.statements.get(state.pc, ()):
            if statement.template == e.address and self.convention.execute_statement(state, statement, e):
                state.pc = statement.end
                return True
        return False

    def _fork(self, state: MachineState, taken: Term, there: int, behind: int) -> list[MachineState]:
        out = []
        place = z3.simplify(taken)
        for condition, pc in ((taken, there), (z3.Not(taken), behind)):
            if z3.is_true(place):
                return self._jump(state, there)
            if z3.is_false(place):
                return self._jump(state, behind)
            other = state.copy()
            other.path.append(condition)
            if feasible([*self.path.conditions, *other.path]):
                other.pc = pc
                out.append(other)
        if len(out) == 1:  # the condition follows from the conditions of the path
            return self._jump(state, out[0].pc)
        return [landed for one in out for landed in self._jump(one, one.pc)]

    def _jump(self, state: MachineState, target: Any) -> list[MachineState]:
        if not isinstance(target, int):
            return self._computed(state, word(target))
        if self.start <= target < self.end and not self._calls_itself(target):
            state.pc = target
            return [state]
        self.convention.call(state, target)  # a tail call
        self.convention.check_return(state, popped=False)
        return []

    def _calls_itself(self, target: int) -> bool:
        """Whether a jump to the function's start is a recursive tail call in the source."""
        e = self.machine.expected()
        return target == self.start and e is not None and e.kind == "call" and self.convention.target(e) == target

    def _computed(self, state: MachineState, target: Term) -> list[MachineState]:
        """Return a state for every target of a jump through a register."""
        place = constant_value(target)
        if place is not None:
            return self._jump(state, place)
        out: list[MachineState] = []
        excluded: list[Term] = []
        while True:
            answered, solver = check([*self.path.conditions, *state.path, *excluded])
            if answered == z3.unknown:
                raise Undecided("the solver gave up: targets of a jump")
            if answered == z3.unsat:
                return out
            value = solver.model().eval(target, model_completion=True).as_long()
            if len(out) == MAX_TARGETS:
                raise Undecided(f"a jump with more than {MAX_TARGETS} targets")
            other = state.copy()
            other.path.append(target == value)
            other.pc = int(value)
            excluded.append(target != value)
            if not self.start <= other.pc < self.end:
                raise Undecided("a jump through a register out of the function")
            out.append(other)

    def _repeat(self, state: MachineState, count: Any, pc: int) -> list[MachineState]:
        rounds = count if isinstance(count, int) else constant_value(word(count))
        insn = self.compiled.insn(pc)
        if rounds is None or insn is None:
            raise Undecided("REPEAT with an unknown count")
        division = insn.row.syntax.startswith("DIV")
        if division and rounds != DIVIDE_COUNT:
            raise Refuted(f"a division of {rounds + 1} steps")
        steps = {rounds, 0} if division else range(rounds + 1)
        for left in sorted(steps, reverse=True):  # only the last steps of a division change the state
            state.pc = pc
            state.regs["RCOUNT"] = left
            self.machine.begin(state, insn)
            if insn.row.does(self.machine, insn.x) is not None:
                raise Refuted(f"REPEAT of {insn.row.syntax}")
        state.regs["RCOUNT"] = 0
        state.pc = pc + WORD_UNITS * insn.words
        return [state]
