"""Register allocation: graph colouring with conservative coalescing, pairs and rematerialisation.

Terms. Nodes are registers; W0-W14 are nodes with their own colour. Two nodes interfere if one is written while the
other is live. A word node may take any of W0-W14, a pair node an even register below W14 and the next register.

Method. Steps 1 to 3 are in interference.py.
1. Build the interference graph.
2. Coalesce copies if the merged node stays colourable: Briggs' test for two virtual registers, George's test for a
   precoloured node. One of the trials uses George's test for virtual registers, too.
3. Simplify: remove nodes in order of colourability, and spill candidates optimistically (Briggs, Cooper, Torczon 1994;
   the weights of pairs follow Smith, Ramsey, Holloway 2004).
4. Colour in reverse order, preferring the register of a copy partner.
5. Rematerialise constants without a colour, spill other nodes without a colour to frame slots, and repeat from 1.
"""

from __future__ import annotations

from toolchain.abi.target import ALLOCATABLE, CALLEE_SAVED, CALLER_SAVED, FP
from toolchain.debuginfo import variables
from toolchain.ir.model import UnsupportedError
from toolchain.mir.function import MFunction
from toolchain.mir.instruction import MI, PairMove, pair_move
from toolchain.mir.liveness import mask_of, registers_in, remove_dead
from toolchain.mir.operands import FIRST_VIRTUAL
from toolchain.regalloc.interference import LOOP_WEIGHT, InterferenceGraph
from toolchain.regalloc.spill import rewrite_spills
from toolchain.verify import allocation

WORD_COLOURS = mask_of(list(ALLOCATABLE))
PAIR_COLOURS = mask_of([r for r in ALLOCATABLE if r % 2 == 0 and r < 14])
TRIAL_LIMIT = 400  # maximum number of instructions for several trials; larger functions are allocated once


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
        groups = {n: g.members_of(n) for n in colouring.spilled}
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
