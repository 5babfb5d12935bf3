"""Stack frames: replace slot operands by addresses, and add prologues and epilogues.

Without frame pointer (addresses are relative to W15, which pushed arguments change):
    entry W15 ->  saved registers | locals, spill slots nearest the top | pushed arguments  <- W15
With frame pointer (dynamic stack, or locals beyond the range of ADD #lit10), as in abi-elf.md §2.4:
    entry W15 ->  caller's W14 | locals, spill slots first | saved registers | dynamic blocks
                  ^ W14
Interrupt functions save all registers that they change, in the order of abi-elf.md §2.5.
"""

from __future__ import annotations

import re

from toolchain.abi.target import CALLEE_SAVED, CALLER_SAVED, FP, LIT5_MAX, LIT10_MAX, LNK_MAX, SP, WORD_OFFSET
from toolchain.ir.model import UnsupportedError
from toolchain.mir.function import MFunction
from toolchain.mir.instruction import MI
from toolchain.mir.operands import FrameSlot, Imm, Mem, Operand

FRAME_POINTER_BYTES = 900  # maximum bytes of locals without LNK; the greatest literal of ADD #lit10 is 1023
PROBE_REACH = 1022  # largest word offset of [Wn+lit] (isa.md §3)
PROBE_BYTES = 8  # -fstack-check probes frames of more than this number of bytes (kernel.md §4)
USES_STACK = re.compile(r"\b(?:push|pop|lnk|ulnk|w15|sp)\b", re.IGNORECASE)
REPEATS = {"repmov", "repfill", "repclr", "div.s", "div.u", "div.sd", "div.ud"}


def wants_frame_pointer(m: MFunction, preferred: bool) -> bool:
    """Whether the function has a frame pointer; register allocation must not use W14 then.

    `preferred`: also where none is needed, except in functions whose inline assembly changes W14.
    """
    if m.naked:
        return False
    if preferred and not any(mi.op == "asm" and FP in mi.also_defs for b in m.blocks for mi in b.insts):
        return True
    return m.dynamic_stack or sum(o.size for o in m.frame if o.fixed is None) > FRAME_POINTER_BYTES


