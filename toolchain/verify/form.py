"""Rules of form: ends of blocks, skips, and the registers and operands that an instruction may have."""

from __future__ import annotations

import itertools
from collections.abc import Collection

from toolchain.mir.function import MBlock, MFunction
from toolchain.mir.instruction import MI, covered_count
from toolchain.mir.operands import FIRST_VIRTUAL, FileRegister, Mem
from toolchain.mir.operations import SKIPS
from toolchain.verify.error import fail

TRANSFERS = {"bra", "jump", "jumpr", "brtable", "ret", "tailcall"}
BLOCK_ENDS = TRANSFERS - {"bra"}
TWO_WORDS = {"call", "tailcall", "jumpr", "repmov", "repclr", "repfill", "div.s", "div.u", "div.sd", "div.ud", "asm",
        "text", "shiftloop", "brtable", "lea", "begin_atomic"}  # fmt: skip


def check(m: MFunction, allocated: bool, known: Collection[str] = (), same_layout: bool = False) -> None:
    """Check all rules of form. Raises MachineError.

    `allocated`: registers are real. The instructions of the blocks in `known` have been checked before. `same_layout`:
    the next blocks and branch tables of those blocks are unchanged, too."""
    names = [b.name for b in m.blocks]
    if len(set(names)) != len(names):
        fail("two blocks have the same name", names[0])
    following = dict(itertools.pairwise(names))
    present = set(names)
    for b in m.blocks:
        if not (same_layout and b.name in known):
            _ends(b, present, following.get(b.name, ""), m)
        if b.name in known:
            continue
        for k, mi in enumerate(b.insts):
            if mi.op in SKIPS:
                _skip(b, k)
            elif mi.pred and not (k and (b.insts[k - 1].pred or b.insts[k - 1].op in SKIPS)):
                fail("conditional without a skip", b.name, mi)
            _registers(m, b, mi, allocated)


def _ends(b: MBlock, names: set[str], following: str, m: MFunction) -> None:
    targets: set[str] = set()
    for k, mi in enumerate(b.insts):
        if mi.op in ("bra", "jump"):
            targets.add(str(mi.args[0]))
        elif mi.op == "brtable":
            targets |= set(m.tables[int(str(mi.args[1]))][1])
        if mi.op in BLOCK_ENDS and k != len(b.insts) - 1:
            fail("code behind the end of a block", b.name, mi)
        if mi.op == "bra" and any(x.op not in TRANSFERS for x in b.insts[k + 1 :]):
            fail("code behind a branch", b.name, mi)
    if not targets <= names:
        fail(f"branch to a block that does not exist ({sorted(targets - names)})", b.name)
    falls = not b.insts or b.insts[-1].op not in BLOCK_ENDS
    if not targets <= set(b.succs):
        fail(f"successors {b.succs} miss a target of {sorted(targets)}", b.name)
    ended = bool(b.insts) and b.insts[-1].op == "text"  # inline assembly, then unreachable
    if falls and b.succs and following not in b.succs and not ended:
        fail(f"falls through to {following or 'nothing'}, not to one of {b.succs}", b.name)


def _skip(b: MBlock, k: int) -> None:
    count, mi = covered_count(b.insts, k), b.insts[k]
    if not count:
        fail("a skip covers nothing", b.name, mi)
    if mi.op != "skip" and (count != 1 or b.insts[k + 1].op in TWO_WORDS):
        fail("a skip instruction covers one word", b.name, mi)


def _registers(m: MFunction, b: MBlock, mi: MI, allocated: bool) -> None:
    for role, a in zip(mi.info.roles, mi.args, strict=False):
        if not isinstance(a, int):
            if allocated and isinstance(a, Mem) and not 0 <= a.base < FIRST_VIRTUAL:
                fail("a virtual register is left", b.name, mi)
        elif a < FIRST_VIRTUAL:
            if role in "SDB" and (a % 2 or a >= 14):
                fail("a pair starts with an even register below W14", b.name, mi)
        elif allocated:
            fail("a virtual register is left", b.name, mi)
        elif role != "n" and (role in "SDB") != (a in m.pairs):
            wide = role in "SDB"
            fail("a pair where a word belongs" if not wide else "a word where a pair belongs", b.name, mi)
    near_byte = mi.op == "mov" and mi.byte and any(isinstance(a, FileRegister) for a in mi.args)
    if near_byte and any(isinstance(a, int) and a != 0 for a in mi.args):
        fail("near bytes move through W0 only", b.name, mi)
