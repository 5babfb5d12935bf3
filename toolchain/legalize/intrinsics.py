"""Legalisation of llvm.* intrinsics: one handler per family, in the table FAMILIES."""

from __future__ import annotations

from collections.abc import Callable

from emu.dspic30f.isa.debugger_words import PLAIN_TRAP
from toolchain.ir.build import const, legal_type
from toolchain.ir.model import I1, I8, I16, I32, VOID, ConstInt, GlobalRef, Instr, UnsupportedError, Value, int_type
from toolchain.legalize import mathlib, softfloat
from toolchain.legalize.context import LegalResult
from toolchain.legalize.memory import MemoryLegalizer

MAX_INLINE_UNITS = 0x4000  # greatest number of units of a REPEAT, whose count has 14 bits (isa.md §5.7)


def expand(lz: MemoryLegalizer, i: Instr, name: str) -> LegalResult:
    """Translate one intrinsic call. Raises UnsupportedError for intrinsics not in the table."""
    base = name[len("llvm.") :]
    for prefix, handler in FAMILIES:
        if base == prefix or base.startswith(prefix + "."):
            return handler(lz, i, base)
    return mathlib.expand(lz, i, base)


def _no_code(lz: MemoryLegalizer, i: Instr, name: str) -> LegalResult:
    """Build no code: hints such as lifetime, assume and prefetch."""
    return None


def _first_operand(lz: MemoryLegalizer, i: Instr, name: str) -> LegalResult:
    """Return the first operand as the result, for intrinsics that return it."""
    return lz.legal(i.args[0])


def _minmax(lz: MemoryLegalizer, i: Instr, name: str) -> LegalResult:
    signed = name[0] == "s"
    extend = lz.sign_extended if signed else lz.zero_extended
    a, b = extend(i.args[0]), extend(i.args[1])
    pred = ("s" if signed else "u") + ("lt" if name[1:4] == "min" else "gt")
    return lz.b.select(lz.b.icmp(pred, a, b), a, b)


def _compare3(lz: MemoryLegalizer, i: Instr, name: str) -> LegalResult:
    """Build scmp or ucmp, a three-way comparison with the value -1, 0 or 1."""
    signed = name[0] == "s"
    extend = lz.sign_extended if signed else lz.zero_extended
    a, b = extend(i.args[0]), extend(i.args[1])
    t, k = legal_type(i.type), "s" if signed else "u"
    more = lz.b.cast("zext", lz.b.icmp(k + "gt", a, b), t)
    less = lz.b.cast("zext", lz.b.icmp(k + "lt", a, b), t)
    return lz.b.binary("sub", more, less)


def _abs(lz: MemoryLegalizer, i: Instr, name: str) -> LegalResult:
    a = lz.sign_extended(i.args[0])
    zero = const(a.type, 0)
    return lz.b.select(lz.b.icmp("slt", a, zero), lz.b.binary("sub", zero, a), a)


def _overflow(lz: MemoryLegalizer, i: Instr, name: str) -> LegalResult:
    """Build {s,u}{add,sub,mul}.with.overflow: result and overflow flag."""
    signed, op, bits = name[0] == "s", name[1:4], i.args[0].type.bits
    extend = lz.sign_extended if signed else lz.zero_extended
    a, b = extend(i.args[0]), extend(i.args[1])
    return list(_checked(lz, op, signed, bits, a, b))


def _checked(lz: MemoryLegalizer, op: str, signed: bool, bits: int, a: Value, b: Value) -> tuple[Value, Value]:
    """Build result and overflow flag of an operation on values extended from `bits` bits."""
    t = a.type
    if op == "mul" or bits != t.bits:
        wide = legal_type(int_type(bits * 2 if op == "mul" else bits + 1))
        ext = "sext" if signed else "zext"
        wa, wb = lz.b.cast(ext, a, wide), lz.b.cast(ext, b, wide)
        exact = lz.multiply(wa, wb) if op == "mul" else lz.b.binary(op, wa, wb)
        result = lz.b.cast("trunc", exact, t)
        if bits == t.bits:
            again = lz.b.cast(ext, result, wide)
        else:
            pad = wide.bits - bits
            again = lz.b.shift("ashr" if signed else "lshr", lz.b.shift("shl", exact, pad), pad)
        return result, lz.b.icmp("ne", again, exact)
    result = lz.b.binary(op, a, b)
    if not signed:
        return result, lz.b.icmp("ult", result, a) if op == "add" else lz.b.icmp("ult", a, b)
    changed = lz.b.binary("xor", a, result)
    other = lz.b.binary("xor", b, result) if op == "add" else lz.b.binary("xor", a, b)
    both = lz.b.binary("and", changed, other)  # negative if the result has the wrong sign
    return result, lz.b.icmp("slt", both, const(t, 0))