class FrameBuilder:
    """Builder of one function's frame: computes its layout and rewrites the function."""

    def __init__(self, m: MFunction, stack_check: bool) -> None:
        self.m = m
        self.stack_check = stack_check
        self.calls = any(mi.op in ("call", "callr", "asm") for b in m.blocks for mi in b.insts)
        self.repeats = any(mi.op in REPEATS for b in m.blocks for mi in b.insts)
        self.saved = self._saved_registers()
        self.locals = self._layout()

    def _saved_registers(self) -> list[int]:
        written: set[int] = set()
        for b in self.m.blocks:
            for mi in b.insts:
                if not (self.m.naked and mi.op == "asm"):
                    written.update(mi.defs())
        if not self.m.interrupt:
            keep = [r for r in CALLEE_SAVED if r in written and not (r == FP and self.m.uses_fp)]
            return keep
        if any(mi.op in ("call", "callr") for b in self.m.blocks for mi in b.insts):
            written |= set(CALLER_SAVED)
        shadow = 4 if "shadow" in self.m.interrupt else 0
        return [r for r in range(shadow, 15) if r in written and not (r == FP and self.m.uses_fp)]

    def _layout(self) -> int:
        """Assign offsets to the objects in use; return the bytes of locals."""
        used = {a.index for b in self.m.blocks for mi in b.insts for a in mi.args if isinstance(a, FrameSlot)}
        free = [(k, o) for k, o in enumerate(self.m.frame) if o.fixed is None and k in used]
        free.sort(key=lambda e: (e[1].spill, -e[1].size), reverse=self.m.uses_fp)
        at = 0
        for _, o in free:
            o.offset = at
            at += (o.size + 1) // 2 * 2
        if self.m.naked and (at or self.saved or self.m.dynamic_stack):
            raise UnsupportedError(
                f"a stack frame in the naked function {self.m.name}: move its C statements to another function"
            )
        if at > LNK_MAX:
            raise UnsupportedError(f"frame of {at} bytes (limit {LNK_MAX})")
        return at

    # -- addresses ----------------------------------------------------------------------------------------------------

    def _locate(self, slot: FrameSlot, pushed: int) -> tuple[int, int]:
        """(base register, offset) of a slot while `pushed` bytes are above the frame."""
        o = self.m.frame[slot.index]
        if self.m.uses_fp:
            below = -2 - (self.interrupt_bytes() if self.m.interrupt else 0)
            return FP, (o.offset if o.fixed is None else below + o.fixed) + slot.off
        if o.fixed is None:
            return SP, o.offset + slot.off - self.locals - pushed
        saved = self.interrupt_bytes() if self.m.interrupt else 2 * len(self.saved)
        return SP, o.fixed + slot.off - saved - self.locals - pushed

    def interrupt_bytes(self) -> int:
        """Bytes that an interrupt function pushes before its frame."""
        extra = (2 if self._saves_rcount() else 0) + (2 if "no_auto_psv" not in self.m.interrupt else 0)
        return 2 * len(self.saved) + 2 * len(self.m.preserved) + extra

    def _saves_rcount(self) -> bool:
        return self.repeats or self.calls

    def run(self) -> None:
        """Rewrite the whole function."""
        for b in self.m.blocks:
            pushed = 0
            out: list[MI] = []
            for mi in b.insts:
                pushes = _pushes(mi)
                out += self._with_frame_pointer_kept(mi.replacement(self._instruction(mi, pushed)))
                pushed += pushes
            b.insts = out
        self._prologue()
        for b in self.m.blocks:
            if b.insts and b.insts[-1].op in ("ret", "tailcall"):
                epilogue = self._epilogue(b.insts[-1])
                for mi in epilogue:
                    mi.epilogue = True
                b.insts[-1:-1] = epilogue
        self._describe()

    def _describe(self) -> None:
        """Record the offsets of locals from W15 at entry, for debug information."""
        m = self.m
        m.frame_bytes = self.locals + 2 * len(self.saved)
        before = self.interrupt_bytes() if m.interrupt else 0
        if m.uses_fp:
            m.locals_base = before + 2
            m.frame_base = (FP, -before - 2)
        else:
            m.locals_base = before or 2 * len(self.saved)
            m.frame_base = (SP, -(m.locals_base + self.locals))

    def _with_frame_pointer_kept(self, new: list[MI]) -> list[MI]:
        """The instructions, with W14 saved around inline assembly that clobbers it while it is the frame pointer."""
        mi = new[0]
        if mi.op != "asm" or not self.m.uses_fp or FP not in mi.also_defs:
            return new
        if USES_STACK.search(mi.text):
            error = UnsupportedError("inline assembly clobbers the frame pointer W14 and uses the stack")
            error.line = mi.line
            raise error
        return [MI("text", "push w14", line=mi.line), mi, MI("text", "pop w14", line=mi.line)]

    def _instruction(self, mi: MI, pushed: int) -> list[MI]:
        if mi.op == "lea":
            base, offset = self._locate(mi.slot(0), pushed)
            return _address_into(mi.register(1), base, offset, mi)
        if mi.op == "setsp":
            return [MI("mov", mi.register(0), SP, line=mi.line)]
        if mi.op == "spadd":
            return _adjust(mi.number(0), mi.line)
        if not any(isinstance(a, FrameSlot) for a in mi.args):
            return [mi]
        return self._slot_operand(mi, pushed)

    def _slot_operand(self, mi: MI, pushed: int) -> list[MI]:
        """MOV with a frame operand; a load beyond the offset range computes the address in its destination register."""
        k = next(n for n, a in enumerate(mi.args) if isinstance(a, FrameSlot))
        slot = mi.slot(k)
        base, offset = self._locate(slot, pushed)
        low, high = (-512, 511) if mi.byte else WORD_OFFSET
        if low <= offset <= high:
            args: list[Operand] = list(mi.args)
            args[k] = Mem("off", base, offset, slot.volatile) if offset else Mem("ind", base, 0, slot.volatile)
            mi.args = args
            return [mi]
        if k == 0 and isinstance(mi.args[1], int):
            r = mi.args[1]
            mi.args = [Mem("idx", base, r, slot.volatile), r]
            return [MI("mov", Imm(offset & 0xFFFF), r, line=mi.line), mi]
        return self._far_store(mi, base, offset, slot.volatile)

    def _far_store(self, mi: MI, base: int, offset: int, volatile: int) -> list[MI]:
        """Store beyond the offset range: PUSH Wt, MOV #offset,Wt, MOV [base+Wt], POP Wt. No flags change."""
        source = mi.args[0]
        t = next(r for r in range(8) if r != source)
        if base == SP:
            offset -= 2
        mi.args = [source, Mem("idx", base, t, volatile)]
        return [
            MI("mov", t, Mem("++", SP), line=mi.line),
            MI("mov", Imm(offset & 0xFFFF), t, line=mi.line),
            mi,
            MI("mov", Mem("-", SP), t, line=mi.line),
        ]

    # -- entry and exit -----------------------------------------------------------------------------------------------

    def _prologue(self) -> None:
        m = self.m
        out: list[MI] = []
        if m.interrupt:
            out += self._interrupt_entry()
        if m.uses_fp:
            out.append(MI("text", f"lnk #{self.locals}"))
            if not m.interrupt:
                out += _push_registers(self.saved)
        else:
            if not m.interrupt:
                out += _push_registers(self.saved)
            out += _adjust(self.locals, None)
        if self.stack_check and self.locals > PROBE_BYTES:  # the pushes probe smaller frames
            out[0:0] = _probe(self.locals + 2 * len(self.saved))
        m.blocks[0].insts[0:0] = out

    def _epilogue(self, last: MI) -> list[MI]:
        m = self.m
        out: list[MI] = []
        if m.uses_fp:
            if not m.interrupt:
                for k, r in enumerate(self.saved):
                    out += _load_far(r, self.locals + 2 * k, last.line)
            out.append(MI("text", "ulnk", line=last.line))
        else:
            out += _adjust(-self.locals, last.line)
            if not m.interrupt:
                out += _pop_registers(self.saved, last.line)
        if m.interrupt:
            out += self._interrupt_exit(last.line)
        return out

    def _interrupt_entry(self) -> list[MI]:
        out = [MI("text", line) for line in self.m.preprologue]
        out += [MI("text", f"push {name}") for name in self.m.preserved]
        if self._saves_rcount():
            out.append(MI("text", "push _RCOUNT"))
        if "shadow" in self.m.interrupt:
            out.append(MI("text", "push.s"))
        out += _push_registers(self.saved)
        if "no_auto_psv" not in self.m.interrupt:
            out.append(MI("text", "push _PSVPAG"))
            load = [MI("mov", Imm("__const_psvpage"), 0), _text("mov w0,_PSVPAG", uses=(0,))]
            if 0 in self.saved or "shadow" in self.m.interrupt:
                out += load
            else:
                out += [_text("push w0", uses=(0,)), *load, _text("pop w0", defs=(0,))]
        return out

    def _interrupt_exit(self, line: str | None) -> list[MI]:
        out = []
        if "no_auto_psv" not in self.m.interrupt:
            out.append(MI("text", "pop _PSVPAG", line=line))
        out += _pop_registers(self.saved, line)
        if "shadow" in self.m.interrupt:
            out.append(MI("text", "pop.s", line=line))
        if self._saves_rcount():
            out.append(MI("text", "pop _RCOUNT", line=line))
        return out + [MI("text", f"pop {name}", line=line) for name in reversed(self.m.preserved)]


