"""Trace blocks: the branches and jumps that stay within a block, and unchanged states and cycles."""

from __future__ import annotations

import numpy as np
import pytest
from test_native_code import own_cache, pair  # noqa: F401  (the fixture)

from emu.chips.dspic30f6014a import DSPIC30F6014A
from emu.dspic30f.cycle_accounting import CycleAccounting
from emu.dspic30f.isa.codec import decode_for_execution
from emu.dspic30f.jit.counting import CycleCounting
from emu.dspic30f.jit.engine import JitEngine
from emu.dspic30f.jit.translate.region import Region, discover
from emu.dspic30f.jit.translate.trace_block import MAX_BRANCHES, MAX_COPIED, MAX_SKIPPED, TraceItem, trace_block
from tests.emu.jit.comparison.random_firmware import Firmware, difference, started, words_of

IFS0 = DSPIC30F6014A.sfrs["IFS0"].address
START = 0x200
SHIFT = words_of("LSR{.B} Ws, Wd", B=0, s=1, p=0, d=1, q=0)
XOR = words_of("XOR{.B} Wb, Ws, Wd", w=2, B=0, s=1, p=0, d=1, q=0)
COUNT = words_of("INC{.B} Ws, Wd", B=0, s=3, p=0, d=3, q=0)
LOAD = words_of("MOV{.B} Ws, Wd", B=0, s=4, g=1, d=5, h=0, w=0)
STORE = words_of("MOV{.W} Wns, f", s=3, f=0x900)
POP = words_of("POP.S")
WIDE = words_of("MOV{.W} #lit16, Wnd", k=7, d=6)


def over(*skipped: list[int]) -> list[int]:
    """Return BRA NC over `skipped`."""
    words = [word for one in skipped for word in one]
    return words_of("BRA NC, Expr", n=len(words)) + words


def jump(*unreached: list[int]) -> list[int]:
    """Return BRA over instructions."""
    words = [word for one in unreached for word in one]
    return words_of("BRA Expr", n=len(words)) + words


def past(words: list[int]) -> list[int]:
    """Return BTSC, which tests a bit of a changing register, and the instruction that it may skip."""
    return words_of("BTSC{.W} Ws, #bit4", s=3, p=0, b=0) + words


BODIES = {
    "a branch round one": SHIFT + over(XOR),
    "round two": SHIFT + over(XOR, COUNT),
    "as many as may be": SHIFT + over(*[COUNT] * MAX_SKIPPED),
    "one more": SHIFT + over(*[COUNT] * (MAX_SKIPPED + 1)),
    "round a load": SHIFT + over(LOAD),
    "round a store": SHIFT + over(STORE),
    "round what changes SR": SHIFT + over(POP, COUNT),
    "a skip": SHIFT + past(XOR),
    "one behind the other": (
        SHIFT + over(XOR) + past(COUNT) + SHIFT + over(COUNT) + past(WIDE) + SHIFT + over(XOR) + past(XOR)
    ),
    "before a pointer it has written": SHIFT + over(words_of("MOV{.W} #lit16, Wnd", k=0x902, d=4)) + LOAD,
    "before a call": SHIFT + over(XOR) + words_of("RCALL Expr", n=0x100),
    "a jump": SHIFT + jump(XOR) + COUNT + STORE,
    "a jump to more than is copied": jump(XOR) + COUNT * (MAX_COPIED + 3),
    "two jumps": SHIFT + jump(XOR) + COUNT + jump(SHIFT) + STORE,
    "a jump past a leader": jump(XOR) + COUNT + SHIFT + XOR + words_of("BRA N, Expr", n=-3),
    "a jump to a short and a long block": jump(XOR) + COUNT + SHIFT * MAX_COPIED + words_of("BRA N, Expr", n=-9),
    "a jump before a pointer it has written": words_of("MOV{.W} #lit16, Wnd", k=0x902, d=4) + jump(XOR) + LOAD,
    "a jump to a call": SHIFT + jump(COUNT) + words_of("RCALL Expr", n=0x100),
}


def firmware_of(body: list[int], corcon: int = 0) -> Firmware:
    """Return a program that repeats `body`. T1 matches every 97 Tcy, and its handler changes the operands of the
    body."""
    registers = {n: 0xB3 + n for n in range(15)} | {15: 0xA00, 4: 0x900, 2: 0xA001}
    changing = words_of("ADD{.B} #lit10, Wn", B=0, k=0x101, d=1)
    firmware, at = started(registers, (("PR1", 96), ("IEC0", 8), ("T1CON", 0x8000)), changing)
    firmware.put(at, words_of("PUSH.S") + words_of("GOTO Expr", n=START))
    at = firmware.put(START, body)
    at = firmware.put(at, words_of("ADD{.B} #lit10, Wn", B=0, k=0x2F, d=1) + COUNT)
    firmware.put(at, words_of("GOTO Expr", n=START))
    call = START + 2 * (len(SHIFT + over(XOR)) + 1 + 0x100)
    firmware.put(call, COUNT + words_of("RETURN"))
    return firmware


