"""Checks of the calling convention: calls, returns, and memory contents at them (abi-elf.md §2.1, §2.2).

In: a machine state and the corresponding event of one path of the source.  A violation raises Refuted.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from typing import Any, Final

import z3

from toolchain.abi.arguments import argument_locations
from toolchain.abi.target import CALLEE_SAVED, CALLER_SAVED, RAM_END, RETURN_ADDRESS_BYTES, SP
from toolchain.proof.asm_statements import Statement
from toolchain.proof.machine_code.machine import ACCUMULATORS, CORE, PSVPAG, MachineState, SymbolicMachine
from toolchain.proof.memory import STACK, StackFrame, SymbolicMemory, bytes_of, concat
from toolchain.proof.path import Event, Path
from toolchain.proof.problem import CompiledFile
from toolchain.proof.runtime_models import HELPERS, Helper
from toolchain.proof.solver import Refuted, Undecided, check, require
from toolchain.proof.terms import Term, constant_value, narrow, vector, wide, word
from toolchain.select.calls import shape_of

NUMBER: Final = re.compile(r"(?P<name>_\w+)?(?P<plus>[+-]?\d+)?")


class ConventionChecker:
    """Checks of one path of the source against a machine with given registers at entry."""

    def __init__(
        self, compiled: CompiledFile, frame: StackFrame, registers: list[Term], path: Path, machine: SymbolicMachine
    ) -> None:
        self.compiled: Final = compiled
        self.frame: Final = frame
        self.registers: Final = registers
        self.path: Final = path
        self.machine: Final = machine
        machine.check_memory = self.check_memory

    def check_memory(self, e: Event) -> None:
        """Check that all stores before an event are in memory."""
        if e.memory is not None:
            self.check_equal_memory(
                self.machine.state, e.memory, self.frame.escaped, f"memory differs at: {_describe(e)}", e.movable_stores
            )

    def call(self, state: MachineState, target: Any) -> None:
        """Check that the next event is this call with equal arguments, and apply the effects of a call."""
        e = self.machine.expected()
        name = self.compiled.functions.get(target) if isinstance(target, int) else None
        helper = HELPERS.get(name or "")
        if helper is not None and (e is None or e.kind != "call" or self.target(e) != target):
            self._apply_model(state, helper)
            return
        if e is None or e.kind != "call":
            raise Refuted(f"calls {name or 'a pointer'}, where the source makes no call")
        wanted = self.target(e)
        if isinstance(wanted, int) and isinstance(target, int):
            if wanted != target:
                raise Refuted(f"calls {name}, where the source calls {e.address}")
        else:
            require(vector(wanted, 16) == word(target) if isinstance(wanted, int) else wanted == word(target),
                   self.machine.conditions, "calls another function than the source")  # fmt: skip
        self._constants("a call")
        pushed = self._arguments(state, e)
        assert e.memory is not None
        self.check_equal_memory(
            state,
            e.memory,
            set() if e.is_tail_call else self.frame.escaped,
            f"memory differs at the call of {name or 'a pointer'}",
        )
        state.memory.havoc(e.memory_after, self.frame.unescaped_bytes())
        self._forget(state, pushed)
        self.machine.advance()
        if e.value is not None:
            for n, term in enumerate(_words_of(e.value)):
                self._put(state, n, term)

    def execute_statement(self, state: MachineState, statement: Statement, e: Event) -> bool:
        """Execute a code sequence as the assembly statement that is the source's next event, if its operands are equal.

        Return whether the operands are equal.  Outputs get the values of the source; flags and clobbered memory become
        unknown.
        """
        assert e.shape is not None
        leaves, inputs = iter(_leaves(e.value or [])), iter(e.arguments)
        registers: list[list[int]] = []
        read: set[int] = set()
        results: list[tuple[int, Term]] = []
        for n, operand in enumerate(e.shape.operands):
            value = next(leaves) if operand.output else next(inputs)[1]
            if isinstance(value, list):
                raise Undecided("an aggregate as operand of an assembly statement")
            words = max(1, (value[0].size() + 15) // 16)
            first = registers[operand.tied][0] if operand.tied is not None else statement.register(n, operand)
            if first is None:
                if operand.output or not self._is_number(statement.texts.get((n, "")), value[0]):
                    return False
                registers.append([])
                continue
            here = list(range(first, first + words))
            registers.append(here)
            if operand.output:
                results += zip(here, _words_of([value]), strict=True)
            elif self._holds(here, value):
                read |= set() if operand.tied is not None else {*here}
            else:
                return False
            if operand.allowed is not None and first not in operand.allowed:
                raise Refuted(f"{_describe(e)}: W{first} is not in the register class of operand {n}")
        if any(m and (m != "d" or text != f"w{registers[n][0] + 1}") for (n, m), text in statement.texts.items()):
            return False
        self._check_operand_registers(e, registers, read)
        self.check_memory(e)
        if e.memory_after is not None:
            state.memory.havoc(e.memory_after, self.frame.unescaped_bytes())
        for n in e.shape.clobbered:
            state.w[n] = z3.FreshConst(z3.BitVecSort(16), f"W{n}")
        state.forget_flags()
        for n, term in results:
            self._put(state, n, term)
        self.machine.advance()
        return True

    def _check_operand_registers(self, e: Event, registers: list[list[int]], read: set[int]) -> None:
        """Check that outputs and clobbers are disjoint, and inputs disjoint from clobbers and early-clobber outputs."""
        assert e.shape is not None
        outputs = [n for n, operand in enumerate(e.shape.operands) if operand.output]
        written = [r for n in outputs for r in registers[n]] + [*e.shape.clobbered]
        early = {r for n in outputs if e.shape.operands[n].early for r in registers[n]} | e.shape.clobbered
        if len(set(written)) < len(written) or read & early:
            raise Refuted(f"{_describe(e)}: operands share a register")

    def _holds(self, registers: list[int], value: Any) -> bool:
        same = _is_value(value, [word(self.machine.w(n)) for n in registers])
        found, _ = check([*self.machine.conditions, z3.Not(same)])
        if found == z3.unknown:
            raise Undecided("the solver gave up: an operand of an assembly statement")
        return bool(found == z3.unsat)

    def _is_number(self, text: str | None, term: Term) -> bool:
        """Whether the text of an immediate operand is the expected number."""
        wanted, found = constant_value(term), NUMBER.fullmatch(text or "")
        if wanted is None or found is None:
            return False
        base = 0 if found["name"] is None else self.compiled.symbols.get(found["name"])
        return base is not None and (base + int(found["plus"] or 0) - wanted) % (1 << term.size()) == 0

    def _constants(self, where: str) -> None:
        same = self.machine.core(PSVPAG) == self.machine.page
        require(same, self.machine.conditions, f"PSVPAG is not that of constants at {where}")

    def _put(self, state: MachineState, register: int, term: Term) -> None:
        if term.size() < 16:
            term = z3.Concat(z3.FreshConst(z3.BitVecSort(16 - term.size()), "above"), term)
        state.w[register] = term

    def target(self, e: Event) -> Any:
        """Return the program address of a call's target, or the term of the pointer through which it calls."""
        if not isinstance(e.address, str):
            place = constant_value(e.address)
            return e.address if place is None else place
        try:
            return self.compiled.address(e.address)
        except KeyError:
            raise Undecided(f"no address of {e.address}") from None

    def _forget(self, state: MachineState, pushed: int = 0) -> None:
        """Make everything unknown that a call may change: W0-W7, RCOUNT, flags, and the stack from its arguments up."""
        for n in CALLER_SAVED:
            state.w[n] = z3.FreshConst(z3.BitVecSort(16), f"W{n}")
        state.regs["RCOUNT"] = narrow(z3.FreshConst(z3.BitVecSort(16), "RCOUNT"))
        state.forget_flags()
        for at in [at for at in state.frame if at >= state.w[SP] - pushed]:
            state.frame[at] = z3.FreshConst(z3.BitVecSort(8), "stack")

    def _arguments(self, state: MachineState, e: Event) -> int:
        """Check the arguments of a call; return the bytes of those on the stack."""
        if any(k.get("byval") is not None for _, _, k in e.arguments):
            raise Undecided("a struct as argument")
        places = argument_locations([shape_of(v, k) for v, _, k in e.arguments], e.named_arguments)
        top = state.w[SP]
        for n, ((_, value, _), place) in enumerate(zip(e.arguments, places, strict=True)):
            if isinstance(value, list):
                raise Undecided("an aggregate as argument")
            if place.register is not None:
                words = [word(self.machine.w(place.register + k)) for k in range(place.words)]
            else:
                low = top + RETURN_ADDRESS_BYTES - place.stack
                words = [concat([self.machine.frame_byte(low + 2 * k + b) for b in (0, 1)]) for k in range(place.words)]
            self._equal(value, words, f"argument {n + 1} of {e.address if isinstance(e.address, str) else 'the call'}")
        return max([RETURN_ADDRESS_BYTES, *(p.stack for p in places)]) - RETURN_ADDRESS_BYTES

    def _equal(self, value: Any, words: list[Term], what: str) -> None:
        require(_is_value(value, words), self.machine.conditions, f"{what} differs")

    def _apply_model(self, state: MachineState, helper: Helper) -> None:
        """Apply the model of a library function that implements an operation of the IR."""
        results = helper.call([word(self.machine.w(n)) for n in CALLER_SAVED])
        self._forget(state)
        state.w[: len(results)] = results

    def check_handler_return(self, state: MachineState) -> None:
        """Check the state at the end of an interrupt handler, which must also restore W0-W7 and the core registers."""
        for n in CALLER_SAVED:
            same = word(self.machine.w(n)) == self.registers[n]
            require(same, self.machine.conditions, f"W{n} is not preserved")
        self._check_core_registers(CORE)
        self.check_return(state)

    def _check_core_registers(self, places: Iterable[int]) -> None:
        for at in places:
            same = self.machine.core(at) == self.machine.before[at]
            require(same, self.machine.conditions, f"{CORE[at]} is not preserved")

    def check_return(self, state: MachineState, popped: bool = True) -> None:
        """Check the state at a return; `popped`: the return address has been popped from the stack."""
        if self.path.end_kind != "ret" or state.event != len(self.path.events):
            e = self.machine.expected()
            raise Refuted("returns where the source does not" if e is None else f"returns before: {_describe(e)}")
        wanted = STACK - RETURN_ADDRESS_BYTES if popped else STACK
        if state.w[SP] != wanted:
            raise Refuted(f"W15 is {state.w[SP] - wanted:+d} bytes off at the end")
        for at in range(STACK - RETURN_ADDRESS_BYTES, STACK):
            if at in state.frame:
                require(
                    state.frame[at] == z3.BitVec(f"stack.{at:x}", 8),
                    self.machine.conditions,
                    "the return address changes",
                )
        for n in CALLEE_SAVED:
            require(word(self.machine.w(n)) == self.registers[n], self.machine.conditions, f"W{n} is not preserved")
        self._check_core_registers(at for at, name in CORE.items() if name != "RCOUNT")
        self._check_accumulators(state)
        if self.path.result is not None:
            self._result(state)
        self.check_equal_memory(state, self.path.memory, set(), "memory differs at the end")

    def check_loop_head(self, state: MachineState) -> None:
        """Check the state at a loop head: equal memory, and pages and accumulators as at entry."""
        self._check_core_registers(at for at, name in CORE.items() if name != "RCOUNT")
        self._check_accumulators(state)
        self.check_equal_memory(state, self.path.memory, set(self.frame.objects), "memory differs at a loop")

    def _check_accumulators(self, state: MachineState) -> None:
        for n, before in enumerate(ACCUMULATORS):
            require(
                wide(state.accumulators[n]) == before.wide, self.machine.conditions, f"ACC{'AB'[n]} is not preserved"
            )

    def _result(self, state: MachineState) -> None:
        at = 0
        for value in _leaves(self.path.result):
            count = max(1, (value[0].size() + 15) // 16)
            self._equal(value, [word(self.machine.w(at + k)) for k in range(count)], "the result")
            at += count

    def check_equal_memory(
        self,
        state: MachineState,
        wanted: SymbolicMemory,
        objects: set[str],
        what: str,
        loose: Sequence[tuple[Term, Term]] = (),
    ) -> None:
        """Check that memory is equal outside the frame and in the given objects of the frame.

        loose  stores that may be executed before or after this point
        """
        ours, theirs = state.memory.copy(), wanted.copy()
        either: dict[int, list[Term]] = {}
        ranges = []
        for address, value in loose:
            place = constant_value(address)
            if place is None:
                ranges.append((address, len(bytes_of(value))))
            else:
                for k, part in enumerate(bytes_of(value)):
                    either.setdefault(place + k & 0xFFFF, []).append(part)
        if ours.array.eq(theirs.array):
            places = set(ours.written) | set(theirs.written)
            for at in sorted(places):
                if self._is_compared(at, objects):
                    mine, values = ours.byte(at), [theirs.byte(at), *either.get(at, [])]
                    same = z3.Or(*(mine == v for v in values), *(_within(vector(at, 16), r) for r in ranges))
                    require(same, self.machine.conditions, f"{what}: {at:#x}")
            return
        at = z3.BitVec("anywhere", 16)
        inside = [z3.And(z3.UGE(at, self.frame.objects[n][0]), z3.ULT(at, sum(self.frame.objects[n]))) for n in objects]
        outside = z3.Or(z3.ULT(at, self.frame.lowest), z3.UGE(at, RAM_END), *inside)
        same = z3.Select(ours.whole(), at) == z3.Select(theirs.whole(), at)
        values_there = [z3.And(at == k, z3.Select(ours.whole(), at) == v) for k, vs in either.items() for v in vs]
        free = [*values_there, *(_within(at, r) for r in ranges)]
        require(z3.Implies(outside, z3.Or(same, *free)), self.machine.conditions, what)

    def _is_compared(self, at: int, objects: set[str]) -> bool:
        if not self.frame.is_private(at) and not self.frame.is_object(at):
            return True
        return any(self.frame.objects[n][0] <= at < sum(self.frame.objects[n]) for n in objects)


def _is_value(value: Any, words: list[Term]) -> Term:
    """Return the condition that registers or stack words hold a value, or that the value is poison."""
    term, poison = value
    whole = words[0] if len(words) == 1 else z3.Concat(*reversed(words))
    same = term == (z3.Extract(term.size() - 1, 0, whole) if term.size() < whole.size() else whole)
    return same if poison is None else z3.Or(poison, same)


def _within(at: Term, place: tuple[Term, int]) -> Term:
    return z3.ULT(at - place[0], vector(place[1], 16))


def _describe(e: Event) -> str:
    return f"{e.kind} {e.address if isinstance(e.address, str) else ''}".strip()


def _leaves(value: Any) -> list[Any]:
    return [leaf for part in value for leaf in _leaves(part)] if isinstance(value, list) else [value]


def _words_of(value: Any) -> list[Term]:
    """Return a value as register-sized terms."""
    out: list[Term] = []
    for term, _ in _leaves(value):
        parts = bytes_of(term)
        if term.size() <= 16:
            out.append(term)
        else:
            out += [concat(parts[k : k + 2]) for k in range(0, len(parts), 2)]
    return out
