"""Register allocation preserves behaviour: random programs run before and after it."""

from __future__ import annotations

import random

import pytest

from toolchain.abi.target import ALLOCATABLE, CALLER_SAVED
from toolchain.mir.function import MBlock, MFunction
from toolchain.mir.instruction import MI
from toolchain.mir.operands import FIRST_VIRTUAL, FileRegister, FrameSlot, Imm
from toolchain.regalloc.colouring import allocate

WORD = 0xFFFF
BINARY = {"add": lambda a, b: a + b, "sub": lambda a, b: a - b, "xor": lambda a, b: a ^ b, "ior": lambda a, b: a | b}
CALL_TRASH = 0xDEAD


class MirMachine:
    """Interpreter of the operations that `generate` uses, over virtual or real registers."""

    def __init__(self, m: MFunction) -> None:
        self.blocks = m.block_map()
        self.order = [b.name for b in m.blocks]
        self.w: dict[int, int] = {}
        self.slots: dict[tuple[int, int], int] = {}
        self.stored: list[int] = []
        self.z = False

    def value(self, a: object) -> int:
        if isinstance(a, Imm):
            assert isinstance(a.value, int)
            return a.value & WORD
        if isinstance(a, FrameSlot):
            return self.slots[a.index, a.off]
        assert isinstance(a, int)
        return self.w[a]

    def run(self, fuel: int = 4000) -> list[int]:
        """Execute the function and return the values written to memory, in order."""
        name: str | None = self.order[0]
        while name is not None:
            block, name, skip = self.blocks[name], None, False
            for mi in block.insts:
                fuel -= 1
                assert fuel > 0
                if mi.op == "skip":
                    skip = self.z == (mi.cc == "z")
                elif mi.pred and skip:
                    continue
                elif mi.op in ("bra", "jump"):
                    if mi.op == "jump" or self.z == (mi.cc == "z"):
                        name = str(mi.args[0])
                        break
                elif mi.op == "ret":
                    return self.stored
                else:
                    self.step(mi)
        return self.stored

    def step(self, mi: MI) -> None:
        match mi.op, mi.args:
            case "mov", [source, FileRegister()]:
                self.stored.append(self.value(source))
            case "mov", [source, FrameSlot() as slot]:
                self.slots[slot.index, slot.off] = self.value(source)
            case "mov", [source, int() as d]:
                self.w[d] = self.value(source)
            case "clr", [int() as d]:
                self.w[d] = 0
            case "cp0", [source]:
                self.z = self.value(source) == 0
            case "mul.uu", [a, b, int() as d]:
                product = self.value(a) * self.value(b)
                self.w[d] = product if d >= FIRST_VIRTUAL else product & WORD
                if d < FIRST_VIRTUAL:
                    self.w[d + 1] = product >> 16
            case "split", [int() as low, int() as high, int() as pair]:
                self.w[low], self.w[high] = self.w[pair] & WORD, self.w[pair] >> 16
            case "splitlo", [int() as low, int() as pair]:
                self.w[low] = self.w[pair] & WORD
            case "exch", [int() as a, int() as b]:
                self.w[a], self.w[b] = self.w[b], self.w[a]
            case "call", _:
                for r in CALLER_SAVED:
                    self.w[r] = CALL_TRASH
            case op, [a, b, int() as d]:
                self.w[d] = BINARY[op](self.value(a), self.value(b)) & WORD
            case _:
                raise AssertionError(mi)


