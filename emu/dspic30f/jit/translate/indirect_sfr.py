"""Registers reached by a pointer: one native function for all accesses whose address is only known at run time.

In: how native code treats each SFR (`Surroundings`), the rules of devices. Out: IR of `i64 entry(rec, now, address,
lanes, value)`. Translated code calls it, through a word of the environment, for addresses below RAM, which are rare:
the text is that of direct accesses, once for all instructions instead of in each.

lanes = 0 reads the word at an even address: it, or -1 where Python must. Otherwise those lanes of `value` are
written: 1, or 0 where Python must, with nothing done. What lives in variables of translated code is left to Python.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Final

from emu.dspic30f.core import Core
from emu.dspic30f.jit.exit_reasons import Access, Surroundings
from emu.dspic30f.jit.translate.rule_emitter import BoundaryReader
from emu.dspic30f.jit.translate.values import Emitter, Number, Value, truth, wide
from emu.dspic30f.jit.translate.variables import pointer
from emu.system.rules import Place, Rule

POINTED: Final = 11
"""Word of the environment: where the function is."""
CONVENTION: Final = "preserve_mostcc"
"""The callee saves registers: those around a rare call keep theirs."""
LANES: Final = (0xFFFF, 0x00FF, 0xFF00)
SLOW, PLAIN, LOUD, FLAGS, RULED = range(5)
"""How a word is accessed: by Python; as memory; as memory that may make an interrupt acceptable; flags, which are only
cleared; from here on by rules."""
_KINDS: Final[Mapping[Access, int]] = {"plain": PLAIN, "irq": LOUD, "flags": FLAGS}

DECLARED: Final = "declare i64 @llvm.umin.i64(i64, i64)"


def pointed_text(core: Core, around: Surroundings) -> str:
    """The module."""
    e = Emitter()
    words = around.ram[0] >> 1
    now, address, lanes, value = (Value(e, name, False) for name in ("%now", "%address", "%lanes", "%value"))
    m = BoundaryReader(core, e, now, "slow")
    e.start("first")
    word = address >> 1
    e.end(f"br i1 {truth(m.below(word, words))}, label %inside, label %slow")
    e.start("inside")
    e.end(f"br i1 {truth(lanes == 0)}, label %read, label %write")
    _read(e, m, around, word, address)
    _write(e, m, around, word, address, lanes, value)
    e.start("slow")
    e.end(f"ret i64 {wide(e.select(lanes == 0, -1, 0))}")
    head = f"define {CONVENTION} i64 @entry(ptr noalias %rec, i64 %now, i64 %address, i64 %lanes, i64 %value) {{"
    return "\n".join([DECLARED, m.constants(), head, e.text(), "}"])


def _switch(e: Emitter, m: BoundaryReader, kinds: list[int], word: Number, rules: list[Rule], plain: str) -> None:
    """Go to where a word's kind is dealt with: `plain` or, by the number of its rule, `plain`.number."""
    cases = " ".join(f"i64 {RULED + number}, label %{plain}.{number}" for number in range(len(rules)))
    simple = " ".join(f"i64 {kind}, label %{plain}" for kind in (PLAIN, LOUD, FLAGS))
    e.end(f"switch i64 {wide(m.table(tuple(kinds), word))}, label %slow [ {simple} {cases} ]")


def _read(e: Emitter, m: BoundaryReader, around: Surroundings, word: Number, address: Number) -> None:
    kinds = [SLOW] * (around.ram[0] >> 1)
    rules: list[Rule] = []
    for at, how in around.reads.items():
        kinds[at >> 1] = PLAIN if how == "plain" and not _in_variables(around, at) else SLOW
    for at, rule in around.rules.items():
        if rule.reads is not None:
            kinds[at >> 1] = RULED + len(rules)
            rules.append(rule)
    e.start("read")
    _switch(e, m, kinds, word, rules, "plain")
    e.start("plain")
    e.end(f"ret i64 {e.load(pointer(e, address), 16).text}")
    for number, rule in enumerate(rules):
        e.start(f"plain.{number}")
        assert rule.reads is not None
        e.end(f"ret i64 {wide(rule.reads(m, rule.places))}")


def _write(
    e: Emitter, m: BoundaryReader, around: Surroundings, word: Number, address: Number, lanes: Value, value: Value
) -> None:
    kinds, masks = [SLOW] * (around.ram[0] >> 1), [0] * (around.ram[0] >> 1)
    rules: list[Rule] = []
    for at, (how, mask) in around.writes.items():
        if not _in_variables(around, at):
            kinds[at >> 1], masks[at >> 1] = _KINDS.get(how, SLOW), mask
    for at, rule in around.rules.items():
        if rule.writes is not None:
            kinds[at >> 1] = RULED + len(rules)
            rules.append(rule)
    e.start("write")
    _switch(e, m, kinds, word, rules, "memory")
    e.start("memory")
    kind = m.table(tuple(kinds), word)
    free = m.table(tuple(masks), word) & lanes
    old = e.load(pointer(e, address), 16)
    m.need((kind != FLAGS) | ((value & free & (old ^ 0xFFFF)) == 0))
    e.store(pointer(e, address), (old & (free ^ 0xFFFF)) | (value & free), 16)
    e.end(f"br i1 {truth(kind == PLAIN)}, label %done, label %loud")
    e.start("loud")
    deadline = Place(around.offset["events.deadline"], 64)
    m.put(deadline, e.select(requested(e, around), 0, m.get(deadline)))
    e.end("br label %done")
    e.start("done")
    e.end("ret i64 1")
    for number, rule in enumerate(rules):
        assert rule.writes is not None
        ways = _ways(e, m, rule, value)
        e.start(f"memory.{number}")
        cases = " ".join(f"i64 {lane}, label %{label}" for lane, label in ways.items())
        e.end(f"switch i64 {lanes.text}, label %slow [ {cases} ]")


def _ways(e: Emitter, m: BoundaryReader, rule: Rule, value: Value) -> dict[int, str]:
    """Labels at which a rule writes, by lanes it is for."""
    ways = {}
    writes: Callable[..., bool] | None = rule.writes
    assert writes is not None
    for lanes in LANES:
        label = e.fresh("lanes")
        e.start(label)
        if writes(m, rule.places, value, lanes):
            e.end("br label %done")
            ways[lanes] = label
        else:
            e.end("br label %slow")
    return ways


def _in_variables(around: Surroundings, address: int) -> bool:
    """Whether translated code may keep a register out of the record."""
    return address == around.offset["SR"] or around.accumulator_at(address) is not None


def requested(e: Emitter, around: Surroundings) -> Value:
    """Truth of "some enabled interrupt is requested"."""
    total: Number = 0
    for flags, enables in around.flag_words:
        total = total | (e.load(pointer(e, flags), 16) & e.load(pointer(e, enables), 16))
    assert isinstance(total, Value)
    return total != 0
