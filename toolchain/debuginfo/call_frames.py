"""Call frame information: locations of the caller's registers at each instruction of a function (DWARF 2 §6.4).

The canonical frame address (CFA) is the caller's W15 before the call, which is W15-4 at entry because the stack grows
upwards (abi-elf.md §6.7). `trace_frames` tracks it through the finished code: pushes and pops, LNK and ULNK, arguments,
inline assembly.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field, replace

from toolchain.abi.target import FP, SP
from toolchain.debuginfo.leb128 import sleb, uleb
from toolchain.mir.function import MFunction
from toolchain.mir.instruction import MI
from toolchain.mir.operands import Mem
from toolchain.verify.stack import stack_change

RETURN_BYTES = 4
RCOUNT, RETURN_ADDRESS = 16, 37  # DWARF register numbers other than those of W0-W15 (abi-elf.md §6.7)
DATA_ALIGN = 2
SCRATCH = range(8)  # W0-W7, which a function need not preserve (abi-elf.md §2.1)
SHADOWED = range(4)  # W0-W3, which PUSH.S saves in shadow registers
ADVANCE_LOC4, UNDEFINED, DEF_CFA, DEF_CFA_REGISTER = "0x04", "0x07", "0x0c", "0x0d"  # DWARF 2 §7.23
DEF_CFA_EXPRESSION, DEF_CFA_OFFSET_SF, VAL_EXPRESSION = "0x0f", "0x13", "0x16"  # DWARF 3 §7.23
OFFSET, RESTORE = 0x80, 0xC0
OP_DEREF, OP_CONST4U, OP_DUP, OP_AND, OP_PLUS = "0x06", "0x0c", "0x12", "0x1a", "0x22"
OP_BREG_SP, OP_BREG_RCOUNT = str(0x70 + SP), str(0x70 + RCOUNT)
STACKED_PC = ("0xfe", "0xff", "0x7f", "0")  # mask; other bits are SRL and IPL3 (isa.md §14.2)
CIE_ID = "0xffffffff"
NAMED = re.compile(r"(push|pop)(?:\.d)?\s+w(\d+)$")
ASM_STACK = re.compile(r"(?:(push|pop)|mov)(\.d)? (?:([^,\[]+)|([^,\[]+),\[w15\+\+\]|\[--w15\],([^,]+))")


@dataclass(frozen=True, slots=True)
class CallFrameState:
    """State of the frame before an instruction. All offsets are bytes above the CFA."""

    depth: int = RETURN_BYTES
    """Offset of W15; after a change of W15 by an unknown amount, its last known offset."""
    frame: int | None = None
    """Offset of W14 between LNK and ULNK, else None."""
    repeats: int = 0
    """n before a push that REPEAT #n repeats, else 0; RCOUNT holds the number of remaining repetitions."""
    saved: tuple[tuple[int, int | None], ...] = ()
    """(register, offset of the caller's value) of saved registers; the offset is None if the value is not in memory."""

    def with_saved(self, changes: dict[int, int | None]) -> CallFrameState:
        """The state with more registers saved; an earlier location of a register has precedence."""
        return replace(self, saved=tuple(sorted((changes | dict(self.saved)).items())))

    def without(self, gone: set[int]) -> CallFrameState:
        """The state after the registers `gone` have been restored to the caller's values."""
        return replace(self, saved=tuple(one for one in self.saved if one[0] not in gone))


@dataclass
class CallFrames:
    """Frame states of a function, and the labels at which they change, collected while its text is written."""

    prefix: str
    interrupt: bool
    states: dict[int, CallFrameState]  # state before each instruction, by id(instruction)
    rows: list[tuple[str, CallFrameState]] = field(default_factory=list)  # (label, state from that label on)
    now: CallFrameState = CallFrameState()

    def at(self, mi: MI) -> str:
        """Label line to write before an instruction if the state changes there, else ""."""
        return self._change(self.states.get(id(mi), self.now))

    def inside(self, line: str) -> str:
        """Label line to write after a line of inline assembly that changes the state, else ""."""
        state = _asm_after(self.now, line, self.interrupt)
        return self._change(state)

    def repeated(self, count: int) -> str:
        """Label line to write between REPEAT #count and the push that it repeats, or ""."""
        return self._change(replace(self.now, repeats=count)) if self.now.frame is None else ""

    def _change(self, state: CallFrameState) -> str:
        if state == self.now:
            return ""
        self.now = state
        label = f".Lcfi{self.prefix}_{len(self.rows)}"
        self.rows.append((label, state))
        return f"{label}:"


