"""Stack of single functions: follows every path from the entry and records the deepest stack at each instruction."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from emu.dspic30f.isa.facts import facts_of
from emu.dspic30f.isa.row import Insn
from toolchain.elf.disassemble import CodeItem
from toolchain.stack.effects import SP, Effect, StackPointerChange, Successor, effect_of

CALLER_SAVED = 0x00FF
"""Bit mask of W0 to W7 (abi-elf.md §2.1)."""

MAX_VISITS = 12  # visits of an instruction with an ever deeper stack after which its loop is considered unbounded


@dataclass(slots=True)
class CallSite:
    """A call site: its address, its stack depth, the target (None through a pointer), and whether it is a tail call."""

    address: int
    depth: int
    target: int | None
    tail: bool = False


@dataclass(slots=True)
class FunctionStack:
    """Result for one function; `frame` is its greatest own use in bytes, without return address and callees.

    `switch` is the depth at which the function switches to another stack, None if it never does.  A path without the
    switch, because W15 is on that stack already, counts in `frame` like any other.
    """

    entry: int
    frame: int = 0
    switch: int | None = None
    calls: list[CallSite] = field(default_factory=list)
    unknown: list[str] = field(default_factory=list)


@dataclass(frozen=True, slots=True)
class _State:
    """One point of a path.

    depth    bytes of the current stack
    frame    depth that W14 points to
    outer    depth of the stack before the switch, None without one
    saved    a register with a copy of W15: (register, depth, outer) of the copy
    shelved  a pushed copy of W15: depth and outer of its location, depth and outer of the copy
    """

    pc: int
    depth: int = 0
    frame: int | None = None
    outer: int | None = None
    saved: tuple[int, int, int | None] | None = None
    shelved: tuple[int, int | None, int, int | None] | None = None
    lost: bool = False  # W15 was replaced by an unknown value, so pushes and pops cannot be matched any more


class Walker:
    """Analyses functions of one image; `code` maps addresses to instructions, `entries` are function starts."""

    def __init__(self, code: Mapping[int, CodeItem], entries: set[int]) -> None:
        self.code, self.entries = code, entries

    def walk(self, entry: int) -> FunctionStack:
        """Return the result for the function at `entry`."""
        result = FunctionStack(entry)
        seen: dict[tuple[int, bool], tuple[int, int]] = {}  # by (address, whether switched): (depth, visits)
        work = [_State(entry)]
        calls: dict[int, CallSite] = {}
        while work:
            state = work.pop()
            key = (state.pc, state.outer is None)
            deepest, visits = seen.get(key, (-1 << 16, 0))
            if deepest >= state.depth:
                continue
            if visits >= MAX_VISITS:
                self._record_unknown(result, f"stack grows in a loop at {state.pc:#x}")
                continue
            seen[key] = (state.depth, visits + 1)
            item = self.code.get(state.pc)
            if item is None:
                self._record_unknown(result, f"continues at {state.pc:#x}, where no code is")
            elif item.insn is not None:
                work += self._step(result, calls, item, state)
        result.calls = [calls[a] for a in sorted(calls)]
        return result

    def _step(self, result: FunctionStack, calls: dict[int, CallSite], item: CodeItem, state: _State) -> list[_State]:
        """Apply one instruction; return the states that follow."""
        assert item.insn is not None
        effect = effect_of(item.insn, item.address)
        following = item.address + 2 * len(item.words)
        after = replace(self._stack(result, item, effect, self._kept(item.insn, effect, state)), pc=following)
        result.frame = max(result.frame, after.depth)
        if item.insn.row.mnemonic == "REPEAT":
            return [self._repeated(result, item, after)]
        match effect.flow:
            case Successor.NEXT:
                return [after]
            case Successor.BRANCH:
                return [after, replace(after, pc=effect.target)]
            case Successor.JUMP if effect.target in self.entries and effect.target != result.entry:
                self._call(calls, item.address, after.depth, effect.target, tail=True)
                return []
            case Successor.JUMP:
                return [replace(after, pc=effect.target)]
            case Successor.CALL | Successor.CALL_POINTER:
                self._call(calls, item.address, after.depth, effect.target if effect.flow is Successor.CALL else None)
                return [after]
            case Successor.JUMP_POINTER:
                self._call(calls, item.address, after.depth, None, tail=True)
                return []
            case Successor.SKIP:
                skipped = self.code.get(following)
                return [after, replace(after, pc=following + 2 * (len(skipped.words) if skipped else 1))]
            case Successor.TABLE:
                return [replace(after, pc=target) for target in self._table(result, following)]
        if after.depth and not after.lost and item.insn.row.mnemonic != "RESET":
            where = f"returns at {item.address:#x} "
            if not any(reason.startswith(where) for reason in result.unknown):
                self._record_unknown(result, f"{where}with {after.depth} bytes still on the stack")
        return []

    @staticmethod
    def _kept(insn: Insn, effect: Effect, state: _State) -> _State:
        """Return the state without copies of W15 that the instruction changes or a callee may overwrite.

        W15 restored from such a copy (alloca) is unknown.
        """
        shelved = state.shelved
        if shelved is not None and shelved[1] == state.outer and state.depth <= shelved[0]:
            state, shelved = replace(state, shelved=None), None  # the location of the copy has been popped
        if effect.popped is not None and shelved is not None and shelved[:2] == (state.depth - 2, state.outer):
            return replace(state, saved=(effect.popped, *shelved[2:]))
        if state.saved is None:
            return state
        register, depth, outer = state.saved
        if effect.pushed == register:
            return replace(state, shelved=(state.depth, state.outer, depth, outer))
        facts = facts_of(insn)
        changed = facts.writes | facts.source_pointers
        if effect.flow in (Successor.CALL, Successor.CALL_POINTER):
            changed |= CALLER_SAVED
        return replace(state, saved=None) if changed >> register & 1 else state

    def _stack(self, result: FunctionStack, item: CodeItem, effect: Effect, state: _State) -> _State:
        """Return the state with depth, frame and stack after the instruction."""
        match effect.pointer:
            case StackPointerChange.LINK:
                base = state.depth + 2
                return replace(state, depth=base + effect.delta, frame=base)
            case StackPointerChange.UNLINK | StackPointerChange.FROM_FRAME if state.frame is not None:
                if effect.pointer is StackPointerChange.UNLINK:
                    return replace(state, depth=state.frame - 2, frame=None)
                return replace(state, depth=state.frame)
            case StackPointerChange.UNLINK | StackPointerChange.FROM_FRAME:
                self._record_unknown(result, f"W15 restored from an unknown W14 at {item.address:#x}")
            case StackPointerChange.SAVED:
                return replace(state, saved=(effect.register, state.depth, state.outer))
            case StackPointerChange.RESTORED if state.saved is not None and state.saved[0] == effect.register:
                return replace(state, depth=state.saved[1], outer=state.saved[2])
            case StackPointerChange.FRESH if state.outer is None:
                if state.depth:
                    result.switch = max(result.switch or 0, state.depth)
                return replace(state, depth=0, outer=state.depth)
            case StackPointerChange.UNKNOWN | StackPointerChange.RESTORED | StackPointerChange.FRESH:
                self._record_unknown(result, f"W{SP} is set to an unknown value at {item.address:#x}")
                return replace(state, lost=True)
            case StackPointerChange.MOVED:
                return replace(state, depth=state.depth + effect.delta)
        return state

    def _repeated(self, result: FunctionStack, item: CodeItem, state: _State) -> _State:
        """Continue after a repeated instruction that changes W15: its effect counts once per iteration."""
        target = self.code.get(state.pc)
        assert item.insn is not None
        delta = effect_of(target.insn, state.pc).delta if target is not None and target.insn is not None else 0
        if not delta:
            return state
        if "k" not in item.insn.row.fields:
            self._record_unknown(result, f"repeated push or pop with an unknown count at {item.address:#x}")
            return state
        depth = state.depth + delta * (item.insn.x.k + 1)
        result.frame = max(result.frame, depth)
        return replace(state, pc=state.pc + 2, depth=depth)

    def _table(self, result: FunctionStack, address: int) -> list[int]:
        """Return the entries of a jump table after BRA Wn: a sequence of BRA and RETLW (abi-elf.md §8.1)."""
        targets: list[int] = []
        while (item := self.code.get(address)) is not None and item.insn is not None:
            name, branch = item.insn.row.mnemonic, effect_of(item.insn, address).flow is Successor.JUMP
            if not (name == "BRA" and branch) and name not in ("RETLW", "RETURN"):
                break
            targets.append(address)
            address += 2
        if not targets:
            self._record_unknown(result, f"computed branch without a table at {address - 2:#x}")
        return targets

    @staticmethod
    def _call(calls: dict[int, CallSite], address: int, depth: int, target: int | None, tail: bool = False) -> None:
        known = calls.get(address)
        if known is None or known.depth < depth:
            calls[address] = CallSite(address, depth, target, tail)

    @staticmethod
    def _record_unknown(result: FunctionStack, text: str) -> None:
        if text not in result.unknown:
            result.unknown.append(text)
