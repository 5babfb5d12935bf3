"""The machine code of a function, run on all inputs of one path of the source, along every way they make it take."""

from __future__ import annotations

from collections.abc import Callable, Set
from typing import Any, Final

import z3

from emu.dspic30f.isa import flow
from emu.dspic30f.isa.rows.multiply import DIVIDE_COUNT
from toolchain.abi.target import RETURN_ADDRESS_BYTES, SP
from toolchain.proof.code.calling_convention import Contract
from toolchain.proof.code.machine import Machine, State
from toolchain.proof.memory import Frame
from toolchain.proof.path import Path
from toolchain.proof.problem import PAGE, WORD_UNITS, Subject
from toolchain.proof.solver import Refuted, Undecided, answer, feasible
from toolchain.proof.terms import Term, holds, known, vector, word

MOST_STEPS: Final = 6000
"""Instructions on one path of the code."""
MOST_TARGETS: Final = 64
"""Of a computed jump."""


class Code:
    """A function between two program addresses.

    `handler` is what kind of interrupt function it is (`interrupt_kind`).
    """

    def __init__(self, subject: Subject, start: int, end: int, frame: Frame, path: Path, handler: str = "") -> None:
        self.subject: Final = subject
        self.start: Final = start
        self.end: Final = end
        self.frame: Final = frame
        self.path: Final = path
        self.handler: Final = handler
        page = vector(subject.symbols.get(PAGE, 0), 16)
        entry = z3.BitVec("PSVPAG", 16) if handler == "auto_psv" else page
        self.state: State
        """What it is at."""
        self.watched: Set[int] = frozenset()
        """Addresses: where a way comes through one, its trace keeps the state."""
        self.machine: Final = Machine(frame, path.events, path.known, page, entry)

    def run(
        self,
        registers: list[Term],
        state: State,
        volatile: Set[int],
        arrived: Callable[[State], bool] | None = None,
        moved: bool = False,
    ) -> list[State]:
        """From a state on, along every way: the states at the end. Raises Refuted, Undecided.

        `registers` are W0-W14 at the function's entry, `volatile` bytes that are accessed only where the source does.
        `arrived` says whether the code has come to where the path of the source ends; it is not asked at the beginning
        but with `moved`.
        """
        self.machine.volatile = volatile
        self.contract = Contract(self.subject, self.frame, registers, self.path, self.machine)
        if arrived is not None and moved and self._end(state, arrived):
            return [state]
        work, ended = [state], []
        while work:
            state = self.state = work.pop()
            for _ in range(MOST_STEPS):
                if state.pc in self.watched:
                    state.trace.append(state.copy())
                following = self._sure_step(state)
                if arrived is not None:
                    following = [one for one in following if not self._end(one, arrived)]
                if not following:
                    ended.append(state)
                if len(following) != 1 or following[0] is not state:
                    work += following
                    break
            else:
                raise Undecided(f"more than {MOST_STEPS} instructions on one path")
        return ended

    def _end(self, state: State, arrived: Callable[[State], bool]) -> bool:
        self.machine.state = state
        return arrived(state)

    def _sure_step(self, state: State) -> list[State]:
        """As `_step`; what is wrong on a path that no input takes does not count."""
        try:
            return self._step(state)
        except Refuted as found:
            if found.conditions is not None:
                raise
            conditions = [*self.path.known, *state.path]
            possible, _ = answer(conditions)
            if possible == z3.unsat:
                return []
            if possible == z3.unknown:
                raise Undecided(f"the solver gave up: {found.what}") from None
            raise Refuted(found.what, conditions) from None

    def _step(self, state: State) -> list[State]:
        """The state itself where there is one way on; none at the end."""
        if self.path.ended == "unreachable" and state.event == len(self.path.events):
            return []  # whatever it does now is right
        insn = self.subject.insn(state.pc)
        if insn is None or not self.start <= state.pc < self.end:
            raise Refuted(f"runs out of the function, to {state.pc:#x}")
        self.machine.begin(state, insn)
        if self._stated(state):
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
                skipped = self.subject.insn(behind)
                if skipped is None:
                    raise Refuted(f"skips what is no instruction at {behind:#x}")
                return self._fork(state, holds(asked.cond), behind + WORD_UNITS * skipped.words, behind)
            case flow.Call():
                state.w[SP] -= RETURN_ADDRESS_BYTES
                self.contract.call(state, asked.target)
                state.pc = behind
                return [state]
            case flow.Return():
                if (asked.kind == "retfie") != bool(self.handler):
                    raise Refuted(f"ends with {asked.kind.upper()}")
                (self.contract.handled if self.handler else self.contract.returned)(state)
                return []
            case flow.Repeat():
                return self._repeat(state, asked.count, behind)
            case flow.Disi() | flow.ClearWatchdog() | flow.Sleep() | flow.Reset():
                raise Refuted(f"{insn.row.syntax} at {state.pc:#x}, which the source has not")
            case _:
                raise Undecided(f"{insn.row.syntax}")

    def _stated(self, state: State) -> bool:
        """Whether an assembly statement of the source stands here, which is done then."""
        e = self.machine.expected()
        if e is None or e.kind != "asm":
            return False
        for statement in self.subject.statements.get(state.pc, ()):
            if statement.template == e.address and self.contract.stated(state, statement, e):
                state.pc = statement.end
                return True
        return False

    def _fork(self, state: State, taken: Term, there: int, behind: int) -> list[State]:
        out = []
        place = z3.simplify(taken)
        for condition, pc in ((taken, there), (z3.Not(taken), behind)):
            if z3.is_true(place):
                return self._jump(state, there)
            if z3.is_false(place):
                return self._jump(state, behind)
            other = state.copy()
            other.path.append(condition)
            if feasible([*self.path.known, *other.path]):
                other.pc = pc
                out.append(other)
        if len(out) == 1:  # what is known of it is known anyway
            return self._jump(state, out[0].pc)
        return [landed for one in out for landed in self._jump(one, one.pc)]

    def _jump(self, state: State, target: Any) -> list[State]:
        if not isinstance(target, int):
            return self._computed(state, word(target))
        if self.start <= target < self.end and not self._calls_itself(target):
            state.pc = target
            return [state]
        self.contract.call(state, target)  # a call whose return is ours
        self.contract.returned(state, popped=False)
        return []

    def _calls_itself(self, target: int) -> bool:
        """Whether a jump to the beginning is a call in the source whose return is ours."""
        e = self.machine.expected()
        return target == self.start and e is not None and e.kind == "call" and self.contract.target(e) == target

    def _computed(self, state: State, target: Term) -> list[State]:
        """Every place a jump by a register can lead to."""
        place = known(target)
        if place is not None:
            return self._jump(state, place)
        out: list[State] = []
        excluded: list[Term] = []
        while True:
            answered, solver = answer([*self.path.known, *state.path, *excluded])
            if answered == z3.unknown:
                raise Undecided("the solver gave up: where a jump leads")
            if answered == z3.unsat:
                return out
            value = solver.model().eval(target, model_completion=True).as_long()
            if len(out) == MOST_TARGETS:
                raise Undecided(f"a jump to more than {MOST_TARGETS} places")
            other = state.copy()
            other.path.append(target == value)
            other.pc = int(value)
            excluded.append(target != value)
            if not self.start <= other.pc < self.end:
                raise Undecided("a jump by a register out of the function")
            out.append(other)

    def _repeat(self, state: State, count: Any, pc: int) -> list[State]:
        rounds = count if isinstance(count, int) else known(word(count))
        insn = self.subject.insn(pc)
        if rounds is None or insn is None:
            raise Undecided("REPEAT by a number that is not known")
        division = insn.row.syntax.startswith("DIV")
        if division and rounds != DIVIDE_COUNT:
            raise Refuted(f"a division of {rounds + 1} steps")
        steps = {rounds, 0} if division else range(rounds + 1)
        for left in sorted(steps, reverse=True):  # of a division the steps between change nothing
            state.pc = pc
            state.regs["RCOUNT"] = left
            self.machine.begin(state, insn)
            if insn.row.does(self.machine, insn.x) is not None:
                raise Refuted(f"REPEAT of {insn.row.syntax}")
        state.regs["RCOUNT"] = 0
        state.pc = pc + WORD_UNITS * insn.words
        return [state]
