"""Machine passes preserve behaviour: random functions over real registers run before and after each pass."""

from __future__ import annotations

import random
from collections.abc import Callable

import pytest

from toolchain.mir.function import MBlock, MFunction
from toolchain.mir.instruction import MI
from toolchain.mir.operands import FileRegister, Imm, Mem, Operand
from toolchain.mir.operations import SKIPS
from toolchain.optimise import block_layout, branches, peephole, returns, schedule, tail_merging

WORD = 0xFFFF
DATA = 0x1000
THREE = ("add", "sub", "and", "ior", "xor")
ONE = ("inc", "dec", "inc2", "dec2", "com", "neg")


class CpuModel:
    """Interpreter of the operations that `generate` uses: W registers, Z, N, C, OV and memory (isa.md §6.1, §6.2)."""

    def __init__(self, m: MFunction) -> None:
        self.blocks = m.block_map()
        self.order = [b.name for b in m.blocks]
        self.w = {r: (r * 2 + DATA if 3 <= r <= 5 else r * 3) for r in range(16)}
        self.memory: dict[int, int] = {}
        self.flags = dict.fromkeys("znvc", False)

    def read(self, a: Operand, byte: bool) -> int:
        if isinstance(a, Imm):
            assert isinstance(a.value, int)
            return a.value & WORD
        if isinstance(a, Mem | FileRegister):
            at = self.address(a, byte)
            return self.memory.get(at, at * 7 & WORD)
        assert isinstance(a, int)
        return self.w[a]

    def address(self, a: Mem | FileRegister, byte: bool) -> int:
        if isinstance(a, FileRegister):
            return int(a.expr, 16)
        size = 1 if byte else 2
        before = {"+": size, "-": -size}.get(a.mode, 0)
        self.w[a.base] = self.w[a.base] + before & WORD
        at = self.w[a.base] + (a.off if a.mode == "off" else 0) & WORD
        self.w[a.base] = self.w[a.base] + {"++": size, "--": -size}.get(a.mode, 0) & WORD
        return at

    def write(self, a: Operand, value: int, byte: bool) -> None:
        if isinstance(a, Mem | FileRegister):
            self.memory[self.address(a, byte)] = value & WORD
        else:
            assert isinstance(a, int)
            self.w[a] = value & WORD

    def arithmetic(self, a: int, b: int, carry: int) -> int:
        total = a + b + carry
        result = total & WORD
        self.flags["c"] = total > WORD
        self.flags["v"] = bool(~(a ^ b) & (a ^ result) & 0x8000)
        self.logic(result)
        return result

    def logic(self, result: int) -> int:
        self.flags["z"], self.flags["n"] = result & WORD == 0, bool(result & 0x8000)
        return result & WORD

    def condition(self, cc: str) -> bool:
        z, n, v, c = (self.flags[k] for k in "znvc")
        return {"z": z, "nz": not z, "n": n, "nn": not n, "c": c, "nc": not c, "lt": n != v, "ge": n == v,
                "gt": not z and n == v, "le": z or n != v, "gtu": c and not z, "leu": not c or z}[cc]  # fmt: skip

    def skips(self, mi: MI) -> bool:
        """Whether a skip instruction skips."""
        if mi.op == "skip":
            return self.condition(mi.cc)
        name, x, y = mi.op.removesuffix("f"), self.read(mi.args[0], False), self.read(mi.args[1], False)
        if name in ("btsc", "btss"):
            return bool(x >> y & 1) == (name == "btss")
        sx, sy = (k - 0x10000 if k & 0x8000 else k for k in (x, y))
        return {"cpseq": x == y, "cpsne": x != y, "cpslt": sx < sy, "cpsgt": sx > sy}[name]

    def run(self) -> tuple[int, dict[int, int]]:
        """Execute the function and return W0 and the written memory."""
        name, fuel = self.order[0], 2000
        while True:
            block, skip = self.blocks[name], False
            at = self.order.index(name) + 1
            name = self.order[at] if at < len(self.order) else ""
            for mi in block.insts:
                fuel -= 1
                if fuel == 0 or mi.op == "ret":
                    if mi.text:
                        self.w[0] = int(mi.text.split("#")[1].split(",")[0])
                    return (-1 if fuel == 0 else self.w[0]), self.memory
                if mi.op in SKIPS:
                    skip = self.skips(mi)
                elif mi.pred and skip:
                    pass
                elif mi.op == "jump" or (mi.op == "bra" and self.condition(mi.cc)):
                    name = str(mi.args[0])
                    break
                elif mi.op != "bra":
                    self.step(mi)

    def step(self, mi: MI) -> None:
        a = mi.args
        match mi.op:
            case "mov":
                self.write(a[1], self.read(a[0], mi.byte), mi.byte)
            case "movd":
                self.pair(a[0], a[1])
            case "clrd":
                assert isinstance(a[0], int)
                self.w[a[0]] = self.w[a[0] + 1] = 0
            case "clr" | "setm":
                self.write(a[0], 0 if mi.op == "clr" else WORD, mi.byte)
            case "cp":
                self.arithmetic(self.read(a[0], False), ~self.read(a[1], False) & WORD, 1)
            case "andl":
                assert isinstance(a[1], int)
                self.w[a[1]] = self.logic(self.w[a[1]] & self.read(a[0], False))
            case "subl":
                assert isinstance(a[1], int)
                self.w[a[1]] = self.arithmetic(self.w[a[1]], ~self.read(a[0], False) & WORD, 1)
            case "cp0":
                self.arithmetic(self.read(a[0], False), WORD, 1)
            case "btst" | "btstf":
                self.flags["z"] = not self.read(a[0], False) >> self.read(a[1], False) & 1
            case "and" | "ior" | "xor":
                x, y = self.read(a[0], False), self.read(a[1], False)
                self.write(a[2], self.logic({"and": x & y, "ior": x | y, "xor": x ^ y}[mi.op]), False)
            case "com":
                self.write(a[1], self.logic(~self.read(a[0], False) & WORD), False)
            case "neg":
                self.write(a[1], self.arithmetic(0, ~self.read(a[0], False) & WORD, 1), False)
            case "add" | "sub":
                x, y = self.read(a[0], False), self.read(a[1], False)
                self.write(a[2], self.arithmetic(x, y if mi.op == "add" else ~y & WORD, int(mi.op == "sub")), False)
            case "incf" | "slf":
                x = self.read(a[0], False)
                self.write(a[0], self.arithmetic(x, 1, 0) if mi.op == "incf" else x << 1, False)
                if mi.op == "slf":
                    self.logic(x << 1)
                    self.flags["c"] = bool(x & 0x8000)
            case "clrf":
                self.write(a[0], 0, False)
            case "iorf":
                self.write(a[0], self.logic(self.read(a[0], False) | self.read(a[1], False)), False)
            case "bsetf":
                self.write(a[0], self.read(a[0], False) | 1 << self.read(a[1], False), False)
            case _:
                k = {"inc": 1, "inc2": 2, "dec": -1, "dec2": -2}[mi.op]
                x = self.read(a[0], False)
                self.write(a[1], self.arithmetic(x, k if k > 0 else ~-k & WORD, int(k < 0)), False)

    def pair(self, source: Operand, dest: Operand) -> None:
        if isinstance(source, Mem):
            assert isinstance(dest, int)
            at = self.w[source.base]
            self.w[dest], self.w[dest + 1] = (self.memory.get(k, k * 7 & WORD) for k in (at, at + 2 & WORD))
        else:
            assert isinstance(source, int)
            low, high = self.w[source], self.w[source + 1]
            if isinstance(dest, Mem):
                at = self.w[dest.base]
                self.memory[at], self.memory[at + 2 & WORD] = low, high
            else:
                assert isinstance(dest, int)
                self.w[dest], self.w[dest + 1] = low, high


