"""Selection of loads, stores and read-modify-write forms."""

from __future__ import annotations

from toolchain.ir.model import ConstInt, Instr, Value
from toolchain.mir.operands import FileRegister, FrameSlot, Imm, Mem, Operand
from toolchain.select.context import Handler, SelectionContext
from toolchain.select.rules import COMMUTES, FILE_BINARY, FILE_CARRY, FILE_UNARY, REGISTER_OP, immediate_rule
from toolchain.select.state import words_of


def move_in(s: SelectionContext, source: Operand, d: int, byte: bool) -> None:
    """Load d from memory. Near bytes are moved through W0 (isa.md §3.3)."""
    if byte and isinstance(source, FileRegister):
        s.emit("mov", source, 0, byte=True)
        s.emit("mov", 0, d)
    else:
        s.emit("mov", source, d, byte=byte)


def move_out(s: SelectionContext, r: int, dest: Operand, byte: bool) -> None:
    """Store r to memory. Near bytes are moved through W0 (isa.md §3.3)."""
    if byte and isinstance(dest, FileRegister):
        s.emit("mov", r, 0)
        s.emit("mov", 0, dest, byte=True)
    else:
        s.emit("mov", r, dest, byte=byte)


def select_load(s: SelectionContext, i: Instr) -> None:
    """Select one MOV per word, low word first. A volatile load without users still reads."""
    d = s.value_regs(i)
    p, byte, number = i.args[0], i.type.bits == 8, s.access_number(i)
    if len(d) == 1:
        move_in(s, s.address(p, byte, volatile=number), d[0], byte)
        return
    for operand, r in zip(_run(s, p, len(d), number), d, strict=True):
        s.emit("mov", operand, r)


def select_loadpair(s: SelectionContext, i: Instr) -> None:
    """Select a load of two words by MOV.D, which is atomic."""
    low, high = s.value_regs(i)
    pair = s.m.new_pair()
    s.emit("movd", Mem("ind", s.reg(i.args[0]), 0, s.access_number(i)), pair)
    s.emit("split", low, high, pair)


def select_storepair(s: SelectionContext, i: Instr) -> None:
    """Select a store of two words by MOV.D, which is atomic."""
    low, high = s.regs(i.args[0])
    pair = s.m.new_pair()
    s.emit("join", pair, low, high)
    s.emit("movd", pair, Mem("ind", s.reg(i.args[1]), 0, s.access_number(i)))


def _run(s: SelectionContext, p: Value, count: int, number: int) -> list[Operand]:
    """Operands of `count` consecutive words at p."""
    first = s.address(p, False, 0, count, number)
    if isinstance(first, Mem):
        start = first.off if first.mode == "off" else 0
        if first.mode in ("ind", "off") and start + 2 * count <= 1024:
            offsets = [start + 2 * k for k in range(count)]
            return [Mem("off" if at else "ind", first.base, at, number) for at in offsets]
        return [first, *(s.offset_operand(first.base, start + 2 * k, False, number) for k in range(1, count))]
    if isinstance(first, FrameSlot):
        return [FrameSlot(first.index, first.off + 2 * k, number) for k in range(count)]
    assert isinstance(first, FileRegister)
    return [first, *(s.address(p, False, 2 * k, count, number) for k in range(1, count))]


def select_store(s: SelectionContext, i: Instr) -> None:
    """Store by a read-modify-write form, else by CLR and SETM for constants, else by moves, low word first."""
    v, p = i.args
    if _store_modified(s, i):
        return
    byte, number = v.type.bits == 8, s.access_number(i)
    if words_of(v) == 1:
        _store_word(s, v, s.address(p, byte, volatile=number), byte)
        return
    operands = _run(s, p, words_of(v), number)
    registers = None if s.is_leaf(v) else s.regs(v)
    for k, operand in enumerate(operands):
        if isinstance(v, ConstInt):
            _store_constant(s, v.value >> 16 * k & 0xFFFF, operand, False)
        else:
            s.emit("mov", registers[k] if registers is not None else s.leaf_word(v, k), operand)


def _store_word(s: SelectionContext, v: Value, operand: Operand, byte: bool) -> None:
    if isinstance(v, ConstInt):
        _store_constant(s, v.value, operand, byte)
        return
    move_out(s, s.reg(v), operand, byte)


def _store_constant(s: SelectionContext, k: int, operand: Operand, byte: bool) -> None:
    """Store a constant word or byte, by CLR or SETM on memory if that form exists (isa.md §5.1)."""
    ones = 0xFF if byte else 0xFFFF
    if k in (0, ones):
        op = "clr" if k == 0 else "setm"
        if isinstance(operand, FileRegister) and operand.near:
            s.emit(op + "f", operand, byte=byte)
            return
        if isinstance(operand, Mem) and operand.mode == "ind":
            s.emit(op, operand, byte=byte)
            return
    t = s.temp()
    s.load_imm(k, t)
    move_out(s, t, operand, byte)


