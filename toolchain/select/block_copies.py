"""Selection of copies and fills of blocks of memory."""

from __future__ import annotations

from toolchain.ir.model import ConstInt, Instr, Value
from toolchain.mir.operands import AddressingMode, Imm, Mem
from toolchain.select.context import Handler, SelectionContext

MAX_UNROLLED_UNITS = 3  # maximum number of units copied one by one; larger copies and fills use REPEAT


def _pointer(s: SelectionContext, p: Value, size: int, block: Instr) -> tuple[int, int | None]:
    """(register with a copy of the pointer, which the operation advances; register of p + size, or None).

    The second register receives the advanced pointer if later code uses p + size. The copy is a separate register,
    because a debugger must not see a value of p + size before the operation."""
    r = s.temp()
    if s.is_leaf(p):
        s.load_leaf(p, 0, r)
    else:
        s.copy(s.reg(p), r)
    step = _step_behind(s, p, size, block)
    if step is None:
        return r, None
    s.folded.add(id(step))
    return r, s.value_regs(step)[0]


def _step_behind(s: SelectionContext, p: Value, size: int, block: Instr) -> Instr | None:
    """The addition p + size of this block whose register is read only after `block`; None if there is none."""
    _, at = s.position[id(block)]
    for step in s.users.get(id(p), ()):
        k = step.args[1] if step.op == "add" and step.args[0] is p else None
        if not isinstance(k, ConstInt) or k.signed != size or not s.same_block(step):
            continue
        if s.position[id(step)][1] > at or id(step) not in s.register_values or id(step) in s.folded:
            continue
        if all(u.op == "phi" or not s.same_block(u) or s.position[id(u)][1] > at for u in s.users[id(step)]):
            return step
    return None


def _modes(count: int, behind: int | None) -> list[AddressingMode]:
    """Addressing modes of `count` accesses; the last one advances the pointer only if the end address is used."""
    modes: list[AddressingMode] = ["++"] * count
    if behind is None:
        modes[-1] = "ind"
    return modes


def select_blockcopy(s: SelectionContext, i: Instr) -> None:
    """Select MOV [Ws++],[Wd++], under REPEAT for more than a few units (isa.md §15)."""
    count, unit = i.extra["count"], i.extra["unit"]
    (dest, dest_end), (source, source_end) = (_pointer(s, p, count * unit, i) for p in i.args[:2])
    byte = unit == 1
    if count <= MAX_UNROLLED_UNITS:
        for source_mode, dest_mode in zip(_modes(count, source_end), _modes(count, dest_end), strict=True):
            s.emit("mov", Mem(source_mode, source), Mem(dest_mode, dest), byte=byte)
    else:
        s.emit("repmov", Imm(count - 1), source, dest, byte=byte)
    for r, end in ((dest, dest_end), (source, source_end)):
        if end is not None:
            s.copy(r, end)


def select_blockfill(s: SelectionContext, i: Instr) -> None:
    """Select CLR [Wd++] or MOV Ws,[Wd++], under REPEAT for more than a few units."""
    count, unit = i.extra["count"], i.extra["unit"]
    value, byte = i.args[1], unit == 1
    zero = isinstance(value, ConstInt) and value.value == 0
    source = None if zero else s.reg(value)
    dest, end = _pointer(s, i.args[0], count * unit, i)
    if count <= MAX_UNROLLED_UNITS:
        for mode in _modes(count, end):
            if source is None:
                s.emit("clr", Mem(mode, dest), byte=byte)
            else:
                s.emit("mov", source, Mem(mode, dest), byte=byte)
    elif source is None:
        s.emit("repclr", Imm(count - 1), dest, byte=byte)
    else:
        s.emit("repfill", Imm(count - 1), dest, source, byte=byte)
    if end is not None:
        s.copy(dest, end)


HANDLERS: dict[str, Handler] = {
    "blockcopy": select_blockcopy,
    "blockfill": select_blockfill,
}