def near(rng: random.Random) -> FileRegister:
    """Return a near operand in the memory that the pointers reach."""
    return FileRegister(f"0x{DATA + 2 * rng.randrange(9):04X}", True)


def instruction(rng: random.Random) -> list[MI]:
    """Return a random piece of straight-line code; W3-W5 are pointers."""
    a, b, d = (rng.randrange(3) + rng.choice((0, 5)) for _ in range(3))
    p = rng.randrange(3, 6)
    match rng.randrange(16):
        case 0:
            return [MI("mov", Imm(rng.choice((0, 1, 5, 5, 0xFFFF))), d)]
        case 1:
            return [MI("mov", a, d)]
        case 2:
            return [MI("mov", Mem("ind", p), d), MI(rng.choice(("inc2", "dec2")), p, p)]
        case 3:
            return [MI("inc2", p, p), MI("mov", a, Mem("ind", p))]
        case 4:
            return [MI("mov", a, Mem("ind", p)), MI("mov", b, Mem("off", p, 2))]
        case 5:
            low = rng.choice((0, 6))
            return [MI("mov", Mem("ind", p), low), MI("mov", Mem("off", p, 2), low + 1)]
        case 6:
            test = rng.choice((MI("cp", a, b), MI("cp0", a), MI("btst", a, Imm(3)), MI("btstf", near(rng), Imm(2))))
            cc = rng.choice(("z", "nz") if test.op.startswith("btst") else ("z", "nz", "lt", "gt", "ge"))
            covered = [MI(rng.choice(THREE), d, b, d) for _ in range(rng.choice((1, 1, 2)))]
            for mi in covered:
                mi.pred = True
            return [test, MI("skip", "", cc=cc), *covered]
        case 10:
            return [rng.choice((
                MI("mov", near(rng), d), MI("mov", a, near(rng)), MI("incf", near(rng)), MI("clrf", near(rng)),
                MI("slf", near(rng)), MI("bsetf", near(rng), Imm(3)), MI("iorf", near(rng), 0),
            ))]  # fmt: skip
        case 11:
            return [MI("mov", near(rng), p), MI("andl", Imm(62), p), MI("mov", Imm(DATA), d), MI("add", p, d, p),
                    MI("mov", Mem("ind", p), d)]  # fmt: skip
        case 7:
            return [MI(rng.choice(ONE), a, d)]
        case 9:
            return [MI("mov", Imm(DATA + 2 * rng.randrange(9)), p), MI("mov", Mem("ind", p), d), MI("clr", b)]
        case 8:
            return [MI(rng.choice(("clr", "setm")), d)]
        case _:
            return [MI(rng.choice(THREE), a, rng.choice((b, Mem("ind", p))), d)]