def _saturating(lz: MemoryLegalizer, i: Instr, name: str) -> LegalResult:
    signed, op, bits = name[0] == "s", name[1:4], i.type.bits
    if op == "shl":
        raise UnsupportedError(f"intrinsic llvm.{name}")
    extend = lz.sign_extended if signed else lz.zero_extended
    a, b = extend(i.args[0]), extend(i.args[1])
    t = a.type
    result, over = _checked(lz, op, signed, bits, a, b)
    if not signed:
        return lz.b.select(over, const(t, (1 << bits) - 1 if op == "add" else 0), result)
    low, high = const(t, 1 << (bits - 1)), const(t, (1 << (bits - 1)) - 1)
    return lz.b.select(over, lz.b.select(lz.b.icmp("slt", a, const(t, 0)), low, high), result)


def _funnel(lz: MemoryLegalizer, i: Instr, name: str) -> LegalResult:
    """Build fshl or fshr: the double-width value a:b shifted by n modulo the width."""
    bits = i.type.bits
    a, b, n = lz.zero_extended(i.args[0]), lz.zero_extended(i.args[1]), lz.zero_extended(i.args[2])
    t = a.type
    left = name.startswith("fshl")
    if isinstance(n, ConstInt):
        k = n.value % bits
        if k == 0:
            return a if left else b
        k = k if left else bits - k
        return lz.b.binary("or", lz.b.shift("shl", a, k), lz.b.shift("lshr", b, bits - k))
    if bits & (bits - 1):
        raise UnsupportedError(f"rotation of a {bits}-bit value by a variable")
    n = lz.b.binary("and", n, const(t, bits - 1))
    rest = lz.b.binary("xor", n, const(t, bits - 1))  # bits-1-n
    if left:
        low = lz.b.binary("lshr", lz.b.shift("lshr", b, 1), rest)
        return lz.b.binary("or", lz.b.binary("shl", a, n), low)
    high = lz.b.binary("shl", lz.b.shift("shl", a, 1), rest)
    return lz.b.binary("or", high, lz.b.binary("lshr", b, n))


