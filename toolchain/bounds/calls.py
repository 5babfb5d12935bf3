"""Calls and returns: which functions a run goes on into, and what it finds behind them."""

from __future__ import annotations

from abc import abstractmethod
from typing import Final

from emu.dspic30f.isa.flow import Branch, Skip
from toolchain.bounds.abstract.state import INHERITED, NOWHERE, State
from toolchain.bounds.abstract.values import Value, ends
from toolchain.bounds.annotations.rules import DEEP, ELSEWHERE, JUMP, TABLE
from toolchain.bounds.builder import TRAP, exact, levels_in
from toolchain.bounds.graph import Block, Step
from toolchain.bounds.result import Outcome
from toolchain.bounds.steps import Steps

MAX_DEPTH: Final = 60
MOST_CALLS: Final = 8 * MAX_DEPTH
"""Calls under way at once, of all functions (DEEP)."""
RESULTS: Final = frozenset((0, 1))
"""Results by which the ways through a function are told apart."""
CHOICE: Final = 6
"""Most instructions of a block that tells them apart."""


class Calls(Steps):
    """One function, once: where control leaves it, and comes back."""

    @abstractmethod
    def _arrive(self, target: int, state: State) -> None:
        """Go on at a block with that state."""

    @abstractmethod
    def _block(self, block: Block, state: State) -> None:
        """Run a block and hand its state on."""

    def _goto(self, last: Step, target: Value, state: State) -> None:
        inside = self.code.blocks
        if exact(target) and target in inside and last.pc not in self.code.tails:
            self._arrive(target, state)
            return
        if last.insn.row.mnemonic == "BRA" and not exact(target):
            table = self.code.blocks[self._head(last)].following
            if not table:
                self.outcome.open[last.pc] = JUMP
            least, most = ends(target)
            for place in table:
                if least <= place <= most:
                    self._arrive(place, state.copy())
            if table and not table[0] <= least <= most <= table[-1]:
                self.outcome.open[last.pc] = TABLE
            return
        targets = [target] if exact(target) else self._unknown(last.pc, state)
        for place in targets:
            self._enter(last, place, state.copy(), tail=True)

    def _head(self, last: Step) -> int:
        return next(head for head, block in self.code.blocks.items() if block.steps[-1] is last)

    def _call(self, last: Step, target: Value, state: State) -> None:
        targets = [target] if exact(target) else self._unknown(last.pc, state)
        if not targets:
            returned = state.copy()
            self._lose_registers(returned)
            returned.w[15] = state.w[15] - 4 & 0xFFFF
            self._arrive(last.after, returned)
        for place in targets:
            self._enter(last, place, state.copy(), tail=False, many=len(targets) > 1)

    def _unknown(self, pc: int, state: State) -> list[int]:
        if not exact(state.w[15]):
            self._leave(state)
            return [entry for entry in self.explorer.rules.resumed() if entry not in self.explorer.active]
        found = self.explorer.rules.calls(pc, state)
        if found is None:
            self.outcome.open[pc] = "the targets of this call through a pointer are not known"
            return []
        return found

    def _enter(self, last: Step, target: int, state: State, tail: bool, many: bool = False) -> None:
        """Call a function, or jump to it, and go on behind it."""
        explorer = self.explorer
        if target in explorer.rules.without or explorer.rules.never(last.pc, target):
            return
        if target == 0:  # a weak function that is not linked
            if not tail:
                state.w[15] = state.w[15] - 4 & 0xFFFF
                self._arrive(last.after, state)
            return
        depth = explorer.active.count(target)
        allowed = explorer.rules.recursion(target)
        if len(explorer.active) > MOST_CALLS:
            self.outcome.open[last.pc] = DEEP
            return
        if depth >= (MAX_DEPTH if allowed is None else allowed):
            if allowed is None:
                self.outcome.open[last.pc] = "recursion"
            return
        start, since, stack, waits = state.time, state.since.copy(), state.w[15], state.waits
        if not tail:
            state.flags = State().flags
        before = state.copy()
        found, general = explorer.call(target, state, many)
        self.outcome.take(found, start, since, (self.code.entry,))
        if found.left is not None:
            self.outcome.waits |= found.waits | waits
        self.outcome.arguments |= tail and found.arguments
        level = explorer.rules.back(target)
        if level is not None and found.left is not None:
            back = state.copy()
            self._lose_registers(back)
            back.time, back.ipl, back.waits = found.left, (level, level), frozenset(found.waits)
            back.w[15] = stack - 4 & 0xFFFF
            ends = [back]
        else:
            ends = [self._behind(before, end, found) if general else end.copy() for end in found.ends.values()]
        rare = explorer.rare(last.pc, target)
        if rare is not None and ends:
            cycles = min(end.time for end in ends)
            self.outcome.share(*rare, cycles)
            for end in ends:
                end.shift(-cycles)
        for end in ends:  # W8-W14 are preserved (abi-elf.md §2.1)
            if not tail and level is None:
                end.w[8:15] = before.w[8:15]
            end.shift(start)
            end.waits |= waits
            end.since = [since[k] if s == INHERITED else s for k, s in enumerate(end.since)]
            self._levels(end, last.pc)
            if tail:
                self._finish(end)
            elif len(ends) > 1 and self._decides(last.after):
                self._block(self.code.blocks[last.after], end)
            else:
                self._arrive(last.after, end)

    def _behind(self, before: State, end: State, found: Outcome) -> State:
        """The caller's state behind a call that was run for all its calls."""
        private = self.explorer.world.private
        new = end.copy()
        new.w = [*end.w[:15], before.w[15] - 4 & 0xFFFF]
        kept = {a: v for a, v in before.mem.items() if (a if a >= 0 else ~a) & ~1 not in private}
        handed = [*before.w[:8], *(before.mem.values() if found.arguments else ())]
        shown = min((ends(value)[0] for value in handed if self.area.inside(value)), default=NOWHERE)
        if found.wild and min(before.leaked, shown) < NOWHERE:
            kept = {}
        new.mem = kept | {a: v for a, v in end.mem.items() if (a if a >= 0 else ~a) & ~1 in private}
        new.leaked = min(before.leaked, shown)
        return new

    def _decides(self, head: int) -> bool:
        """Whether a block does nothing but choose a way: results of a call are kept apart until then."""
        block = self.code.blocks[head]
        short = len(block.steps) <= CHOICE and block.steps[-1].flow in (Branch, Skip)
        return short and head not in self.code.heads

    @staticmethod
    def _lose_registers(state: State) -> None:
        """What a call may change (abi-elf.md §2.1)."""
        fresh = State()
        state.w[:8] = fresh.w[:8]
        state.flags = fresh.flags

    def _leave(self, state: State) -> None:
        """Control goes to another stack."""
        self.outcome.left = max(self.outcome.left or 0, state.time)
        self.outcome.waits |= state.waits

    @staticmethod
    def _restored(state: State, srl: Value, ipl3: Value) -> None:
        """RETFIE brings the level back that was stacked (isa.md §7.4)."""
        (low, high), trap = levels_in(srl), ends(ipl3)
        state.ipl = low | (TRAP if trap[0] else 0), high | (TRAP if trap[1] else 0)

    def _return(self, target: Value, state: State) -> None:
        if not exact(state.w[15]):
            if not self.explorer.rules.switches(self.code.entry):
                self.outcome.open[self.code.entry] = ELSEWHERE
            self._leave(state)
            state.ipl, state.disi = (0, 0), 0  # whatever level it is, this stack is done with it
            self._levels(state, self.code.entry)
            return
        self._finish(state)

    def _finish(self, state: State) -> None:
        top = state.w[15]
        above = (
            {k for k in state.mem if (at := k if k >= 0 else ~k) >= top and self.area.holds(at)} if exact(top) else ()
        )
        for key in above:
            del state.mem[key]
        state.w[4:8], state.flags = State().w[4:8], State().flags  # not preserved (abi-elf.md §2.1)
        if exact(top) and state.leaked >= top:
            state.leaked = NOWHERE  # what has leaked is gone
        result = state.w[0]
        shown = result if exact(result) and result in RESULTS else None
        end = self.outcome.ends.get(shown)
        self.outcome.ends[shown] = state if end is None else self.area.join(end, state)
