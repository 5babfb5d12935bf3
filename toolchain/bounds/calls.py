"""Abstract execution of calls, jumps between functions, and returns."""

from __future__ import annotations

from abc import abstractmethod
from typing import Final

from emu.dspic30f.isa.flow import Branch, Skip
from toolchain.bounds.abstract.state import INHERITED, NO_ADDRESS, AbstractState
from toolchain.bounds.abstract.values import Value, extremes
from toolchain.bounds.annotations.flow_facts import (
    CALLS_TOO_DEEP,
    JUMP_PAST_TABLE,
    JUMP_WITHOUT_TABLE,
    NOT_ANALYSED,
    UNBALANCED_RETURN,
    UNKNOWN_RETURN,
)
from toolchain.bounds.graph import BasicBlock, Instruction
from toolchain.bounds.result import FunctionResult
from toolchain.bounds.steps import InstructionExecution
from toolchain.bounds.transfer import TRAP, is_constant, priority_range

MAX_RECURSION: Final = 60
MAX_CALL_DEPTH: Final = 8 * MAX_RECURSION
"""Greatest depth of the abstract call stack."""
RESULTS: Final = frozenset((0, 1))
"""Values of W0 (0 and 1) at a return for which separate return states are kept."""
RETURN_TARGET: Final = "return target"
"""Key of the popped return address in the registers of a return state."""
MAX_TEST_BLOCK: Final = 6
"""Greatest number of instructions of a block that tests such a result after a call."""