def trace_frames(m: MFunction, prefix: str) -> CallFrames:
    """Frame states of a finished function, by data flow over its blocks."""
    interrupt = bool(m.interrupt)
    blocks = m.block_map()
    at_start = {m.blocks[0].name: CallFrameState()}
    found: dict[int, CallFrameState] = {}
    work = [m.blocks[0].name]
    while work:
        b = blocks[work.pop()]
        state = at_start[b.name]
        for mi in b.insts:
            found[id(mi)] = state
            state = _after(state, mi, interrupt)
        for name in b.succs:
            if name not in at_start:
                at_start[name] = state
                work.append(name)
    return CallFrames(prefix, interrupt, found)


def _after(state: CallFrameState, mi: MI, interrupt: bool) -> CallFrameState:
    text = str(mi.args[0]) if mi.op == "text" else ""
    if text.startswith("lnk "):
        below = state.depth + 2
        return replace(state.with_saved({FP: state.depth}), depth=below + int(text[5:]), frame=below)
    if text == "ulnk":
        assert state.frame is not None
        first = state.frame - 2
        gone = {r for r, place in state.saved if place is not None and place >= first}
        return replace(state.without(gone), depth=first, frame=None)
    if text == "push.s":
        return state.with_saved(dict.fromkeys(SHADOWED))
    if text == "pop.s":
        return state.without({r for r, place in state.saved if place is None})
    if state.frame is not None:
        return _pushed(state, mi, interrupt) if _pushes_saved(mi) else replace(state, depth=state.depth + _growth(mi))
    change = _growth(mi)
    if change > 0:
        return _pushed(state, mi, interrupt)
    after = replace(state, depth=state.depth + change)
    back = {r for r, place in state.saved if r in _popped(mi) and place is not None and place >= after.depth}
    return after.without(back) if back else after


def _growth(mi: MI) -> int:
    """Bytes that an instruction adds to the stack."""
    if mi.op == "asm":
        return sum(_asm_change(line)[0] for line in mi.text.split("\n"))
    return stack_change(mi)


def _asm_after(state: CallFrameState, line: str, interrupt: bool) -> CallFrameState:
    """State after a line of inline assembly, which may push and pop registers."""
    change, registers = _asm_change(line)
    if change > 0:
        kept = {r: state.depth + 2 * k for k, r in enumerate(registers) if interrupt or r not in SCRATCH}
        return replace(state.with_saved(dict(kept)), depth=state.depth + change)
    depth = state.depth + change
    return replace(state, depth=depth).without({r for r, at in state.saved if r in registers and at == depth})


