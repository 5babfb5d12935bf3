"""Rules of flags: they are live inside a block only, and no pass changes the kind of instruction that sets them."""

from __future__ import annotations

from toolchain.mir.function import MBlock
from toolchain.mir.operations import CC_INVERSE, READS_FLAGS
from toolchain.verify.error import MachineError, fail

FlagUse = tuple[str, str, str]  # (opcode of the reader, flag, opcode of the writer)
COMPARISONS = {"cp", "cp0", "btst"}  # comparisons that an instruction with the same flags may replace


def flag_uses(b: MBlock) -> list[FlagUse]:
    """Every flag that the block reads, with reader and writer. Raises MachineError if the block does not set it."""
    writer: dict[str, str] = {}
    out: list[FlagUse] = []
    for mi in b.insts:
        for flag in mi.flags_read():
            if flag not in writer:
                fail(f"flag {flag.upper()} is read but was not set in the block", b.name, mi)
            op = "bra" if mi.op in READS_FLAGS else mi.op  # a skip counts as a branch over its instructions
            reader = f"{op} {min(mi.cc, CC_INVERSE.get(mi.cc, mi.cc))}".strip()
            out.append((reader, flag, writer[flag]))
        for flag in mi.flags_written():
            writer[flag] = mi.op if not mi.pred else f"conditional {mi.op}"
    return out


def compare(before: set[FlagUse], after: set[FlagUse], replaces: bool) -> None:
    """Raise MachineError for a new combination of reader and writer; with `replaces`, comparisons may be replaced."""
    tested = {(reader, flag) for reader, flag, writer in before if writer.removesuffix("f") in COMPARISONS}
    for reader, flag, writer in sorted(after - before):
        if not (replaces and (reader, flag) in tested):
            raise MachineError(f"{reader} now reads {flag.upper()} as set by {writer}")
