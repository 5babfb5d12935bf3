"""Does the machine code of a function do what its IR says? Every path of the IR against every path of the code.

For each path of the IR that some input takes, the code runs from its first instruction with what holds on that path.
It must show the world the same, in order, give back the same, leave the same in memory, and keep W8-W14, W15 and its
return address (abi-elf.md §2.1).
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Final

import z3

from emu.dspic30f.isa import flow
from emu.dspic30f.isa.row import Insn
from emu.dspic30f.isa.text import StatementError, parse
from toolchain.ir.model import Arg, ConstInt, Function, Instr, Type, Value, size_of
from toolchain.lower.abi import Place, place_arguments
from toolchain.lower.calls import parameter_places, shape_of
from toolchain.lower.cfg import loop_depths
from toolchain.lower.names import symbol
from toolchain.proof.helpers import HELPERS, Helper
from toolchain.proof.machine import Machine, State
from toolchain.proof.memory import STACK, Frame, Memory, joined, split
from toolchain.proof.solver import Refuted, Undecided, answer, budget, demand, example, feasible
from toolchain.proof.source import Evaluator, Event, Path
from toolchain.proof.subject import WORD_UNITS, Subject
from toolchain.proof.terms import Term, holds, known, truth_number, vector, word
from toolchain.proof.witness import Witness, witness_of
from toolchain.target import CALLEE_SAVED, CALLER_SAVED, RETURN_ADDRESS_BYTES, SP

MOST_STEPS: Final = 6000
"""Instructions on one path of the code."""
MOST_TARGETS: Final = 64
"""Of a computed jump."""


@dataclass(frozen=True)
class Verdict:
    """Of one function: proved, refuted or undecided, and why. `loops`: whether its IR has one."""

    function: str
    kind: str
    why: str = ""
    loops: bool = False
    paths: int = 0
    witness: Witness | None = None
    """Of a refutation: the input that shows it, where what differs depends on one."""


def verdicts(subject: Subject, only: str | None = None) -> Iterator[Verdict]:
    """Of every function the file defines."""
    for f in subject.module.functions.values():
        if f.blocks and f.linkage != "available_externally" and only in (None, f.name):
            yield Proof(subject, f).verdict()


class Proof:
    """One function."""

    def __init__(self, subject: Subject, f: Function) -> None:
        self.subject: Final = subject
        self.f: Final = f
        self.name: Final = symbol(subject.module, f.name)
        self.start: Final = subject.symbols[self.name]
        self.end: Final = subject.ends.get(self.name, self.start)
        self.frame: Final = Frame()
        self.registers: Final = [z3.BitVec(f"W{n}", 16) for n in range(15)]
        self.array: Final = z3.Array("memory", z3.BitVecSort(16), z3.BitVecSort(8))
        self.paths = 0

    def verdict(self) -> Verdict:
        """Try to prove it."""
        loops = any(loop_depths(self.f).values())
        budget.begin()
        try:
            self._run()
        except Refuted as found:
            budget.begin()
            return Verdict(self.f.name, "refuted", found.what, loops, self.paths, self._input(found.conditions or []))
        except Undecided as found:
            return Verdict(self.f.name, "undecided", str(found), loops, self.paths)
        return Verdict(self.f.name, "proved", "", loops, self.paths)

    def _input(self, conditions: Sequence[Term]) -> Witness | None:
        model = example(conditions, self.path.preferred)
        return None if model is None else witness_of(model, self.name, self.registers, self.array)

    # -- both sides --------------------------------------------------------------------------------------------------

    def _run(self) -> None:
        if self.f.vararg:
            raise Undecided("a variable number of arguments")
        start = Path(Memory(self.array))
        self._parameters(start)
        for path in Evaluator(self.f, self.frame, self.subject.address).paths(start):
            if feasible(path.known):
                self.paths += 1
                self._code(path)
        if not self.paths:
            raise Undecided("no input gets through it")

    def _parameters(self, path: Path) -> None:
        """Where variables lie, and what parameters are (abi-elf.md §2.2)."""
        placed = self.subject.placed[self.f.name]
        sizes = {i.name: _alloca_size(i) for b in self.f.blocks for i in b.instrs if i.op == "alloca"}
        for name, size in sizes.items():
            if name in placed:
                self.frame.objects[name] = (STACK + placed[name], size)
        places = parameter_places(self.f)
        self.frame.lowest = STACK - max([RETURN_ADDRESS_BYTES, *(p.stack for p in places)])
        for a, place in zip(self.f.args, places, strict=True):
            if a.attrs.get("byval") is not None:
                raise Undecided("a struct parameter")
            path.values[id(a)] = (self._parameter(a, place), None)
        self.frame.escaped |= escaped(self.f)

    def _parameter(self, a: Arg, place: Place) -> Term:
        if place.register is not None:
            words = [self.registers[place.register + k] for k in range(place.words)]
        else:
            low = STACK - place.stack
            words = [joined([z3.BitVec(f"stack.{low + 2 * k + b:x}", 8) for b in (0, 1)]) for k in range(place.words)]
        whole = words[0] if len(words) == 1 else z3.Concat(*reversed(words))
        return z3.Extract(a.type.bits - 1, 0, whole) if a.type.bits < whole.size() else whole

    # -- the code ----------------------------------------------------------------------------------------------------

    def _code(self, path: Path) -> None:
        """Run it on all inputs of one path of the source."""
        self.machine = Machine(self.frame, path.events, path.known)
        self.machine.settle = self._settle
        self.path = path
        work = [State([*self.registers, STACK], Memory(self.array), self.start)]
        while work:
            state = work.pop()
            for _ in range(MOST_STEPS):
                following = self._sure_step(state)
                if len(following) != 1 or following[0] is not state:
                    work += following
                    break
            else:
                raise Undecided(f"more than {MOST_STEPS} instructions on one path")

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
        self._assembly(insn)
        asked = insn.row.does(self.machine, insn.x)
        here, behind = state.pc, state.pc + WORD_UNITS * insn.words
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
                self._call(state, asked.target)
                state.pc = behind
                return [state]
            case flow.Return():
                if asked.kind == "retfie":
                    raise Undecided("an interrupt handler")
                self._returned(state)
                return []
            case flow.Repeat():
                return self._repeat(state, asked.count, behind)
            case flow.Disi() | flow.ClearWatchdog() | flow.Sleep() | flow.Reset():
                if self.told != here:
                    raise Refuted(f"{insn.row.syntax} at {here:#x}, which the source has not")
                state.pc = behind
                return [state]
            case _:
                raise Undecided(f"{insn.row.syntax}")

    told = -1
    """Where the code of an assembly statement stands."""
    _pushed = 0
    """Bytes of arguments on the stack, of the call that is made."""

    def _assembly(self, insn: Insn) -> None:
        """An assembly statement of one instruction without operands, if this is it."""
        e = self.machine.expected()
        if e is None or e.kind != "asm":
            return
        wanted = assembled(str(e.address))
        state = self.machine.state
        if wanted == [
            w for k in range(len(wanted)) if (w := self.subject.code.get(state.pc + WORD_UNITS * k)) is not None
        ]:
            if len(wanted) != insn.words:
                raise Undecided("assembly of several instructions")
            self.told = state.pc
            self._settle(e)
            if e.after is not None:
                state.memory.become(e.after, self.frame.kept())
            self.machine.passed()

    def _settle(self, e: Event) -> None:
        """What was written before is in memory."""
        if e.memory is not None:
            self._same_memory(self.machine.state, e.memory, self.frame.escaped, f"memory differs at: {_said(e)}")

    def _fork(self, state: State, taken: Term, there: int, behind: int) -> list[State]:
        out = []
        place = z3.simplify(taken)
        for condition, pc in ((taken, there), (z3.Not(taken), behind)):
            if z3.is_true(place):
                state.pc = there
                return [state]
            if z3.is_false(place):
                state.pc = behind
                return [state]
            other = state.copy()
            other.path.append(condition)
            if feasible([*self.path.known, *other.path]):
                other.pc = pc
                out.append(other)
        if len(out) == 1:  # what is known of it is known anyway
            state.pc = out[0].pc
            return [state]
        return [landed for one in out for landed in self._jump(one, one.pc)]

    def _jump(self, state: State, target: Any) -> list[State]:
        if not isinstance(target, int):
            return self._computed(state, word(target))
        if self.start <= target < self.end:
            state.pc = target
            return [state]
        self._call(state, target)  # a call whose return is ours
        self._returned(state, popped=False)
        return []

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
        steps = {rounds, 0} if insn.row.syntax.startswith("DIV") else range(rounds + 1)
        for left in sorted(steps, reverse=True):  # of a division the steps between change nothing
            state.pc = pc
            state.regs["RCOUNT"] = left
            self.machine.begin(state, insn)
            insn.row.does(self.machine, insn.x)
        state.regs["RCOUNT"] = 0
        state.pc = pc + WORD_UNITS * insn.words
        return [state]

    # -- calls and the end -------------------------------------------------------------------------------------------

    def _call(self, state: State, target: Any) -> None:
        e = self.machine.expected()
        name = self.subject.functions.get(target) if isinstance(target, int) else None
        helper = HELPERS.get(name or "")
        if helper is not None and (e is None or e.kind != "call" or self._target(e) != target):
            self._by_model(state, helper)
            return
        if e is None or e.kind != "call":
            raise Refuted(f"calls {name or 'a pointer'}, which the source does not here")
        wanted = self._target(e)
        if isinstance(wanted, int) and isinstance(target, int):
            if wanted != target:
                raise Refuted(f"calls {name}, the source {e.address}")
        else:
            demand(vector(wanted, 16) == word(target) if isinstance(wanted, int) else wanted == word(target),
                   self.machine.given, "calls another function than the source")  # fmt: skip
        self._arguments(state, e)
        assert e.memory is not None
        self._same_memory(state, e.memory, self.frame.escaped, f"memory differs at the call of {name or 'a pointer'}")
        state.memory.become(e.after, self.frame.kept())
        self._forget(state, self._pushed)
        self.machine.passed()
        if e.value is not None:
            for n, term in enumerate(_words_of(e.value)):
                self._put(state, n, term)

    def _put(self, state: State, register: int, term: Term) -> None:
        if term.size() < 16:
            term = z3.Concat(z3.FreshConst(z3.BitVecSort(16 - term.size()), "above"), term)
        state.w[register] = term

    def _target(self, e: Event) -> Any:
        if not isinstance(e.address, str):
            place = known(e.address)
            return e.address if place is None else place
        try:
            return self.subject.address(e.address)
        except KeyError:
            raise Undecided(f"no address of {e.address}") from None

    def _forget(self, state: State, pushed: int = 0) -> None:
        """What a call leaves unknown: W0-W7, flags, its arguments on the stack (bytes) and what lay above."""
        for n in CALLER_SAVED:
            state.w[n] = z3.FreshConst(z3.BitVecSort(16), f"W{n}")
        for name in ("C", "Z", "OV", "N", "DC"):
            state.flags[name] = truth_number(z3.FreshConst(z3.BoolSort(), "flag"))
        for at in [at for at in state.frame if at >= state.w[SP] - pushed]:
            state.frame[at] = z3.FreshConst(z3.BitVecSort(8), "stack")

    def _arguments(self, state: State, e: Event) -> None:
        if any(k.get("byval") is not None for _, _, k in e.arguments):
            raise Undecided("a struct as argument")
        places = place_arguments([shape_of(v, k) for v, _, k in e.arguments], e.named)
        top = state.w[SP]
        self._pushed = max([RETURN_ADDRESS_BYTES, *(p.stack for p in places)]) - RETURN_ADDRESS_BYTES
        for n, ((_, value, _), place) in enumerate(zip(e.arguments, places, strict=True)):
            if isinstance(value, list):
                raise Undecided("an aggregate as argument")
            if place.register is not None:
                words = [word(self.machine.w(place.register + k)) for k in range(place.words)]
            else:
                low = top + RETURN_ADDRESS_BYTES - place.stack
                words = [joined([self.machine._own(low + 2 * k + b) for b in (0, 1)]) for k in range(place.words)]
            self._equal(value, words, f"argument {n + 1} of {e.address if isinstance(e.address, str) else 'the call'}")

    def _equal(self, value: Any, words: list[Term], what: str) -> None:
        term, poison = value
        whole = words[0] if len(words) == 1 else z3.Concat(*reversed(words))
        same = term == (z3.Extract(term.size() - 1, 0, whole) if term.size() < whole.size() else whole)
        demand(same if poison is None else z3.Or(poison, same), self.machine.given, f"{what} differs")

    def _by_model(self, state: State, helper: Helper) -> None:
        """A function of the run-time library that stands for an operation of the IR."""
        results = helper.call([word(self.machine.w(n)) for n in CALLER_SAVED])
        self._forget(state)
        state.w[: len(results)] = results

    def _returned(self, state: State, popped: bool = True) -> None:
        """Everything at the end. `popped`: the return address has been taken off the stack."""
        if self.path.ended != "ret" or state.event != len(self.path.events):
            e = self.machine.expected()
            raise Refuted("returns where the source does not" if e is None else f"returns before: {_said(e)}")
        wanted = STACK - RETURN_ADDRESS_BYTES if popped else STACK
        if state.w[SP] != wanted:
            raise Refuted(f"W15 is {state.w[SP] - wanted:+d} bytes off at the end")
        for at in range(STACK - RETURN_ADDRESS_BYTES, STACK):
            if at in state.frame:
                demand(
                    state.frame[at] == z3.BitVec(f"stack.{at:x}", 8), self.machine.given, "the return address changes"
                )
        for n in CALLEE_SAVED:
            demand(word(self.machine.w(n)) == self.registers[n], self.machine.given, f"W{n} is not what it was")
        if self.path.result is not None:
            self._result(state)
        self._same_memory(state, self.path.memory, set(), "memory differs at the end")

    def _result(self, state: State) -> None:
        at = 0
        for value in _leaves(self.path.result):
            count = max(1, (value[0].size() + 15) // 16)
            self._equal(value, [word(self.machine.w(at + k)) for k in range(count)], "the result")
            at += count

    def _same_memory(self, state: State, wanted: Memory, objects: set[str], what: str) -> None:
        """Equal bytes everywhere but in the frame; of that, in these objects of the source."""
        ours, theirs = state.memory.copy(), wanted.copy()
        if ours.array.eq(theirs.array):
            places = set(ours.written) | set(theirs.written)
            for at in sorted(places):
                if self._counts(at, objects):
                    demand(ours.byte(at) == theirs.byte(at), self.machine.given, f"{what}: {at:#x}")
            return
        at = z3.BitVec("anywhere", 16)
        inside = [z3.And(z3.UGE(at, self.frame.objects[n][0]), z3.ULT(at, sum(self.frame.objects[n]))) for n in objects]
        outside = z3.Or(z3.ULT(at, self.frame.lowest), z3.UGE(at, 0x2800), *inside)
        same = z3.Select(ours.whole(), at) == z3.Select(theirs.whole(), at)
        demand(z3.Implies(outside, same), self.machine.given, what)

    def _counts(self, at: int, objects: set[str]) -> bool:
        if not self.frame.is_private(at) and not self.frame.is_object(at):
            return True
        return any(self.frame.objects[n][0] <= at < sum(self.frame.objects[n]) for n in objects)


def _said(e: Event) -> str:
    return f"{e.kind} {e.address if isinstance(e.address, str) else ''}".strip()


def _alloca_size(i: Instr) -> int:
    t = i.extra["type"]
    assert isinstance(t, Type)
    count = i.args[0].value if i.args and isinstance(i.args[0], ConstInt) else 1
    return size_of(t) * count


def _leaves(value: Any) -> list[Any]:
    return [leaf for part in value for leaf in _leaves(part)] if isinstance(value, list) else [value]


def _words_of(value: Any) -> list[Term]:
    """Register by register."""
    out: list[Term] = []
    for term, _ in _leaves(value):
        parts = split(term)
        if term.size() <= 16:
            out.append(term)
        else:
            out += [joined(parts[k : k + 2]) for k in range(0, len(parts), 2)]
    return out


def escaped(f: Function) -> set[str]:
    """Variables whose addresses are used otherwise than to load and store."""
    roots: dict[int, str] = {}
    for b in f.blocks:
        for i in b.instrs:
            if i.op == "alloca":
                roots[id(i)] = i.name
    out: set[str] = set()
    changed = True
    while changed:
        changed = False
        for b in f.blocks:
            for i in b.instrs:
                if i.op == "getelementptr" and id(i.args[0]) in roots and id(i) not in roots:
                    roots[id(i)], changed = roots[id(i.args[0])], True
    for b in f.blocks:
        for i in b.instrs:
            for n, a in enumerate(i.args):
                if id(a) in roots and not _is_plain_use(i, n):
                    out.add(roots[id(a)])
    return out


def _is_plain_use(i: Instr, n: int) -> bool:
    if i.op in ("load", "getelementptr"):
        return n == 0
    if i.op == "store":
        return n == 1
    callee: Value = i.args[-1]
    return i.op == "call" and getattr(callee, "name", "").startswith("llvm.")


def assembled(text: str) -> list[int]:
    """Words of an assembly statement, none where it is not plain instructions."""
    words: list[int] = []
    for line in re.split(r"[;\n]", text):
        if line.strip():
            try:
                words += parse(line.strip()).encode(0)
            except StatementError as error:
                raise Undecided(f"assembly: {error}") from None
    return words
