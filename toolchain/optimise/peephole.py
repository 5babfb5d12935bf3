"""Peephole optimisation: local rewrites over real registers.

Each rewrite examines neighbouring instructions of one block and the registers and flags that are live after them.
Needs: frames built. No rewrite adds an instruction.
"""

from __future__ import annotations

from toolchain.abi.target import CALLEE_SAVED, FP, LIT10_BYTE_MAX, LIT10_MAX, SP
from toolchain.mir.function import MBlock, MFunction
from toolchain.mir.instruction import MI
from toolchain.mir.liveness import live_out, mask_of, remove_dead_in_block
from toolchain.mir.operands import AddressingMode, Imm, Mem
from toolchain.mir.operations import SKIPS
from toolchain.optimise import copies

AT_RETURN = mask_of([*CALLEE_SAVED, 15])
ALL = 0xFFFF
# Operations with one result that set N and Z by the word or byte that they write.
SETS_NZ = {"add", "sub", "subr", "addc", "subb", "and", "ior", "xor", "addl", "subl", "andl", "iorl", "xorl",
           "inc", "dec",
           "inc2", "dec2", "neg", "com", "sl", "lsr", "asr", "sl1", "lsr1", "asr1", "se", "ze", "rlc",
           "rrc"}  # fmt: skip
STICKY_Z = {"addc", "subb", "subbr", "cpb"}


def run(m: MFunction) -> None:
    """Apply all rewrites until nothing changes, at most four times."""
    at_return = ALL if m.interrupt else AT_RETURN
    for _ in range(4):
        changed = copies.run(m)
        out = live_out(m, at_return)
        for b in m.blocks:
            changed |= local(b, out[b.name])
        if not changed:
            break
    for b in m.blocks:
        clear_pairs(b)


def clear_pairs(b: MBlock) -> None:
    """Merge CLR of both registers of a pair into one instruction."""
    k = 0
    while k + 1 < len(b.insts):
        one, two = b.insts[k : k + 2]
        if one.op == two.op == "clr" and not (one.byte or two.byte or one.pred or two.pred):
            r, q = one.args[0], two.args[0]
            if isinstance(r, int) and isinstance(q, int) and r ^ q == 1 and min(r, q) < FP:
                pair = MI("clrd", min(r, q), line=one.line)
                pair.claims = two.claims
                pair.written_values = one.written_values | two.written_values
                pair.values_before = one.values_before | two.values_before
                b.insts[k : k + 2] = [pair]
        k += 1


def local(b: MBlock, live: int) -> bool:
    """Apply every rewrite once to one block; `live` are the registers live at its end. Return whether it changed."""
    before = len(b.insts)
    touched = remove_dead_in_block(b, live)
    touched |= drop_compares(b)
    touched |= compare_while_copying(b)
    touched |= compare_in_place(b, live)
    touched |= auto_increment(b)
    touched |= merge_pairs(b)
    return touched or len(b.insts) != before


def flags_read_after(b: MBlock, at: int) -> set[str] | None:
    """Conditions that read the flags written by instruction `at`; None if another kind of instruction reads them."""
    found: set[str] = set()
    for mi in b.insts[at + 1 :]:
        if mi.op in ("bra", "skip"):
            found.add(mi.cc)
        elif mi.info.reads or mi.op in ("asm", "text"):
            return None
        if mi.flags_written() and not mi.pred:
            return found
        if mi.pred and mi.flags_written():
            return None
    return found


def drop_compares(b: MBlock) -> bool:
    """Remove repeated comparisons, and each CP0 of a register whose last write set the same Z and N."""
    changed = False
    k = 0
    while k < len(b.insts):
        mi = b.insts[k]
        if mi.op == "cp" and _repeated(b, k):
            del b.insts[k]
            changed = True
            continue
        if mi.op == "cp0" and isinstance(mi.args[0], int):
            r = mi.args[0]
            writer = _flag_source(b, k, r, mi.byte)
            readers = flags_read_after(b, k)
            enough = {"n", "nn"} if writer is not None and writer.op in STICKY_Z else {"z", "nz", "n", "nn"}
            if writer is not None and readers is not None and readers <= enough:
                del b.insts[k]
                changed = True
                continue
        k += 1
    return changed


