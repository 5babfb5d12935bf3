"""Instruction selection: legal IR to machine form over virtual registers.

The selector visits the instructions of a block from the last to the first. It emits code for an instruction that has an
effect or whose registers a later instruction has requested. A later instruction may fold an earlier one instead: a load
into an ALU operand, an addition into an address, a comparison into a branch.
Needs: legal IR, critical edges split, no switch. Ensures: virtual registers, copies instead of phis.
"""

from __future__ import annotations

from collections.abc import Callable

from toolchain.ir.cfg import loop_depths, predecessors
from toolchain.ir.model import Block, ConstInt, DbgRecord, Instr, Undef, UnsupportedError, Value
from toolchain.mir.function import CONSTANT_WORD, OPTIMISED_OUT, MBlock, MFunction
from toolchain.mir.instruction import MI
from toolchain.select import arith, block_copies, calls, compare, conditional, memory, multiply, shifts
from toolchain.select.context import SelectionContext


class FunctionSelector(SelectionContext):
    """Selects one function; handles terminators and phis."""

    # -- function -----------------------------------------------------------------------------------------------------

    def run(self) -> MFunction:
        """Return the machine form of the function."""
        self._find_two_stage_blocks()
        calls.incoming(self)
        code = {block.name: self._select_block(block) for block in self.f.blocks}
        depths = loop_depths(self.f)
        for block in self.f.blocks:
            mb = MBlock(block.name, [], block.succs, depths[block.name], block.name in self.taken)
            mb.insts = [*self._entry_code(block), *code[block.name]]
            self.m.blocks.append(mb)
        self.m.slot_of = dict(self.slots)
        self._bind_variables()
        return self.m

    def _find_two_stage_blocks(self) -> None:
        """Find the successors of indirectbr, whose phis are copied twice because the edges cannot be split."""
        preds = predecessors(self.f)
        ends = {b.name: b.instrs[-1].op for b in self.f.blocks}
        for b in self.f.blocks:
            if any(ends[p] == "indirectbr" for p in preds[b.name]):
                self.two_stage.add(b.name)

    def _select_block(self, block: Block) -> list[MI]:
        """Select the instructions of a block from the last to the first; return their code in order."""
        self.block = block
        chunks: list[list[MI]] = []
        for i in reversed(block.instrs):
            self.out = []
            self.line = i.line
            try:
                self.instruction(i)
            except UnsupportedError as e:
                e.line = i.line
                raise
            chunks.append(self.out)
        return [mi for chunk in reversed(chunks) for mi in chunk]

    def _entry_code(self, block: Block) -> list[MI]:
        """Code at the start of a block: moves of parameters in the first block, copies of phis after an indirectbr."""
        code: list[MI] = []
        if block is self.f.blocks[0]:
            self.out = []
            self.line = None
            calls.receive(self)
            code += self.out
        if block.name in self.two_stage:
            self.out = []
            for phi in block.phis():
                if id(phi) in self.needed:
                    for source, dest in zip(self.phi_input(phi), self.value_regs(phi), strict=True):
                        self.copy(source, dest)
            code += self.out
        return code

    def _bind_variables(self) -> None:
        """Record the locations of source variables for every debug record."""
        for k, record in enumerate(self.f.dbg_records):
            slot = self.slots.get(id(record.value)) if record.kind == "memory" else None
            found = (-1 - slot,) if slot is not None else self._words_of(record)
            if found:
                self.m.bindings[k] = (record.variable, found)

    def _words_of(self, record: DbgRecord) -> tuple[int, ...]:
        """Words of a variable (`mir.VariableLocation`); empty if its location is unknown."""
        if record.kind == "parameter":
            return tuple(self.registers.get(id(word), (OPTIMISED_OUT,))[0] for word in record.words)
        if record.kind == "returned":
            return tuple(self.registers.get(id(record.value), ()))
        if record.kind != "dbg_value" or record.expression:
            return ()
        if isinstance(record.value, ConstInt):
            words = max(1, record.value.type.bits // 16)
            return tuple(CONSTANT_WORD + (record.value.value >> 16 * k & 0xFFFF) for k in range(words))
        return tuple(self.registers.get(id(record.value), ()))

    def phi_input(self, phi: Instr) -> tuple[int, ...]:
        """Registers that predecessors write for a phi: its own, or separate ones after an indirectbr."""
        if self.position[id(phi)][0] not in self.two_stage:
            return self.value_regs(phi)
        if id(phi) not in self.phi_inputs:
            self.phi_inputs[id(phi)] = tuple(self.temp() for _ in self.value_regs(phi))
        return self.phi_inputs[id(phi)]

    def instruction(self, i: Instr) -> None:
        """Select one instruction if it has an effect or its value is used."""
        if id(i) in self.folded:
            return
        if i.op in SIDE_EFFECTS or i.volatile or id(i) in self.needed:
            HANDLERS[i.op](self, i)

    # -- terminators --------------------------------------------------------------------------------------------------

    def phi_copies(self, targets: list[str]) -> list[tuple[int, int | tuple[Value, int]]]:
        """Moves (destination, source register or word of a leaf) of phis on the edges to `targets`."""
        moves: list[tuple[int, int | tuple[Value, int]]] = []
        for target in targets:
            for phi in self.by_name[target].phis():
                if id(phi) not in self.needed:
                    continue
                v = phi.args[phi.blocks.index(self.block.name)]
                if isinstance(v, Undef):
                    continue
                dest = self.phi_input(phi)
                if self.is_leaf(v):
                    moves += [(d, (v, k)) for k, d in enumerate(dest)]
                else:
                    moves += [(d, s) for d, s in zip(dest, self.value_regs(v), strict=True) if d != s]
        return moves

    def parallel_copy(self, moves: list[tuple[int, int | tuple[Value, int]]]) -> None:
        """Emit parallel moves: registers first, cycles through a temporary register, constants last."""
        pending = {d: s for d, s in moves if isinstance(s, int)}
        while pending:
            sources = set(pending.values())
            ready = [d for d in pending if d not in sources]
            if not ready:
                d = next(iter(pending))
                t = self.temp()
                self.emit("mov", pending[d], t)
                pending[d] = t
                continue
            for d in ready:
                self.emit("mov", pending.pop(d), d)
        for d, s in moves:
            if not isinstance(s, int):
                self.load_leaf(s[0], s[1], d)


def select_br(s: FunctionSelector, i: Instr) -> None:
    """Select an unconditional branch, or a comparison and conditional branch."""
    if not i.args:
        s.parallel_copy(s.phi_copies(i.blocks))
        s.emit("jump", i.blocks[0])
        return
    cc = compare.condition(s, i.args[0], i)
    s.emit("bra", i.blocks[0], cc=cc)
    s.emit("jump", i.blocks[1])


def select_brtable(s: FunctionSelector, i: Instr) -> None:
    """Select BRA Wn into a table of BRA instructions (isa.md §7.1: the offset counts instruction words)."""
    s.m.tables.append((s.block.name, list(i.blocks)))
    s.emit("brtable", s.reg(i.args[0]), str(len(s.m.tables) - 1))


def select_indirectbr(s: FunctionSelector, i: Instr) -> None:
    """Select a GNU computed goto, through a handle."""
    r = s.reg(i.args[0])
    s.parallel_copy(s.phi_copies(list(dict.fromkeys(i.blocks))))
    s.emit("jumpr", r)


def select_unreachable(s: FunctionSelector, i: Instr) -> None:
    """Select RESET: the block is never executed, but a function needs at least one instruction."""
    s.emit("text", "reset")


def select_phi(s: FunctionSelector, i: Instr) -> None:
    """Emit no code: predecessors copy values into the registers of phis."""
    s.value_regs(i)


def select_no_code(s: FunctionSelector, i: Instr) -> None:
    """Emit no code: the users of a slot compute its address."""


def select_cast_alias(s: FunctionSelector, i: Instr) -> None:
    """Select trunc and bits: reuse the registers of the operand's low words, or load a leaf into new registers."""
    if s.is_leaf(i.args[0]):
        for k, r in enumerate(s.value_regs(i)):
            s.load_leaf(i.args[0], k, r)
    else:
        s.value_regs(i)


SIDE_EFFECTS = frozenset((
    "store", "loadpair", "storepair", "call", "asm", "builtin", "blockcopy", "blockfill", "setsp", "dynalloca", "br",
    "brtable", "indirectbr", "ret", "unreachable",
))  # fmt: skip
HANDLERS: dict[str, Callable[[FunctionSelector, Instr], None]] = {
    "br": select_br,
    "brtable": select_brtable,
    "indirectbr": select_indirectbr,
    "unreachable": select_unreachable,
    "phi": select_phi,
    "slot": select_no_code,
    "trunc": select_cast_alias,
    "bits": select_cast_alias,
    **arith.HANDLERS,
    **multiply.HANDLERS,
    **shifts.HANDLERS,
    **conditional.HANDLERS,
    **compare.HANDLERS,
    **memory.HANDLERS,
    **block_copies.HANDLERS,
    **calls.HANDLERS,
}
