"""The trace of each engine equals one made by single steps, in one run or in slices, and changes no state."""

from __future__ import annotations

import io
from pathlib import Path

import pytest

import emu
from emu.debug.disassembly import instruction
from emu.image.loader import load_image
from emu.image.model import Image
from emu.instruments.trace import HEADER, SILENT, Tracer
from emu.machine.machine import Machine
from tests.emu.jit.comparison.compiled_program import compile_eagerly
from tests.emu.jit.comparison.random_firmware import load, random_firmware
from toolchain.driver import driver

HELLO = Path(__file__).parents[1] / "cli" / "hello.hex"
SOURCE = """
#include <p30F6014A.h>
#include <string.h>
volatile int ticks; volatile long total; char text[40], copy[40];
void __attribute__((interrupt, no_auto_psv)) _T1Interrupt(void) { IFS0bits.T1IF = 0; ticks++; }
static int mix(int n) { return n % 7 == 3 ? n * 5 : n / 3; }
int main(void) {
    PR1 = 700; IEC0bits.T1IE = 1; T1CON = 0x8000; U1MODE = 0x8000; U1STA = 0x400;
    for (int i = 0; ; i++) {
        for (int k = 0; k < 40; k++) { text[k] = (char)mix(i + k); total += text[k]; }
        memcpy(copy, text, sizeof copy);
        while (!U1STAbits.TRMT) {}
        U1TXREG = (char)i;
        if (i % 4 == 0) __asm__ volatile("pwrsav #1");
        if (i == 20) __asm__ volatile("disi #0x3fff\\n pwrsav #1\\n reset");
    }
}
"""


def stepped(machine: Machine, image: Image, until: int) -> str:
    """Return the trace of a run to cycle `until`, made by single steps."""
    core = machine.record.u16[:42]
    names = {
        sfr.address // 2: "W" + sfr.name.removeprefix("WREG") if sfr.name.startswith("WREG") else sfr.name
        for sfr in image.chip.sfrs.values()
        if sfr.address < 84 and sfr.name not in SILENT
    }
    lines = [HEADER]

    def write(cycle: int, text: str, before: list[int]) -> None:
        pairs = enumerate(zip(before, core.tolist(), strict=True))
        changed = [f"{names[n]}={new:04X}" for n, (old, new) in pairs if old != new and n in names]
        lines.append(f"{cycle:12} {text:54}  {' '.join(changed)}".rstrip())

    while machine.cycle < until:
        cycle, pc, before = machine.cycle, machine.pc, core.tolist()
        stop = machine.service_boundary(until)
        if machine.pc != pc:
            write(cycle, f"{'':8}  -- exception: {image.symbols.text(machine.pc)}", before)
        elif machine.cycle != cycle:
            write(cycle, f"{'':8}  -- nothing executed for {machine.cycle - cycle:,} cycles", before)
        if stop is not None or machine.cycle >= until:
            break
        cycle, pc, before = machine.cycle, machine.pc, core.tolist()
        word = machine.program.word(pc)
        item = instruction(image, pc, word, machine.program.word(pc + 2))
        stop = machine.step()
        if machine.cycle != cycle:
            write(cycle, f"{pc:#08x}  {item.text if item is not None else f'.pword {word:#08x}'}", before)
        if stop is not None:
            break
    return "\n".join(lines) + "\n"


def traced(machine: Machine, image: Image, until: int, cycles: int) -> str:
    """Return the trace of a run to cycle `until` in slices of `cycles` Tcy."""
    stream = io.StringIO()
    tracer = Tracer(machine, image, stream)
    while machine.cycle < until and tracer.advance(min(until, machine.cycle + cycles)) is None:
        pass
    tracer.close()
    return stream.getvalue()


def check(one: str, other: str) -> None:
    """Compare two traces; a failure shows the first line that differs."""
    found, expected = one.splitlines(), other.splitlines()
    first = next((n for n, pair in enumerate(zip(found, expected, strict=False)) if pair[0] != pair[1]), None)
    assert first is None or found[first - 1 : first + 2] == expected[first - 1 : first + 2]
    assert len(found) == len(expected)


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("trace")
    (folder / "p.c").write_text(SOURCE)
    assert driver.main(["-Os", str(folder / "p.c"), "-o", str(folder / "p.elf")]) == 0
    return folder / "p.elf"


@pytest.mark.parametrize(
    ("engine", "slices"), [pytest.param("plain", 1 << 30, marks=pytest.mark.slow), ("jit", 1 << 30), ("jit", 777)]
)
def test_a_program_with_interrupts_idle_and_a_reset(path: Path, engine: str, slices: int) -> None:
    image, until = load_image(path), 60_000
    stepping, machine = emu.load(path, engine="plain", board=None), emu.load(path, engine=engine, board=None)
    expected = stepped(stepping, image, until)
    assert expected.count("exception") > 20
    assert expected.count("nothing executed") > 0
    check(traced(machine, image, until, slices), expected)
    assert machine.snapshot() == stepping.snapshot()


@pytest.mark.parametrize("seed", range(6))
def test_random_firmware(seed: int) -> None:
    """Random instructions of every row, with traps, REPEAT, DO and interrupts, give equal traces."""
    image = load_image(HELLO)
    texts, states = [], []
    for engine in ("stepped", "jit"):
        machine = Machine(engine=engine.replace("stepped", "plain"))
        machine.stop_on_fault = False
        compile_eagerly(machine)
        load(machine, random_firmware(seed))
        texts.append(stepped(machine, image, 2_500) if engine == "stepped" else traced(machine, image, 2_500, 900))
        states.append(machine.snapshot())
    check(texts[1], texts[0])
    assert states[0] == states[1]


def test_one_instrument_at_a_time_and_none_after_the_end(path: Path) -> None:
    image = load_image(path)
    for engine in ("plain", "jit"):
        machine = emu.load(path, engine=engine, board=None)
        stream = io.StringIO()
        tracer = Tracer(machine, image, stream)
        with pytest.raises(ValueError, match="one instrument at a time"):
            Tracer(machine, image, io.StringIO())
        tracer.advance(500)
        tracer.close()
        length = len(stream.getvalue())
        machine.advance(1_000)
        assert len(stream.getvalue()) == length > 1_000
