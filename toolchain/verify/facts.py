"""Facts of one block for the rules of the verifier, cached until a pass changes the block."""

from __future__ import annotations

from collections.abc import Mapping

from toolchain.mir.function import MBlock, MFunction
from toolchain.mir.instruction import MI
from toolchain.verify import flags, registers, stack, traces

Key = tuple[object, ...]


def instruction_key(mi: MI) -> Key:
    """All parts of an instruction that any rule uses."""
    return (mi.op, mi.info, mi.byte, mi.cc, mi.pred, mi.epilogue, mi.also_uses, mi.also_defs, *mi.args)


class BlockFacts:
    """Contribution of one block to the rules of the whole function."""

    __slots__ = ("events", "flag_uses", "key", "kill", "numbers", "pushed", "reads", "stack", "written")

    def __init__(self, b: MBlock, key: list[Key]) -> None:
        self.key = key
        self.flag_uses = flags.flag_uses(b)
        self.reads, self.kill, self.pushed, self.written = registers.summary(b)
        self.stack = stack.plain_change(b)
        self.events, self.numbers = traces.observable_events(b)


def key_of(b: MBlock) -> list[Key]:
    """The current content of a block, for a later comparison."""
    return [tuple(b.succs), *map(instruction_key, b.insts)]


def collect_facts(
    m: MFunction, keys: Mapping[str, list[Key]], before: Mapping[str, BlockFacts]
) -> dict[str, BlockFacts]:
    """Facts of every block by name, reusing those of `before` with the same key. Raises MachineError for lost flags."""
    found = {}
    for b in m.blocks:
        old, key = before.get(b.name), keys[b.name]
        found[b.name] = old if old is not None and old.key == key else BlockFacts(b, key)
    return found
