"""Selection of inline assembly: GCC-style operands in clang's form (`$0`, constraint list)."""

from __future__ import annotations

import re
from dataclasses import dataclass

from toolchain.frontend.asm_constraints import CLASSES, MARK
from toolchain.ir.model import ConstInt, GlobalRef, Instr, Type, UnsupportedError, Value, size_of
from toolchain.mir.instruction import MI
from toolchain.mir.operands import FIRST_VIRTUAL, Imm, Mem, Operand
from toolchain.mir.operations import opaque
from toolchain.select.context import SelectionContext

# Register names of the front end, which are those of the MSP430; r0-r3 have alternative names.
REGISTER_NAMES = {"pc": 0, "sp": 1, "sr": 2, "cg": 3, "fp": 4, **{f"r{n}": n for n in range(16)}}
REFERENCE = re.compile(r"\$(?:(\d+)|\{(\d+)(?::(\w))?\}|\{:uid\}|\$)")
REFUSED_LETTERS = frozenset("abcdetwABxyz")


@dataclass
class AsmConstraint:
    """One operand of the constraint string."""

    output: bool
    early: bool
    indirect: bool
    text: str
    tied: int | None
    fixed: int | None

    @property
    def either(self) -> bool:
        """Whether register and memory are allowed (`rm`, `g`); in this case a register is used, as in XC16."""
        return "r" in self.text and "m" in self.text


def _parse(text: str) -> tuple[list[AsmConstraint], list[int]]:
    """Operands and clobbered registers of a constraint string. Raise UnsupportedError for unknown constraints."""
    operands, clobbers = [], []
    for part in _split(text):
        if part.startswith("~"):
            name = part[2:-1]
            if name in REGISTER_NAMES:
                clobbers.append(REGISTER_NAMES[name])
            elif name not in ("memory", "cc", "dirflag", "fpsr", "flags"):
                raise UnsupportedError(f"inline assembly clobber '{name}'")
            continue
        output = part.startswith("=")
        body = part.lstrip("=")
        early = "&" in body
        indirect = "*" in body
        body = body.replace("&", "").replace("*", "").replace("%", "")
        fixed = None
        if body.startswith("{"):
            name = body[1:-1]
            if name not in REGISTER_NAMES:
                raise UnsupportedError(f"inline assembly register '{name}'")
            fixed = REGISTER_NAMES[name]
        tied = int(body) if body.isdigit() else None
        operands.append(AsmConstraint(output, early, indirect, body, tied, fixed))
    return operands, clobbers


def _assign_classes(constraints: list[AsmConstraint], clobbers: list[int], text: str) -> None:
    """Assign registers to operands with a register class. Raise UnsupportedError if a class has too few registers.

    An input may share the register of an output, unless the output is early-clobber."""
    mark = MARK.match(text)
    if mark is None:
        return
    taken = {True: set(clobbers), False: set(clobbers)}
    for c in constraints:
        if c.fixed is not None:
            taken[c.output].add(c.fixed)
    for number, letter in re.findall(r"(\d+)([a-z])", mark[1]):
        c = constraints[int(number)]
        tied = any(other.tied == int(number) for other in constraints)
        sides = (True, False) if tied or c.early else (c.output,)
        free = [r for r in CLASSES[letter] if not any(r in taken[side] for side in sides)]
        if not free:
            raise UnsupportedError(f"inline assembly: no register is left for constraint '{letter}'")
        c.fixed = free[0]
        for side in sides:
            taken[side].add(free[0])


def _split(text: str) -> list[str]:
    return re.findall(r"[^,{]*\{[^}]*\}[^,]*|[^,]+", text)