def _count_zeros(lz: MemoryLegalizer, i: Instr, name: str) -> LegalResult:
    """Build ctlz or cttz by words: FF1L and FF1R return positions from 1, and 0 for a zero word (isa.md §6.4)."""
    bits = i.type.bits
    leading = name.startswith("ctlz")
    v = lz.zero_extended(i.args[0])
    t = v.type
    if t.bits < 16:
        v = lz.b.cast("zext", v, I16)
    words = max(t.bits // 16, 1)
    result: Value = const(I16, bits)
    order = range(words) if leading else reversed(range(words))
    for k in order:
        word = lz.b.cast("trunc", lz.b.shift("lshr", v, 16 * k), I16) if words > 1 else v
        position = lz.b.emit("ff1l" if leading else "ff1r", I16, [word])
        before = bits - 16 * (k + 1) if leading else 16 * k
        count = lz.b.add(position, before - 1)
        result = lz.b.select(lz.b.icmp("eq", word, const(I16, 0)), result, count)
    return lz.b.cast("trunc" if t.bits < 16 else "zext", result, t)


def _popcount(lz: MemoryLegalizer, i: Instr, name: str) -> LegalResult:
    """Build ctpop: the sum of the counts of the words, each by a library function (abi-elf.md §2.8)."""
    v = lz.zero_extended(i.args[0])
    t = v.type
    if t.bits < 16:
        v = lz.b.cast("zext", v, I16)
    total: Value | None = None
    for k in range(max(t.bits // 16, 1)):
        word = lz.b.cast("trunc", lz.b.shift("lshr", v, 16 * k), I16) if t.bits > 16 else v
        count = lz.b.call("__popcounthi2", I16, [word])
        total = count if total is None else lz.b.binary("add", total, count)
    assert total is not None
    return lz.b.cast("trunc" if t.bits < 16 else "zext", total, t)


def _bswap(lz: MemoryLegalizer, i: Instr, name: str) -> LegalResult:
    v = lz.legal(i.args[0])
    t, words = v.type, i.type.bits // 16
    if i.type.bits % 16:
        raise UnsupportedError(f"byte swap of i{i.type.bits}")
    result: Value | None = None
    for k in range(words):
        word = lz.b.cast("trunc", lz.b.shift("lshr", v, 16 * k), I16)
        swapped = lz.b.cast("zext", lz.b.emit("swap", I16, [word]), t)
        placed = lz.b.shift("shl", swapped, 16 * (words - 1 - k))
        result = placed if result is None else lz.b.binary("or", result, placed)
    return result


def _bitreverse(lz: MemoryLegalizer, i: Instr, name: str) -> LegalResult:
    """Build bitreverse by swapping adjacent groups of 1, 2, 4, ... bits."""
    bits = i.type.bits
    if bits & (bits - 1):
        raise UnsupportedError(f"bit reversal of i{bits}")
    v: Value = lz.legal(i.args[0])
    t, step = v.type, 1
    while step < bits:
        mask = sum(((1 << step) - 1) << k for k in range(0, bits, 2 * step))
        low = lz.b.shift("shl", lz.b.binary("and", v, const(t, mask)), step)
        v = lz.b.binary("or", low, lz.b.binary("and", lz.b.shift("lshr", v, step), const(t, mask)))
        step *= 2
    return v


def _memory(lz: MemoryLegalizer, i: Instr, name: str) -> LegalResult:
    """Build memcpy, memmove, memset: block operations for constant sizes, library calls otherwise."""
    dst, src, size = (lz.legal(a) for a in i.args[:3])
    if size.type.bits != 16:
        size = lz.b.cast("trunc" if size.type.bits > 16 else "zext", size, I16)
    kind = name[:6]
    attrs = i.extra["attrs"]
    if isinstance(size, ConstInt) and size.value == 0:
        return None
    even = lz.even(dst, attrs[0].get("align", 1))
    if kind != "memset":
        even = even and lz.even(src, attrs[1].get("align", 1))
    unit = 2 if even and isinstance(size, ConstInt) and not size.value & 1 else 1
    inline = isinstance(size, ConstInt) and size.value // unit <= MAX_INLINE_UNITS
    if kind == "memset":
        value = lz.b.cast("trunc", src, I8)
        if inline and isinstance(size, ConstInt):
            _fill(lz, dst, value, size.value, unit)
        else:
            lz.b.call("memset", I16, [dst, lz.b.cast("zext", value, I16), size])
    elif inline and kind == "memcpy" and isinstance(size, ConstInt):
        lz.b.emit("blockcopy", VOID, [dst, src], count=size.value // unit, unit=unit)
    else:
        lz.b.call(kind if kind == "memcpy" else "memmove", I16, [dst, src, size])
    return None


def _fill(lz: MemoryLegalizer, dst: Value, value: Value, size: int, unit: int) -> None:
    if unit == 2:
        value = (
            const(I16, value.value * 0x101)
            if isinstance(value, ConstInt)
            else lz.b.binary("mul", lz.b.cast("zext", value, I16), const(I16, 0x101))
        )
    lz.b.emit("blockfill", VOID, [dst, value], count=size // unit, unit=unit)


def _va_start(lz: MemoryLegalizer, i: Instr, name: str) -> LegalResult:
    lz.b.store(lz.b.emit("vastart", I16, []), lz.legal(i.args[0]))
    return None


def _va_copy(lz: MemoryLegalizer, i: Instr, name: str) -> LegalResult:
    lz.b.store(lz.b.load(I16, lz.legal(i.args[1])), lz.legal(i.args[0]))
    return None


def _stacksave(lz: MemoryLegalizer, i: Instr, name: str) -> LegalResult:
    return lz.b.emit("getsp", I16, [])


def _stackrestore(lz: MemoryLegalizer, i: Instr, name: str) -> LegalResult:
    lz.b.emit("setsp", VOID, [lz.legal(i.args[0])])
    return None


def _entry_word(lz: MemoryLegalizer, i: Instr, name: str) -> LegalResult:
    """Build __builtin_return_address and __builtin_frame_address; 0 for outer functions, which GCC allows."""
    level = i.args[0]
    if not isinstance(level, ConstInt) or level.value:
        return const(I16, 0)
    return lz.b.emit("entryword", I16, [], address=name.startswith("frame"))


def _fmuladd(lz: MemoryLegalizer, i: Instr, name: str) -> LegalResult:
    """Build a multiplication and an addition, each of which rounds, as in XC16."""
    a, b, c = (lz.legal(x) for x in i.args[:3])
    mode = "sf" if a.type.bits == 32 else "df"
    return lz.b.call(f"__add{mode}3", a.type, [lz.b.call(f"__mul{mode}3", a.type, [a, b]), c])


def _fabs(lz: MemoryLegalizer, i: Instr, name: str) -> LegalResult:
    a = lz.legal(i.args[0])
    return lz.b.binary("and", a, const(a.type, (1 << (a.type.bits - 1)) - 1))


def _copysign(lz: MemoryLegalizer, i: Instr, name: str) -> LegalResult:
    a, s = lz.legal(i.args[0]), lz.legal(i.args[1])
    sign = 1 << (a.type.bits - 1)
    return lz.b.binary("or", lz.b.binary("and", a, const(a.type, sign - 1)), lz.b.binary("and", s, const(a.type, sign)))


def _round_to_int(lz: MemoryLegalizer, i: Instr, name: str) -> LegalResult:
    stem = name.split(".")[0]
    return lz.b.call(stem + ("f" if i.args[0].type.bits == 32 else ""), legal_type(i.type), [lz.legal(i.args[0])])


def _fpclass(lz: MemoryLegalizer, i: Instr, name: str) -> LegalResult:
    """Build llvm.is.fpclass: the classes of the mask (order of LangRef), tested on the bits of the value."""
    a, mask = lz.legal(i.args[0]), i.args[1]
    assert isinstance(mask, ConstInt)
    t, bits = a.type, a.type.bits
    fraction = 23 if bits == 32 else 52
    sign, infinity = 1 << (bits - 1), ((1 << (bits - 1 - fraction)) - 1) << fraction
    magnitude = lz.b.binary("and", a, const(t, sign - 1))
    negative = lz.b.icmp("slt", a, const(t, 0))
    above = lz.b.icmp("ugt", magnitude, const(t, infinity))
    quiet = lz.b.icmp("uge", magnitude, const(t, infinity | 1 << (fraction - 1)))
    zero = lz.b.icmp("eq", magnitude, const(t, 0))
    infinite = lz.b.icmp("eq", magnitude, const(t, infinity))
    finite = lz.b.icmp("ult", magnitude, const(t, infinity))
    normal = lz.b.binary("and", finite, lz.b.icmp("uge", magnitude, const(t, 1 << fraction)))
    subnormal = lz.b.binary("and", lz.b.icmp("ult", magnitude, const(t, 1 << fraction)), lz.b.logical_not(zero))
    by_bit: list[tuple[Value, bool | None]] = [
        (lz.b.binary("and", above, lz.b.logical_not(quiet)), None), (quiet, None), (infinite, True), (normal, True),
        (subnormal, True), (zero, True), (zero, False), (subnormal, False), (normal, False), (infinite, False),
    ]  # fmt: skip
    result: Value = const(I1, 0)
    for k, (kind, wants_negative) in enumerate(by_bit):
        if mask.value >> k & 1:
            if wants_negative is not None:
                kind = lz.b.binary("and", kind, negative if wants_negative else lz.b.logical_not(negative))
            result = lz.b.binary("or", result, kind)
    return result


def _fptoint_sat(lz: MemoryLegalizer, i: Instr, name: str) -> LegalResult:
    """Build a saturating conversion; the library saturates 32 and 64 bits (abi-elf.md §2.8), others are clamped."""
    signed = name.startswith("fptosi")
    bits = i.type.bits
    wide = int_type(64 if bits > 32 else 32)
    v = softfloat.to_int(lz.b, lz.legal(i.args[0]), signed, wide)
    if bits < wide.bits:
        low, high = (-(1 << (bits - 1)), (1 << (bits - 1)) - 1) if signed else (0, (1 << bits) - 1)
        k = "s" if signed else "u"
        v = lz.b.select(lz.b.icmp(k + "gt", v, const(wide, high)), const(wide, high), v)
        if signed:
            v = lz.b.select(lz.b.icmp("slt", v, const(wide, low)), const(wide, low), v)
    return lz.b.cast("trunc", v, legal_type(i.type))


def _trap(lz: MemoryLegalizer, i: Instr, name: str) -> LegalResult:
    """Build a software breakpoint followed by a reset, as in the default interrupt handler (abi-elf.md §3.3).

    The number of the failed check follows as data for the debugger.
    """
    if name == "debugtrap":
        lz.b.emit("builtin", VOID, [], name="__builtin_software_breakpoint")
        return None
    check = i.args[0] if name == "ubsantrap" else const(I16, PLAIN_TRAP)
    assert isinstance(check, ConstInt)
    lz.b.emit("builtin", VOID, [const(I16, check.value & 0xFF)], name="__builtin_failed_check")
    return None


def _object_size(lz: MemoryLegalizer, i: Instr, name: str) -> LegalResult:
    flag = i.args[1]
    assert isinstance(flag, ConstInt)
    return const(legal_type(i.type), 0 if flag.value else -1)


def _constant_p(lz: MemoryLegalizer, i: Instr, name: str) -> LegalResult:
    return const(I1, isinstance(i.args[0], ConstInt | GlobalRef))


def _powi(lz: MemoryLegalizer, i: Instr, name: str) -> LegalResult:
    suffix = "f" if i.type.bits == 32 else ""
    mode = "sf" if i.type.bits == 32 else "df"
    n = lz.b.cast("sext", lz.sign_extended(i.args[1]), I32)
    exponent = lz.b.call(f"__floatsi{mode}", legal_type(i.type), [n])
    return lz.b.call("pow" + suffix, legal_type(i.type), [lz.legal(i.args[0]), exponent])


FAMILIES: list[tuple[str, Callable[[MemoryLegalizer, Instr, str], LegalResult]]] = [
    *((n, _no_code) for n in ("lifetime.start", "lifetime.end", "assume", "prefetch", "donothing", "va_end",
      "invariant", "clear_cache",
                              "sideeffect", "experimental.noalias.scope.decl", "pseudoprobe", "fake.use")),
    *((n, _first_operand) for n in ("expect", "annotation", "ptr.annotation", "launder.invariant.group", "ssa.copy",
                            "strip.invariant.group", "threadlocal.address", "preserve.array.access.index",
                            "preserve.struct.access.index", "arithmetic.fence", "canonicalize")),
    *((n, _minmax) for n in ("smin", "smax", "umin", "umax")),
    ("scmp", _compare3),
    ("ucmp", _compare3),
    ("abs", _abs),
    *((k + op + ".with.overflow", _overflow) for k in "su" for op in ("add", "sub", "mul")),
    *((k + op + ".sat", _saturating) for k in "su" for op in ("add", "sub")),
    ("fshl", _funnel),
    ("fshr", _funnel),
    ("ctlz", _count_zeros),
    ("cttz", _count_zeros),
    ("ctpop", _popcount),
    ("bswap", _bswap),
    ("bitreverse", _bitreverse),
    *((n, _memory) for n in ("memcpy", "memcpy.inline", "memmove", "memset", "memset.inline")),
    ("va_start", _va_start),
    ("va_copy", _va_copy),
    ("stacksave", _stacksave),
    ("stackrestore", _stackrestore),
    ("frameaddress", _entry_word),
    ("returnaddress", _entry_word),
    ("fmuladd", _fmuladd),
    ("fabs", _fabs),
    ("copysign", _copysign),
    *((n, _round_to_int) for n in ("lrint", "llrint", "lround", "llround")),
    ("is.fpclass", _fpclass),
    ("fptosi.sat", _fptoint_sat),
    ("fptoui.sat", _fptoint_sat),
    *((n, _trap) for n in ("trap", "debugtrap", "ubsantrap")),
    ("objectsize", _object_size),
    ("is.constant", _constant_p),
    ("powi", _powi),
]  # fmt: skip