# ---------------------------------------------------------------------------------------------------------------------
# read-modify-write


def _store_modified(s: SelectionContext, i: Instr) -> bool:
    """Select store (load p op x), p as a read-modify-write form if the values have no other use."""
    op, p = i.args
    if isinstance(op, Instr) and op.type.bits > 16:
        return _modify_wide(s, i, op, p)
    if not isinstance(op, Instr) or op.type.bits not in (8, 16) or not s.single_use(op) or not s.same_block(op):
        return False
    if id(op) in s.needed or op.op not in ("add", "sub", "and", "or", "xor", "shl", "lshr", "ashr"):
        return False
    a, b = op.args
    load = _load_of(s, a, p, i)
    if load is None and op.op in COMMUTES:
        a, b = b, a
        load = _load_of(s, a, p, i)
    if load is None:
        return False
    byte = op.type.bits == 8
    if isinstance(b, ConstInt):
        return _modify_constant(s, op, b, load, p, byte)
    if op.op in FILE_BINARY:
        return _modify_register(s, op, b, load, p, byte)
    return False


def _load_of(s: SelectionContext, v: Value, p: Value, store: Instr) -> Instr | None:
    """The load `v` if it reads the address of the store and may be moved to the store; else None."""
    load = s.foldable_load(v, store)
    if load is None or load.volatile != store.volatile:
        return None
    same = s.decompose(load.args[0])
    other = s.decompose(p)
    if same[1] != other[1]:
        return None
    x, y = same[0], other[0]
    if x is y:
        return load
    if s.is_leaf(x) and s.is_leaf(y) and not isinstance(x, Instr) and repr(x) == repr(y):
        return load
    return None


def _target(s: SelectionContext, p: Value, byte: bool, load: Instr) -> FileRegister | Mem | None:
    """Operand of a read-modify-write form: near address or [Wn]; None if only MOV can access the address.

    A volatile operand has the number of the load."""
    number = s.access_number(load)
    base, offset = s.decompose(p)
    if id(base) in s.slots:
        return None
    if s.is_leaf(base):
        mark = len(s.out)
        operand = s.address(p, byte, volatile=number)
        if isinstance(operand, FileRegister) and operand.near:
            return operand
        del s.out[mark:]
        return None
    if offset == 0 and not (isinstance(base, Instr) and base.op == "add" and s.address_only(base)):
        return Mem("ind", s.reg(base), 0, number)
    return None


def _modify_constant(s: SelectionContext, op: Instr, b: ConstInt, load: Instr, p: Value, byte: bool) -> bool:
    """Select memory op= constant; return whether an instruction for it exists."""
    name, k, bits = op.op, b.value, op.type.bits
    if name == "sub":
        name, k = "add", -k & ((1 << bits) - 1)
    signed = k - (1 << bits) if k >> (bits - 1) else k
    unary = FILE_UNARY.get((name, signed))
    rule = immediate_rule(name, k, bits)
    bit = _single_bit(name, k, bits)
    if unary is None and bit is None and name not in FILE_BINARY:
        return False
    target = _target(s, p, byte, load)
    if target is None:
        return False
    if isinstance(target, FileRegister):
        s.folded.add(id(load))
        if unary is not None:
            s.emit(unary, target, byte=byte)
        elif bit is not None:
            s.emit(bit[0] + "f", target, Imm(bit[1]), byte=byte)
        else:
            s.load_imm(k, 0)
            s.emit(FILE_BINARY[name], target, 0, byte=byte)
        return True
    if bit is not None:
        s.emit(bit[0], target, Imm(bit[1]), byte=byte)
    elif unary is not None and rule is not None and rule.form == "unary":
        s.emit(rule.op, target, target, byte=byte)
    elif unary in ("slf", "lsrf", "asrf"):
        s.emit(unary[:-1] + "1", target, target, byte=byte)
    elif name in REGISTER_OP:
        t = s.temp()
        s.load_imm(k, t)
        s.emit(REGISTER_OP[name], t, target, target, byte=byte)
    else:
        return False
    s.folded.add(id(load))
    return True


def _single_bit(name: str, k: int, bits: int) -> tuple[str, int] | None:
    """("bset", "bclr" or "btg", bit number) of an operation that changes one bit; None for others."""
    inverse = ~k & ((1 << bits) - 1)
    if name == "and" and inverse and inverse & (inverse - 1) == 0:
        return "bclr", inverse.bit_length() - 1
    if name in ("or", "xor") and k and k & (k - 1) == 0:
        return ("bset" if name == "or" else "btg"), k.bit_length() - 1
    return None


