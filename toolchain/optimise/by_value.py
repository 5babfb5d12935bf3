"""Struct parameters in registers: words that are only read stay where they came.

The front end hands a struct passed by value over as a pointer to a copy. When that copy travels in registers
(abi-elf.md §2.2) and the function does nothing but load parts of it, every load becomes the word that holds it, and
the frame has no copy. Needs: legal IR. Ensures: what `argword` reads has no address.
"""

from __future__ import annotations

from toolchain.ir.build import Builder
from toolchain.ir.model import I8, I16, Arg, ConstInt, Function, Instr, Value, int_type
from toolchain.select.calls import is_struct, parameter_places


def run(f: Function) -> None:
    """Rewrite the loads of every struct parameter that allows it."""
    for a, place in zip(f.args, parameter_places(f), strict=True):
        if is_struct(a) and place.register is not None:
            loads = _loads(f, a, place.words)
            if loads:
                _read_words(f, a, loads)


def _loads(f: Function, a: Arg, words: int) -> list[tuple[Instr, int]] | None:
    """Loads from the copy with their byte offsets; None when its address goes elsewhere or a load is not of words."""
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
    """Whether a load takes one byte or whole words of the copy."""
    return at >= 0 and at + bits // 8 <= 2 * words and (bits == 8 or (at % 2 == 0 and bits in (16, 32, 64)))


def _read_words(f: Function, a: Arg, loads: list[tuple[Instr, int]]) -> None:
    """Put the words at the entry, their combinations where the loads were."""
    words: dict[int, Instr] = {}
    for load, at in loads:
        for k in range(at // 2, (at + load.type.bits // 8 + 1) // 2):
            if k not in words:
                words[k] = Instr("argword", I16, [])
                words[k].extra = {"argument": a, "word": k}
    gone = {id(load): at for load, at in loads}
    values: dict[int, Value] = {}
    for b in f.blocks:
        old, b.instrs = b.instrs, []
        build = Builder(b)
        for i in old:
            if id(i) in gone:
                build.line = i.line
                values[id(i)] = _value(build, words, gone[id(i)], i.type.bits)
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


def _value(b: Builder, words: dict[int, Instr], at: int, bits: int) -> Value:
    """What a load of `bits` at byte `at` of the copy reads."""
    if bits == 8:
        return b.cast("trunc", b.shift("lshr", words[at // 2], 8) if at % 2 else words[at // 2], I8)
    t = int_type(bits)
    total = b.cast("zext", words[at // 2], t)
    for k in range(1, bits // 16):
        total = b.binary("or", total, b.shift("shl", b.cast("zext", words[at // 2 + k], t), 16 * k))
    return total