def _repeated(b: MBlock, at: int) -> bool:
    """Whether an earlier comparison of the same operands has left the same flags."""
    mi = b.insts[at]
    if not all(isinstance(a, int | Imm) for a in mi.args):
        return False
    operands = {a for a in mi.args if isinstance(a, int)}
    for k in range(at - 1, -1, -1):
        before = b.insts[k]
        if before.op == "cp" and before.args == mi.args and before.byte == mi.byte and not before.pred:
            return True
        if before.flags_written() or operands & set(before.defs()) or before.op in ("call", "callr", "asm", "text"):
            return False
    return False


def compare_while_copying(b: MBlock) -> bool:
    """Replace MOV Wa,Wb next to CP0 of either register by SUB Wa,#0,Wb, which sets the same flags (isa.md §6.2)."""
    k, before = 0, len(b.insts)
    while k + 1 < len(b.insts):
        one, two = b.insts[k : k + 2]
        copy, test = (one, two) if two.op == "cp0" else (two, one)
        k += 1
        if test.op != "cp0" or test.byte or test.pred or copy.pred or not copy.is_copy():
            continue
        source, dest = copy.args
        tested = test.args[0] == source or (test.args[0] == dest and copy is one)
        if tested and isinstance(source, int) and isinstance(dest, int) and max(source, dest) < SP:
            new = MI("sub", source, Imm(0), dest, line=copy.line)
            new.claims = one.claims
            b.insts[k - 1 : k + 1] = [new]
    return len(b.insts) != before


def compare_in_place(b: MBlock, live: int) -> bool:
    """Replace MOV #k,Wt; CP Wn,Wt by SUB #k,Wn, which sets the same flags, if both registers are dead afterwards."""
    changed = False
    for k in range(len(b.insts) - 1, 0, -1):
        mi, load = b.insts[k], b.insts[k - 1]
        if mi.op == "cp" and load.op == "mov" and isinstance(load.args[0], Imm) and not mi.pred and not load.pred:
            n, t = mi.args
            value = load.args[0].value
            fits = isinstance(value, int) and value <= (LIT10_BYTE_MAX if mi.byte else LIT10_MAX)
            if isinstance(n, int) and load.args[1] == t and n != t and fits and not live >> n & 1:
                assert isinstance(t, int)
                if not live >> t & 1:
                    new = MI("subl", Imm(value), n, byte=mi.byte, line=mi.line)
                    b.insts[k - 1 : k + 1] = [new]
                    changed = True
                    return changed
        used, written = mi.register_sets()
        live = live & ~written | used
    return changed


def _flag_source(b: MBlock, at: int, r: int, byte: bool) -> MI | None:
    """The instruction before `at` that wrote register r and set the flags; None if either changed since."""
    for k in range(at - 1, -1, -1):
        mi = b.insts[k]
        if mi.pred or mi.op in SKIPS:
            return None
        if mi.flags_written():
            dest = mi.args[-1] if mi.args else None
            if mi.op in SETS_NZ and dest == r and (mi.byte == byte or _fits_a_byte(mi)):
                return mi
            return None
        if r in mi.defs() or mi.op in ("call", "callr", "asm", "text"):
            return None
    return None


def _fits_a_byte(mi: MI) -> bool:
    """Whether a word operation clears bits 7-15, so that the word and its low byte have the same Z and N."""
    masks = [a.value for a in mi.args if isinstance(a, Imm)] if mi.op in ("and", "andl") else []
    return any(isinstance(mask, int) and 0 <= mask <= 0x7F for mask in masks)


# ---------------------------------------------------------------------------------------------------------------------
# addressing


STEPS = {"inc": 1, "inc2": 2, "dec": -1, "dec2": -2}


def auto_increment(b: MBlock) -> bool:
    """Merge accesses through [Wn] with increments of Wn by the access size: to [Wn++], [Wn--], [++Wn] or [--Wn]."""
    changed = False
    k = 0
    while k < len(b.insts):
        step = b.insts[k]
        amount = _step_amount(step)
        if amount is not None and flags_unused(b, k):
            r = step.register(-1)
            if _fold_after(b, k, r, amount) or _fold_before(b, k, r, amount):
                del b.insts[k]
                changed = True
                continue
        k += 1
    return changed


def _step_amount(mi: MI) -> int | None:
    """Signed amount by which an instruction increments a register; None for any other instruction."""
    if mi.pred or mi.byte:
        return None
    if mi.op in STEPS and isinstance(mi.args[0], int) and mi.args[0] == mi.args[1]:
        return STEPS[mi.op]
    if mi.op in ("add", "sub") and isinstance(mi.args[0], int) and mi.args[0] == mi.args[2] and mi.args[1] == Imm(4):
        return 4 if mi.op == "add" else -4  # the access is a MOV.D
    return None