def _asm_change(line: str) -> tuple[int, list[int]]:
    """Bytes that a line of inline assembly adds to the stack, and the registers that it pushes or pops."""
    found = ASM_STACK.fullmatch(re.sub(r"\s+", " ", line.strip().lower()).replace(", ", ","))
    if found is None:
        return 0, []
    word, double, operand = found[1] or "mov", bool(found[2]), found[3] or found[4] or found[5]
    size = 4 if double else 2
    number = re.fullmatch(r"w(\d+)", operand)
    registers = [] if number is None else [int(number[1]) + k for k in range(size // 2)]
    return (-size if word == "pop" or found[5] else size), registers


def _pushes_saved(mi: MI) -> bool:
    """Whether an instruction is a push of the prologue, which has no source line."""
    return mi.line is None and _growth(mi) > 0


def _pushed(state: CallFrameState, mi: MI, interrupt: bool) -> CallFrameState:
    registers = _registers(mi, "push", 0)
    kept = {r: state.depth + 2 * k for k, r in enumerate(registers) if interrupt or r not in SCRATCH}
    return replace(state.with_saved(dict(kept)), depth=state.depth + _growth(mi))


def _popped(mi: MI) -> list[int]:
    return _registers(mi, "pop", 1)


def _registers(mi: MI, name: str, operand: int) -> list[int]:
    """Registers of a push or pop (`name`), in the order of their addresses."""
    if mi.op == "text":
        text = str(mi.args[0])
        found = NAMED.match(text)
        if found is not None and found[1] == name:
            return [int(found[2])]
        return [RCOUNT] if text == f"{name} _RCOUNT" else []
    if mi.op not in ("mov", "movd") or not any(isinstance(a, Mem) and a.base == SP for a in mi.args):
        return []
    r = mi.args[operand]
    return [] if not isinstance(r, int) else [r, r + 1] if mi.op == "movd" else [r]


class FrameSection:
    """Section .debug_frame of one module."""

    def __init__(self) -> None:
        self.functions: list[tuple[str, str, CallFrames]] = []

    def add(self, name: str, end: str, frames: CallFrames) -> None:
        """Add the entry of a function, whose code is between two labels."""
        self.functions.append((name, end, frames))

    def text(self) -> list[str]:
        """All lines of the section; none without functions."""
        if not self.functions:
            return []
        out = ["\t.section .debug_frame,info"]
        for interrupt in sorted({frames.interrupt for _, _, frames in self.functions}):
            out += self._common(interrupt)
        for name, end, frames in self.functions:
            out += self._entry(name, end, frames)
        return out

    def _common(self, interrupt: bool) -> list[str]:
        """Common information entry (CIE). Handlers mask the return address and preserve all registers."""
        data = [DEF_CFA, str(SP), "0", DEF_CFA_OFFSET_SF, *sleb(-RETURN_BYTES // DATA_ALIGN)]
        if interrupt:
            expression = [OP_DEREF, OP_CONST4U, *STACKED_PC, OP_AND]
            data += [VAL_EXPRESSION, *uleb(RETURN_ADDRESS), str(len(expression)), *expression]
        else:
            data += [str(OFFSET | RETURN_ADDRESS), "0"]
            data += [one for r in (*SCRATCH, RCOUNT) for one in (UNDEFINED, str(r))]
        head = ["1", "0", "1", *sleb(DATA_ALIGN), str(RETURN_ADDRESS)]
        return _record(
            f".Ldbg_cie{int(interrupt)}", [f"\t.4byte {CIE_ID}", _bytes([*head, *data])], 4 + len(head + data)
        )

    def _entry(self, name: str, end: str, frames: CallFrames) -> list[str]:
        lines = [f"\t.4byte .Ldbg_cie{int(frames.interrupt)}", f"\t.4byte {name},{end}-{name}"]
        size = 12
        before, place = CallFrameState(), name
        for label, state in frames.rows:
            data = _difference(before, state)
            if data:
                lines += [f"\t.byte {ADVANCE_LOC4}", f"\t.4byte {label}-{place}", _bytes(data)]
                size += 5 + len(data)
                place = label
            before = state
        return _record(f".Ldbg_fde_{name}", lines, size)


def _difference(before: CallFrameState, after: CallFrameState) -> list[str]:
    """Call frame instructions from one state to the next."""
    data: list[str] = []
    (register, offset), (old_register, old_offset) = _base(after), _base(before)
    if after.repeats:
        expression = [OP_BREG_SP, *sleb(-offset - 2 * after.repeats), OP_BREG_RCOUNT, "0", OP_DUP, OP_PLUS, OP_PLUS]
        data += [DEF_CFA_EXPRESSION, str(len(expression)), *expression]
    elif before.repeats:
        data += [DEF_CFA, str(register), "0", DEF_CFA_OFFSET_SF, *sleb(-offset // DATA_ALIGN)]
    else:
        if register != old_register:
            data += [DEF_CFA_REGISTER, str(register)]
        if offset != old_offset:
            data += [DEF_CFA_OFFSET_SF, *sleb(-offset // DATA_ALIGN)]
    old, new = dict(before.saved), dict(after.saved)
    for r in sorted(old.keys() - new.keys()):
        data.append(str(RESTORE | r))
    for r, at in new.items():
        if r in old and old[r] == at:
            continue
        data += [UNDEFINED, str(r)] if at is None else [str(OFFSET | r), *uleb(at // DATA_ALIGN)]
    return data


def _base(state: CallFrameState) -> tuple[int, int]:
    return (SP, state.depth) if state.frame is None else (FP, state.frame)


def _bytes(data: list[str]) -> str:
    return f"\t.byte {','.join(data)}"


def _record(label: str, lines: list[str], size: int) -> list[str]:
    """Lines of one entry: length, content of `size` bytes, and NOPs up to a multiple of 4 bytes."""
    padding = -size % 4
    out = [f"{label}:", f"\t.4byte {size + padding}", *lines]
    return [*out, _bytes(["0"] * padding)] if padding else out
