"""The pass pipeline: well-formed IR after every pass, deterministic output, checked order."""

from __future__ import annotations

from dataclasses import replace

import pytest

from tests.toolchain.compiled import llvm
from toolchain.driver import pipeline
from toolchain.driver.pipeline import (
    FUNCTION_PASSES,
    BackendOptions,
    FunctionContext,
    Pass,
    check_order,
    compile_module,
)
from toolchain.ir import cfg
from toolchain.ir.read import read_module
from toolchain.ir.spec import check
from toolchain.legalize import legalize
from toolchain.optimise import combine
from toolchain.select import switch

SOURCE = """
struct bits { unsigned a:3; int b:5; long long q:40; } s;
double scale(double x, int n) { while (n--) x *= 2.5; return x < 3.0 || x != x ? x : (float)n; }
int classify(long k, int *p) {
  switch (k) { case 1: return 5; case 2: return 7; case 3: return 9; case 100000: return *p; }
  for (int i = 0; i < 10 && p[i] != 3; i++) if (p[i] > 4 || p[i] % 3 == 1) s.q += i;
  return s.b;
}
int wide(unsigned long long a, long b) { return __builtin_clzll(a) + (a >> (b & 63)) + __builtin_popcountl(b); }
int vla(int n) { char buf[n]; for (int i = 0; i < n; i++) buf[i] = i; return buf[n / 2]; }
"""


@pytest.mark.parametrize("level", ["0", "1", "s", "2"])
def test_every_ir_pass_leaves_well_formed_legal_functions(level: str) -> None:
    """Every IR pass leaves well-formed, legal functions."""
    module = read_module(llvm(SOURCE, level))
    for f in module.functions.values():
        if not f.blocks:
            continue
        assert check(f) == []
        cfg.remove_unreachable(f)
        legalize.legalize(module, f, str)
        for step in (
            cfg.remove_unreachable,
            cfg.dead_code,
            lambda g: combine.combine(g, level == "s"),
            cfg.split_logical_branches,
            cfg.sink_compares,
            lambda g: switch.lower_switches(g, True),
            cfg.split_critical_edges,
        ):
            step(f)
            assert check(f, legal=True) == []


@pytest.mark.parametrize("level", ["0", "1", "s", "2"])
def test_output_is_the_same_every_time(level: str) -> None:
    """Compiling equal input twice gives equal assembly."""
    text = llvm(SOURCE, level)
    assert compile_module(text, BackendOptions(level)) == compile_module(text, BackendOptions(level))


def test_no_virtual_register_reaches_the_assembly() -> None:
    """The assembly contains no virtual register: all registers are W0-W15."""
    import re

    text = compile_module(llvm(SOURCE), BackendOptions())
    assert all(int(n) <= 15 for n in re.findall(r"\bw(\d+)\b", text))


def test_a_pass_before_what_it_needs_is_refused() -> None:
    """`check_order` refuses a pass that precedes the pass which establishes a required property."""
    check_order(FUNCTION_PASSES)
    with pytest.raises(AssertionError, match="single-bits"):
        check_order([p for p in FUNCTION_PASSES if p.name != "critical-edges"])
    with pytest.raises(AssertionError, match="odd"):
        check_order([Pass("odd", lambda c: None, needs=("no pass gives this",))])


@pytest.mark.parametrize("level", ["0", "1", "s", "2"])
def test_a_pass_runs_only_at_its_levels(level: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The executed passes are those that the table lists for the level, in its order."""
    executed: list[str] = []

    def recorded(p: Pass) -> Pass:
        def run(c: FunctionContext) -> None:
            executed.append(p.name)
            p.run(c)

        return replace(p, run=run)

    monkeypatch.setattr(pipeline, "FUNCTION_PASSES", [recorded(p) for p in FUNCTION_PASSES])
    compile_module(llvm("int f(int a) { return a + 1; }", level), BackendOptions(level))
    assert executed == [p.name for p in FUNCTION_PASSES if level in p.levels]
    assert ("tail-merging" in executed) == (level == "s")
    assert ("combine" in executed) == (level != "0")
