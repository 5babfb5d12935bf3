"""Instruction selection: legal IR -> machine form over virtual registers.

Every block is walked from its end. An instruction emits code only when it has an effect or somebody asked for its
registers; whoever asks may instead fold it (a load into an ALU operand, an addition into an address, a comparison into
a branch). Code of one IR instruction is collected in order in `out` and put before what is already there.
Needs: legal IR, critical edges split, no switch. Ensures: machine form with virtual registers, phis turned into copies.
"""

from __future__ import annotations

from collections.abc import Callable

from ..ir.model import (
    I1,
    Arg,
    Block,
    BlockAddress,
    ConstInt,
    Function,
    GlobalRef,
    Instr,
    Module,
    Undef,
    UnsupportedError,
    Value,
)
from ..target import BYTE_OFFSET, WORD_OFFSET
from . import arith, calls, compare, memory
from .abi import Place
from .cfg import loop_depths, predecessors
from .data import is_near
from .mir import MI, File, FrameObject, Imm, MBlock, Mem, MFunction, Operand, Slot
from .names import block_label, symbol

FAR_FRAME_BYTES = 380  # above this, locals are reached through computed addresses (offset limits, isa.md §3.2)


def words_of(v: Value) -> int:
    """Machine words a legal value occupies."""
    return max(1, v.type.bits // 16)


class Selector:
    """State of one function's selection."""

    def __init__(self, module: Module, f: Function, for_size: bool, taken: set[str]) -> None:
        self.module = module
        self.f = f
        self.for_size = for_size
        self.taken = taken
        self.m = MFunction(f.name)
        self.out: list[MI] = []
        self.line: str | None = None
        self.registers: dict[int, tuple[int, ...]] = {}
        self.needed: set[int] = set()  # instructions that must emit code
        self.wanted: set[int] = set()  # values whose own registers somebody reads
        self.users: dict[int, list[Instr]] = {}
        self.position: dict[int, tuple[str, int]] = {}
        self.epoch: dict[int, int] = {}
        self.folded: set[int] = set()
        self.slots: dict[int, int] = {}
        self.block: Block = f.blocks[0]
        self.variadic_anchor = 0
        self.places: list[Place] = []
        self.arg_slots: dict[int, int] = {}
        self.phi_inputs: dict[int, tuple[int, ...]] = {}
        self.two_stage: set[str] = set()
        self._index()

    # -- analysis -----------------------------------------------------------------------------------------------------

    def _index(self) -> None:
        """Positions, users, memory epochs, frame slots, values used outside their block."""
        total = 0
        for block in self.f.blocks:
            epoch = 0
            for at, i in enumerate(block.instrs):
                self.position[id(i)] = (block.name, at)
                self.epoch[id(i)] = epoch
                if i.op in MEMORY_BARRIERS or i.volatile:
                    epoch += 1
                for a in i.args:
                    if isinstance(a, Instr | Arg):
                        self.users.setdefault(id(a), []).append(i)
                if i.op == "slot":
                    size = i.extra["size"]
                    assert isinstance(size, int)
                    self.slots[id(i)] = self.new_slot(size)
                    total += size
        self.far_frame = total > FAR_FRAME_BYTES
        for block in self.f.blocks:
            for i in block.instrs:
                for k, a in enumerate(i.args):
                    if isinstance(a, Instr):
                        home = i.blocks[k] if i.op == "phi" else block.name
                        if a.op == "phi" or self.position[id(a)][0] != home:
                            self.needed.add(id(a))
                            self.wanted.add(id(a))

    def new_slot(self, size: int, fixed: int | None = None) -> int:
        """Add an object to the frame."""
        self.m.frame.append(FrameObject(max(size, 1), fixed))
        return len(self.m.frame) - 1

    def single_use(self, v: Value) -> bool:
        """Whether the value has exactly one user."""
        return len(self.users.get(id(v), ())) == 1

    def same_block(self, v: Instr) -> bool:
        """Whether an instruction sits in the block being selected."""
        found = self.position.get(id(v))
        return found is not None and found[0] == self.block.name

    # -- emission -----------------------------------------------------------------------------------------------------

    def emit(self, op: str, *args: Operand, byte: bool = False, cc: str = "") -> MI:
        """Append one machine instruction to the current chunk."""
        mi = MI(op, *args, byte=byte, cc=cc, line=self.line)
        self.out.append(mi)
        return mi

    def copy(self, source: int, dest: int) -> None:
        """Register move; coalescing removes most of them."""
        if source != dest:
            self.emit("mov", source, dest)

    def temp(self) -> int:
        """A fresh one-word register."""
        return self.m.new_register()

    # -- values to registers ------------------------------------------------------------------------------------------

    def regs(self, v: Value) -> tuple[int, ...]:
        """Registers that hold the words of a value, low word first; constants are loaded here and now."""
        if (isinstance(v, Instr) and v.op != "slot") or (isinstance(v, Arg) and id(v) not in self.slots):
            return self.value_regs(v)
        return tuple(self.leaf_word(v, k) for k in range(words_of(v)))

    def value_regs(self, v: Value) -> tuple[int, ...]:
        """Registers of a non-constant value, marking it as needed."""
        found = self.registers.get(id(v))
        if found is None:
            found = self._assign(v)
            self.registers[id(v)] = found
        self.needed.add(id(v))
        self.wanted.add(id(v))
        if (isinstance(v, Instr) and v.op in ("trunc", "bits")) or self._is_bool_zext(v):
            assert isinstance(v, Instr)
            self.value_regs(v.args[0])
        return found

    def _assign(self, v: Value) -> tuple[int, ...]:
        """Choose registers: aliases for truncations and clean booleans, fresh ones otherwise."""
        if isinstance(v, Instr):
            source = v.args[0] if v.args else None
            if v.op in ("trunc", "bits") and isinstance(source, Instr | Arg) and id(source) not in self.slots:
                return self.value_regs(source)[: words_of(v)]
            if self._is_bool_zext(v):
                assert source is not None
                low = self.value_regs(source)
                return (*low, *(self.temp() for _ in range(words_of(v) - 1)))
            if v.op in ("zext", "sext") and isinstance(source, Instr | Arg) and id(source) not in self.slots:
                if source.type.bits >= 16:
                    low = self.value_regs(source)
                    return (*low, *(self.temp() for _ in range(words_of(v) - len(low))))
        made = tuple(self.temp() for _ in range(words_of(v)))
        for k in range(0, len(made) - 1, 2):
            self.m.pair_hints[made[k]] = made[k + 1]
        return made

    @staticmethod
    def _is_bool_zext(v: Value) -> bool:
        return isinstance(v, Instr) and v.op == "zext" and v.args[0].type is I1 and isinstance(v.args[0], Instr | Arg)

    def reg(self, v: Value) -> int:
        """Register of a one-word value."""
        return self.regs(v)[0]

    def leaf_word(self, v: Value, k: int) -> int:
        """Load word k of a constant, symbol or frame address into a fresh register."""
        r = self.temp()
        self.load_leaf(v, k, r)
        return r

    def load_leaf(self, v: Value, k: int, r: int) -> None:
        """Load word k of a constant, symbol or frame address into a register. Leaves the flags alone except for lea."""
        if isinstance(v, ConstInt):
            self.load_imm(v.value >> 16 * k & 0xFFFF, r, v.type.bits == 8)
        elif isinstance(v, Undef):
            self.emit("clr", r)
        elif id(v) in self.slots:
            self.emit("lea", Slot(self.slots[id(v)]), r)
        elif isinstance(v, GlobalRef | BlockAddress):
            self.emit("mov", Imm(self.address_expr(v)), r)
        else:
            raise UnsupportedError(f"constant {v!r}")

    def load_imm(self, k: int, r: int, byte: bool = False) -> None:
        """Load a 16-bit number. Bytes leave the upper half undefined, so the shortest word form serves."""
        if k == 0:
            self.emit("clr", r)
        elif k == 0xFFFF:
            self.emit("setm", r)
        else:
            self.emit("mov", Imm(k), r)

    def address_expr(self, v: Value) -> str:
        """Assembler expression for the 16-bit address of a symbol."""
        if isinstance(v, BlockAddress):
            return f"handle({block_label(v.function, v.block)})"
        assert isinstance(v, GlobalRef)
        name = symbol(self.module, v.name)
        if v.name in self.module.functions:
            return f"handle({name})"
        offset = v.offset - 0x10000 if v.offset >= 0x8000 else v.offset
        return f"{name}{offset:+d}" if offset else name

    def is_leaf(self, v: Value) -> bool:
        """Values without a register of their own: loaded at every use."""
        return not isinstance(v, Instr | Arg) or id(v) in self.slots

    # -- addresses ----------------------------------------------------------------------------------------------------

    def decompose(self, p: Value) -> tuple[Value, int]:
        """Pointer = base + constant, looking through additions that exist only for addressing."""
        offset = 0
        while (
            isinstance(p, Instr)
            and p.op == "add"
            and isinstance(p.args[1], ConstInt)
            and (self.address_only(p) or self.is_leaf(p.args[0]))
        ):
            offset += p.args[1].signed
            p = p.args[0]
        return p, offset

    def address_only(self, p: Instr) -> bool:
        """Whether a sum is used by loads and stores (as their address) only."""
        for user in self.users.get(id(p), ()):
            if user.op == "load":
                continue
            if user.op == "store" and user.args[1] is p and user.args[0] is not p:
                continue
            if (
                user.op == "add"
                and user.args[0] is p
                and isinstance(user.args[1], ConstInt)
                and self.address_only(user)
            ):
                continue
            return False
        return True

    def address(self, p: Value, byte: bool, extra: int = 0, count: int = 1) -> Operand:
        """Operand for a MOV at p + extra, usable for `count` words by `step`. File only for words and near bytes."""
        base, offset = self.decompose(p)
        offset += extra
        if isinstance(base, GlobalRef):
            ref = GlobalRef(base.name, base.offset + offset)
            if base.name not in self.module.functions:
                near = is_near(self.module, base.name)
                constant = self._constant_global(base.name)
                if near or (not byte and not constant):
                    return File(self.address_expr(ref), near)
            r = self.temp()
            self.emit("mov", Imm(self.address_expr(ref)), r)
            return Mem("ind", r)
        if isinstance(base, ConstInt):
            at = base.value + offset & 0xFFFF
            if at < 0x2000 or (not byte and not at & 1):
                return File(f"0x{at:04X}", at < 0x2000)
            r = self.temp()
            self.load_imm(at, r)
            return Mem("ind", r)
        if id(base) in self.slots:
            if not self.far_frame:
                return Slot(self.slots[id(base)], offset)
            r = self.temp()
            self.emit("lea", Slot(self.slots[id(base)], offset), r)
            return Mem("ind", r)
        if count == 1 and offset == 0 and isinstance(base, Instr) and base.op == "add" and self.address_only(base):
            if not isinstance(base.args[1], ConstInt):
                return Mem("idx", self.reg(base.args[0]), self.reg(base.args[1]))
        return self.offset_operand(self.reg(base), offset, byte)

    def _constant_global(self, name: str) -> bool:
        var = self.module.globals.get(name)
        return var is not None and var.constant

    def offset_operand(self, base: int, offset: int, byte: bool) -> Operand:
        """[base+offset], computing the sum when the offset is out of reach."""
        if offset == 0:
            return Mem("ind", base)
        low, high = BYTE_OFFSET if byte else WORD_OFFSET
        if low <= offset <= high and (byte or not offset & 1):
            return Mem("off", base, offset)
        r, k = self.temp(), self.temp()
        self.emit("mov", Imm(offset & 0xFFFF), k)
        self.emit("add", base, k, r)
        return Mem("ind", r)

    def foldable_load(self, v: Value, user: Instr) -> Instr | None:
        """The load that defines `v`, when it may move down to its only user.

        The user may be selected twice, as a sum folded into an address and for its own sake; then the register that
        was asked for first decides.
        """
        if not isinstance(v, Instr) or v.op != "load" or not self.single_use(v) or not self.same_block(v):
            return None
        if id(v) in self.wanted:
            return None
        if not self.same_block(user):
            return None
        start = self.epoch[id(v)] + (1 if v.volatile else 0)
        return v if start == self.epoch[id(user)] else None

    def source(self, v: Value, user: Instr) -> Operand:
        """Operand for the Ws position of an ALU instruction: a register, or [Wn] when a load folds."""
        load = self.foldable_load(v, user)
        if load is not None and load.type.bits in (8, 16) and not load.volatile:
            base, offset = self.decompose(load.args[0])
            plain = not self.is_leaf(base) and offset == 0
            if plain and not (isinstance(base, Instr) and base.op == "add" and self.address_only(base)):
                self.folded.add(id(load))
                return Mem("ind", self.reg(base))
        return self.reg(v)

    def near_operand(self, v: Value, user: Instr) -> File | None:
        """Near address of a load that may fold into `user` as a file-register operand."""
        load = self.foldable_load(v, user)
        if load is None or load.type.bits not in (8, 16):
            return None
        base, _ = self.decompose(load.args[0])
        if not self.is_leaf(base) or id(base) in self.slots:
            return None
        mark = len(self.out)
        operand = self.address(load.args[0], load.type.bits == 8)
        if isinstance(operand, File) and operand.near:
            self.folded.add(id(load))
            return operand
        del self.out[mark:]
        return None

    # -- function -----------------------------------------------------------------------------------------------------

    def run(self) -> MFunction:
        """Select the whole function."""
        f = self.f
        depths = loop_depths(f)
        preds = predecessors(f)
        ends = {b.name: b.instrs[-1].op for b in f.blocks}
        for b in f.blocks:
            if any(ends[p] == "indirectbr" for p in preds[b.name]):
                self.two_stage.add(b.name)
        calls.incoming(self)
        bodies: dict[str, list[list[MI]]] = {}
        for block in f.blocks:
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
                if self.out:
                    chunks.append(self.out)
            bodies[block.name] = chunks
        for block in f.blocks:
            mb = MBlock(block.name, [], block.succs, depths[block.name], block.name in self.taken)
            if block is f.blocks[0]:
                self.out = []
                self.line = None
                calls.receive(self)
                mb.insts += self.out
            if block.name in self.two_stage:
                self.out = []
                for phi in block.phis():
                    if id(phi) in self.needed:
                        for source, dest in zip(self.phi_input(phi), self.value_regs(phi), strict=True):
                            self.copy(source, dest)
                mb.insts += self.out
            for chunk in reversed(bodies[block.name]):
                mb.insts += chunk
            self.m.blocks.append(mb)
        self.m.slot_of = dict(self.slots)
        for record in self.f.dbg_records:
            found = (
                self.registers.get(id(record.value)) if record.kind == "dbg_value" and not record.expression else None
            )
            if found is not None:
                self.m.in_registers.append((record.variable, found))
        return self.m

    def phi_input(self, phi: Instr) -> tuple[int, ...]:
        """Registers predecessors write for a phi: its own, or separate ones below an indirectbr."""
        if self.position[id(phi)][0] not in self.two_stage:
            return self.value_regs(phi)
        if id(phi) not in self.phi_inputs:
            self.phi_inputs[id(phi)] = tuple(self.temp() for _ in self.value_regs(phi))
        return self.phi_inputs[id(phi)]

    def instruction(self, i: Instr) -> None:
        """Emit one instruction if its effect or its value is wanted."""
        if id(i) in self.folded:
            return
        if i.op in EFFECTS or i.volatile or id(i) in self.needed:
            SELECT[i.op](self, i)

    def result(self, i: Instr) -> int:
        """Register of a one-word result."""
        return self.value_regs(i)[0]

    # -- terminators --------------------------------------------------------------------------------------------------

    def phi_copies(self, targets: list[str]) -> list[tuple[int, int | tuple[Value, int]]]:
        """Moves (destination, source register or leaf word) for the edges to `targets`."""
        blocks = {b.name: b for b in self.f.blocks} if targets else {}
        moves: list[tuple[int, int | tuple[Value, int]]] = []
        for target in targets:
            for phi in blocks[target].phis():
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
        """Perform moves as if at once: registers first, cycles through a temporary, constants last."""
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


def select_br(s: Selector, i: Instr) -> None:
    """Branches; a comparison used here becomes CP and a condition."""
    if not i.args:
        s.parallel_copy(s.phi_copies(i.blocks))
        s.emit("jump", i.blocks[0])
        return
    cc = compare.condition(s, i.args[0], i)
    s.emit("bra", i.blocks[0], cc=cc)
    s.emit("jump", i.blocks[1])


def select_brtable(s: Selector, i: Instr) -> None:
    """BRA Wn into a table of BRA instructions (isa.md §7.1: the offset counts instruction words)."""
    s.m.tables.append((s.block.name, list(i.blocks)))
    s.emit("brtable", s.reg(i.args[0]), str(len(s.m.tables) - 1))


def select_indirectbr(s: Selector, i: Instr) -> None:
    """GNU computed goto through a handle."""
    r = s.reg(i.args[0])
    s.parallel_copy(s.phi_copies(list(dict.fromkeys(i.blocks))))
    s.emit("jumpr", r)


def select_unreachable(s: Selector, i: Instr) -> None:
    """Nothing: control never comes here. An empty function still needs a word, so a reset stands for it."""
    s.emit("text", "reset")


def select_phi(s: Selector, i: Instr) -> None:
    """Phis emit nothing here; predecessors copy into their registers."""
    s.value_regs(i)


def select_nothing(s: Selector, i: Instr) -> None:
    """slot, and aliases whose registers are those of their operand."""


def select_cast_alias(s: Selector, i: Instr) -> None:
    """trunc and bits: alias of the low words, or a leaf loaded into fresh registers."""
    if s.is_leaf(i.args[0]):
        for k, r in enumerate(s.value_regs(i)):
            s.load_leaf(i.args[0], k, r)
    else:
        s.value_regs(i)


MEMORY_BARRIERS = frozenset(("store", "call", "asm", "builtin", "blockcopy", "blockfill", "setsp", "dynalloca"))
EFFECTS = frozenset((
    "store", "call", "asm", "builtin", "blockcopy", "blockfill", "setsp", "dynalloca", "br", "brtable", "indirectbr",
    "ret", "unreachable",
))  # fmt: skip
SELECT: dict[str, Callable[[Selector, Instr], None]] = {
    "br": select_br,
    "brtable": select_brtable,
    "indirectbr": select_indirectbr,
    "unreachable": select_unreachable,
    "phi": select_phi,
    "slot": select_nothing,
    "trunc": select_cast_alias,
    "bits": select_cast_alias,
    **arith.SELECT,
    **compare.SELECT,
    **memory.SELECT,
    **calls.SELECT,
}