def _modify_register(s: SelectionContext, op: Instr, b: Value, load: Instr, p: Value, byte: bool) -> bool:
    """Select memory op= register; return whether an instruction for it exists."""
    target = _target(s, p, byte, load)
    if target is None:
        return False
    value = s.reg(b)
    s.folded.add(id(load))
    if isinstance(target, FileRegister):
        s.copy(value, 0)
        s.emit(FILE_BINARY[op.op], target, 0, byte=byte)
    else:
        name = "subr" if op.op == "sub" else REGISTER_OP[op.op]
        s.emit(name, value, target, target, byte=byte)
    return True


def _modify_wide(s: SelectionContext, store: Instr, op: Instr, p: Value) -> bool:
    """Select the modification of several words in near memory through W0. CLR and MOV preserve the carry between them.

    Volatile objects are excluded: the source reads all their words before it writes the first."""
    if store.volatile or not s.single_use(op) or not s.same_block(op) or id(op) in s.needed or op.op not in FILE_BINARY:
        return False
    a, b = op.args
    load = _load_of(s, a, p, store)
    if load is None and op.op in COMMUTES:
        a, b = b, a
        load = _load_of(s, a, p, store)
    base = s.decompose(p)[0]
    if load is None or not s.is_leaf(base) or id(base) in s.slots:
        return False
    targets = [s.address(p, False, 2 * k, words_of(op)) for k in range(words_of(op))]
    if not all(isinstance(t, FileRegister) and t.near for t in targets):
        return False
    if isinstance(b, ConstInt):
        s.folded.add(id(load))
        _modify_words_constant(s, op.op, targets, b.value)
    elif s.is_leaf(b):
        return False
    else:
        s.folded.add(id(load))
        _modify_words_register(s, op.op, targets, s.regs(b))
    return True


def _modify_words_register(s: SelectionContext, op: str, targets: list[Operand], registers: tuple[int, ...]) -> None:
    """Emit (words in near memory) op= (words in registers)."""
    for k, (target, r) in enumerate(zip(targets, registers, strict=True)):
        s.copy(r, 0)
        s.emit(FILE_CARRY[op] if k else FILE_BINARY[op], target, 0)


def _modify_words_constant(s: SelectionContext, op: str, targets: list[Operand], value: int) -> None:
    """Emit (words in near memory) op= constant. Words that the operation leaves unchanged are skipped."""
    neutral = 0xFFFF if op == "and" else 0
    carry = False
    for k, target in enumerate(targets):
        word = value >> 16 * k & 0xFFFF
        if not carry and word == neutral:
            continue
        if not carry and op == "add" and word == 1:
            s.emit("incf", target)
        else:
            s.load_imm(word, 0)
            s.emit(FILE_CARRY[op] if carry else FILE_BINARY[op], target, 0)
        carry = op in ("add", "sub")


# ---------------------------------------------------------------------------------------------------------------------
# the stack pointer


def select_dynalloca(s: SelectionContext, i: Instr) -> None:
    """Allocate a block at W15 and increase W15 by the rounded size (abi-elf.md §2.4)."""
    s.m.dynamic_stack = True
    d, t, u = s.value_regs(i)[0], s.temp(), s.temp()
    s.emit("inc", s.reg(i.args[0]), t)
    s.copy(t, u)
    s.emit("bclr", u, Imm(0))
    s.emit("mov", 15, d)
    top = s.temp()
    s.emit("add", d, u, top)
    s.emit("setsp", top)


def select_getsp(s: SelectionContext, i: Instr) -> None:
    """Select llvm.stacksave."""
    s.m.dynamic_stack = True
    s.emit("mov", 15, s.value_regs(i)[0])


def select_setsp(s: SelectionContext, i: Instr) -> None:
    """Select llvm.stackrestore."""
    s.m.dynamic_stack = True
    s.emit("setsp", s.reg(i.args[0]))


def select_vastart(s: SelectionContext, i: Instr) -> None:
    """Select va_start: store the address of the last named argument (abi-elf.md §2.4)."""
    s.emit("lea", FrameSlot(s.variadic_anchor), s.value_regs(i)[0])


HANDLERS: dict[str, Handler] = {
    "load": select_load,
    "loadpair": select_loadpair,
    "storepair": select_storepair,
    "store": select_store,
    "dynalloca": select_dynalloca,
    "getsp": select_getsp,
    "setsp": select_setsp,
    "vastart": select_vastart,
}
