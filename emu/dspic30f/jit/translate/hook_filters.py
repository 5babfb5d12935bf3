"""Filters of hooks as LLVM IR (emu/system/hook_filters.py).

Where native code cannot read a number as Python does, the filter counts as true, and the hook is called. This concerns
registers without a rule that computes them, and device registers while an event is due in the present cycle.
"""

from __future__ import annotations

from typing import Final

from emu.dspic30f.jit.ir.builder import NeedsInterpreter
from emu.dspic30f.jit.ir.comparison import compare
from emu.dspic30f.jit.ir.rule_emitter import AccessEmitter
from emu.dspic30f.jit.ir.values import Number, truth
from emu.dspic30f.jit.ir.variables import pointer
from emu.dspic30f.jit.translate.frame import FunctionFrame
from emu.dspic30f.state.data_space import W_END
from emu.system.hook_filters import Comparison, Filter


def some_filter_holds(f: FunctionFrame, filters: tuple[Filter, ...], calls: str) -> Number:
    """Emit the evaluation of filters and return whether at least one holds.

    `calls` is the label of the block that calls the hook; code that cannot evaluate a number branches to it.
    """
    result: Number = 0
    for comparisons in filters:
        holds: Number = 1
        for one in comparisons:
            holds = _comparison(f, one, calls) & holds
        result = holds | result
    return result


def _comparison(f: FunctionFrame, one: Comparison, calls: str) -> Number:
    """Emit one comparison; 1 if native code cannot evaluate it."""
    e, first = f.e, f.layout.ram[0]
    if one.base is not None:
        return _in_frame(f, one, one.base)
    if one.address >= first:
        return compare(one, e.load(pointer(e, one.address), 8 * one.size))
    if one.address < W_END:
        return compare(one, _registers(f, one.address, one.size))
    try:
        word = _sfr(f, one.address & ~1, calls)
    except NeedsInterpreter:
        return 1
    due = e.let(f"icmp ule i64 %before, {f.v.get('cycle').text}", bit=True)
    low = word >> 8 if one.address & 1 else word
    return compare(one, low & ((1 << 8 * one.size) - 1)) | due


def _in_frame(f: FunctionFrame, one: Comparison, base: int) -> Number:
    """Emit the comparison of a local variable in the stack frame; 1 if its address is not in RAM."""
    e, (first, end) = f.e, f.layout.ram
    ea = (f.v.get(f"W{base}") + one.address) & 0xFFFF
    inside = (ea >= first) & (ea <= end - one.size)
    found = e.load(pointer(e, e.select(inside, ea, first)), 8 * one.size)
    return compare(one, found) | (inside == 0)


def _registers(f: FunctionFrame, address: int, size: int) -> Number:
    """Return the number in W registers, from the byte or word at their data address."""
    number: Number = f.v.get(f"W{address >> 1}")
    if size > 2:
        number = number | (f.v.get(f"W{(address >> 1) + 1}") << 16)
    return (number >> 8 * (address & 1)) & ((1 << 8 * size) - 1)


def _sfr(f: FunctionFrame, address: int, calls: str) -> Number:
    """Return the SFR at `address` in the present cycle. Raises NeedsInterpreter if only Python can compute it."""
    rule = f.layout.rules.get(address)
    if rule is not None and rule.reads is not None:
        f.b.now = f.v.get("cycle")
        word: Number = rule.reads(_HookEmitter(f, calls), rule.operands)
        return word
    if address == f.layout.offset["SR"]:
        return f.b.sr_word()
    if f.layout.reads.get(address) != "plain" or f.layout.accumulator_at(address) is not None:
        raise NeedsInterpreter
    return f.e.load(pointer(f.e, address), 16)


class _HookEmitter(AccessEmitter):
    """Emitter for a register's rule before a hook. Where a requirement does not hold, the hook is called."""

    def __init__(self, f: FunctionFrame, calls: str) -> None:
        super().__init__(f.b)
        self._calls: Final = calls

    def require(self, condition: Number) -> None:
        """Branch to the call of the hook unless `condition` holds."""
        go = self.e.fresh("go")
        self.e.end(f"br i1 {truth(condition)}, label %{go}, label %{self._calls}")
        self.e.start(go)