def generate(seed: int) -> MFunction:
    """Return a function of six blocks with forward branches and different returns."""
    rng = random.Random(seed)
    m = MFunction("random")
    names = [f"b{k}" for k in range(6)] + ["out"]
    for k, name in enumerate(names):
        insts = [mi for _ in range(rng.randrange(1, 7)) for mi in instruction(rng)]
        if name == "out" or rng.random() < 0.1:
            insts += [MI("mov", Imm(rng.randrange(8)), 0)] if rng.random() < 0.5 else []
            insts.append(MI("ret"))
            insts[-1].also_uses = (0,)
            m.blocks.append(MBlock(name, insts, []))
            continue
        one, two = rng.choice(names[k + 1 :]), names[k + 1]
        if rng.random() < 0.7:
            r = rng.randrange(3)
            insts += rng.choice((
                [MI("cp0", r)], [MI("cp", r, Imm(5))], [MI("cp", r, 6)], [MI("dec", r, r)],
                [MI("dec", r, r), MI("cp0", r)], [MI("dec", r, r), MI("mov", r, 6)],
                [MI("add", r, 6, r), MI("inc2", 3, 3)], [MI("mov", Imm(9), 7), MI("cp", r, 7)],
            ))  # fmt: skip
            insts.append(MI("bra", one, cc=rng.choice(("z", "nz", "lt", "ge", "gtu", "nn"))))
            m.blocks.append(MBlock(name, [*insts, MI("jump", two)], list(dict.fromkeys([one, two]))))
        else:
            same = rng.random() < 0.6  # equal endings for tail merging
            insts += [MI("add", 0, 1, 2), MI("mov", 2, Mem("ind", 3)), MI("com", 2, 0)] if same else []
            m.blocks.append(MBlock(name, [*insts, MI("jump", one)], [one]))
    return m


PASSES: dict[str, Callable[[MFunction], None]] = {
    "peephole": peephole.run, "schedule": schedule.run, "tail-merging": tail_merging.run, "layout": block_layout.run,
    "jumps": branches.thread_jumps, "reorder": branches.reorder, "branches": branches.run, "returns": returns.run,
}  # fmt: skip


def reachable(m: MFunction) -> MFunction:
    """Return the function without unreachable blocks, like the output of selection."""
    branches.thread_jumps(m)
    return m


@pytest.mark.parametrize("name", list(PASSES))
def test_a_machine_pass_preserves_behaviour(name: str) -> None:
    """Each pass alone preserves the behaviour of 300 random functions."""
    for seed in range(300):
        m = reachable(generate(seed))
        PASSES[name](m)
        assert CpuModel(m).run() == CpuModel(reachable(generate(seed))).run(), f"seed {seed}\n{m.dump()}"


def test_all_machine_passes_in_order_preserve_behaviour() -> None:
    """The passes in the order of the pipeline preserve the behaviour of 400 random functions."""
    for seed in range(300, 700):
        m = reachable(generate(seed))
        for name, step in PASSES.items():
            if name != "layout":
                step(m)
        assert CpuModel(m).run() == CpuModel(reachable(generate(seed))).run(), f"seed {seed}\n{m.dump()}"


def test_stalls_are_found_as_the_manual_lists_them() -> None:
    """Pipeline stalls are found for the cases of the tables in isa.md §13.2."""
    direct = MI("add", 0, 1, 2)
    assert not schedule.stalls(direct, MI("mov", 2, 3))
    assert schedule.stalls(direct, MI("mov", Mem("ind", 2), 3))
    assert schedule.stalls(direct, MI("mov", Mem("++", 2), 3))
    assert not schedule.stalls(direct, MI("mov", 0, Mem("ind", 2)))
    stepped = MI("add", 0, 1, Mem("++", 2))
    assert not schedule.stalls(stepped, MI("mov", 2, 3))
    assert schedule.stalls(stepped, MI("mov", Mem("ind", 2), 3))
    assert not schedule.stalls(MI("mov", Mem("++", 1), 2), MI("mov", Mem("++", 1), 3))
