"""Source variables in registers, for debug information: where they are after allocation, as address ranges.

A variable is where the value last bound to it lives, for as long as that value is live; the binding is taken to hold
from the value's definition, which may be a few instructions early.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from .liveness import bits, live_out
from .mir import Located, MFunction


def annotate(m: MFunction, rename: dict[int, int]) -> None:
    """Note on every instruction which variables are in which real registers behind it. Registers are still virtual."""
    bindings = [
        (variable, bits(list(registers)), tuple(rename[r] for r in registers))
        for variable, registers in reversed(m.in_registers)
        if all(r in rename and r not in m.pairs for r in registers)
    ]
    interesting = 0
    for _, mask, _ in bindings:
        interesting |= mask
    known: dict[int, tuple[Located, ...]] = {}

    def located(live: int) -> tuple[Located, ...]:
        live &= interesting
        if live not in known:
            found: dict[str, tuple[int, ...]] = {}
            for variable, mask, registers in bindings:
                if live & mask == mask:
                    found.setdefault(variable, registers)
            known[live] = tuple(sorted(found.items()))
        return known[live]

    out = live_out(m)
    for b in m.blocks:
        live = out[b.name]
        for mi in reversed(b.insts):
            mi.variables = located(live)
            live = live & ~bits(mi.defs()) | bits(mi.uses())
        b.variables = located(live)


@dataclass
class Ranges:
    """Collects (start label, end label, registers) of every variable while text is written."""

    prefix: str
    found: dict[str, list[tuple[str, str, tuple[int, ...]]]] = field(default_factory=dict)
    _open: dict[str, tuple[str, tuple[int, ...]]] = field(default_factory=dict)
    _state: tuple[Located, ...] = ()
    _serial: int = 0

    def at(self, state: tuple[Located, ...] | None) -> str:
        """Label line to write where the state changes, or ""."""
        if state is None or state == self._state:
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
