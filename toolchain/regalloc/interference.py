"""Interference graph of register allocation: construction, coalescing of copies, simplification (colouring.py)."""

from __future__ import annotations

import copy

from toolchain.mir.function import MFunction
from toolchain.mir.instruction import MI, pair_move
from toolchain.mir.liveness import live_out, mask_of, registers_in
from toolchain.mir.operands import FIRST_VIRTUAL

REAL = (1 << FIRST_VIRTUAL) - 1
LOOP_WEIGHT = 8  # weight of code per level of loops around it
EXACT_SPILL_NODES = 300  # maximum number of nodes for which the best spill candidate is recomputed at every step



class InterferenceGraph:
    """Interference graph of one round of allocation."""

    def __init__(self, m: MFunction) -> None:
        self.m = m
        self.adjacent: dict[int, int] = {}
        self.alias: dict[int, int] = {}
        self.moves: list[tuple[int, int, int]] = []  # copies as (weight, source, destination)
        self.cost: dict[int, float] = {}
        self.hints: dict[int, list[tuple[int, int]]] = {}  # by node: (copy partner, colour offset)
        self.pair_mask = mask_of(sorted(m.pairs))
        self._build()

    def of_copy(self, m: MFunction) -> InterferenceGraph:
        """An independent copy of the graph, for a clone of its function."""
        new = copy.copy(self)
        new.m = m
        new.adjacent, new.alias, new.moves, new.cost = {**self.adjacent}, {**self.alias}, [*self.moves], {**self.cost}
        new.hints = {n: [*partners] for n, partners in self.hints.items()}
        return new

    def _build(self) -> None:
        out = live_out(self.m)
        adjacent = self.adjacent
        for r in range(FIRST_VIRTUAL):
            adjacent[r] = REAL & ~(1 << r)
        for b in self.m.blocks:
            live = out[b.name]
            weight = LOOP_WEIGHT ** min(b.depth, 4)
            for mi in reversed(b.insts):
                live = self._instruction(mi, live, weight)
        for n, mask in list(adjacent.items()):
            for t in registers_in(mask):
                adjacent[t] = adjacent.get(t, 0) | 1 << n

    def _instruction(self, mi: MI, live: int, weight: int) -> int:
        adjacent, cost = self.adjacent, self.cost
        defs, uses = mi.defs(), mi.uses()
        after = live
        if mi.is_copy():
            after &= ~(1 << uses[0])
            self.moves.append((weight, uses[0], defs[0]))
        for k in mi.late:
            a = mi.args[k]
            if isinstance(a, int):
                after |= 1 << a
        d = mask_of(defs)
        for r in defs:
            adjacent[r] = adjacent.get(r, 0) | (after | d) & ~(1 << r)
            cost[r] = cost.get(r, 0) + weight
        for r in uses:
            adjacent.setdefault(r, 0)
            cost[r] = cost.get(r, 0) + weight
        move = pair_move(mi)
        if move is not None:
            for offset, word in enumerate(move.words):
                self.hints.setdefault(word, []).append((move.pair, offset))
                self.hints.setdefault(move.pair, []).append((word, -offset))
        return live & ~d | mask_of(uses)

    def find(self, n: int) -> int:
        """The node into which a coalesced node was merged."""
        while n in self.alias:
            n = self.alias[n]
        return n

    def pressure(self, n: int, mask: int) -> int:
        """Maximum number of colours of n's class that the nodes in `mask` can occupy."""
        if n in self.m.pairs:
            return mask.bit_count()
        return mask.bit_count() + (mask & self.pair_mask).bit_count()

    def limit(self, n: int) -> int:
        """Number of colours in n's class, without W14 if it is the frame pointer."""
        return 7 if n in self.m.pairs else 15 - self.m.uses_fp

    # -- coalescing ---------------------------------------------------------------------------------------------------

    def coalesce(self, eager: bool, thorough: bool) -> None:
        """Merge the nodes of copies, most frequent first, if that is safe; with `eager` also copies of real registers.

        `thorough` uses George's test for virtual registers, too, which removes more moves but may cause more spills."""
        pending = sorted(self.moves, key=lambda m: -m[0])
        changed = True
        while changed and pending:
            changed = False
            rest = []
            for weight, source, dest in pending:
                a, b = self.find(source), self.find(dest)
                if a == b:
                    continue
                if (eager or min(a, b) >= FIRST_VIRTUAL) and self._mergeable(a, b, thorough):
                    self._merge(a, b)
                    changed = True
                else:
                    rest.append((weight, source, dest))
            pending = rest
        for _, source, dest in pending:
            a, b = self.find(source), self.find(dest)
            if a != b and not self.adjacent[a] >> b & 1:
                self.hints.setdefault(a, []).append((b, 0))
                self.hints.setdefault(b, []).append((a, 0))

    def _mergeable(self, a: int, b: int, thorough: bool) -> bool:
        if a == 15 or b == 15 or self.adjacent[a] >> b & 1:
            return False
        if (a < FIRST_VIRTUAL and b < FIRST_VIRTUAL) or (a in self.m.pairs) != (b in self.m.pairs):
            return False
        if b < FIRST_VIRTUAL:
            a, b = b, a
        if a < FIRST_VIRTUAL:  # George's test
            return self._harmless(a, b)
        both = self.adjacent[a] | self.adjacent[b]
        if self.pressure(a, both) < self.limit(a):
            return True
        if thorough and (self._harmless(a, b) or self._harmless(b, a)):
            return True
        significant = (both & REAL).bit_count()
        for t in registers_in(both & ~REAL):
            mask = self.adjacent[t]
            shared = mask >> a & 1 and mask >> b & 1
            if self.pressure(t, mask) - (1 if shared else 0) >= self.limit(t):
                significant += 2 if t in self.m.pairs else 1
        return significant < self.limit(a)

    def _harmless(self, a: int, b: int) -> bool:
        """George's test: whether every neighbour of b also interferes with a, or can always be coloured."""
        trouble = self.adjacent[b] & ~self.adjacent[a]
        if a >= FIRST_VIRTUAL and trouble & REAL:
            return False
        return all(self.pressure(t, self.adjacent[t]) < self.limit(t) for t in registers_in(trouble & ~REAL))

    def _merge(self, a: int, b: int) -> None:
        if b < FIRST_VIRTUAL:
            a, b = b, a
        self.alias[b] = a
        mask = self.adjacent.pop(b)
        self.adjacent[a] |= mask
        bit_a, bit_b = 1 << a, 1 << b
        for t in registers_in(mask):
            self.adjacent[t] = self.adjacent[t] & ~bit_b | bit_a
        self.cost[a] = self.cost.get(a, 0) + self.cost.get(b, 0)
        if b in self.m.temps:
            self.m.temps.add(a)
        if b in self.hints:
            self.hints.setdefault(a, []).extend(self.hints.pop(b))

    # -- simplification -----------------------------------------------------------------------------------------------

    def simplify(self) -> list[int]:
        """Remove all virtual nodes; return them in the order of removal."""
        remaining = {n for n in self.adjacent if n >= FIRST_VIRTUAL}
        active = mask_of(sorted(remaining)) | REAL
        stack: list[int] = []
        ready = [n for n in remaining if self.pressure(n, self.adjacent[n] & active) < self.limit(n)]
        queued = set(ready)
        ranked: list[int] = []  # for large graphs: spill candidates by their degree at the start, cheapest last
        if len(remaining) > EXACT_SPILL_NODES:
            ranked = sorted(remaining, key=lambda n: (self._spill_metric(n, active), n), reverse=True)
        while remaining:
            if not ready:
                while ranked and ranked[-1] not in remaining:
                    ranked.pop()
                victim = ranked[-1] if ranked else min(remaining, key=lambda n: (self._spill_metric(n, active), n))
                ready.append(victim)
                queued.add(victim)
            n = ready.pop()
            if n not in remaining:
                continue
            remaining.discard(n)
            active &= ~(1 << n)
            stack.append(n)
            for t in registers_in(self.adjacent[n] & active & ~REAL):
                if t not in queued and self.pressure(t, self.adjacent[t] & active) < self.limit(t):
                    queued.add(t)
                    ready.append(t)
        return stack

    def _spill_metric(self, n: int, active: int) -> float:
        if n in self.m.temps:
            return float("inf")
        return self.cost.get(n, 0) / (1 + self.pressure(n, self.adjacent[n] & active))

    def members_of(self, n: int) -> list[int]:
        """Virtual registers merged into node `n`."""
        return [r for r in [n, *self.alias] if r >= FIRST_VIRTUAL and self.find(r) == n]