def _pushes(mi: MI) -> int:
    """Bytes that an instruction adds to the stack for the rest of its block."""
    if mi.op == "spadd":
        return mi.number(0)
    if mi.op == "repmov" and mi.args[2] == SP:
        return 2 * (mi.number(0) + 1)
    return sum(2 for a in mi.args if isinstance(a, Mem) and a.mode == "++" and a.base == SP)


def _probe(depth: int) -> list[MI]:
    """Read `depth` bytes above W15, so that a stack that is too short traps while W15 is still inside it.

    Otherwise the frame of the trap (isa.md §14.2) would overwrite the neighbouring memory. The CPU may execute two more
    instructions after the read (§14.4, soft traps); they are harmless. W7 may contain an argument."""
    if depth + 2 > PROBE_REACH:
        return [*_adjust(depth, None), MI("cp0", Mem("ind", SP)), *_adjust(-depth, None), MI("text", "nop")]
    return [MI("text", line) for line in ("push w7", f"mov [w15+{depth}],w7", "pop w7", "nop")]


def _adjust(amount: int, line: str | None) -> list[MI]:
    """Instructions that add `amount` to W15."""
    if amount == 0:
        return []
    op, k = ("add", amount) if amount > 0 else ("sub", -amount)
    if k <= LIT5_MAX:
        return [MI(op, SP, Imm(k), SP, line=line)]
    if k <= LIT10_MAX:
        return [MI(op + "l", Imm(k), SP, line=line)]
    return [*_adjust(amount - (LIT10_MAX - 1 if amount > 0 else 1 - LIT10_MAX), line),
            MI(op + "l", Imm(LIT10_MAX - 1), SP, line=line)]  # fmt: skip


