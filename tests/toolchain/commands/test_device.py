"""Option -mcpu=: memory, registers, header and configuration words of another device, up to the running image."""

from __future__ import annotations

from pathlib import Path

import pytest

import emu
from emu.chips import chip_named
from toolchain import cli

CHIP = chip_named("30F4013")
PROGRAM = """
#include <xc.h>
#pragma config FOSFPR = XT_PLL8, WDT = WDT_OFF, GCP = CODE_PROT_ON
static volatile unsigned ticks, seen[30];
void __attribute__((interrupt, no_auto_psv)) _T1Interrupt(void)
{
    IFS0bits.T1IF = 0;
    seen[ticks++] = PORTAbits.RA11;
}
int main(void)
{
    PR1 = 1000;
    IEC0bits.T1IE = 1;
    T1CON = 0x8000;
    while (ticks < 5)
        ;
    T1CON = 0;
    return (TRISA == 0x0800) + seen[0];
}
"""


def build(tmp_path: Path, text: str, *words: str) -> Path:
    """Return the image of a program for the 30F4013."""
    source, image = tmp_path / "a.c", tmp_path / "a.elf"
    source.write_text(text)
    assert cli.main(["cc", "-Os", "-mcpu=30F4013", *words, str(source), "-o", str(image)]) == 0
    return image


def test_a_program_for_another_part_runs_on_it(tmp_path: Path) -> None:
    """A program for the 30F4013 runs on it: device name, pin RA11, stack, data and vectors fit the device."""
    image = build(tmp_path, PROGRAM)
    machine = emu.load(image, board=None)
    assert machine.chip.name == CHIP.name
    machine.pins.set("RA11", 1)
    stop = machine.run(cycles=100_000)
    assert (stop.reason, machine.w[0]) == ("halt", 2)
    assert machine.peek("_ticks") == 5
    assert machine.w[15] < machine.peek("SPLIM") < CHIP.data["ram"].end
    assert machine.program.setting("FGS") == 0xFFFD


def test_a_program_larger_than_its_memory_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A program that fits the RAM of the 30F6014A but not the 2 KB of the 30F4013 is refused."""
    source = tmp_path / "a.c"
    source.write_text("static char big[3000]; int main(void) { return (int)(unsigned)&big; }")
    assert cli.main(["cc", "-Os", "-mcpu=30F4013", str(source), "-o", str(tmp_path / "a.elf")]) == 2
    assert "data memory 0x800..0xfff overflows" in capsys.readouterr().err
    assert cli.main(["cc", "-Os", str(source), "-o", str(tmp_path / "a.elf")]) == 0


def test_an_unknown_device_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """An unknown device gives one message and exit status 2."""
    assert cli.main(["cc", "-mcpu=30F2010", "a.c"]) == 2
    assert "device '30F2010' is not supported (expected 30F6014A, 30F4013," in capsys.readouterr().err