def region_of(body: list[int]) -> Region:
    """Return the region that begins at the body."""
    flash = firmware_of(body).flash
    return discover(START, lambda pc: decode_for_execution(flash.get(pc, 0), flash.get(pc + 2, 0)))


def block(body: list[int], barriers: set[int] | None = None, last: int = -1) -> list[TraceItem]:
    """Return the first block of the body."""
    region = region_of(body)
    return trace_block(region, START, region.leaders, barriers or set(), last)


def arms(body: list[int], barriers: set[int] | None = None, last: int = -1) -> list[int]:
    """Return the number of instructions that each branch of the first block skips."""
    return [len(item.skipped) for item in block(body, barriers, last) if item.skipped]


def places(body: list[int], barriers: set[int] | None = None, last: int = -1) -> list[int]:
    """Return the word offsets of the instructions of the first block, up to the end of the body."""
    offsets = [(item.step.pc - START) // 2 for item in block(body, barriers, last)]
    return [offset for offset in offsets if offset < len(body)]


@pytest.mark.parametrize(("name", "lengths"), [
    ("a branch round one", [1]), ("round two", [2]), ("as many as may be", [MAX_SKIPPED]), ("one more", []),
    ("a skip", [1]),
    ("round a load", []), ("round a store", []), ("one behind the other", [1] * MAX_BRANCHES), ("before a call", [1]),
])  # fmt: skip
def test_a_block_goes_past_what_only_computes(name: str, lengths: list[int]) -> None:
    """A block continues over branches that skip only computations: at most MAX_BRANCHES branches over at most
    MAX_SKIPPED instructions."""
    assert arms(BODIES[name]) == lengths


def test_a_block_ends_where_something_is_looked_at() -> None:
    """A hook within or after the skipped instructions, or the end of a DO loop there, ends the block."""
    skipped, behind = START + 4, START + 6
    body = BODIES["a branch round one"]
    assert arms(body) == [1]
    assert arms(body, {skipped}) == arms(body, {behind}) == arms(body, last=skipped) == []


def test_a_block_continues_at_the_target_of_one_jump() -> None:
    """A block continues with whole blocks of at most MAX_COPIED instructions behind its first jump.

    A hook at a target or the end of a DO loop ends it."""
    past_a_leader = BODIES["a jump past a leader"]
    assert places(past_a_leader) == [0, 2, 3, 4, 5]
    assert places(past_a_leader, {START + 6}) == [0, 2]
    assert places(past_a_leader, {START + 4}) == places(past_a_leader, last=START) == [0]
    assert places(past_a_leader, last=START + 8) == [0, 2, 3, 4]
    assert places(BODIES["a jump to a short and a long block"]) == [0, 2]
    assert places(BODIES["a jump to more than is copied"]) == [0]
    assert places(BODIES["two jumps"]) == [0, 1, 3, 4]


def test_a_loop_is_not_unrolled() -> None:
    """A jump back into its own block ends the block."""
    assert places(COUNT + words_of("BRA Expr", n=-2)) == [0, 1]


@pytest.mark.slow
@pytest.mark.parametrize("body", BODIES.values(), ids=BODIES)
def test_whole_records_are_equal_wherever_a_run_stops(body: list[int]) -> None:
    """Both engines have equal states at stops in every phase of the loop and of the interrupt."""
    plain, native = pair(firmware_of(body))
    for length in (*range(1, 130), 997, 5003):
        assert plain.run(length) == native.run(length)
        assert not difference(plain, native)


@pytest.mark.slow
@pytest.mark.parametrize("at", range(START, START + 2 * len(BODIES["one behind the other"]), 2))
def test_hooks_are_called_in_the_same_cycles(at: int) -> None:
    """Both engines call hooks on a branch, on skipped instructions and after them in the same cycles."""
    arrivals: list[list[int]] = []
    machines = list(pair(firmware_of(BODIES["one behind the other"])))
    for machine in machines:
        seen: list[int] = []
        machine.hook_pc(at, lambda m=machine, s=seen: s.append(m.cycle))  # type: ignore[misc]
        machine.run(5_000)
        arrivals.append(seen)
    assert arrivals[0] == arrivals[1]
    assert len(arrivals[0]) > 50
    assert not difference(*machines)


@pytest.mark.parametrize("name", ["one behind the other", "round what changes SR"])
def test_cycles_are_counted_on_both_ways(name: str) -> None:
    """Cycle accounting gives equal cycles by address in both engines, on both paths of a branch."""
    counted = []
    for machine in pair(firmware_of(BODIES[name])):
        accounting = CycleAccounting(machine.core, lambda _at, _count: None)
        if isinstance(machine.runner, JitEngine):
            machine.runner.start_counting(CycleCounting(accounting, lambda pc: pc))
        else:
            accounting.start()
        machine.run(20_000)
        counted.append(np.array(accounting.cells))
    assert counted[0].sum() > 19_000
    assert (counted[0] == counted[1]).all()
