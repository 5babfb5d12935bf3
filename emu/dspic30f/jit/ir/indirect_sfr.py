"""Indirect SFR access: a native helper for SFR addresses that are known only at run time.

Inputs: the access kind of each SFR (`MachineLayout`) and the rules of devices. Output: the IR of
`i64 entry(rec, now, address, lanes, value)`. Translated code calls it through a word of the environment for addresses
below RAM, which are rare. All access code exists once in the helper instead of once per instruction.

If `lanes` is 0, the helper reads the word at an even address. It returns the word, or -1 if Python must read it.
Otherwise it writes the bits `lanes` of `value`. It returns 1, or 0 without any effect if Python must write it. Python
accesses the registers that translated code keeps in variables.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Final

from emu.dspic30f.core import Core
from emu.dspic30f.jit.ir.builder import CALLING_CONVENTION
from emu.dspic30f.jit.ir.rule_emitter import BoundaryEmitter
from emu.dspic30f.jit.ir.values import Emitter, Number, Value, truth, wide
from emu.dspic30f.jit.ir.variables import pointer
from emu.dspic30f.jit.machine_layout import MachineLayout, SfrAccess
from emu.system.rules import Cell, Rule

LANES: Final = (0xFFFF, 0x00FF, 0xFF00)
SLOW, PLAIN, INTERRUPT_CONTROL, FLAGS, FIRST_RULE = range(5)
"""Kinds of access to a word: by Python; as memory; as memory that may make an interrupt acceptable; as interrupt flags,
which native code only clears. Numbers from FIRST_RULE on mean access by a rule."""
_KINDS: Final[Mapping[SfrAccess, int]] = {"plain": PLAIN, "irq": INTERRUPT_CONTROL, "flags": FLAGS}

DECLARED: Final = "declare i64 @llvm.umin.i64(i64, i64)"


def indirect_sfr_text(core: Core, layout: MachineLayout) -> str:
    """Return the LLVM IR of the module with the helper."""
    e = Emitter()
    words = layout.ram[0] >> 1
    now, address, lanes, value = (Value(e, name, False) for name in ("%now", "%address", "%lanes", "%value"))
    m = BoundaryEmitter(core, e, now, "slow")
    e.start("first")
    word = address >> 1
    e.end(f"br i1 {truth(m.below(word, words))}, label %inside, label %slow")
    e.start("inside")
    e.end(f"br i1 {truth(lanes == 0)}, label %read, label %write")
    _read(e, m, layout, word, address)
    _write(e, m, layout, word, address, lanes, value)
    e.start("slow")
    e.end(f"ret i64 {wide(e.select(lanes == 0, -1, 0))}")
    parameters = "ptr noalias %rec, i64 %now, i64 %address, i64 %lanes, i64 %value"
    head = f"define {CALLING_CONVENTION} i64 @entry({parameters}) {{"
    return "\n".join([DECLARED, m.constants(), head, e.text(), "}"])


def _switch(e: Emitter, m: BoundaryEmitter, kinds: list[int], word: Number, rules: list[Rule], plain: str) -> None:
    """Branch on the kind of the word: to block `plain`, or for rule number N to block `plain`.N; else to `slow`."""
    cases = " ".join(f"i64 {FIRST_RULE + number}, label %{plain}.{number}" for number in range(len(rules)))
    simple = " ".join(f"i64 {kind}, label %{plain}" for kind in (PLAIN, INTERRUPT_CONTROL, FLAGS))
    e.end(f"switch i64 {wide(m.table(tuple(kinds), word))}, label %slow [ {simple} {cases} ]")


def _read(e: Emitter, m: BoundaryEmitter, layout: MachineLayout, word: Number, address: Number) -> None:
    kinds = [SLOW] * (layout.ram[0] >> 1)
    rules: list[Rule] = []
    for at, how in layout.reads.items():
        kinds[at >> 1] = PLAIN if how == "plain" and not _in_variables(layout, at) else SLOW
    for at, rule in layout.rules.items():
        if rule.reads is not None:
            kinds[at >> 1] = FIRST_RULE + len(rules)
            rules.append(rule)
    e.start("read")
    _switch(e, m, kinds, word, rules, "plain")
    e.start("plain")
    e.end(f"ret i64 {e.load(pointer(e, address), 16).text}")
    for number, rule in enumerate(rules):
        e.start(f"plain.{number}")
        assert rule.reads is not None
        e.end(f"ret i64 {wide(rule.reads(m, rule.operands))}")


def _write(
    e: Emitter, m: BoundaryEmitter, layout: MachineLayout, word: Number, address: Number, lanes: Value, value: Value
) -> None:
    kinds, masks = [SLOW] * (layout.ram[0] >> 1), [0] * (layout.ram[0] >> 1)
    rules: list[Rule] = []
    for at, (how, mask) in layout.writes.items():
        if not _in_variables(layout, at):
            kinds[at >> 1], masks[at >> 1] = _KINDS.get(how, SLOW), mask
    for at, rule in layout.rules.items():
        if rule.writes is not None:
            kinds[at >> 1] = FIRST_RULE + len(rules)
            rules.append(rule)
    e.start("write")
    _switch(e, m, kinds, word, rules, "memory")
    e.start("memory")
    kind = m.table(tuple(kinds), word)
    free = m.table(tuple(masks), word) & lanes
    old = e.load(pointer(e, address), 16)
    m.require((kind != FLAGS) | ((value & free & (old ^ 0xFFFF)) == 0))
    e.store(pointer(e, address), (old & (free ^ 0xFFFF)) | (value & free), 16)
    e.end(f"br i1 {truth(kind == PLAIN)}, label %done, label %loud")
    e.start("loud")
    deadline = Cell(layout.offset["events.deadline"], 64)
    m.put(deadline, e.select(interrupt_requested(e, layout), 0, m.get(deadline)))
    e.end("br label %done")
    e.start("done")
    e.end("ret i64 1")
    for number, rule in enumerate(rules):
        assert rule.writes is not None
        labels = _lane_blocks(e, m, rule, value)
        e.start(f"memory.{number}")
        cases = " ".join(f"i64 {lane}, label %{label}" for lane, label in labels.items())
        e.end(f"switch i64 {lanes.text}, label %slow [ {cases} ]")


def _lane_blocks(e: Emitter, m: BoundaryEmitter, rule: Rule, value: Value) -> dict[int, str]:
    """Emit, for each combination of lanes that the rule supports, a block that writes by the rule.

    Return the labels.
    """
    labels = {}
    writes: Callable[..., bool] | None = rule.writes
    assert writes is not None
    for lanes in LANES:
        label = e.fresh("lanes")
        e.start(label)
        if writes(m, rule.operands, value, lanes):
            e.end("br label %done")
            labels[lanes] = label
        else:
            e.end("br label %slow")
    return labels


def _in_variables(layout: MachineLayout, address: int) -> bool:
    """Return whether translated code may keep the register at `address` in variables."""
    return address == layout.offset["SR"] or layout.accumulator_at(address) is not None


def interrupt_requested(e: Emitter, layout: MachineLayout) -> Value:
    """Return whether an enabled interrupt is requested."""
    total: Number = 0
    for flags, enables in layout.flag_words:
        total = total | (e.load(pointer(e, flags), 16) & e.load(pointer(e, enables), 16))
    assert isinstance(total, Value)
    return total != 0