def flags_unused(b: MBlock, at: int) -> bool:
    """Whether no instruction reads the flags that instruction `at` sets. Flags are never live across blocks."""
    readers = flags_read_after(b, at)
    return readers is not None and not readers


def _fold_after(b: MBlock, at: int, r: int, amount: int) -> bool:
    """Try to merge the increment of r at index `at` with the last access through [r] before it; return success."""
    for k in range(at - 1, -1, -1):
        mi = b.insts[k]
        if r in mi.uses() or r in mi.defs():
            return _modify(mi, r, amount, "++" if amount > 0 else "--")
        if mi.info.fixed and mi.op not in SKIPS:
            return False
    return False


def _fold_before(b: MBlock, at: int, r: int, amount: int) -> bool:
    """Try to merge the increment of r at index `at` with the first access through [r] after it; return success."""
    for k in range(at + 1, len(b.insts)):
        mi = b.insts[k]
        if r in mi.uses() or r in mi.defs():
            return _modify(mi, r, amount, "+" if amount > 0 else "-")
        if mi.info.fixed and mi.op not in SKIPS:
            return False
    return False


def _modify(mi: MI, r: int, amount: int, mode: AddressingMode) -> bool:
    """Make an instruction's only operand [r] modify r, if the instruction has no other use of r (isa.md §3.4)."""
    size = 1 if mi.byte or mi.op in ("se", "ze") else 4 if mi.op == "movd" else 2
    if abs(amount) != size or mi.pred or mi.info.fixed or mi.info.memory:
        return False
    places = [k for k, a in enumerate(mi.args) if isinstance(a, Mem) and a.mode == "ind" and a.base == r]
    mentions = sum(
        1 for a in mi.args if a == r or (isinstance(a, Mem) and (a.base == r or (a.mode == "idx" and a.off == r)))
    )
    if len(places) != 1 or mentions != 1 or r in mi.also_uses or r in mi.also_defs or mi.op in ("bset", "bclr", "btg"):
        return False
    mi.args[places[0]] = Mem(mode, r, volatile=mi.volatile)
    return True


def merge_pairs(b: MBlock) -> bool:
    """Merge two moves of adjacent words and registers into MOV.D (isa.md §5.5). Return whether any were merged."""
    changed = False
    k = 0
    while k + 1 < len(b.insts):
        merged = _merged(b.insts[k], b.insts[k + 1])
        if merged is not None:
            b.insts[k : k + 2] = [merged]
            changed = True
        k += 1
    return changed


def _merged(first: MI, second: MI) -> MI | None:
    """The MOV.D with the effect of two moves; None if MOV.D cannot express them."""
    if first.op != "mov" or second.op != "mov" or first.byte or second.byte or first.pred or second.pred:
        return None
    a, b = first.args
    c, d = second.args
    if isinstance(a, int) and isinstance(b, int) and isinstance(c, int) and isinstance(d, int):
        if a > c:
            a, b, c, d = c, d, a, b
        if a % 2 == 0 and b % 2 == 0 and c == a + 1 and d == b + 1 and a < 14 and b < 14:
            return MI("movd", a, b, line=first.line)
        return None
    if isinstance(b, int) and isinstance(d, int) and isinstance(a, Mem) and isinstance(c, Mem):
        if b == c.base:  # the first load must not change the address of the second
            return None
        low = _pair_of(a, b, c, d)
        return MI("movd", a if low == b else c, low, line=first.line) if low is not None else None
    if isinstance(a, int) and isinstance(c, int) and isinstance(b, Mem) and isinstance(d, Mem):
        low = _pair_of(b, a, d, c)
        return MI("movd", low, b if low == a else d, line=first.line) if low is not None else None
    return None


def _pair_of(x: Mem, r: int, y: Mem, q: int) -> int | None:
    """Low register of the pair (r, q), in either order, if one MOV.D can move it to or from the addresses x and y.

    MOV.D accesses the low word first. Volatile words must belong to one access and keep their order."""
    if x.base != y.base or x.volatile != y.volatile:
        return None
    if _offset(x) == 0 and _offset(y) == 2:
        low, high = r, q
    elif _offset(x) == 2 and _offset(y) == 0 and not x.volatile:
        low, high = q, r
    else:
        return None
    return low if low % 2 == 0 and high == low + 1 and low < 14 else None


def _offset(a: Mem) -> int | None:
    return 0 if a.mode == "ind" else a.off if a.mode == "off" else None
