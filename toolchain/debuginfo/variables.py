"""Locations of source variables in registers and in the frame, as address ranges.

Register allocation claims that a variable is in the registers of its value as long as that value is live. Later passes
move, merge and replace instructions, so every claim is verified on the finished code: on every path, the last write of
the register must write that value. A claim that cannot be verified is omitted, and a debugger reports the variable as
optimised out.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from toolchain.debuginfo.bindings import BoundLine
from toolchain.mir.function import OPTIMISED_OUT, MFunction, VariableLocation
from toolchain.mir.instruction import MI
from toolchain.mir.liveness import live_out

RegisterValues = dict[int, int]
"""Number of the value that each register contains."""


def attach_claims(m: MFunction, rename: Mapping[int, int], group: Mapping[int, int]) -> None:
    """Attach claims about variables to every instruction, before virtual registers are renamed.

    `rename` maps virtual registers to real ones; `group` maps coalesced registers to one number.
    """
    known: dict[int, tuple[str, tuple[int, ...], tuple[int, ...], tuple[int, ...]]] = {}
    for k, (variable, words) in m.bindings.items():
        virtual = tuple(
            w if w >= OPTIMISED_OUT or w < 0 or (w in rename and w not in m.pairs) else OPTIMISED_OUT for w in words
        )
        known[k] = variable, virtual, tuple(rename.get(w, w) for w in virtual), tuple(group.get(w, 0) for w in virtual)
    out = live_out(m)
    for b in m.blocks:
        live = out[b.name]
        for mi in reversed(b.insts):
            mi.written_values = {rename[r]: group[r] for r in mi.defs() if r in rename and r not in m.pairs}
            used, written = mi.register_sets()
            live = live & ~written | used
            if isinstance(mi.line, BoundLine):
                here = [known[k] for k in mi.line.records if k in known]
                claims = [(v, tuple(r if w < 0 or w >= OPTIMISED_OUT or live >> w & 1 else OPTIMISED_OUT
                                    for w, r in zip(virtual, real, strict=True)), values)
                          for v, virtual, real, values in here]  # fmt: skip
                mi.claims = tuple(claim for claim in claims if _has_location(claim[1]))


def verified_locations(m: MFunction) -> dict[int, tuple[VariableLocation, ...]]:
    """Verified locations of variables before each instruction of the finished function, by id(instruction)."""
    at_start = _values_at_start(m)
    found: dict[int, tuple[VariableLocation, ...]] = {}
    for b in m.blocks:
        values = dict(at_start[b.name])
        for mi in b.insts:
            values.update(mi.values_before)
            verified = [(v, _verified(values, real, wanted)) for v, real, wanted in mi.claims]
            found[id(mi)] = tuple(sorted((v, words) for v, words in verified if _has_location(words)))
            _step(values, mi)
    return found


def _verified(values: RegisterValues, words: tuple[int, ...], wanted: tuple[int, ...]) -> tuple[int, ...]:
    """The words of a claim; OPTIMISED_OUT for registers that do not contain the claimed values."""
    return tuple(
        w if w < 0 or w >= OPTIMISED_OUT or values.get(w) == value else OPTIMISED_OUT
        for w, value in zip(words, wanted, strict=True)
    )


def _has_location(words: tuple[int, ...]) -> bool:
    """Whether any word has a location."""
    return any(w != OPTIMISED_OUT for w in words)


def _step(values: RegisterValues, mi: MI) -> None:
    """Update the values by the writes of an instruction."""
    for r in mi.defs():
        if r in mi.written_values:
            values[r] = mi.written_values[r]
        else:
            values.pop(r, None)


def _values_at_start(m: MFunction) -> dict[str, RegisterValues]:
    """Values that registers contain on all paths into each block, by forward data flow."""
    preds: dict[str, list[str]] = {b.name: [] for b in m.blocks}
    for b in m.blocks:
        for s in b.succs:
            preds[s].append(b.name)
    start: dict[str, RegisterValues] = {m.blocks[0].name: {}}
    end: dict[str, RegisterValues] = {}
    changed = True
    while changed:
        changed = False
        for b in m.blocks:
            incoming = [end[p] for p in preds[b.name] if p in end]
            if b is not m.blocks[0]:
                start[b.name] = _meet(incoming)
            values = dict(start[b.name])
            for mi in b.insts:
                values.update(mi.values_before)
                _step(values, mi)
            if end.get(b.name) != values:
                end[b.name] = values
                changed = True
    return start


def _meet(incoming: list[RegisterValues]) -> RegisterValues:
    """Facts that all incoming paths share."""
    if not incoming:
        return {}
    return {r: value for r, value in incoming[0].items() if all(other.get(r) == value for other in incoming[1:])}


@dataclass
class LocationLists:
    """Collects (start label, end label, words) of every variable while the text of a function is written."""

    prefix: str
    found: dict[str, list[tuple[str, str, tuple[int, ...]]]] = field(default_factory=dict)
    _open: dict[str, tuple[str, tuple[int, ...]]] = field(default_factory=dict)
    _state: tuple[VariableLocation, ...] = ()
    _serial: int = 0

    def at(self, state: tuple[VariableLocation, ...]) -> str:
        """Label line to write if the locations change to `state`, else ""."""
        if state == self._state:
            return ""
        self._serial += 1
        label = f".Lvar{self.prefix}_{self._serial}"
        self._change(state, label)
        return f"{label}:"

    def close(self, end: str) -> None:
        """End all open ranges at a label."""
        self._change((), end)

    def _change(self, state: tuple[VariableLocation, ...], label: str) -> None:
        new = dict(state)
        for variable, (start, registers) in list(self._open.items()):
            if new.get(variable) != registers:
                self.found.setdefault(variable, []).append((start, label, registers))
                del self._open[variable]
        for variable, registers in new.items():
            self._open.setdefault(variable, (label, registers))
        self._state = state
