"""Engines take memory limits, vectors and interrupt numbers from `Chip`, which a fictitious chip shows."""

from __future__ import annotations

from dataclasses import replace

import pytest

from emu.chips.chip import Region
from emu.chips.dspic30f6014a import DSPIC30F6014A
from emu.dspic30f.engines import NAMES
from emu.dspic30f.isa.table import ROWS
from emu.dspic30f.jit.engine import JitEngine
from emu.machine.machine import Machine
from tests.emu.chips.made_up import FLASH_END, MADE_UP, RAM_END, SFR_END, Y_START
from tests.emu.cpu.cpu_rig import assemble
from tests.emu.cpu.engine_fuzz import check_pairs, check_programs
from tests.emu.jit.comparison.engine_pair import QuickCompiler, check_wild

ENGINES = [name for name in NAMES if name != "auto"]
NO_WATCHDOG = 0x7FFF


def machine_with(engine: str, text: str, **registers: int) -> Machine:
    """Return a machine with the fictitious chip at the first instruction of `text`."""
    machine = Machine(MADE_UP, engine=engine)
    if isinstance(machine.runner, JitEngine):
        machine.runner.threshold, machine.runner.wait, machine.runner.compiler = 1, True, QuickCompiler(0)
    machine.program.put(MADE_UP.config["FWDT"].address, NO_WATCHDOG)
    machine.stop_on_fault = False
    machine.reset("POR")
    words, labels = assemble(text)
    for address, word in words.items():
        machine.program.put(address, word)
    for vector in MADE_UP.vectors:
        if vector.name in labels:
            machine.program.put(vector.ivt, labels[vector.name])
    machine.pc = min(words)
    for number in range(15):
        machine.w[number] = registers.get(f"w{number}", 0)
    return machine


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("store", ["mov w1, [w0]", "mov.b w1, [w0]", "push w1"])
@pytest.mark.parametrize(("address", "inside"), [(RAM_END - 2, True), (RAM_END, False), (0x2000, False)])
def test_ram_ends_where_the_chip_says(engine: str, store: str, address: int, inside: bool) -> None:
    """isa.md §14.4 cause 3: a store beyond the chip's RAM is an address error and writes nothing."""
    text = f"{store}\nend: bra end\nAddressError: bra AddressError"
    states = []
    for name in ("plain", engine):
        machine = machine_with(name, text, w0=address, w1=0x55AA)
        machine.w[15] = address if store.startswith("push") else SFR_END + 0x100
        machine.run_until(machine.cycle + 12)
        assert (machine.peek("INTTREG") & 0x3F == 2) is not inside
        assert not inside or machine.peek(address, 1) == 0xAA
        states.append(machine.snapshot())
    assert states[0] == states[1]


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("address", [SFR_END, Y_START - 2, Y_START, RAM_END - 2])
def test_prefetches_know_where_y_ram_begins(engine: str, address: int) -> None:
    """isa.md §1.2: X prefetches read 0 from the chip's Y RAM, and Y prefetches read 0 from outside of it."""
    machine = machine_with(engine, "movsac a, [w8], w4, [w10], w5\nend: bra end", w8=address, w10=address)
    machine.poke(address, 0x1111)
    machine.run_until(machine.cycle + 4)
    in_y = address >= Y_START
    assert (machine.w[4], machine.w[5]) == ((0, 0x1111) if in_y else (0x1111, 0))


@pytest.mark.parametrize("engine", ENGINES)
def test_a_stack_pointer_at_the_end_of_ram_cannot_take_an_interrupt_natively(engine: str) -> None:
    """isa.md §14.4: an exception frame must fit below the end of RAM with both words; otherwise native code leaves
    the address error to Python."""
    text = "inc w2, w2\nloop: bra loop\nT1Interrupt: bra T1Interrupt\nAddressError: bra AddressError"
    states = []
    for name in ("plain", engine):
        machine = machine_with(name, text)
        source = next(source for source in MADE_UP.interrupts.values() if source.name == "T1")
        machine.w[15] = RAM_END - 2
        machine.write("PR1", 20)
        machine.write(source.enable[0], 1 << source.enable[1])
        machine.write("T1CON", 0x8000)
        machine.run_until(60)
        states.append(machine.snapshot())
    assert states[0] == states[1]


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("begun", [0, 4])
def test_reset_puts_the_stack_at_the_start_of_ram_and_fetches_end_with_flash(engine: str, begun: int) -> None:
    """isa.md §2.1, §14.4 cause 5: reset sets the stack pointer to the start of RAM, and a fetch beyond flash is an
    address error, also in the first cycle after reset."""
    machine = machine_with(engine, "AddressError: bra AddressError")
    assert machine.w[15] == SFR_END
    machine.run_until(begun)
    machine.pc = FLASH_END
    machine.run_until(machine.cycle + 8)
    assert machine.peek("INTTREG") & 0x3F == 2


def test_an_inconsistent_memory_map_is_refused() -> None:
    """A chip is refused unless Y RAM is the upper part of RAM and RAM follows the SFRs, on which the engines rely."""
    with pytest.raises(ValueError, match="do not follow each other"):
        replace(DSPIC30F6014A, data=dict(DSPIC30F6014A.data) | {"yram": Region("yram", 0x1A00, 0x2800)})


@pytest.mark.slow
def test_a_sample_of_the_instruction_campaign() -> None:
    """A sample of tests/fuzz/emulator/fuzz_engines.py with the fictitious chip finds no difference."""
    assert check_pairs(7, len(ROWS), 1, "jit", MADE_UP)
    assert check_programs(7, 4, "jit", MADE_UP)


@pytest.mark.parametrize("seed", [1, 3, 5])
def test_a_sample_of_the_native_campaign(seed: int) -> None:
    """A sample of tests/fuzz/emulator/fuzz_jit.py with the fictitious chip finds no difference."""
    assert check_wild(seed, stops=8, chip=MADE_UP).stops == 8
