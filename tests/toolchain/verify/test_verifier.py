"""The machine verifier detects planted bugs of every class and reports nothing in correct code."""

from __future__ import annotations

import functools
from collections.abc import Callable

import pytest

from tests.toolchain.compiled import llvm
from toolchain.driver import pipeline
from toolchain.ir.read import read_module
from toolchain.mir.function import MBlock, MFunction
from toolchain.mir.instruction import MI
from toolchain.mir.liveness import summary
from toolchain.mir.operands import FileRegister, Imm, Mem
from toolchain.regalloc import colouring
from toolchain.verify import MachineError
from toolchain.verify.registers import undefined_at_entry

SOURCE = """
extern volatile unsigned A, B; extern volatile unsigned long L; int g(int); int near; long out;
int f(int a, int b, long c, volatile unsigned *p) {
  char frame[40], other[40];
  char *q = a ? frame : other;
  out = a > b ? c : 0x12345678L;
  *q = b;
  B = 1; A |= 4; B = A; p[1] = 2; p[0] = 3; (void)L;
  int kept = near + *q;
  if (a < b && g(a) > 3) { B = 5; kept += g(b); }
  return kept + frame[0] + (int)(c * a) + (a == 3);
}
"""
PlantBug = Callable[[MFunction], bool]
"""Plants a bug in a function; returns False if the function has no suitable instruction."""


def _each(m: MFunction) -> list[tuple[MBlock, int, MI]]:
    return [(b, k, mi) for b in m.blocks for k, mi in enumerate(b.insts)]


def _uncovered(m: MFunction) -> bool:
    for b, k, mi in _each(m):
        if mi.pred and b.insts[k - 1].pred:
            b.insts.insert(k, MI("mov", Imm(1), 3))
            return True
    return False


def _emptied(m: MFunction) -> bool:
    for b, _, mi in _each(m):
        if mi.pred:
            b.insts = [x for x in b.insts if not x.pred]
            return True
    return False


def _swapped_stores(m: MFunction) -> bool:
    for b, k, mi in _each(m):
        if mi.volatile and k + 1 < len(b.insts):
            for j in range(k + 1, len(b.insts)):
                if b.insts[j].volatile and b.insts[j].volatile != mi.volatile:
                    b.insts[k], b.insts[j] = b.insts[j], b.insts[k]
                    return True
    return False


def _dropped_read(m: MFunction) -> bool:
    for b, k, mi in _each(m):
        if mi.volatile and mi.op == "mov" and isinstance(mi.args[0], Mem | FileRegister):
            del b.insts[k]
            return True
    return False


def _doubled_write(m: MFunction) -> bool:
    for b, k, mi in _each(m):
        if mi.volatile and mi.op == "mov" and isinstance(mi.args[1], Mem | FileRegister):
            b.insts.insert(k, mi.clone())
            return True
    return False


def _narrowed(m: MFunction) -> bool:
    for _, _, mi in _each(m):
        if mi.volatile and mi.op in ("mov", "bsetf") and not mi.byte:
            mi.byte = True
            return True
    return False


def _moved_over_call(m: MFunction) -> bool:
    for b, k, mi in _each(m):
        if mi.op == "call":
            for j in range(k - 1, -1, -1):
                if b.insts[j].volatile:
                    b.insts.insert(k, b.insts.pop(j))
                    return True
            for j in range(k + 1, len(b.insts)):
                if b.insts[j].volatile:
                    b.insts.insert(k, b.insts.pop(j))
                    return True
    return False


def _clobbered_flags(m: MFunction) -> bool:
    for b, k, mi in _each(m):
        if mi.op == "bra" and k:
            b.insts.insert(k, MI("and", 5, 5, 5))
            return True
    return False


def _lost_flags(m: MFunction) -> bool:
    for b, k, mi in _each(m):
        if mi.op == "bra" and k and b.insts[k - 1].flags_written():
            del b.insts[k - 1]
            return not any(x.flags_written() for x in b.insts[: k - 1])
    return False


def _undefined(m: MFunction) -> bool:
    reads, kill = ({b.name: summary(b)[k] for b in m.blocks} for k in (0, 1))
    undefined = undefined_at_entry(m, reads, kill)
    free = next(r for r in range(7, 0, -1) if not undefined >> r & 1)
    m.blocks[0].insts.insert(0, MI("mov", free, Mem("off", 15, -60)))
    return True


def _unsaved(m: MFunction) -> bool:
    for b, k, mi in _each(m):
        if mi.op in ("mov", "movd") and len(mi.args) == 2 and mi.args[1] == Mem("++", 15):
            b.insts[k] = MI("addl", Imm(4 if mi.op == "movd" else 2), 15)
            return True
    return False


def _unbalanced(m: MFunction) -> bool:
    m.blocks[0].insts.insert(0, MI("mov", 7, Mem("++", 15)))
    return True


