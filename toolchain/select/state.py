"""Selection state of one function: uses of values, registers of values, emission of instructions."""

from __future__ import annotations

from toolchain.abi.arguments import ArgumentLocation
from toolchain.abi.names import block_label, symbol
from toolchain.ir.model import (
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
from toolchain.mir.function import FrameObject, MFunction
from toolchain.mir.instruction import MI
from toolchain.mir.operands import FrameSlot, Imm, Operand

FAR_FRAME_BYTES = 380  # maximum bytes of locals addressed by offsets (offset limits, isa.md §3.2)


def words_of(v: Value) -> int:
    """Number of machine words of a legal value."""
    return max(1, v.type.bits // 16)


MEMORY_BARRIERS = frozenset(
    ("store", "loadpair", "storepair", "call", "asm", "builtin", "blockcopy", "blockfill", "setsp", "dynalloca")
)


class SelectionState:
    """Values and registers of one function, and the machine instructions selected so far."""

    def __init__(self, module: Module, f: Function, for_size: bool, taken: set[str]) -> None:
        self.module = module
        self.f = f
        self.for_size = for_size
        self.taken = taken
        self.m = MFunction(f.name)
        self.out: list[MI] = []
        self.line: str | None = None
        self.registers: dict[int, tuple[int, ...]] = {}
        self.needed: set[int] = set()  # instructions whose value is used, so that code is emitted for them
        self.register_values: set[int] = set()  # values whose registers are read
        self.users: dict[int, list[Instr]] = {}
        self.position: dict[int, tuple[str, int]] = {}
        self.epoch: dict[int, int] = {}
        self.access: dict[int, int] = {}  # numbers of the volatile loads and stores
        self.folded: set[int] = set()
        self.slots: dict[int, int] = {}
        self.block: Block = f.blocks[0]
        self.by_name = {b.name: b for b in f.blocks}
        self.variadic_anchor = 0
        self.parameters: list[ArgumentLocation] = []
        self.arg_slots: dict[int, int] = {}
        self.phi_inputs: dict[int, tuple[int, ...]] = {}
        self.two_stage: set[str] = set()
        self._index()

    # -- analysis -----------------------------------------------------------------------------------------------------

    def _index(self) -> None:
        """Compute positions, users, memory epochs, frame slots, and values used outside their block."""
        total = 0
        for block in self.f.blocks:
            epoch = 0
            for at, i in enumerate(block.instrs):
                self.position[id(i)] = (block.name, at)
                self.epoch[id(i)] = epoch
                if i.volatile or i.op in ("loadpair", "storepair"):
                    self.access[id(i)] = len(self.access) + 1
                if i.op in MEMORY_BARRIERS or i.volatile:
                    epoch += 1
                for a in i.args:
                    if isinstance(a, Instr | Arg):
                        self.users.setdefault(id(a), []).append(i)
                if i.op == "slot":
                    size = i.extra["size"]
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
                            self.register_values.add(id(a))

    def new_slot(self, size: int, fixed: int | None = None) -> int:
        """Add an object to the frame and return its number."""
        self.m.frame.append(FrameObject(max(size, 1), fixed))
        return len(self.m.frame) - 1

    def access_number(self, i: Instr | None) -> int:
        """Number of a volatile load or store; 0 for other instructions and None."""
        return self.access.get(id(i), 0)

    def single_use(self, v: Value) -> bool:
        """Whether the value has exactly one user."""
        return len(self.users.get(id(v), ())) == 1

    def same_block(self, v: Instr) -> bool:
        """Whether an instruction belongs to the block that is being selected."""
        found = self.position.get(id(v))
        return found is not None and found[0] == self.block.name

    # -- emission -----------------------------------------------------------------------------------------------------

    def emit(self, op: str, *args: Operand, byte: bool = False, cc: str = "") -> MI:
        """Append a machine instruction to the code of the current IR instruction."""
        mi = MI(op, *args, byte=byte, cc=cc, line=self.line)
        self.out.append(mi)
        return mi

    def copy(self, source: int, dest: int) -> None:
        """Append a register move; coalescing removes most of them."""
        if source != dest:
            self.emit("mov", source, dest)

    def temp(self) -> int:
        """A new one-word register."""
        return self.m.new_register()

    # -- values to registers ------------------------------------------------------------------------------------------

    def regs(self, v: Value) -> tuple[int, ...]:
        """Registers with the words of a value, low word first; constants are loaded at the current position."""
        if (isinstance(v, Instr) and v.op != "slot") or (isinstance(v, Arg) and id(v) not in self.slots):
            return self.value_regs(v)
        return tuple(self.leaf_word(v, k) for k in range(words_of(v)))

    def value_regs(self, v: Value) -> tuple[int, ...]:
        """Registers of a value that is not a leaf; marks the value as needed."""
        found = self.registers.get(id(v))
        if found is None:
            found = self._assign(v)
            self.registers[id(v)] = found
        self.needed.add(id(v))
        self.register_values.add(id(v))
        if (isinstance(v, Instr) and v.op in ("trunc", "bits")) or self._is_bool_zext(v):
            assert isinstance(v, Instr)
            self.value_regs(v.args[0])
        return found

    def _assign(self, v: Value) -> tuple[int, ...]:
        """Choose registers: those of the operand for truncations and extended booleans, new ones otherwise."""
        if isinstance(v, Instr):
            source = v.args[0] if v.args else None
            if v.op in ("trunc", "bits") and isinstance(source, Instr | Arg) and id(source) not in self.slots:
                return self.value_regs(source)[: words_of(v)]
            if self._is_bool_zext(v):
                assert source is not None
                low = self.value_regs(source)
                return (*low, *(self.temp() for _ in range(words_of(v) - 1)))
            extended = v.op in ("zext", "sext") and isinstance(source, Instr | Arg) and id(source) not in self.slots
            if extended and source is not None and source.type.bits >= 16:
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

    def result(self, i: Instr) -> int:
        """Register of a one-word result."""
        return self.value_regs(i)[0]

    def leaf_word(self, v: Value, k: int) -> int:
        """Load word k of a leaf into a new register and return the register."""
        r = self.temp()
        self.load_leaf(v, k, r)
        return r

    def load_leaf(self, v: Value, k: int, r: int) -> None:
        """Load word k of a constant, symbol or frame address into a register. Only `lea` changes flags."""
        if isinstance(v, ConstInt):
            self.load_imm(v.value >> 16 * k & 0xFFFF, r, v.type.bits == 8)
        elif isinstance(v, Undef):
            self.emit("clr", r)
        elif id(v) in self.slots:
            self.emit("lea", FrameSlot(self.slots[id(v)]), r)
        elif isinstance(v, GlobalRef | BlockAddress):
            self.emit("mov", Imm(self.address_expr(v)), r)
        else:
            raise UnsupportedError(f"constant {v!r}")

    def load_imm(self, k: int, r: int, byte: bool = False) -> None:
        """Load a 16-bit number. The upper byte of byte values is undefined, so word forms load bytes, too."""
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
        """Whether a value is a constant, symbol or frame address, which is loaded at every use."""
        return not isinstance(v, Instr | Arg) or id(v) in self.slots