def _address_into(r: int, base: int, offset: int, mi: MI) -> list[MI]:
    """Instructions that compute r = base + offset."""
    if offset == 0:
        return [MI("mov", base, r, line=mi.line)]
    if abs(offset) <= LIT5_MAX:
        out = [MI("add" if offset > 0 else "sub", base, Imm(abs(offset)), r, line=mi.line)]
    else:
        out = [MI("mov", Imm(offset & 0xFFFF), r, line=mi.line), MI("add", base, r, r, line=mi.line)]
    return out


def _load_far(r: int, offset: int, line: str | None) -> list[MI]:
    """Instructions that load r from W14 + offset."""
    if offset <= WORD_OFFSET[1]:
        return [MI("mov", Mem("off", FP, offset) if offset else Mem("ind", FP), r, line=line)]
    return [MI("mov", Imm(offset), r, line=line), MI("mov", Mem("idx", FP, r), r, line=line)]


def _text(text: str, uses: tuple[int, ...] = (), defs: tuple[int, ...] = ()) -> MI:
    """An instruction given as text, with the registers that it uses and defines."""
    mi = MI("text", text)
    mi.also_uses, mi.also_defs = uses, defs
    return mi


def _push_registers(registers: list[int]) -> list[MI]:
    """Instructions that push registers, two at a time if an even register and the next one are both saved."""
    out = []
    k = 0
    while k < len(registers):
        r = registers[k]
        if r % 2 == 0 and r < 14 and registers[k + 1 : k + 2] == [r + 1]:
            out.append(MI("movd", r, Mem("++", SP)))
            k += 2
        else:
            out.append(MI("mov", r, Mem("++", SP)))
            k += 1
    return out


def _pop_registers(registers: list[int], line: str | None) -> list[MI]:
    out = []
    for push in reversed(_push_registers(registers)):
        out.append(MI(push.op, Mem("-", SP), push.args[0], line=line))
    return out


def build_frame(m: MFunction, stack_check: bool) -> None:
    """Build the frame. Needs: real registers, `uses_fp` set. Ensures: no FrameSlot, lea, spadd or setsp remains."""
    FrameBuilder(m, stack_check).run()
