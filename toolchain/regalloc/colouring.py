"""Register allocation: graph colouring with conservative coalescing, pairs and rematerialisation.

Terms. Nodes are registers; W0-W14 are nodes with their own colour. Two nodes interfere if one is written while the
other is live. A word node may take any of W0-W14, a pair node an even register below W14 and the next register.

Method.
1. Build the interference graph.
2. Coalesce copies if the merged node stays colourable: Briggs' test for two virtual registers, George's test for a
   precoloured node. One of the trials uses George's test for virtual registers, too.
3. Simplify: remove nodes in order of colourability, and spill candidates optimistically (Briggs, Cooper, Torczon 1994;
   the weights of pairs follow Smith, Ramsey, Holloway 2004).
4. Colour in reverse order, preferring the register of a copy partner.
5. Rematerialise constants without a colour, spill other nodes without a colour to frame slots, and repeat from 1.
"""

from __future__ import annotations

import copy

from toolchain.abi.target import ALLOCATABLE, CALLEE_SAVED, CALLER_SAVED, FP
from toolchain.debuginfo import variables
from toolchain.ir.model import UnsupportedError
from toolchain.mir.function import MFunction
from toolchain.mir.instruction import MI, PairMove, pair_move
from toolchain.mir.liveness import live_out, mask_of, registers_in, remove_dead
from toolchain.mir.operands import FIRST_VIRTUAL
from toolchain.regalloc.spill import rewrite_spills
from toolchain.verify import allocation

WORD_COLOURS = mask_of(list(ALLOCATABLE))
PAIR_COLOURS = mask_of([r for r in ALLOCATABLE if r % 2 == 0 and r < 14])
REAL = (1 << FIRST_VIRTUAL) - 1
LOOP_WEIGHT = 8
EXACT_SPILL_NODES = 300  # maximum number of nodes for which the best spill candidate is recomputed at every step
TRIAL_LIMIT = 400  # maximum number of instructions for several trials; larger functions are allocated once


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


class Colouring:
    """Assignment of real registers to the nodes of a simplified graph."""

    def __init__(self, g: InterferenceGraph) -> None:
        self.g = g
        self.m = g.m
        self.colour: dict[int, int] = {r: r for r in range(FIRST_VIRTUAL)}
        self.used_saved = 0
        self.spilled: list[int] = []
        self.partner: dict[int, list[tuple[int, int]]] = {}
        for low, high in g.m.pair_hints.items():
            a, b = g.find(low), g.find(high)
            self.partner.setdefault(a, []).append((b, -1))
            self.partner.setdefault(b, []).append((a, 1))

    def run(self, order: list[int]) -> None:
        """Colour nodes in the reverse of the order of their removal."""
        for n in reversed(order):
            allowed = self._allowed(n)
            if not allowed:
                self.spilled.append(n)
                continue
            c = self._choose(n, allowed)
            self.colour[n] = c
            self.used_saved |= (1 << c | (2 << c if n in self.m.pairs else 0)) & mask_of(list(CALLEE_SAVED))

    def _allowed(self, n: int) -> int:
        taken = 0
        for t in registers_in(self.g.adjacent[n]):
            c = self.colour.get(t)
            if c is not None:
                taken |= (3 if t in self.m.pairs else 1) << c
        if n in self.m.pairs:
            return PAIR_COLOURS & ~taken & ~(taken >> 1)
        if self.m.uses_fp:
            taken |= 1 << FP
        return WORD_COLOURS & ~taken

    def _choose(self, n: int, allowed: int) -> int:
        votes: dict[int, int] = {}
        for partner, offset in self.g.hints.get(n, ()):
            c = self.colour.get(self.g.find(partner))
            if c is not None and c + offset >= 0 and allowed >> (c + offset) & 1:
                votes[c + offset] = votes.get(c + offset, 0) + 4
        for partner, offset in self.partner.get(n, ()):
            c = self.colour.get(self.g.find(partner))
            if c is not None and c + offset >= 0 and allowed >> (c + offset) & 1 and (c + offset) % 2 == (offset > 0):
                votes[c + offset] = votes.get(c + offset, 0) + 3
        if votes:
            best = max(votes, key=lambda c: (votes[c], -self._fresh(c), -c))
            if not self._fresh(best) or votes[best] > 3:
                return best
        return self._best(n, allowed)

    def _fresh(self, c: int) -> int:
        """1 if the function would have to save the register only because of this node, else 0."""
        return int(c in CALLEE_SAVED and not self.used_saved >> c & 1)

    def _best(self, n: int, allowed: int) -> int:
        """The cheapest register: preferably one that need not be saved, with the parity that a pair hint requires."""
        registers = registers_in(allowed)
        if self.m.interrupt:
            return registers[0]
        partners = self.partner.get(n)
        low = partners is not None and partners[0][1] < 0
        best, least = -1, (3, 0, 0)
        for c in registers:
            mismatch = int(partners is not None and (c % 2 == 0) != low)
            order = 7 - c if partners is None and c in CALLER_SAVED else c
            rank = (self._fresh(c) * (1 + (c == 14)), mismatch, order)
            if rank < least:
                best, least = c, rank
        return best


