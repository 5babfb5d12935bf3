"""Legalisation of integers above 128 bits, which the front end uses for long runs of bit-fields.

A wide integer is a list of 16-bit words, the lowest first. Bits above the width of the type are 0 in the last word.
"""

from __future__ import annotations

from toolchain.ir.build import IrBuilder, const, legal_type
from toolchain.ir.model import I8, I16, I32, ConstInt, Instr, Type, UnsupportedError, Value, store_size
from toolchain.legalize import packing
from toolchain.legalize.context import LegalResult
from toolchain.legalize.memory import MemoryLegalizer

WORD = 16
OWN_HANDLER = frozenset(("select", "freeze", "phi", "call", "ret"))


def is_wide(i: Instr) -> bool:
    """Whether an instruction computes with wide integers and is translated here."""
    return i.op not in OWN_HANDLER and (i.type.kind == "wide" or any(a.type.kind == "wide" for a in i.args))


def translate(lz: MemoryLegalizer, i: Instr) -> LegalResult:
    """Translate one instruction. Raise UnsupportedError for multiplication, division and shifts by variables."""
    b = lz.b
    match i.op:
        case "load":
            return _load(lz, i)
        case "store":
            _store(lz, i)
            return None
        case "and" | "or" | "xor":
            pairs = zip(lz.legal_leaves(i.args[0]), lz.legal_leaves(i.args[1]), strict=True)
            return [b.binary(i.op, x, y) for x, y in pairs]
        case "add" | "sub":
            return _sum(b, i.op, lz.legal_leaves(i.args[0]), lz.legal_leaves(i.args[1]), i.type)
        case "shl" | "lshr" | "ashr" if isinstance(i.args[1], ConstInt):
            return _shift(b, i.op, lz.legal_leaves(i.args[0]), i.args[1].value, i.type)
        case "zext" | "sext":
            return _extend(lz, i)
        case "trunc" if i.type.kind == "wide":
            return _clean(b, lz.legal_leaves(i.args[0])[: word_count(i.type)], i.type)
        case "trunc":
            return _low(lz, lz.legal_leaves(i.args[0]), i.type)
        case "icmp" if i.pred in ("eq", "ne"):
            pairs = zip(lz.legal_leaves(i.args[0]), lz.legal_leaves(i.args[1]), strict=True)
            differ: Value = const(I16, 0)
            for x, y in pairs:
                differ = b.binary("or", b.binary("xor", x, y), differ)
            return b.icmp(i.pred, differ, const(I16, 0))
    raise UnsupportedError(f"'{i.op}' of {i.args[0].type}")


def word_count(t: Type) -> int:
    """Number of words of a wide type."""
    return (t.bits + WORD - 1) // WORD


def _clean(b: IrBuilder, words: list[Value], t: Type) -> list[Value]:
    """The words with the bits above the width of `t` cleared."""
    spare = -t.bits % WORD
    return [*words[:-1], b.binary("and", words[-1], const(I16, 0xFFFF >> spare))] if spare else words


def _load(lz: MemoryLegalizer, i: Instr) -> list[Value]:
    """Build the loads of all words; the last one may be a byte."""
    p, align, size = lz.legal(i.args[0]), i.extra.get("align", 2), store_size(i.type)
    out: list[Value] = []
    for at in range(0, size, 2):
        q = lz.b.add(p, at)
        out.append(lz.load_bits(I16, min(2, size - at), q, lz.even(q, align), i.volatile))
    return out


def _store(lz: MemoryLegalizer, i: Instr) -> None:
    """Build the stores of all words; the last one may be a byte."""
    p, align, size = lz.legal(i.args[1]), i.extra.get("align", 2), store_size(i.args[0].type)
    for at, word in zip(range(0, size, 2), lz.legal_leaves(i.args[0]), strict=True):
        q = lz.b.add(p, at)
        lz.store_bits(word, min(2, size - at), q, lz.even(q, align), i.volatile)


def _sum(b: IrBuilder, op: str, x: list[Value], y: list[Value], t: Type) -> list[Value]:
    """Build a sum or difference; bit 16 of each partial result is the carry or borrow."""
    out: list[Value] = []
    carry: Value = const(I32, 0)
    for one, other in zip(x, y, strict=True):
        whole = b.binary(op, b.cast("zext", one, I32), b.cast("zext", other, I32))
        whole = b.binary(op, whole, carry)
        out.append(b.cast("trunc", whole, I16))
        carry = b.binary("and", b.shift("lshr", whole, WORD), const(I32, 1))
    return _clean(b, out, t)


def _shift(b: IrBuilder, op: str, words: list[Value], by: int, t: Type) -> list[Value]:
    """Build a shift by a constant."""
    count, (whole, part) = len(words), divmod(by, WORD)
    fill: Value = const(I16, 0)
    if op == "ashr":
        spare = -t.bits % WORD
        top = b.shift("ashr", b.shift("shl", words[-1], spare), spare) if spare else words[-1]
        words, fill = [*words[:-1], top], b.shift("ashr", top, WORD - 1)

    def word(k: int) -> Value:
        return words[k] if 0 <= k < count else fill if k >= count else const(I16, 0)

    out: list[Value] = []
    for k in range(count):
        if op == "shl":
            high, low = word(k - whole), word(k - whole - 1)
            above, below = b.shift("shl", high, part), b.shift("lshr", low, WORD - part) if part else low
        else:
            high, low = word(k + whole + 1), word(k + whole)
            above, below = b.shift("shl", high, WORD - part) if part else high, b.shift("lshr", low, part)
        out.append(b.binary("or", above, below) if part else word(k - whole if op == "shl" else k + whole))
    return _clean(b, out, t) if op != "lshr" else out


def _extend(lz: MemoryLegalizer, i: Instr) -> list[Value]:
    """Build zext or sext to a wide type."""
    b, count, source = lz.b, word_count(i.type), i.args[0]
    if source.type.kind == "wide":
        if i.op == "sext":
            raise UnsupportedError(f"sext of {source.type}")
        return lz.legal_leaves(source) + [const(I16, 0)] * (count - word_count(source.type))
    value = lz.sign_extended(source) if i.op == "sext" else lz.zero_extended(source)
    if value.type.bits < WORD:
        value = b.cast(i.op, value, I16)
    words = [b.cast("trunc", b.shift("lshr", value, at), I16) for at in range(0, value.type.bits, WORD)]
    fill: Value = b.shift("ashr", words[-1], WORD - 1) if i.op == "sext" else const(I16, 0)
    return _clean(b, (words + [fill] * count)[:count], i.type)


def _low(lz: MemoryLegalizer, words: list[Value], t: Type) -> Value:
    """Build the low bits of a wide integer in a narrower type."""
    if t.bits == 1:
        return lz.to_bool(words[0])
    target = legal_type(t)
    if target is I8:
        return lz.b.cast("trunc", words[0], I8)
    return packing.concatenate(lz.b, words[: target.bits // WORD], WORD, target)
