"""What the rules need to know of one block, found once for as long as no pass changes the block."""

from __future__ import annotations

from collections.abc import Mapping

from toolchain.mir.mir import MI, MBlock, MFunction
from toolchain.verify import flags, registers, stack, traces

Key = tuple[object, ...]


def written_down(mi: MI) -> Key:
    """All of an instruction that any rule looks at."""
    return (mi.op, mi.info, mi.byte, mi.cc, mi.pred, mi.epilogue, mi.also_uses, mi.also_defs, *mi.args)


class Facts:
    """One block's part in the rules that hold for the whole function."""

    __slots__ = ("key", "kill", "numbers", "pushed", "reads", "sources", "stack", "word", "written")

    def __init__(self, b: MBlock, key: list[Key]) -> None:
        self.key = key
        self.sources = flags.walk(b)
        self.reads, self.kill, self.pushed, self.written = registers.summary(b)
        self.stack = stack.plain_change(b)
        self.word, self.numbers = traces.seen_outside(b)


def key_of(b: MBlock) -> list[Key]:
    """The block as it is now, to compare with later."""
    return [tuple(b.succs), *map(written_down, b.insts)]


def taken_down(m: MFunction, keys: Mapping[str, list[Key]], before: Mapping[str, Facts]) -> dict[str, Facts]:
    """Facts of every block by name, those of `before` where its key is the same. Raises MachineError for lost flags."""
    found = {}
    for b in m.blocks:
        old, key = before.get(b.name), keys[b.name]
        found[b.name] = old if old is not None and old.key == key else Facts(b, key)
    return found