def allocate(m: MFunction, for_size: bool, verify: bool = False) -> MFunction:
    """Replace virtual registers by W0-W14 and return the function.

    In the result, every pair is an even register and the next one, and pair moves are expanded to word moves.

    Coalescing with argument and result registers usually helps, but may leave too few registers for other values. Small
    functions are therefore allocated three times, with it, without it, and with it and `thorough` (see `coalesce`).
    The cheapest result is returned. If the first one has no moves and no saved registers, the others are omitted.
    """
    remove_dead(m)
    size = sum(len(b.insts) for b in m.blocks)
    if size > TRIAL_LIMIT:
        _allocate(m, True, False, verify)
        return m
    trials = []
    untouched = InterferenceGraph(m)
    for number, (eager, thorough) in enumerate(((True, False), (False, False), (True, True))):
        trial = m.clone()
        _allocate(trial, eager, thorough, verify, untouched.of_copy(trial))
        trials.append((_cost(trial, for_size), number, trial))
        if not number and not _is_improvable(trial):
            return trial
    return min(trials, key=lambda t: t[:2])[2]


def _allocate(m: MFunction, eager: bool, thorough: bool, verify: bool, first: InterferenceGraph | None = None) -> None:
    """Allocate in place. `first` is the graph of the first round, if it is known.

    Every round spills at least one register of the program and none of the spill code, so the iteration terminates."""
    while True:
        g, first = first or InterferenceGraph(m), None
        g.coalesce(eager, thorough)
        colouring = Colouring(g)
        colouring.run(g.simplify())
        if not colouring.spilled:
            if verify:
                allocation.check(m, {r: colouring.colour[g.find(r)] for r in [*g.adjacent, *g.alias]})
            _apply(m, g, colouring.colour)
            return
        groups = {n: list(members_of(g, n)) for n in colouring.spilled}
        if m.temps.issuperset(r for group in groups.values() for r in group):
            raise _no_room(m, {r for group in groups.values() for r in group})
        rewrite_spills(m, groups)


def _no_room(m: MFunction, registers: set[int]) -> UnsupportedError:
    """Error for an instruction whose operands need too many registers; only inline assembly can have so many."""
    wanting = [mi for b in m.blocks for mi in b.insts if registers & {*mi.uses(), *mi.defs()}]
    crowded = next((mi for mi in wanting if mi.op == "asm"), None)
    if crowded is None:
        return UnsupportedError("register allocation does not converge")
    error = UnsupportedError("inline assembly: its operands and clobbers need more registers than the CPU has")
    error.line = crowded.line
    return error


def _is_improvable(m: MFunction) -> bool:
    """Whether an allocation contains copies or writes callee-saved registers, which another trial may avoid."""
    return any(mi.is_copy() or any(r in CALLEE_SAVED for r in mi.defs()) for b in m.blocks for mi in b.insts)


def _cost(m: MFunction, for_size: bool) -> int:
    """Cost of an allocation: words, including saves of registers, weighted by loop depth unless `for_size`."""
    saved: set[int] = set()
    total = 0
    for b in m.blocks:
        weight = 1 if for_size else LOOP_WEIGHT ** min(b.depth, 3)
        total += weight * sum(mi.info.words for mi in b.insts)
        for mi in b.insts:
            saved.update(r for r in mi.defs() if r in CALLEE_SAVED)
    return total + 2 * len({r // 2 for r in saved})


def members_of(g: InterferenceGraph, n: int) -> list[int]:
    """Virtual registers merged into node n."""
    return [r for r in [n, *g.alias] if r >= FIRST_VIRTUAL and g.find(r) == n]


def _apply(m: MFunction, g: InterferenceGraph, colour: dict[int, int]) -> None:
    """Rename registers to their colours, expand pair moves and drop copies of a register to itself."""
    rename = {r: colour[g.find(r)] for r in [*g.adjacent, *g.alias] if g.find(r) in colour}
    if m.bindings:
        variables.attach_claims(m, rename, {r: g.find(r) for r in rename})
    for b in m.blocks:
        out: list[MI] = []
        dropped: dict[int, int] = {}  # values that the removed copies would have written
        for mi in b.insts:
            mi.map_registers(rename)
            start = len(out)
            move = pair_move(mi)
            if move is not None:
                out += _word_moves(move, mi.line)
            elif mi.is_copy() and mi.args[0] == mi.args[1]:
                dropped.update(mi.written_values)
                continue
            else:
                out.append(mi)
            if mi.written_values and move is not None:
                writer = {d: made for made in out[start:] for d in made.defs()}
                for r, value in mi.written_values.items():
                    (writer[r].written_values if r in writer else dropped)[r] = value
            elif dropped and len(out) > start:
                out[start].values_before, dropped = dropped, {}
        b.insts = out
    m.pairs = set()


def _word_moves(move: PairMove, line: str | None) -> list[MI]:
    """Word moves with the effect of a pair move, in an order that overwrites no source; EXCH for a swap."""
    moves = []
    for offset, word in enumerate(move.words):
        source, dest = (word, move.pair + offset) if move.into_pair else (move.pair + offset, word)
        if source != dest:
            moves.append((source, dest))
    if len(moves) == 2:
        (s0, d0), (s1, d1) = moves
        if d0 == s1 and d1 == s0:
            return [MI("exch", s0, s1, line=line)]
        if d0 == s1:
            moves.reverse()
    return [MI("mov", s, d, line=line) for s, d in moves]
