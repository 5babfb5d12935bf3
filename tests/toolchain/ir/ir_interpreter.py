"""Interpreter of legal IR: the reference for tests of IR passes."""

from __future__ import annotations

from toolchain.ir.build import compare, const, evaluate
from toolchain.ir.model import Arg, ConstInt, Function, GlobalRef, Instr, Undef, Value

MEMORY_TOP = 0x8000
FUEL = 200_000


class Interpreter:
    """One execution of one function.

    Memory is a dictionary of bytes; the value of an unwritten byte depends only on its address.
    """

    def __init__(self, f: Function, arguments: list[int]) -> None:
        self.f = f
        self.blocks = {b.name: b for b in f.blocks}
        self.memory: dict[int, int] = {}
        self.values: dict[int, int] = {id(a): k for a, k in zip(f.args, arguments, strict=True)}
        self.next_slot = MEMORY_TOP
        self.accesses: list[tuple[str, int, int]] = []  # volatile accesses as (load or store, address, value)

    def byte(self, at: int) -> int:
        return self.memory.get(at & 0xFFFF, (at * 37 + 11) & 0xFF)

    def value(self, v: Value) -> int:
        match v:
            case ConstInt():
                return v.value
            case Undef():
                return 0
            case GlobalRef():
                return 0x1000 + sum(map(ord, v.name)) * 16 % 0x800 + v.offset & 0xFFFF
        assert isinstance(v, Instr | Arg)
        return self.values[id(v)]

    def run(self) -> tuple[int | None, dict[int, int]]:
        """Execute the function and return its result and the memory written outside of the frame."""
        name, before, fuel = self.f.blocks[0].name, "", FUEL
        while True:
            block = self.blocks[name]
            phis = {id(p): self.value(p.args[p.blocks.index(before)]) for p in block.phis()}
            self.values.update(phis)
            for i in block.instrs:
                fuel -= 1
                assert fuel > 0
                if i.op == "phi":
                    continue
                if i.op == "ret":
                    written = {a: b for a, b in self.memory.items() if a < MEMORY_TOP}
                    return (self.value(i.args[0]) if i.args else None), written
                if i.op in ("br", "switch", "brtable"):
                    before, name = name, self.target(i)
                    break
                result = self.step(i)
                if i.volatile:
                    moved = result if result is not None else self.value(i.args[0])
                    self.accesses.append((i.op, self.value(i.args[-1]), moved))
                if result is not None:
                    self.values[id(i)] = result & ((1 << i.type.bits) - 1)

    def target(self, i: Instr) -> str:
        if i.op == "br":
            return i.blocks[0 if not i.args or self.value(i.args[0]) else 1]
        if i.op == "brtable":
            return i.blocks[self.value(i.args[0])]
        cases = i.extra["cases"]
        chosen = self.value(i.args[0])
        return i.blocks[cases.index(chosen) + 1] if chosen in cases else i.blocks[0]

    def divided(self, call: Instr, a: ConstInt, b: ConstInt) -> int:
        """Return the result of a division function of the run-time library."""
        op = call.extra["divides"]
        x, d = (a.signed, b.signed) if op[0] == "s" else (a.value, b.value)
        quotient = abs(x) // abs(d) * (1 if (x < 0) == (d < 0) else -1)
        return quotient if op.endswith("div") else x - quotient * d

    def step(self, i: Instr) -> int | None:
        args = [const(a.type, self.value(a)) for a in i.args if a.type.bits]
        match i.op:
            case "call":
                return self.divided(i, args[0], args[1])
            case "icmp":
                return int(compare(i.pred, args[0], args[1]))
            case "select":
                return args[1].value if args[0].value else args[2].value
            case "zext" | "trunc" | "bits":
                return args[0].value
            case "sext":
                return args[0].signed
            case "mulhigh":
                x = args[0].signed if i.extra["signed"] else args[0].value
                return x * args[1].value >> i.type.bits
            case "load":
                size = max(1, i.type.bits // 8)
                return sum(self.byte(args[0].value + k) << 8 * k for k in range(size))
            case "store":
                for k in range(max(1, args[0].type.bits // 8)):
                    self.memory[args[1].value + k & 0xFFFF] = args[0].value >> 8 * k & 0xFF
                return None
            case "slot":
                size = i.extra["size"]
                self.next_slot += size + 2 & ~1
                return self.next_slot - (size + 2 & ~1)
            case "sdiv" | "srem":
                return self.divide(i.op, args[0].signed, args[1].signed)
            case "divother":
                first = i.args[0]
                assert isinstance(first, Instr)
                a, b = (const(x.type, self.value(x)) for x in first.args)
                op = {"udiv": "urem", "urem": "udiv", "sdiv": "srem", "srem": "sdiv"}[first.op]
                return self.divide(op, a.signed, b.signed) if op[0] == "s" else evaluate(op, a, b)
        found = evaluate(i.op, args[0], args[1])
        assert found is not None, i.op
        return found

    @staticmethod
    def divide(op: str, a: int, b: int) -> int:
        quotient = abs(a) // abs(b) * (1 if (a < 0) == (b < 0) else -1)
        return quotient if op == "sdiv" else a - quotient * b
