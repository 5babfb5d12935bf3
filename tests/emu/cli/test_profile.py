"""`emu profile`: every cycle is counted once."""

from __future__ import annotations

import pytest

from emu.loader import load_image
from emu.machine import Machine
from emu.profile import Profiler
from toolchain.driver import main as compile_program

SOURCE = """
#include <p30F6014A.h>
volatile unsigned int ticks;
void __attribute__((interrupt, no_auto_psv)) _T1Interrupt(void) { IFS0bits.T1IF = 0; ticks++; }
__attribute__((noinline)) void spin(void) { for (int i = 0; i < 10; i++) __asm__ volatile("nop"); }
int main(void) {
    PR1 = 999; T1CON = 0x8000; IEC0bits.T1IE = 1;
    for (;;) { spin(); __asm__ volatile("pwrsav #1"); }
}
"""


@pytest.fixture(scope="module")
def image(tmp_path_factory):
    folder = tmp_path_factory.mktemp("profile")
    source, target = folder / "timer.c", folder / "timer.elf"
    source.write_text(SOURCE)
    assert compile_program(["-Os", "-g", "-fxc16-attributes", str(source), "-o", str(target)]) == 0
    return load_image(target)


def profile_of(image, cycles: int, skip: int = 5_000):
    machine = Machine(image.chip, engine="interp")
    machine.load(image)
    machine.run_until(skip)
    return machine, Profiler(machine, image).run(machine.cycle + cycles)


def test_shares_add_up_and_repeat_with_the_timer(image):
    """1000 Tcy from interrupt to interrupt (dspic30f6014a.md §7): ten periods are ten times one."""
    _, ten = profile_of(image, 10_000)
    _, one = profile_of(image, 1_000)
    assert ten.cycles == 10_000
    assert ten.busy == sum(ten.levels.values()) == sum(ten.files.values()) == sum(ten.functions.values())
    assert dict(ten.functions) == {n: 10 * c for n, c in one.functions.items()}
    assert ten.idle == 10 * one.idle > 5_000


def test_entering_an_interrupt_counts_for_its_handler(image):
    """isa.md §14.2: from the first cycle that runs to the handler's first instruction; the machine's own count of what
    happens at level 4, the reset priority."""
    _, one = profile_of(image, 1_000)
    assert one.functions["__T1Interrupt"] == one.levels[4]
    machine = Machine(image.chip, engine="interp")
    machine.load(image)
    machine.run_until(5_000)
    handler = image.symbols.find("_T1Interrupt").address
    assert machine.run(cycles=2_000, until=handler).reason == "until"
    start = machine.cycle
    while machine.state.ipl:
        machine.step()
    assert one.levels[4] == machine.cycle - start + 3


def test_groups_match_functions_and_files(image):
    _, one = profile_of(image, 1_000)
    assert one.group(["_spin"]) == one.functions["_spin"]
    assert one.group(["*/timer.c"]) == one.busy
    assert not one.matched("spin")