def _odd_pair(m: MFunction) -> bool:
    for _, _, mi in _each(m):
        for k, (role, a) in enumerate(zip(mi.info.roles, mi.args, strict=False)):
            if role in "SDB" and isinstance(a, int):
                mi.args[k] = 5
                return True
    return False


def _wrong_target(m: MFunction) -> bool:
    for _, _, mi in _each(m):
        if mi.op == "bra":
            mi.args[0] = "nowhere"
            return True
    return False


def _fell_through(m: MFunction) -> bool:
    for b in m.blocks[:-1]:
        if b.insts and b.insts[-1].op == "jump":
            b.insts.pop()
            m.blocks.remove(b)
            m.blocks.append(b)
            return True
    return False


def _virtual_left(m: MFunction) -> bool:
    m.blocks[0].insts.insert(0, MI("mov", 99, 3))
    return True


def _near_byte(m: MFunction) -> bool:
    m.blocks[0].insts.insert(0, MI("mov", FileRegister("_near", True), 5, byte=True))
    return True


CLASSES: list[tuple[str, str, PlantBug]] = [
    ("an unconditional instruction under a skip", "frame", _uncovered),
    ("a skip that covers no instruction", "frame", _emptied),
    ("volatile accesses exchanged", "schedule", _swapped_stores),
    ("a volatile read dropped", "peephole", _dropped_read),
    ("a volatile write doubled", "peephole", _doubled_write),
    ("a volatile access narrowed", "select", _narrowed),
    ("a volatile access moved over a call", "schedule", _moved_over_call),
    ("volatile accesses exchanged while branches are laid out", "branches", _swapped_stores),
    ("a volatile read dropped while tails are merged", "tail-merging", _dropped_read),
    ("flags clobbered before a branch", "schedule", _clobbered_flags),
    ("the comparison before a branch lost", "schedule", _lost_flags),
    ("a register read that nothing wrote", "schedule", _undefined),
    ("a callee-saved register not saved", "frame", _unsaved),
    ("the stack not balanced", "frame", _unbalanced),
    ("a pair in an odd register", "allocate", _odd_pair),
    ("a branch to nowhere", "branches", _wrong_target),
    ("a block that falls through to the wrong one", "branches", _fell_through),
    ("a virtual register after allocation", "allocate", _virtual_left),
    ("a near byte not through W0", "peephole", _near_byte),
]


def plant_after(
    run: Callable[[pipeline.FunctionContext], None], plant: PlantBug, planted: list[bool], c: pipeline.FunctionContext
) -> None:
    """Run a pass, plant a bug after it, and record in `planted` whether that was possible."""
    run(c)
    planted.append(plant(c.m))


def compile_with(plant: PlantBug | None, after: str, monkeypatch: pytest.MonkeyPatch, level: str) -> bool:
    """Compile SOURCE with a bug planted after the pass `after`; return whether it could be planted."""
    planted: list[bool] = []
    passes = []
    for p in pipeline.FUNCTION_PASSES:
        run = p.run
        if p.name == after and plant is not None:
            run = functools.partial(plant_after, p.run, plant, planted)
        passes.append(pipeline.Pass(p.name, run, p.levels, p.needs, p.gives))
    monkeypatch.setattr(pipeline, "FUNCTION_PASSES", passes)
    module = read_module(llvm(SOURCE, level))
    pipeline.ModuleCompiler(module, pipeline.BackendOptions(level=level)).run()
    return any(planted)


@pytest.mark.parametrize("level", ["0", "1", "s", "2"])
def test_sound_code_passes(level: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The verifier reports nothing in correct code."""
    assert not compile_with(None, "", monkeypatch, level)


@pytest.mark.parametrize(("after", "plant"), [row[1:] for row in CLASSES], ids=[row[0] for row in CLASSES])
def test_a_planted_bug_is_detected_after_its_pass(after: str, plant: PlantBug, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each class of bug is detected after its pass, at the first level at which it can be planted."""
    for level in ("s", "2", "1", "0"):
        with monkeypatch.context() as patch:
            said = ""
            try:
                was_planted = compile_with(plant, after, patch, level)
            except MachineError as error:
                was_planted, said = True, str(error)
        if was_planted:
            assert f"after pass {after}:" in said, f"not caught at -O{level}"
            return
    raise AssertionError("the bug can be planted at no level")


def test_a_wrong_colour_is_detected(monkeypatch: pytest.MonkeyPatch) -> None:
    """The verifier detects two values that share a register while both are live."""
    choose = colouring.Colouring.run

    def confuse(self: colouring.Colouring, order: list[int]) -> None:
        choose(self, order)
        for n, mask in self.g.adjacent.items():
            if n >= 16 and n in self.colour and n not in self.m.pairs:
                for t in range(16, mask.bit_length()):
                    if mask >> t & 1 and t in self.colour and t not in self.m.pairs:
                        self.colour[n] = self.colour[t]
                        return

    monkeypatch.setattr(colouring.Colouring, "run", confuse)
    with pytest.raises(MachineError, match="does not contain"):
        compile_with(None, "", monkeypatch, "s")