def generate(seed: int, pressure: int, calls: bool) -> MFunction:
    """Return a function with a loop and a conditional block, with about `pressure` values live at the same time."""
    rng = random.Random(seed)
    m = MFunction("random")
    live = [m.new_register() for _ in range(pressure)]
    entry = MBlock("entry", [MI("mov", Imm(rng.randrange(0x10000)), r) for r in live], ["loop"])
    counter = m.new_register()
    entry.insts += [MI("mov", Imm(3), counter), MI("jump", "loop")]
    loop = MBlock("loop", body(rng, m, live, calls), ["loop", "left"], depth=1)
    loop.insts += [MI("add", counter, one := m.new_register(), counter), MI("cp0", counter)]
    loop.insts.insert(0, MI("mov", Imm(-1), one))
    loop.insts += [MI("bra", "loop", cc="nz"), MI("jump", "left")]
    tested = rng.choice(live)
    left = MBlock("left", [*body(rng, m, live, calls), MI("cp0", tested)], ["right", "end"])
    left.insts += [MI("bra", "end", cc="z"), MI("jump", "right")]
    right = MBlock("right", [*body(rng, m, live, calls), MI("jump", "end")], ["end"])
    end = MBlock("end", [MI("mov", r, FileRegister("out", True)) for r in live] + [MI("ret")])
    m.blocks = [entry, loop, left, right, end]
    return m


def body(rng: random.Random, m: MFunction, live: list[int], calls: bool) -> list[MI]:
    """Return straight-line code that redefines some of the live registers."""
    out: list[MI] = []
    for _ in range(12):
        a, b, d = (rng.choice(live) for _ in range(3))
        kind = rng.randrange(6)
        if kind == 0:
            out.append(MI("mov", a, d))
        elif kind == 1:
            pair, low, high = m.new_pair(), m.new_register(), m.new_register()
            out += [MI("mul.uu", a, b, pair), MI("split", low, high, pair), MI("xor", low, high, d)]
        elif kind == 2:
            out += [MI("cp0", a), MI("skip", "", cc=rng.choice(["z", "nz"]))]
            for _ in range(rng.choice((1, 1, 4))):
                out.append(MI("mov", rng.choice(live), rng.choice(live)))
                out[-1].pred = True
        elif kind == 3 and calls:
            call = MI("call", "_f")
            call.also_defs = CALLER_SAVED
            out.append(call)
        else:
            t = m.new_register()
            out += [MI("mov", Imm(rng.randrange(0x10000)), t), MI(rng.choice(list(BINARY)), a, t, d)]
    return out


@pytest.mark.parametrize("calls", [False, True], ids=["leaf", "with calls"])
@pytest.mark.parametrize("pressure", [3, 10, 14, 22])
def test_allocation_preserves_behaviour(pressure: int, calls: bool) -> None:
    """Allocation preserves behaviour with coalescing, pairs, conditional moves, calls, spilling and
    rematerialisation."""
    for seed in range(25):
        expected = MirMachine(generate(seed, pressure, calls)).run()
        m = generate(seed, pressure, calls)
        m.uses_fp = seed % 3 == 0
        allocated = allocate(m, for_size=bool(seed % 2))
        assert MirMachine(allocated).run() == expected, f"seed {seed}\n{allocated.dump()}"


def test_no_virtual_register_and_no_unaligned_pair_is_left() -> None:
    """After allocation there is no virtual register, and MUL writes an even register below W14 (isa.md §5.6)."""
    for seed in range(20):
        for block in allocate(generate(seed, 16, False), True).blocks:
            for mi in block.insts:
                assert set(mi.uses()) | set(mi.defs()) <= {*ALLOCATABLE, 15}
                if mi.op == "mul.uu":
                    assert isinstance(mi.args[2], int)
                    assert mi.args[2] % 2 == 0
                    assert mi.args[2] < 14


def test_values_live_across_calls_avoid_scratch_registers() -> None:
    """Values that are live across calls avoid W0-W7, which a callee may change (abi-elf.md §2.1)."""
    m = MFunction("across")
    kept = [m.new_register() for _ in range(3)]
    call = MI("call", "_f")
    call.also_defs = CALLER_SAVED
    loads = [MI("mov", FileRegister("in", True), r) for r in kept]
    stores = [MI("mov", r, FileRegister("out", True)) for r in kept]
    insts = [*loads, call, *stores]
    m.blocks = [MBlock("entry", [*insts, MI("ret")])]
    used = {mi.args[0] for mi in allocate(m, True).blocks[0].insts[4:7]}
    assert all(isinstance(r, int) and r >= 8 for r in used)