class CallExecution(InstructionExecution):
    """One abstract execution of a function: calls and returns."""

    @abstractmethod
    def _arrive(self, target: int, state: AbstractState) -> None:
        """Continue the execution in a state at the block `target`."""

    @abstractmethod
    def _block(self, block: BasicBlock, state: AbstractState) -> None:
        """Execute a block and pass the resulting states to its successors."""

    def _goto(self, last: Instruction, target: Value, state: AbstractState) -> None:
        inside = self.code.blocks
        if is_constant(target) and target in inside and last.pc not in self.code.tail_calls:
            self._arrive(target, state)
            return
        if last.insn.row.mnemonic == "BRA" and not is_constant(target):
            table = self.code.blocks[self._head(last)].following
            if not table:
                self.result.unbounded[last.pc] = JUMP_WITHOUT_TABLE
            least, most = extremes(target)
            for place in table:
                if least <= place <= most:
                    self._arrive(place, state.copy())
            if table and not table[0] <= least <= most <= table[-1]:
                self.result.unbounded[last.pc] = JUMP_PAST_TABLE
            return
        targets = [target] if is_constant(target) else self._pointer_targets(last.pc, state)
        for place in targets:
            self._enter(last, place, state.copy(), tail=True)

    def _head(self, last: Instruction) -> int:
        return next(head for head, block in self.code.blocks.items() if block.steps[-1] is last)

    def _call(self, last: Instruction, target: Value, state: AbstractState) -> None:
        targets = [target] if is_constant(target) else self._pointer_targets(last.pc, state)
        if not targets:
            returned = state.copy()
            self._forget_registers(returned)
            returned.w[15] = state.w[15] - 4 & 0xFFFF
            self._arrive(last.after, returned)
        for place in targets:
            self._enter(last, place, state.copy(), tail=False, many=len(targets) > 1)

    def _pointer_targets(self, pc: int, state: AbstractState) -> list[int]:
        if not is_constant(state.w[15]):
            self._record_stack_switch(state)
            return [
                entry for entry in self.explorer.flow_facts.resume_points() if entry not in self.explorer.call_stack
            ]
        found = self.explorer.flow_facts.call_targets(pc, state)
        if found is None:
            self.result.unbounded[pc] = "the targets of this call through a pointer are not known"
            return []
        return found

    def _enter(self, last: Instruction, target: int, state: AbstractState, tail: bool, many: bool = False) -> None:
        """Execute a call or tail call and continue after it."""
        explorer = self.explorer
        if target in explorer.flow_facts.excluded or explorer.flow_facts.is_never_called(last.pc, target):
            return
        if target == 0:  # an undefined weak function
            if not tail:
                state.w[15] = state.w[15] - 4 & 0xFFFF
                self._arrive(last.after, state)
            return
        if target in explorer.flow_facts.stack_depths:
            self._pass_over(last, state, explorer.flow_facts.stack_depths[target], tail)
            return
        depth = explorer.call_stack.count(target)
        allowed = explorer.flow_facts.recursion_depths.get(target)
        if len(explorer.call_stack) > MAX_CALL_DEPTH:
            self.result.unbounded[last.pc] = CALLS_TOO_DEEP
            return
        if depth >= (MAX_RECURSION if allowed is None else allowed):
            if allowed is None:
                self.result.unbounded[last.pc] = "recursion"
            return
        start, since, stack, waits = state.time, state.masked_since.copy(), state.w[15], state.waits
        if not tail:
            state.flags = AbstractState().flags
        before = state.copy()
        found, general = explorer.call(target, state, many)
        self.result.merge_call(found, start, since, (self.code.entry,))
        if found.switch_time is not None:
            self.result.waits |= found.waits | waits
        self.result.reads_caller_stack |= tail and found.reads_caller_stack
        level = explorer.flow_facts.return_level(target)
        if level is not None and found.switch_time is not None:
            back = state.copy()
            self._forget_registers(back)
            back.time, back.ipl, back.waits = found.switch_time, (level, level), frozenset(found.waits)
            back.w[15] = stack - 4 & 0xFFFF
            ends = [back]
        else:
            ends = [
                self._after_general_call(before, end, found) if general else end.copy()
                for end in found.return_states.values()
            ]
        share = explorer.call_share(last.pc, target)
        if share is not None and ends:
            cycles = min(end.time for end in ends)
            self.result.exclude_iteration(*share, cycles)
            for end in ends:
                end.shift(-cycles)
        changed = explorer.preserved.changed_by(target)
        for end in ends:
            if not tail and level is None:
                target_of_return = end.regs.pop(RETURN_TARGET, None)
                if end.w[15] != stack - 4 and not (is_constant(target_of_return) and target_of_return == last.after):
                    self.result.unbounded[last.pc] = UNBALANCED_RETURN
                for number in range(8, 15):
                    if number not in changed:  # abi-elf.md §2.1
                        end.w[number] = before.w[number]
            end.shift(start)
            end.waits |= waits
            end.masked_since = [since[k] if s == INHERITED else s for k, s in enumerate(end.masked_since)]
            self._update_masking(end, last.pc)
            if tail:
                self._record_return(end)
                continue
            self._record_stack_depth(end)  # at the CPU priority after the call, which may be lower than before
            if len(ends) > 1 and self._tests_result(last.after):
                self._block(self.code.blocks[last.after], end)
            else:
                self._arrive(last.after, end)

    def _pass_over(self, last: Instruction, state: AbstractState, depth: int, tail: bool) -> None:
        """Continue after a call of a function that is not analysed and uses `depth` bytes of stack."""
        self.result.unbounded[last.pc] = NOT_ANALYSED
        top = state.w[15]
        if not is_constant(top):
            self._record_stack_switch(state)
            return
        state.w[15] = top + depth
        self._record_stack_depth(state)
        state.w[15] = top - 4 & 0xFFFF
        self.result.unknown_store = True
        if min(state.lowest_leak, *map(self._leak, state.w[:8])) < NO_ADDRESS:
            state.mem = {}
        self._forget_registers(state)
        if tail:
            self._record_return(state)
        else:
            self._arrive(last.after, state)

    def _leak(self, value: Value) -> int:
        """Return the lowest stack address that a value exposes to a callee, NO_ADDRESS if it exposes none."""
        return extremes(value)[0] if self.area.points_into(value) else NO_ADDRESS

    def _after_general_call(self, before: AbstractState, end: AbstractState, found: FunctionResult) -> AbstractState:
        """Return the caller's state after a call that was analysed in the general context."""
        private = self.explorer.model.tracked_words
        new = end.copy()
        new.w = [*end.w[:15], end.w[15] + before.w[15] - self.explorer.general_top(before.w[15]) & 0xFFFF]
        kept = {a: v for a, v in before.mem.items() if (a if a >= 0 else ~a) & ~1 not in private}
        handed = [*before.w[:8], *(before.mem.values() if found.reads_caller_stack else ())]
        shown = min(map(self._leak, handed))
        if found.unknown_store and min(before.lowest_leak, shown) < NO_ADDRESS:
            kept = {}
        new.mem = kept | {a: v for a, v in end.mem.items() if (a if a >= 0 else ~a) & ~1 in private}
        new.lowest_leak = min(before.lowest_leak, shown)
        return new

    def _tests_result(self, head: int) -> bool:
        """Whether a block only tests the result of a call; until then, the call's return states are kept separate."""
        block = self.code.blocks[head]
        short = len(block.steps) <= MAX_TEST_BLOCK and block.steps[-1].flow in (Branch, Skip)
        return short and head not in self.code.heads

    @staticmethod
    def _forget_registers(state: AbstractState) -> None:
        """Make the caller-saved registers unknown (abi-elf.md §2.1)."""
        fresh = AbstractState()
        state.w[:8] = fresh.w[:8]
        state.flags = fresh.flags

    def _record_stack_switch(self, state: AbstractState) -> None:
        """Record that control passes to another stack."""
        self.result.switch_time = max(self.result.switch_time or 0, state.time)
        self.result.waits |= state.waits

    @staticmethod
    def _restore_priority(state: AbstractState, srl: Value, ipl3: Value) -> None:
        """Restore the CPU priority that RETFIE pops from the stack (isa.md §7.4)."""
        (low, high), trap = priority_range(srl), extremes(ipl3)
        state.ipl = low | (TRAP if trap[0] else 0), high | (TRAP if trap[1] else 0)

    def _return(self, target: Value, state: AbstractState) -> None:
        if not is_constant(state.w[15]):
            if not self.explorer.flow_facts.switches_stack(self.code.entry) or self.area.points_into(state.w[15]):
                self.result.unbounded[self.code.entry] = UNKNOWN_RETURN
            self._record_stack_switch(state)
            state.ipl, state.disi_end = (0, 0), 0  # masking ends for this stack, independent of the new priority
            self._update_masking(state, self.code.entry)
            return
        state.regs[RETURN_TARGET] = target
        self._record_return(state)

    def _record_return(self, state: AbstractState) -> None:
        top = state.w[15]
        above = (
            {k for k in state.mem if (at := k if k >= 0 else ~k) >= top and self.area.contains(at)}
            if is_constant(top)
            else ()
        )
        for key in above:
            del state.mem[key]
        state.w[4:8], state.flags = AbstractState().w[4:8], AbstractState().flags  # not preserved (abi-elf.md §2.1)
        if is_constant(top) and state.lowest_leak >= top:
            state.lowest_leak = NO_ADDRESS  # the frame whose address leaked no longer exists
        result = state.w[0]
        shown = result if is_constant(result) and result in RESULTS else None
        end = self.result.return_states.get(shown)
        self.result.return_states[shown] = state if end is None else self.area.join(end, state)
