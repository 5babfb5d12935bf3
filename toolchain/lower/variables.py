"""Source variables in registers and in the frame, for debug information: where they are, as address ranges.

Allocation claims: a variable is in the registers that its value was given, as long as that value is live. Later passes
move, merge and replace instructions, so every claim is checked on the finished code: along every way, the last write of
the register must be one of that value. What cannot be shown is left out, and a debugger says "optimised out".
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from .bindings import Position
from .liveness import bits, live_out
from .mir import MI, Located, MFunction

Values = dict[int, int]
"""Register -> number of the value it holds."""


def claim(m: MFunction, rename: Mapping[int, int], group: Mapping[int, int]) -> None:
    """Note on every instruction what its position says of variables. Registers are still virtual.

    `rename` gives their real ones, `group` one number to registers that are the same value under two names.
    """
    known: dict[int, tuple[str, int, tuple[int, ...], tuple[int, ...]]] = {}
    for k, (variable, registers) in m.bindings.items():
        if registers[0] < 0:
            known[k] = (variable, 0, registers, ())
        elif all(r in rename and r not in m.pairs for r in registers):
            real = tuple(rename[r] for r in registers)
            known[k] = (variable, bits(list(registers)), real, tuple(group[r] for r in registers))
    out = live_out(m)
    for b in m.blocks:
        live = out[b.name]
        for mi in reversed(b.insts):
            mi.holds = {rename[r]: group[r] for r in mi.defs() if r in rename and r not in m.pairs}
            live = live & ~bits(mi.defs()) | bits(mi.uses())
            if isinstance(mi.line, Position):
                here = [known[k] for k in mi.line.records if k in known]
                mi.variables = tuple((v, real, values) for v, mask, real, values in here if live & mask == mask)


def proved(m: MFunction) -> dict[int, tuple[Located, ...]]:
    """id of an instruction of the finished function -> where variables are in front of it."""
    at_start = _values_at_start(m)
    found: dict[int, tuple[Located, ...]] = {}
    for b in m.blocks:
        values = dict(at_start[b.name])
        for mi in b.insts:
            values.update(mi.holds_before)
            true = [(v, real) for v, real, wanted in mi.variables if _true(values, real, wanted)]
            found[id(mi)] = tuple(sorted(true))
            _step(values, mi)
    return found


def _true(values: Values, registers: tuple[int, ...], wanted: tuple[int, ...]) -> bool:
    return not wanted or all(values.get(r) == value for r, value in zip(registers, wanted, strict=True))


def _step(values: Values, mi: MI) -> None:
    for r in mi.defs():
        if r in mi.holds:
            values[r] = mi.holds[r]
        else:
            values.pop(r, None)


def _values_at_start(m: MFunction) -> dict[str, Values]:
    """Forward data flow: what every register holds on all ways into a block."""
    preds: dict[str, list[str]] = {b.name: [] for b in m.blocks}
    for b in m.blocks:
        for s in b.succs:
            preds[s].append(b.name)
    start: dict[str, Values] = {m.blocks[0].name: {}}
    end: dict[str, Values] = {}
    changed = True
    while changed:
        changed = False
        for b in m.blocks:
            ways = [end[p] for p in preds[b.name] if p in end]
            if b is not m.blocks[0]:
                start[b.name] = _meet(ways)
            values = dict(start[b.name])
            for mi in b.insts:
                values.update(mi.holds_before)
                _step(values, mi)
            if end.get(b.name) != values:
                end[b.name] = values
                changed = True
    return start


def _meet(ways: list[Values]) -> Values:
    if not ways:
        return {}
    return {r: value for r, value in ways[0].items() if all(way.get(r) == value for way in ways[1:])}


@dataclass
class Ranges:
    """Collects (start label, end label, registers) of every variable while text is written."""

    prefix: str
    found: dict[str, list[tuple[str, str, tuple[int, ...]]]] = field(default_factory=dict)
    _open: dict[str, tuple[str, tuple[int, ...]]] = field(default_factory=dict)
    _state: tuple[Located, ...] = ()
    _serial: int = 0

    def at(self, state: tuple[Located, ...]) -> str:
        """Label line to write where the state changes, or ""."""
        if state == self._state:
            return ""
        self._serial += 1
        label = f".Lvar{self.prefix}_{self._serial}"
        self._change(state, label)
        return f"{label}:"

    def close(self, end: str) -> None:
        """All ranges end here."""
        self._change((), end)

    def _change(self, state: tuple[Located, ...], label: str) -> None:
        new = dict(state)
        for variable, (start, registers) in list(self._open.items()):
            if new.get(variable) != registers:
                self.found.setdefault(variable, []).append((start, label, registers))
                del self._open[variable]
        for variable, registers in new.items():
            self._open.setdefault(variable, (label, registers))
        self._state = state
