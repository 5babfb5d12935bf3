"""Selection context of one function: its state, and operands in memory (addressing modes, foldable loads)."""

from __future__ import annotations

from collections.abc import Callable

from toolchain.abi.sections import is_near
from toolchain.abi.target import BYTE_OFFSET, WORD_OFFSET
from toolchain.ir.model import ConstInt, GlobalRef, Instr, Value
from toolchain.mir.operands import FileRegister, FrameSlot, Imm, Mem, Operand
from toolchain.select.state import SelectionState


class SelectionContext(SelectionState):
    """Selection state of one function, with methods for operands in memory; argument of all instruction handlers."""

    # -- addresses ----------------------------------------------------------------------------------------------------

    def decompose(self, p: Value) -> tuple[Value, int]:
        """(base, constant offset) of a pointer; additions that only compute addresses are folded into the offset."""
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
        """Whether a sum is used only as the address of loads and stores."""
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

    def address(self, p: Value, byte: bool, extra: int = 0, count: int = 1, volatile: int = 0) -> Operand:
        """Operand of MOV for the first of `count` words, or for a byte, at p + extra.

        Only words and near bytes have a FileRegister operand. `volatile` is the number of the access (`mir`)."""
        base, offset = self.decompose(p)
        offset += extra
        if isinstance(base, GlobalRef):
            ref = GlobalRef(base.name, base.offset + offset)
            if base.name not in self.module.functions:
                near = is_near(self.module, base.name)
                constant = self._constant_global(base.name)
                odd = not byte and offset & 1  # no operand can encode it; the access traps
                if (near and not odd) or (not byte and not constant and not odd):
                    return FileRegister(self.address_expr(ref), near, volatile)
            r = self.temp()
            self.emit("mov", Imm(self.address_expr(ref)), r)
            return Mem("ind", r, 0, volatile)
        if isinstance(base, ConstInt):
            at = base.value + offset & 0xFFFF
            if (byte and at < 0x2000) or (not byte and not at & 1):
                return FileRegister(f"0x{at:04X}", at < 0x2000, volatile)
            r = self.temp()
            self.load_imm(at, r)
            return Mem("ind", r, 0, volatile)
        if id(base) in self.slots:
            if not self.far_frame:
                return FrameSlot(self.slots[id(base)], offset, volatile)
            r = self.temp()
            self.emit("lea", FrameSlot(self.slots[id(base)], offset), r)
            return Mem("ind", r, 0, volatile)
        if isinstance(base, Instr) and count == 1 and offset == 0 and self._is_index_sum(base):
            return Mem("idx", self.reg(base.args[0]), self.reg(base.args[1]), volatile)
        return self.offset_operand(self.reg(base), offset, byte, volatile)

    def _is_index_sum(self, base: Instr) -> bool:
        """Whether a pointer is a sum base + index that is used only as an address."""
        return base.op == "add" and not isinstance(base.args[1], ConstInt) and self.address_only(base)

    def _constant_global(self, name: str) -> bool:
        var = self.module.globals.get(name)
        return var is not None and var.constant

    def offset_operand(self, base: int, offset: int, byte: bool, volatile: int = 0) -> Mem:
        """Operand [base+offset]; the sum is computed if the offset is out of range."""
        if offset == 0:
            return Mem("ind", base, 0, volatile)
        low, high = BYTE_OFFSET if byte else WORD_OFFSET
        if low <= offset <= high and (byte or not offset & 1):
            return Mem("off", base, offset, volatile)
        r, k = self.temp(), self.temp()
        self.emit("mov", Imm(offset & 0xFFFF), k)
        self.emit("add", base, k, r)
        return Mem("ind", r, 0, volatile)

    def foldable_load(self, v: Value, user: Instr) -> Instr | None:
        """The load that defines `v`, if it may move down to its only user; else None.

        A user can be selected twice: folded into an address, and for its own value. Therefore a load that already has a
        register is not folded.
        """
        if not isinstance(v, Instr) or v.op != "load" or not self.single_use(v) or not self.same_block(v):
            return None
        if id(v) in self.register_values:
            return None
        if not self.same_block(user):
            return None
        start = self.epoch[id(v)] + (1 if v.volatile else 0)
        return v if start == self.epoch[id(user)] else None

    def source(self, v: Value, user: Instr) -> Operand:
        """Operand Ws of an ALU instruction: [Wn] if a load can be folded, else a register."""
        load = self.foldable_load(v, user)
        if load is not None and load.type.bits in (8, 16) and not load.volatile:
            base, offset = self.decompose(load.args[0])
            plain = not self.is_leaf(base) and offset == 0
            if plain and not (isinstance(base, Instr) and base.op == "add" and self.address_only(base)):
                self.folded.add(id(load))
                return self._stepping(base, load, user) or Mem("ind", self.reg(base))
        return self.reg(v)

    def _stepping(self, p: Value, load: Instr, user: Instr) -> Mem | None:
        """Operand [Wn++] for a comparison at a branch, if p + size is live after it and p is not; else None.

        In other cases the peephole pass merges the step. In this case the step would separate comparison and branch."""
        if user.op != "br" or not isinstance(p, Instr):
            return None
        others = [u for u in self.users[id(p)] if u is not load]
        step = others[0] if len(others) == 1 else None
        if step is None or step.op != "add" or step.args[0] is not p or not self.same_block(step):
            return None
        k = step.args[1]
        inside = [u for u in self.users.get(id(step), ()) if u.op != "phi" and self.same_block(u)]
        if not isinstance(k, ConstInt) or k.signed != load.type.bits // 8 or inside or id(step) not in self.needed:
            return None
        self.folded.add(id(step))
        d = self.value_regs(step)[0]
        self.copy(self.reg(p), d)
        return Mem("++", d)

    def near_operand(self, v: Value, user: Instr) -> FileRegister | None:
        """File-register operand for a load from near memory that may fold into `user`, or None."""
        load = self.foldable_load(v, user)
        if load is None or load.type.bits not in (8, 16):
            return None
        base, _ = self.decompose(load.args[0])
        if not self.is_leaf(base) or id(base) in self.slots:
            return None
        mark = len(self.out)
        operand = self.address(load.args[0], load.type.bits == 8, volatile=self.access_number(load))
        if isinstance(operand, FileRegister) and operand.near:
            self.folded.add(id(load))
            return operand
        del self.out[mark:]
        return None


Handler = Callable[[SelectionContext, Instr], None]
"""Function that selects one instruction. Modules of handlers have a table HANDLERS by opcode; `select` joins them."""
