"""IR passes preserve behaviour: functions run in an interpreter before and after a pass, with equal random
arguments."""

from __future__ import annotations

import random
from collections.abc import Callable
from functools import partial

import pytest

from tests.cases import check_all
from tests.toolchain.compiled import llvm
from tests.toolchain.ir.ir_interpreter import Interpreter
from toolchain.ir import cfg
from toolchain.ir.model import Function, Instr
from toolchain.ir.read import read_module
from toolchain.legalize import legalize, magic
from toolchain.optimise import combine, induction, single_bits
from toolchain.select import switch

SOURCE = """
int walk(int *a, int n) { int s = 0; n &= 15;
  for (int i = 0; i < n; i++) s += a[i] * a[i + 1] - a[n - 1 - i]; return s; }
void fill(long *a, unsigned n) { n &= 7; for (unsigned i = 0; i != n; i++) a[i] = i * 3L; }
int down(char *p, int n) { int s = 0; n &= 31; while (n--) s = s * 3 + *p++; return s; }
unsigned digits(unsigned v, char *out) { unsigned n = 0;
  do { out[n++] = '0' + v % 10; v /= 10; } while (v); return n; }
int divide(int a, int b) { return b ? a / b * 7 + a % b : -1; }
int pick(int x) { switch (x & 31) {
  case 0: return 4; case 1: return 9; case 2: return x; case 3: return -1; case 4: return 8;
  case 5: return x * 3; case 6: return 7; case 7: case 8: case 9: return 2; case 20: return 1;
  case 30: return 5; } return 0; }
int sparse(long x) { switch (x % 200000) {
  case 1: return 5; case 3000: return 7; case 70000: return 9; case -5: return 2; }
  return 0; }
int logic(int a, int b, int c) { return (a > 3 && b < c) || (a == b && !(c & 8)) ? a - c : b; }
int nested(int *m, int n) { int s = 0; n &= 7;
  for (int i = 0; i < n; i++) for (int j = 0; j < i; j++) s += m[i * 4 + j] ^ m[j];
  return s; }
unsigned long bits(unsigned long v) { unsigned long r = 0;
  for (int i = 0; i < 32; i++) { r = r << 1 | (v & 1); v >>= 1; }
  return r; }
unsigned long tens(unsigned long x) { return x / 10 * 3 + x % 10 - x / 7 + x % 1000; }
volatile unsigned port, other; volatile unsigned char latch;
void one_of_two(int x) { if (x & 1) port |= 4; else port &= ~8u; }
void on_or_off(int x) { if (x & 1) latch |= 16; else latch &= ~16; other = x; }
void one_of_three(int x) { if (x > 3) { other = 1; port |= 4; } else if (x == 2) port ^= 32; else { port = 7; } }
int polled(int n) { int k = 0; n &= 7;
  while (n--) { if (other & n) port ^= 4; else port &= ~1u; k += port; } return k; }
int twice(int x) { unsigned p = port; port = x & 1 ? p | 4 : p & ~4u; port = x & 2 ? p | 64 : p & ~2u; return p; }
void words_too(int x) { unsigned p = port; port = x & 1 ? p | 6 : p & ~9u; if (x & 4) port |= 1; else port = x; }
long signed_tens(long x) { return x / -10 + x % 10 * 5 - x / 4096 + x % 7; }
"""
PASSES: dict[str, Callable[[Function], None]] = {
    "dead code": cfg.dead_code, "remainders": partial(combine.recover_remainders, for_size=False),
    "remainders for size": partial(combine.recover_remainders, for_size=True), "quotients": combine.reuse_quotients,
    "conditional": combine.make_operations_conditional, "selects": combine.group_selects,
    "magic": partial(magic.run, for_size=False), "magic for speed": partial(magic.run, for_size=False, for_speed=True),
    "magic for size": partial(magic.run, for_size=True), "paired divisions": combine.pair_divisions,
    "induction": induction.run, "increments": combine.sink_increments, "blocks": combine.hoist_block_steps,
    "countdowns": combine.move_countdowns, "logical branches": cfg.split_logical_branches,
    "sunk compares": cfg.sink_compares, "switches for size": lambda f: switch.lower_switches(f, True),
    "switches for speed": lambda f: switch.lower_switches(f, False), "critical edges": cfg.split_critical_edges,
    "single bits": partial(single_bits.run, is_near=lambda name: True),
}  # fmt: skip
TEXTS: dict[str, str] = {}


def functions(level: str) -> list[Function]:
    """Return fresh legal functions of SOURCE that the interpreter supports."""
    if level not in TEXTS:
        TEXTS[level] = llvm(SOURCE, level)
    module = read_module(TEXTS[level])
    defined = [f for f in module.functions.values() if f.blocks]
    for f in defined:
        cfg.remove_unreachable(f)
        legalize.legalize(module, f, str)
        cfg.remove_unreachable(f)
    return [f for f in defined if all(divides(i) for b in f.blocks for i in b.instrs if i.op == "call")]


def divides(call: Instr) -> bool:
    """Whether the interpreter supports the called division function."""
    return call.type.bits == 32 and "divides" in call.extra


def outcomes(f: Function, seed: int) -> list[object]:
    """Return results, memory and volatile accesses for 20 random argument lists."""
    rng = random.Random(seed)
    found: list[object] = []
    for _ in range(20):
        arguments = [rng.choice((rng.randrange(40), rng.randrange(1 << a.type.bits))) for a in f.args]
        run = Interpreter(f, arguments)
        found.append((run.run(), run.accesses))
    return found


@pytest.mark.parametrize("level", ["0", "s", "2"])
def test_each_pass_preserves_behaviour(level: str) -> None:
    """Each pass preserves results, memory and volatile accesses."""
    expected = [outcomes(f, seed) for seed, f in enumerate(functions(level))]

    def check(name: str) -> None:
        for seed, f in enumerate(functions(level)):
            PASSES[name](f)
            assert outcomes(f, seed) == expected[seed], f.name

    check_all(check, PASSES)


@pytest.mark.parametrize("level", ["s", "2"])
def test_all_passes_in_order_preserve_behaviour(level: str) -> None:
    """All passes in the order of the pipeline preserve results, memory and volatile accesses."""
    for seed, (plain, f) in enumerate(zip(functions(level), functions(level), strict=True)):
        for name, step in PASSES.items():
            if name != "switches for speed":
                step(f)
        assert outcomes(f, seed) == outcomes(plain, seed), f.name


def test_an_array_walk_becomes_a_pointer_walk() -> None:
    """Strength reduction removes the shift of the index from the loop."""
    f = next(f for f in functions("s") if f.name == "fill")
    induction.run(f)
    loop = next(iter(cfg.natural_loops({b.name: b.succs for b in f.blocks}, f.blocks[0].name).values()))
    cfg.dead_code(f)
    assert not any(i.op in ("shl", "mul") and i.type.bits == 16 for b in f.blocks if b.name in loop for i in b.instrs)
