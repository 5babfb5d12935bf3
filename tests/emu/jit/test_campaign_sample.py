"""A sample of tests/fuzz/emulator/fuzz_jit.py: straight, wild and long programs, and their counts."""

from __future__ import annotations

import pytest

from tests.emu.jit.comparison.engine_pair import (
    Difference,
    InstructionObserver,
    Tally,
    advance,
    check_straight,
    check_wild,
    engine_pair,
)
from tests.emu.jit.comparison.long_runs import check_long
from tests.emu.jit.comparison.straight_body import Shape
from tests.emu.jit.comparison.straight_firmware import straight_firmware

SHORT = Shape(instructions=250)


@pytest.mark.parametrize("seed", range(2))
def test_straight_programs_run_equally_in_blocks_and_in_exact_code(seed: int) -> None:
    """engines.md §4.3: straight programs give equal states in block code, in exact code and in the interpreter;
    native code executes most distinct instructions in both kinds of code."""
    tally = check_straight(seed, SHORT)
    assert len(tally.seen) > 150
    assert len(tally.native) > 0.8 * len(tally.seen)
    assert tally.stops >= 2


@pytest.mark.parametrize("seed", range(2))
def test_wild_programs_run_equally(seed: int) -> None:
    """engines.md §4.3: wild programs, with jumps, traps and mode changes at random places, give equal states."""
    assert check_wild(seed, stops=8).stops == 8


@pytest.mark.slow
def test_long_runs_end_equally_and_with_equal_counts_of_instructions() -> None:
    """Long runs of block code, exact code and the interpreter from one snapshot have equal final states and
    instruction counts."""
    tally = check_long(1, 200_000, share=0.3)
    assert tally.instructions["of these beside the interpreter"] > 50_000
    assert tally.entries["long"] > 30


def test_interrupts_hit_repeats_loops_and_stalls() -> None:
    """Interrupts occur in REPEAT, in loops and in stalls; the tally counts exceptions by the kind of place that they
    interrupted."""
    tally = Tally()
    for seed in (37, 39):
        tally.add(check_straight(seed, SHORT))
    assert tally.places["interrupts"] > 20
    assert min(tally.places[place] for place in ("inside REPEAT", "inside DO", "on a return")) > 0


def test_a_difference_is_found_and_what_python_ran_does_not_count_as_native() -> None:
    """A wrong bit is reported as a difference, and instructions that Python executed do not count as native."""
    plain, native = engine_pair(straight_firmware(1, SHORT), 0, 0)
    watch = InstructionObserver(plain, native)
    advance(plain, native, 500, Tally())
    assert watch.native_now() < set(watch.ran)
    assert all(watch.python[key] <= watch.ran[key] for key in watch.ran)
    native.poke("ACCAL", plain.peek("ACCAL") ^ 1)
    with pytest.raises(Difference, match=f"data {plain.address_of('ACCAL'):#06x}"):
        advance(plain, native, 1, Tally())


def test_tallies_survive_being_packed() -> None:
    """A packed tally restores all counts."""
    tally, other = check_wild(1, stops=3), Tally()
    other.unpack(tally.as_json(), tally.packed())
    assert other == tally
