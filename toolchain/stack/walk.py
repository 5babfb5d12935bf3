"""One function at a time: follow every path from its entry and keep the deepest stack at each instruction."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from toolchain.elf.disassemble import Item
from toolchain.stack.effects import SP, Effect, Flow, Pointer, effect_of

MAX_VISITS = 12  # times one instruction may be reached with an ever deeper stack before its loop counts as unbounded


@dataclass(slots=True)
class Call:
    """A call site: where, how deep the stack is there, to which address (None through a pointer), tail call or not."""

    address: int
    depth: int
    target: int | None
    tail: bool = False


@dataclass(slots=True)
class Function:
    """What a walk found; `frame` is the deepest own use in bytes, without return address and callees."""

    entry: int
    frame: int = 0
    calls: list[Call] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    returns: bool = False


class Walker:
    """Walks functions of one image; `code` maps addresses to instructions, `entries` are function starts."""

    def __init__(self, code: Mapping[int, Item], entries: set[int]) -> None:
        self.code, self.entries = code, entries

    def walk(self, entry: int) -> Function:
        """Return the facts of the function that starts at `entry`."""
        result = Function(entry)
        seen: dict[int, tuple[int, int | None, int]] = {}
        work: list[tuple[int, int, int | None]] = [(entry, 0, None)]
        calls: dict[int, Call] = {}
        while work:
            pc, depth, frame = work.pop()
            before = seen.get(pc)
            if before is not None and before[0] >= depth:
                continue
            visits = before[2] + 1 if before else 1
            if visits > MAX_VISITS:
                self._note(result, f"stack grows in a loop at {pc:#x}")
                continue
            seen[pc] = (depth, frame, visits)
            item = self.code.get(pc)
            if item is None or item.insn is None:
                if item is None:
                    self._note(result, f"runs out of known code at {pc:#x}")
                continue
            work += self._step(result, calls, item, depth, frame)
        result.calls = [calls[a] for a in sorted(calls)]
        return result

    def _step(
        self, result: Function, calls: dict[int, Call], item: Item, depth: int, frame: int | None
    ) -> list[tuple[int, int, int | None]]:
        """Apply one instruction; return the states that follow."""
        assert item.insn is not None
        effect = effect_of(item.insn, item.address)
        after, frame = self._depth(result, item, effect, depth, frame)
        result.frame = max(result.frame, after)
        following = item.address + 2 * len(item.words)
        if item.insn.row.mnemonic == "REPEAT":
            return [self._repeated(result, item, following, after, frame)]
        match effect.flow:
            case Flow.NEXT:
                return [(following, after, frame)]
            case Flow.BRANCH:
                return [(following, after, frame), (effect.target, after, frame)]
            case Flow.JUMP if effect.target in self.entries and effect.target != result.entry:
                self._call(calls, item.address, after, effect.target, tail=True)
                result.returns = True
                return []
            case Flow.JUMP:
                return [(effect.target, after, frame)]
            case Flow.CALL | Flow.CALL_POINTER:
                self._call(calls, item.address, after, effect.target if effect.flow is Flow.CALL else None)
                return [(following, after, frame)]
            case Flow.JUMP_POINTER:
                self._call(calls, item.address, after, None, tail=True)
                return []
            case Flow.SKIP:
                skipped = self.code.get(following)
                behind = following + 2 * len(skipped.words) if skipped else following + 2
                return [(following, after, frame), (behind, after, frame)]
            case Flow.TABLE:
                return [(target, after, frame) for target in self._table(result, following)]
        result.returns = True
        if after and item.insn.row.mnemonic != "RESET":
            self._note(result, f"returns at {item.address:#x} with {after} bytes still on the stack")
        return []

    def _depth(
        self, result: Function, item: Item, effect: Effect, depth: int, frame: int | None
    ) -> tuple[int, int | None]:
        match effect.pointer:
            case Pointer.LINK:
                result.frame = max(result.frame, depth + 2 + effect.delta)
                return depth + 2 + effect.delta, depth + 2
            case Pointer.UNLINK | Pointer.FROM_FRAME:
                if frame is None:
                    self._note(result, f"W15 restored from an unknown W14 at {item.address:#x}")
                    return depth, frame
                return (frame - 2, None) if effect.pointer is Pointer.UNLINK else (frame, frame)
            case Pointer.FRESH if depth == 0:
                return 0, frame
            case Pointer.UNKNOWN | Pointer.FRESH:
                self._note(result, f"W{SP} is set to an unknown value at {item.address:#x}")
                return depth, frame
        return depth + effect.delta, frame

    def _repeated(
        self, result: Function, item: Item, following: int, depth: int, frame: int | None
    ) -> tuple[int, int, int | None]:
        """Go on behind a repeated instruction, its effect on the stack counted once per iteration."""
        target = self.code.get(following)
        if target is None or target.insn is None or item.insn is None:
            return following, depth, frame
        delta = effect_of(target.insn, following).delta
        if not delta:
            return following, depth, frame
        if "k" not in item.insn.row.fields:
            self._note(result, f"repeated push or pop with a count not known at {item.address:#x}")
            return following, depth, frame
        total = depth + delta * (item.insn.x.k + 1)
        result.frame = max(result.frame, total)
        return following + 2, total, frame

    def _table(self, result: Function, address: int) -> list[int]:
        """Entries of a jump table behind BRA Wn: a run of BRA and RETLW (abi-elf.md §8.1)."""
        targets: list[int] = []
        while (item := self.code.get(address)) is not None and item.insn is not None:
            name, branch = item.insn.row.mnemonic, effect_of(item.insn, address).flow is Flow.JUMP
            if not (name == "BRA" and branch) and name not in ("RETLW", "RETURN"):
                break
            targets.append(address)
            address += 2
        if not targets:
            self._note(result, f"computed branch without a table at {address - 2:#x}")
        return targets

    @staticmethod
    def _call(calls: dict[int, Call], address: int, depth: int, target: int | None, tail: bool = False) -> None:
        known = calls.get(address)
        if known is None or known.depth < depth:
            calls[address] = Call(address, depth, target, tail)

    @staticmethod
    def _note(result: Function, text: str) -> None:
        if text not in result.notes:
            result.notes.append(text)
