"""Scalar replacement of struct parameters: no copy in memory for structs in registers that are only read.

In the IR of the front end, a struct passed by value is a pointer to a copy. If registers hold the struct (abi-elf.md
§2.2) and the function only loads from the copy, this pass replaces every load by the register of its word (`argword`).
Needs: legal IR.
"""

from __future__ import annotations

from toolchain.ir.build import IrBuilder
from toolchain.ir.model import I8, I16, Arg, ConstInt, Function, Instr, Value, int_type
from toolchain.select.calls import is_struct, parameter_locations


def run(f: Function) -> None:
    """Replace the loads of every struct parameter that is in registers and only read."""
    for a, location in zip(f.args, parameter_locations(f), strict=True):
        if is_struct(a) and location.register is not None:
            loads = _loads(f, a, location.words)
            if loads:
                _read_words(f, a, loads)


def _loads(f: Function, a: Arg, words: int) -> list[tuple[Instr, int]] | None:
    """Loads from the copy with their byte offsets; None if its address has other uses or a load is of another size."""
    offsets: dict[int, int] = {id(a): 0}
    found: list[tuple[Instr, int]] = []
    pending: list[Value] = [a]
    users: dict[int, list[Instr]] = {}
    for i in (i for b in f.blocks for i in b.instrs):
        for v in i.args:
            users.setdefault(id(v), []).append(i)
    while pending:
        p = pending.pop()
        for i in users.get(id(p), ()):
            k = i.args[1] if i.op == "add" and i.args[0] is p else None
            if isinstance(k, ConstInt):
                offsets[id(i)] = offsets[id(p)] + k.signed
                pending.append(i)
            elif i.op == "load" and not i.volatile and _inside(offsets[id(p)], i.type.bits, words):
                found.append((i, offsets[id(p)]))
            else:
                return None
    return found


def _inside(at: int, bits: int, words: int) -> bool:
    """Whether a load reads one byte or whole words of the copy."""
    return at >= 0 and at + bits // 8 <= 2 * words and (bits == 8 or (at % 2 == 0 and bits in (16, 32, 64)))


def _read_words(f: Function, a: Arg, loads: list[tuple[Instr, int]]) -> None:
    """Add the words to the entry block, and replace the loads by combinations of words."""
    words: dict[int, Instr] = {}
    for load, at in loads:
        for k in range(at // 2, (at + load.type.bits // 8 + 1) // 2):
            if k not in words:
                words[k] = Instr("argword", I16, [])
                words[k].extra = {"argument": a, "word": k}
    offset_of = {id(load): at for load, at in loads}
    values: dict[int, Value] = {}
    for b in f.blocks:
        old, b.instrs = b.instrs, []
        build = IrBuilder(b)
        for i in old:
            if id(i) in offset_of:
                build.line = i.line
                values[id(i)] = _value(build, words, offset_of[id(i)], i.type.bits)
            else:
                b.instrs.append(i)
    for b in f.blocks:
        for i in b.instrs:
            i.args = [values.get(id(v), v) for v in i.args]
    for record in f.dbg_records:
        if record.kind == "dbg_value" and id(record.value) in values:
            record.value = values[id(record.value)]
        elif record.kind == "parameter" and record.value is a:
            record.words = tuple(words.get(k) for k in range(max(words) + 1))
    f.blocks[0].instrs[:0] = words.values()


def _value(b: IrBuilder, words: dict[int, Instr], at: int, bits: int) -> Value:
    """Build the value that a load of `bits` bits at byte offset `at` reads."""
    if bits == 8:
        return b.cast("trunc", b.shift("lshr", words[at // 2], 8) if at % 2 else words[at // 2], I8)
    t = int_type(bits)
    total = b.cast("zext", words[at // 2], t)
    for k in range(1, bits // 16):
        total = b.binary("or", total, b.shift("shl", b.cast("zext", words[at // 2 + k], t), 16 * k))
    return total
