"""Flow rules: generated code has the same effect as the rules evaluated on numbers."""

from __future__ import annotations

import random
from typing import Any

import pytest

from emu.dspic30f.interpreter import flow_rules
from emu.dspic30f.interpreter.rule_paths import function_of
from emu.dspic30f.jit.engine import JitEngine
from emu.dspic30f.state.state import NOT_REPEATING, RA, State
from emu.machine.machine import Machine
from emu.system.rules import INTEGER_OPERATIONS, Cell
from tests.emu.cpu.cpu_rig import Rig


class OnNumbers:
    """Builder that evaluates rules on the record and stores their results at the end."""

    select = INTEGER_OPERATIONS.select

    def __init__(self, state: State) -> None:
        self._views = {16: state.u16, 64: state.record.u64}
        self._puts: list[tuple[Cell, int]] = []

    def get(self, place: Cell) -> int:
        return self._views[place.bits][place.index]

    def put(self, place: Cell, value: int) -> None:
        self._puts.append((place, value & (1 << place.bits) - 1))

    def is_true(self, condition: Any) -> bool:
        return bool(condition)

    def run(self, rule: Any, *arguments: Any) -> Any:
        result = rule(self, *arguments)
        for place, value in self._puts:
            self._views[place.bits][place.index] = value
        self._puts.clear()
        return result


RULES = {
    "repeat": (flow_rules.execute_repeat, ("count",)), "repeated": (flow_rules.end_iteration, ("counting",)),
    "repeating": (flow_rules.restore_repeat, ("count", "left")),
    "do": (flow_rules.execute_do, ("count", "start", "end")), "loop_again": (flow_rules.end_loop_iteration, ()),
    "resume": (flow_rules.execute_retfie, ("srl", "ipl3")), "disi": (flow_rules.execute_disi, ("count", "after")),
}  # fmt: skip


@pytest.mark.parametrize("name", RULES)
def test_generated_python_does_what_the_rule_says(name: str) -> None:
    rule, parameters = RULES[name]
    generator = random.Random(name)
    one, other = (Machine(engine="plain").state for _ in range(2))
    operands = flow_rules.operands_of(one)
    run = function_of(other.record, rule, operands, *parameters)
    results = set()
    for _ in range(100):
        for place in (operands.rcount, operands.dcount):
            one.u16[place.index] = generator.choice((0, 1, 2, generator.randrange(0x4000)))
        for place in (operands.sr, operands.corcon, *operands.loop[1:], *operands.shadow):
            one.u16[place.index] = generator.getrandbits(16)
        one.u16[operands.edt.index] = generator.randrange(4)
        one.repeat = generator.randrange(4)
        other.record.bytes[:] = one.record.bytes
        arguments = [generator.choice((0, 1, generator.randrange(0x100))) for _ in parameters]
        result = OnNumbers(one).run(rule, operands, *arguments)
        assert run(*arguments) == result
        assert bytes(one.record.bytes) == bytes(other.record.bytes)
        results.add(result)
    assert results == ({True, False} if name in ("repeat", "repeated", "loop_again") else {None})


@pytest.mark.parametrize("count", range(1, 6))
def test_a_repeat_that_is_counted_elsewhere_leaves_the_same_state(count: int) -> None:
    state, closed = (Machine(engine="plain").state for _ in range(2))
    operands = flow_rules.operands_of(state)
    stepped, jumped = OnNumbers(state), OnNumbers(closed)
    assert stepped.run(flow_rules.execute_repeat, operands, count)
    for left in range(count, -1, -1):
        jumped.run(flow_rules.restore_repeat, operands, count, left)
        assert (state.rcount, state.repeat, state.sr) == (closed.rcount, closed.repeat, closed.sr)
        assert stepped.run(flow_rules.end_iteration, operands, state.sr & RA) == (left != 0)
    assert state.repeat == NOT_REPEATING


def eager(text: str, engine: str, **w: int) -> Rig:
    """Return a machine that compiles all code before it runs it."""
    rig = Rig(text, engine, **w)
    if isinstance(rig.machine.runner, JitEngine):
        rig.machine.runner.threshold, rig.machine.runner.wait = 1, True
    return rig


@pytest.mark.parametrize(("last", "iterations"), [("clr 0x38", 1), ("dec 0x38", 3), ("mov w5, 0x38", 2)])
def test_the_last_instruction_of_a_loop_may_write_its_counter(engine: str, last: str, iterations: int) -> None:
    """isa.md §7.6: DCOUNT is read after the instruction at DOEND, which may write it."""
    again = "btsc w0, #1\nclr w5\n"  # the second iteration writes 0
    rig = eager(f"do #5, last\ninc w0, w0\n{again}last: {last}\nend: nop", engine, w0=0, w5=3)
    rig.cycles_to()
    assert rig.machine.w[0] == iterations
    assert rig.machine.peek("SR") & 0x0200 == 0


def test_an_interrupt_that_the_last_instruction_of_a_loop_enables_comes_behind_it(engine: str) -> None:
    """isa.md §14.3: if the last instruction of a loop enables an interrupt by writing IEC, the interrupt is accepted
    at the boundary after it."""
    text = """again: mov #0, w0
        bclr 0x8C, #3
        bset 0x84, #3
        do #5, last
        inc w0, w0
        nop
        last: bset 0x8C, #3
        dec w9, w9
        bra nz, again
        end: nop
        isr: mov w0, 0x1100
        bclr 0x84, #3
        retfie"""
    rig = eager(text, engine, w9=8)
    rig.enable(3, 4)
    rig.vector(0x1A, "isr")
    rig.cycles_to()
    assert rig.machine.peek(0x1100) == 1


def test_an_event_that_the_last_instruction_of_a_loop_brings_nearer_is_in_time(engine: str) -> None:
    """engines.md §4.2: if the last instruction of a loop shortens a timer's period to 30, the timer's interrupt is on
    time."""
    text = """mov #0x8000, w3
        mov w3, 0x104
        again: mov #1000, w1
        mov w1, 0x102
        clr 0x100
        mov #30, w1
        do #50, last
        inc w0, w0
        nop
        last: mov w1, 0x102
        dec w9, w9
        bra nz, again
        end: nop
        isr: bclr 0x84, #3
        retfie"""
    rig = eager(text, engine, w0=0, w9=4)
    rig.enable(3, 4)
    rig.vector(0x1A, "isr")
    rig.note("isr")
    rig.run(700)
    yardstick = eager(text, "plain", w0=0, w9=4)
    yardstick.enable(3, 4)
    yardstick.vector(0x1A, "isr")
    yardstick.note("isr")
    yardstick.run(700)
    assert len(rig.arrivals) > 10
    assert rig.arrivals == yardstick.arrivals