class AsmBuilder:
    """Builds the machine instruction of one statement: operands, their roles, copies before and after."""

    def __init__(self, s: SelectionContext, i: Instr) -> None:
        self.s = s
        self.i = i
        self.asm = i.extra["asm"]
        self.operands: list[Operand] = []
        self.roles: list[str] = []
        self.late: list[int] = []
        self.after: list[tuple[int, tuple[int, ...]]] = []
        self.stores: list[tuple[int, int, bool]] = []  # outputs in memory: (pointer, register, whether it is a byte)
        self.fixed_uses: list[int] = []
        self.fixed_defs: list[int] = []
        self.blocks = [0, 4]  # first registers of the blocks W0-W3 and W4-W7 that are free for 64-bit operands
        self.reference: list[int] = []  # index in `operands` of each operand number of the template

    def run(self) -> None:
        """Emit the statement."""
        constraints, clobbers = _parse(self.asm.constraints)
        _assign_classes(constraints, clobbers, self.asm.text)
        results = self.i.extra["results"]
        inputs = list(self.i.args)
        result_at = 0
        early = False
        for c in constraints:
            if c.output and c.indirect and c.either:
                self.memory_output_in_register(c, inputs.pop(0), element(self.i, len(self.i.args) - len(inputs) - 1))
            elif c.output and not c.indirect:
                self.output(c, results[result_at], result_at)
                result_at += 1
                early |= c.early
            elif c.tied is not None:
                self.tied(c, inputs.pop(0))
            else:
                self.input(c, inputs.pop(0))
        if early or clobbers:  # a clobbered register may be written before the inputs are read
            self.late = [k for k, r in enumerate(self.roles) if r in "sS"]
        mi = MI("asm", *self.operands, line=self.s.line)
        mi.info = opaque("".join(self.roles), "cznv", words=max(1, self.asm.text.count("\n") + 1))
        mi.also_defs = tuple(dict.fromkeys([*clobbers, *self.fixed_defs]))
        mi.also_uses = tuple(self.fixed_uses)
        mi.late = tuple(self.late)
        mi.cc = ""
        mi.text = self.template()
        if any(r >= 15 for r in mi.also_defs):
            raise UnsupportedError("inline assembly clobbers the stack pointer W15")
        self.s.out.append(mi)
        for pointer, source, byte in self.stores:
            self.s.emit("mov", source, Mem("ind", pointer), byte=byte)
        for source, dest in self.after:
            if len(dest) == 1:
                self.s.copy(source, dest[0])
            else:
                self.s.emit("split", dest[0], dest[1], source)

    def _check(self, c: AsmConstraint, t: Type) -> int:
        """Number of words of an operand. Raise UnsupportedError for unsupported sizes and constraints."""
        words = max(1, t.bits // 16)
        if words == 4 and c.fixed is None and self.blocks and "r" in c.text:
            c.fixed = self.blocks.pop()  # 64-bit operands are in W4-W7 or W0-W3, as in calls
        elif words > 2 and c.fixed is None:
            raise UnsupportedError(f"inline assembly operand of {t.bits} bits")
        letters = set(c.text) & REFUSED_LETTERS
        if letters and c.fixed is None:
            raise UnsupportedError(f"inline assembly constraint '{c.text}' (use r, i or m)")
        return words

    def add(self, operand: Operand, role: str) -> int:
        self.operands.append(operand)
        self.roles.append(role)
        return len(self.operands) - 1

    def output(self, c: AsmConstraint, t: Type, index: int) -> None:
        words = self._check(c, t)
        dest = self.s.value_regs(self.i) if index == 0 else result_registers(self.s, self.i, index, words)
        if c.fixed is not None:
            self.reference.append(self.add(c.fixed, "d"))
            self.fixed_defs += range(c.fixed, c.fixed + words)
            for k in range(words):
                self.after.append((c.fixed + k, (dest[k],)))
            return
        r = self.s.temp() if words == 1 else self.s.m.new_pair()
        self.reference.append(self.add(r, "d" if words == 1 else "D"))
        self.after.append((r, dest))

    def memory_output_in_register(self, c: AsmConstraint, p: Value, t: Type) -> None:
        """Add an output in memory for which a register is allowed; the register is stored after the statement."""
        size = size_of(t)
        if size > 2:
            raise UnsupportedError(f"inline assembly operand '{c.text}' of {size} bytes (use r or m)")
        r = self.s.temp()
        self.reference.append(self.add(r, "d"))
        self.stores.append((self.s.reg(p), r, size == 1))

    def tied(self, c: AsmConstraint, v: Value) -> None:
        """Add an input that is tied to an output, whose register is then read and written."""
        assert c.tied is not None
        at = self.reference[c.tied]
        r = self.operands[at]
        if not isinstance(r, int):  # "+m": the object in memory already contains the value
            self.s.emit("mov", self.s.reg(v), r, byte=v.type.bits == 8)
            self.reference.append(at)
            return
        if r < FIRST_VIRTUAL:
            for k, word in enumerate(self.s.regs(v)):
                self.s.copy(word, r + k)
                self.fixed_uses.append(r + k)
            self.reference.append(at)
            return
        self._load(v, r, self.roles[at] == "D")
        self.roles[at] = "b" if self.roles[at] == "d" else "B"
        self.reference.append(at)

    def _load(self, v: Value, r: int, pair: bool) -> None:
        registers = self.s.regs(v)
        if pair:
            self.s.emit("join", r, registers[0], registers[1])
        else:
            self.s.copy(registers[0], r)

    def input(self, c: AsmConstraint, v: Value) -> None:
        if c.indirect or c.text == "m":
            if not c.indirect:
                raise UnsupportedError("inline assembly memory operand without an address")
            self.reference.append(self.add(self.memory(v), "s"))
            return
        if ("r" not in c.text and c.fixed is None) or (
            ("i" in c.text or "n" in c.text) and not c.either and self.s.is_leaf(v)
        ):
            if isinstance(v, ConstInt):
                self.reference.append(self.add(Imm(v.signed), "n"))
                return
            if isinstance(v, GlobalRef):
                self.reference.append(self.add(Imm(self.s.address_expr(v)), "n"))
                return
            if "r" not in c.text and "g" not in c.text:
                raise UnsupportedError(f"inline assembly operand for '{c.text}' is not a constant")
        words = self._check(c, v.type)
        if c.fixed is not None:
            for k, r in enumerate(self.s.regs(v)):
                self.s.copy(r, c.fixed + k)
                self.fixed_uses.append(c.fixed + k)
            self.reference.append(self.add(c.fixed, "s"))
            return
        if words == 2:
            r = self.s.m.new_pair()
            self._load(v, r, True)
            self.reference.append(self.add(r, "S"))
        else:
            self.reference.append(self.add(self.s.reg(v), "s"))

    def memory(self, p: Value) -> Operand:
        """Operand [Wn] for an address."""
        return Mem("ind", self.s.reg(p))

    def template(self) -> str:
        """The template with operand numbers replaced by indices into `args` (`MI.text`)."""

        def replace(m: re.Match[str]) -> str:
            number = m[1] or m[2]
            if number is None:
                return "$" if m[0] == "$$" else "\x00uid\x00"
            at = self.reference[int(number)]
            return f"\x00{at}:{m[3] or ''}\x00"

        return REFERENCE.sub(replace, MARK.sub("", self.asm.text))


def element(asm: Instr, k: int) -> Type:
    """Type of the object whose address is argument `k`."""
    return asm.extra["attrs"][k]["elementtype"]


def result_registers(s: SelectionContext, asm: Instr, index: int, words: int) -> tuple[int, ...]:
    """Registers of result `index`; new ones if the result is not used."""
    for user in s.users.get(id(asm), ()):
        if user.op == "asmresult" and user.extra["index"] == index:
            return s.value_regs(user)
    return tuple(s.temp() for _ in range(words))


def select_asm(s: SelectionContext, i: Instr) -> None:
    """Select one statement with the copies of its operands."""
    AsmBuilder(s, i).run()


def select_asmresult(s: SelectionContext, i: Instr) -> None:
    """Emit no code: the statement writes its results."""
