"""Selection of calls, returns and function entry (abi-elf.md §2.2-2.4)."""

from __future__ import annotations

from toolchain.abi.arguments import ArgumentLocation, ArgumentShape, argument_locations, scalar_shape, struct_shape
from toolchain.abi.names import symbol
from toolchain.abi.target import CALLER_SAVED, RETURN_ADDRESS_BYTES, SP
from toolchain.ir.model import (
    Arg,
    ConstInt,
    Function,
    GlobalRef,
    Instr,
    ParameterAttributes,
    Type,
    Undef,
    Value,
    align_of,
    size_of,
)
from toolchain.mir.operands import FrameSlot, Imm, Mem
from toolchain.select import asm_inline, builtins
from toolchain.select.context import Handler, SelectionContext

BLOCK_PUSH_WORDS = 5  # minimum number of words of a struct that is pushed by REPEAT


def shape_of(v: Value, attrs: ParameterAttributes) -> ArgumentShape:
    """Shape of an argument or parameter with these attributes."""
    t = attrs.get("byval")
    if t is None:
        return scalar_shape(v.type)
    return struct_shape(t, attrs.get("align", 0), attrs.get("unaligned_run", False))


# ---------------------------------------------------------------------------------------------------------------------
# function entry


def is_struct(a: Arg) -> bool:
    """Whether a parameter is a struct passed by value, which the IR represents by the address of a copy."""
    return "byval" in a.attrs


def parameter_locations(f: Function) -> list[ArgumentLocation]:
    """Locations of the parameters of a function."""
    return argument_locations([shape_of(a, a.attrs) for a in f.args], len(f.args) if f.vararg else None)


def incoming(s: SelectionContext) -> None:
    """Allocate frame slots for parameters on the stack and for structs, before code is selected."""
    f = s.f
    s.parameters = parameter_locations(f)
    read = [i.extra["argument"] for i in f.blocks[0].instrs if i.op == "argword"]
    low = RETURN_ADDRESS_BYTES
    for a, location in zip(f.args, s.parameters, strict=True):
        t = a.attrs.get("byval")
        if location.stack:
            low = max(low, location.stack)
            slot = s.new_slot(2 * location.words, -location.stack)
            s.arg_slots[id(a)] = slot
            if t is not None:
                s.slots[id(a)] = slot
        elif t is not None and a not in read:
            s.slots[id(a)] = s.new_slot(max(2 * location.words, 1))
    s.variadic_anchor = s.new_slot(2, -low) if f.vararg else 0


def receive(s: SelectionContext) -> None:
    """Emit entry code: move parameters from registers and stack to virtual registers or slots."""
    late: list[tuple[Arg, ArgumentLocation]] = []
    for a, location in zip(s.f.args, s.parameters, strict=True):
        if location.register is None:
            late.append((a, location))
            continue
        if id(a) in s.slots:
            for k in range(location.words):
                s.emit("mov", location.register + k, FrameSlot(s.slots[id(a)], 2 * k))
        elif is_struct(a):
            for word in s.f.blocks[0].instrs:
                if word.op == "argword" and word.extra["argument"] is a and id(word) in s.needed:
                    s.copy(location.register + word.extra["word"], s.value_regs(word)[0])
        elif id(a) in s.needed:
            for k, r in enumerate(s.value_regs(a)):
                s.copy(location.register + k, r)
    for a, location in late:
        if location.stack and id(a) not in s.slots and id(a) in s.needed:
            for k, r in enumerate(s.value_regs(a)):
                s.emit("mov", FrameSlot(s.arg_slots[id(a)], 2 * k), r)


# ---------------------------------------------------------------------------------------------------------------------
# calls


def select_call(s: SelectionContext, i: Instr) -> None:
    """Select a call: push stack arguments from last to first, load register arguments, call, copy the result."""
    callee = i.args[-1]
    args = i.args[:-1]
    attrs = i.extra["attrs"]
    named = i.extra["fixed"] if i.extra.get("vararg") else None
    locations = argument_locations([shape_of(a, k) for a, k in zip(args, attrs, strict=True)], named)
    target: int | str
    target = symbol(s.module, callee.name) if isinstance(callee, GlobalRef) else s.reg(callee)
    pushed = _push_stack_arguments(s, args, attrs, locations)
    used = _load_register_arguments(s, args, attrs, locations)
    mi = s.emit("callr", target) if isinstance(target, int) else s.emit("call", target)
    mi.also_uses = tuple(used)
    mi.also_defs = CALLER_SAVED
    mi.tail = i.extra.get("tail") in ("tail", "musttail") and not pushed
    if pushed:
        s.emit("spadd", Imm(-pushed))
    _take_results(s, i)


