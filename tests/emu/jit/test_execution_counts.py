"""Coverage by native counters equals that of the plain engine, which counts every instruction by itself."""

from __future__ import annotations

from pathlib import Path

import pytest

import emu
from emu.image.loader import load_image
from emu.instruments.coverage import Counts, count_executions
from emu.machine.machine import Machine
from emu.profile.cycle_shares import Profiler
from tests.emu.jit.comparison.compiled_program import build, compile_eagerly
from tests.emu.jit.comparison.random_firmware import load, random_firmware
from toolchain.driver import driver

SOURCE = """
#include <p30F6014A.h>
volatile int ticks; volatile long total; char text[40];
void __attribute__((interrupt, no_auto_psv)) _T1Interrupt(void) { IFS0bits.T1IF = 0; ticks++; }
static int mix(int n) { return n % 7 == 3 ? n * 5 : n / 3; }
int main(void) {
    PR1 = 700; IEC0bits.T1IE = 1; T1CON = 0x8000; U1MODE = 0x8000; U1STA = 0x400;
    for (int i = 0; ; i++) {
        for (int k = 0; k < 40; k++) { text[k] = (char)mix(i + k); total += text[k]; }
        while (!U1STAbits.TRMT) {}
        U1TXREG = (char)i;
        if (i % 4 == 0) __asm__ volatile("pwrsav #1");
    }
}
"""


def counted(machine: Machine, cycles: int) -> tuple[Counts, bytes]:
    """Run with counters and return the counts and the final state."""
    counts = Counts()
    compile_eagerly(machine)
    stop = count_executions(machine, counts)
    machine.run(cycles=cycles)
    stop()
    return counts, machine.snapshot()


@pytest.fixture(scope="module")
def image(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build(tmp_path_factory.mktemp("counts"), SOURCE)


def test_a_program_with_interrupts_loops_and_polls(image: Path) -> None:
    """Counts of executions and of taken branches are equal, and counting changes no state."""
    plain, state = counted(emu.load(image, engine="plain", board=None), 120_000)
    native, other = counted(emu.load(image, engine="jit", board=None), 120_000)
    assert native.executed == plain.executed
    assert native.taken == plain.taken
    assert state == other
    assert sum(plain.executed.values()) > 60_000


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_random_firmware(seed: int) -> None:
    """Random instructions of every row, with traps, REPEAT, DO and interrupts, give equal counts."""
    found = []
    for engine in ("plain", "jit"):
        machine = Machine(engine=engine)
        load(machine, random_firmware(seed))
        found.append(counted(machine, 6_000))
    (plain, state), (native, other) = found
    assert state == other
    assert native.executed == plain.executed
    assert native.taken == plain.taken


REPEATS = """
    .include "p30F6014A.inc"
    .global __reset
__reset: mov #0x900, w15
again:  inc w4, w4
    and w4, #3, w6
    repeat w6
    inc 0x0A00
    repeat #2
    mov w4, 0x0A02
    bra again
"""


def test_a_repeat_with_a_count_of_0_counts_for_itself(tmp_path: Path) -> None:
    """The cycle of REPEAT and that of its target, which then runs once, belong to two instructions (isa.md §7.5)."""
    source, target = tmp_path / "p.s", tmp_path / "p.elf"
    source.write_text(REPEATS)
    assert driver.main(["-nostdlib", "-nostartfiles", str(source), "-o", str(target)]) == 0
    image = load_image(target)
    counts, profiles = [], []
    for engine in ("plain", "jit"):
        counted_one, _ = counted(emu.load(target, engine=engine, board=None), 3_000)
        counts.append((counted_one.executed, counted_one.taken))
        machine = emu.load(target, engine=engine, board=None)
        compile_eagerly(machine)
        profiles.append(Profiler(machine, image).run(3_000).addresses)
    assert counts[0] == counts[1]
    assert profiles[0] == profiles[1]
    repeat = 4 + image.symbols.find("again").address  # type: ignore[union-attr]
    assert counts[0][0][repeat + 2] > 2 * counts[0][0][repeat] > 400


def test_counting_ends(image: Path) -> None:
    """After the end of counting, the engine runs its usual code and counts nothing."""
    machine = emu.load(image, engine="jit", board=None)
    counts, _ = counted(machine, 20_000)
    before = counts.executed.copy()
    machine.run(cycles=20_000)
    assert counts.executed == before
