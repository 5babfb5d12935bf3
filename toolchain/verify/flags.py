"""Flags live inside a block, and a reader's flags come from the kind of instruction they came from before."""

from __future__ import annotations

from toolchain.mir.mir import CC_INVERSE, READS_FLAGS, MBlock
from toolchain.verify.error import MachineError, fail

Source = tuple[str, str, str]  # reader, flag, writer
LIKE_A_TEST = {"cp", "cp0", "btst"}  # comparisons that another instruction's result may stand for


def walk(b: MBlock) -> list[Source]:
    """Who reads which flag from whom. Raises MachineError for one that was not written in the same block."""
    writer: dict[str, str] = {}
    out: list[Source] = []
    for mi in b.insts:
        for flag in mi.flags_read():
            if flag not in writer:
                fail(f"flag {flag.upper()} is read but was not set in the block", b.name, mi)
            op = "bra" if mi.op in READS_FLAGS else mi.op  # a skip is a branch over what it covers
            reader = f"{op} {min(mi.cc, CC_INVERSE.get(mi.cc, mi.cc))}".strip()
            out.append((reader, flag, writer[flag]))
        for flag in mi.flags_written():
            writer[flag] = mi.op if not mi.pred else f"conditional {mi.op}"
    return out


def compare(before: set[Source], after: set[Source], exchanges: bool) -> None:
    """No new combination of reader and writer. `exchanges`: comparisons may have given way to what set the flags."""
    tested = {(reader, flag) for reader, flag, writer in before if writer.removesuffix("f") in LIKE_A_TEST}
    for reader, flag, writer in sorted(after - before):
        if not (exchanges and (reader, flag) in tested):
            raise MachineError(f"{reader} now reads {flag.upper()} as {writer} leaves it")
