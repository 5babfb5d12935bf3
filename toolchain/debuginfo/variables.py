"""Source variables in registers and in the frame, for debug information: where they are, as address ranges.

Allocation claims: a variable is in the registers that its value was given, as long as that value is live. Later passes
move, merge and replace instructions, so every claim is checked on the finished code: along every way, the last write of
the register must be one of that value. What cannot be shown is left out, and a debugger says "optimised out".
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from toolchain.debuginfo.bindings import Position
from toolchain.mir.liveness import live_out
from toolchain.mir.mir import GONE, MI, Located, MFunction

Values = dict[int, int]
"""Register -> number of the value it holds."""


def claim(m: MFunction, rename: Mapping[int, int], group: Mapping[int, int]) -> None:
    """Note on every instruction what its position says of variables. Registers are still virtual.

    `rename` gives their real ones, `group` one number to registers that are the same value under two names.
    """
    known: dict[int, tuple[str, tuple[int, ...], tuple[int, ...], tuple[int, ...]]] = {}
    for k, (variable, words) in m.bindings.items():
        virtual = tuple(w if w >= GONE or w < 0 or (w in rename and w not in m.pairs) else GONE for w in words)
        known[k] = variable, virtual, tuple(rename.get(w, w) for w in virtual), tuple(group.get(w, 0) for w in virtual)
    out = live_out(m)
    for b in m.blocks:
        live = out[b.name]
        for mi in reversed(b.insts):
            mi.holds = {rename[r]: group[r] for r in mi.defs() if r in rename and r not in m.pairs}
            used, written = mi.register_sets()
            live = live & ~written | used
            if isinstance(mi.line, Position):
                here = [known[k] for k in mi.line.records if k in known]
                claims = [(v, tuple(r if w < 0 or w >= GONE or live >> w & 1 else GONE
                                    for w, r in zip(virtual, real, strict=True)), values)
                          for v, virtual, real, values in here]  # fmt: skip
                mi.variables = tuple(claim for claim in claims if _anywhere(claim[1]))


def proved(m: MFunction) -> dict[int, tuple[Located, ...]]:
    """id of an instruction of the finished function -> where variables are in front of it."""
    at_start = _values_at_start(m)
    found: dict[int, tuple[Located, ...]] = {}
    for b in m.blocks:
        values = dict(at_start[b.name])
        for mi in b.insts:
            values.update(mi.holds_before)
            true = [(v, _true(values, real, wanted)) for v, real, wanted in mi.variables]
            found[id(mi)] = tuple(sorted((v, words) for v, words in true if _anywhere(words)))
            _step(values, mi)
    return found


def _true(values: Values, words: tuple[int, ...], wanted: tuple[int, ...]) -> tuple[int, ...]:
    """The words, those in registers as far as these hold what they should."""
    return tuple(
        w if w < 0 or w >= GONE or values.get(w) == value else GONE for w, value in zip(words, wanted, strict=True)
    )


def _anywhere(words: tuple[int, ...]) -> bool:
    return any(w != GONE for w in words)


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