def _take_results(s: SelectionContext, i: Instr) -> None:
    """Copy the result from its registers; the members of an aggregate are in consecutive registers from W0."""
    results = i.extra.get("results")
    if not results:
        if id(i) in s.needed:
            for k, r in enumerate(s.value_regs(i)):
                s.copy(k, r)
        return
    at = 0
    users = {u.extra["index"]: u for u in s.users.get(id(i), ()) if u.op == "callresult"}
    for k, t in enumerate(results):
        part = i if k == 0 else users.get(k)
        words = max(1, t.bits // 16)
        if part is not None and id(part) in s.needed:
            for n, r in enumerate(s.value_regs(part)):
                s.copy(at + n, r)
        at += words


def _push_stack_arguments(
    s: SelectionContext, args: list[Value], attrs: list[ParameterAttributes], locations: list[ArgumentLocation]
) -> int:
    """Push stack arguments in descending order of their offset; return the bytes pushed."""
    pushed = 0
    for k in sorted((k for k in range(len(args)) if locations[k].stack), key=lambda k: -locations[k].stack):
        v = args[k]
        t = attrs[k].get("byval")
        if t is not None:
            _push_struct(s, v, t)
        elif s.is_leaf(v):
            for word in range(locations[k].words):
                if isinstance(v, ConstInt) and not v.value >> 16 * word & 0xFFFF:
                    s.emit("clr", Mem("++", SP))
                else:
                    s.emit("mov", s.leaf_word(v, word), Mem("++", SP))
        else:
            for r in s.regs(v):
                s.emit("mov", r, Mem("++", SP))
        pushed += 2 * locations[k].words
    return pushed


def _push_struct(s: SelectionContext, v: Value, t: Type) -> None:
    """Push a copy of a struct in memory."""
    words = (size_of(t) + 1) // 2
    if align_of(t) == 2 and words >= BLOCK_PUSH_WORDS:
        source = s.temp()
        s.copy(s.reg(v), source)
        s.emit("repmov", Imm(words - 1), source, SP)
        return
    if words >= BLOCK_PUSH_WORDS:  # copied byte by byte through another pointer, because W15 must remain even
        source, dest = s.temp(), s.temp()
        s.copy(s.reg(v), source)
        s.emit("mov", SP, dest)
        s.emit("spadd", Imm(2 * words))
        s.emit("repmov", Imm(size_of(t) - 1), source, dest, byte=True)
        return
    for r in _struct_words(s, v, t):
        s.emit("mov", r, Mem("++", SP))


def _struct_words(s: SelectionContext, v: Value, t: Type) -> list[int]:
    """Load the words of a struct in memory; the padding byte of an odd size is not read."""
    base, size = s.reg(v), size_of(t)
    out = []
    for at in range(0, size, 2):
        r = s.temp()
        if align_of(t) == 2:
            s.emit("mov", s.offset_operand(base, at, False), r)
        elif at + 1 == size:
            s.emit("mov", s.offset_operand(base, at, True), r, byte=True)
        else:
            low, high, shifted = s.temp(), s.temp(), s.temp()
            raw = s.temp()
            s.emit("mov", s.offset_operand(base, at, True), raw, byte=True)
            s.emit("ze", raw, low)
            s.emit("mov", s.offset_operand(base, at + 1, True), high, byte=True)
            s.emit("sl", high, Imm(8), shifted)
            s.emit("ior", low, shifted, r)
        out.append(r)
    return out


def _load_register_arguments(
    s: SelectionContext, args: list[Value], attrs: list[ParameterAttributes], locations: list[ArgumentLocation]
) -> list[int]:
    """Copy arguments into W0-W7; return these registers. All values are computed before the first copy."""
    moves: list[tuple[int, int]] = []
    leaves: list[tuple[Value, int, int]] = []
    used: list[int] = []
    for v, a, location in zip(args, attrs, locations, strict=True):
        if location.register is None:
            continue
        if isinstance(v, Undef):
            continue
        used += range(location.register, location.register + location.words)
        t = a.get("byval")
        if t is not None:
            moves += [(r, location.register + k) for k, r in enumerate(_struct_words(s, v, t))]
        elif s.is_leaf(v):
            leaves += [(v, k, location.register + k) for k in range(location.words)]
        else:
            moves += [(r, location.register + k) for k, r in enumerate(s.regs(v))]
    for source, dest in moves:
        s.copy(source, dest)
    for leaf, word, dest in leaves:
        s.load_leaf(leaf, word, dest)
    return used


def select_ret(s: SelectionContext, i: Instr) -> None:
    """Copy the result to W0 and the following registers (abi-elf.md §2.3), then return."""
    at = 0
    used: list[int] = []
    leaves: list[tuple[Value, int, int]] = []
    for v in i.args:
        words = max(1, v.type.bits // 16)
        if not isinstance(v, Undef):
            used += range(at, at + words)
            if s.is_leaf(v):
                leaves += [(v, k, at + k) for k in range(words)]
            else:
                for k, r in enumerate(s.regs(v)):
                    s.copy(r, at + k)
        at += words
    for leaf, word, dest in leaves:
        s.load_leaf(leaf, word, dest)
    s.emit("ret").also_uses = tuple(used)


def select_entryword(s: SelectionContext, i: Instr) -> None:
    """Load the first word of the return address, or the frame address, of this function."""
    slot = s.new_slot(2, -RETURN_ADDRESS_BYTES)
    s.emit("lea" if i.extra["address"] else "mov", FrameSlot(slot), s.value_regs(i)[0])


def select_argword(s: SelectionContext, i: Instr) -> None:
    """Emit no code: `receive` copies the word into its register."""


def select_callresult(s: SelectionContext, i: Instr) -> None:
    """Emit no code: the call copies all members of its result."""


HANDLERS: dict[str, Handler] = {
    "call": select_call,
    "ret": select_ret,
    "callresult": select_callresult,
    "entryword": select_entryword,
    "argword": select_argword,
    "builtin": builtins.select_builtin,
    "asm": asm_inline.select_asm,
    "asmresult": asm_inline.select_asmresult,
}
