"""Waveforms as stimulus: a VCD file of `emu run` reproduces its edges; CSV cells set pins and send bytes."""

from __future__ import annotations

import pytest

from emu.boards.epuck.stimulus import StimulusError, load_waveform
from emu.cli import main
from tests.vcd_reader import VCDVCD
from toolchain.driver.driver import main as compile_program

PULSES = """
#include <p30F6014A.h>
int main(void) {
    TRISBbits.TRISB8 = 0; TRISD &= ~0x100; ADPCFG = 0xFFFF;
    for (unsigned n = 1; n < 60; n++) {
        LATDbits.LATD8 ^= 1;
        for (unsigned i = 0; i < n * 7 % 40; i++) __asm__ volatile("nop");
        LATBbits.LATB8 ^= 1;
    }
    for (;;) __asm__ volatile("pwrsav #1");
}
"""
ECHO = """
#include <p30F6014A.h>
int main(void) {
    U2BRG = 7; U2MODE = 0x8000; U2STA = 0x400; TRISDbits.TRISD8 = 0; ADPCFG = 0xFFFF;
    for (;;) { if (U2STAbits.URXDA) U2TXREG = U2RXREG + 1; LATDbits.LATD8 = PORTBbits.RB8; }
}
"""


def compiled(folder, name: str, text: str):
    (folder / f"{name}.c").write_text(text)
    assert compile_program(["-Os", "-g", str(folder / f"{name}.c"), "-o", str(folder / f"{name}.elf")]) == 0
    return folder / f"{name}.elf"


def edges(path, pin: str):
    waves = VCDVCD(str(path))
    return waves[next(name for name in waves.signals if name.startswith(f"pins.{pin}"))].tv


def test_our_own_waveform_read_back_gives_the_same_edges(tmp_path, capsys):
    """If the recorded pins of one robot drive another's inputs, every edge is at the same time to the picosecond."""
    first, second = tmp_path / "first.vcd", tmp_path / "second.vcd"
    idle = compiled(tmp_path, "idle", "#include <p30F6014A.h>\nint main(void) { ADPCFG = 0xFFFF; for (;;) {} }")
    pulses = compiled(tmp_path, "pulses", PULSES)
    assert main(["run", str(pulses), "--cycles", "60000", "--vcd", str(first)]) == 0
    words = ["run", str(idle), "--cycles", "60000", "--stimulus", str(first), "--vcd", str(second)]
    assert main(words) == 0
    for pin in ("RB8", "RD8"):
        assert len(edges(first, pin)) > 50
        assert edges(first, pin)[1:] == edges(second, pin)[1:]


def test_csv_sets_pins_and_says_bytes(tmp_path, capsys):
    script = tmp_path / "events.csv"
    script.write_text("time, RB8, uart2\n0.001, 1, 65\n0.002, , 66\n0.003, 0,\n")
    target = tmp_path / "out.vcd"
    echo = compiled(tmp_path, "echo", ECHO)
    words = ["run", str(echo), "--seconds", "0.005", "--stimulus", str(script), "--vcd", str(target)]
    assert main([*words, "--uart2", str(tmp_path / "said")]) == 0
    assert (tmp_path / "said").read_bytes() == b"BC"
    levels = [(time / 1e12, level) for time, level in edges(target, "RD8") if time > 5e8]
    assert [level for _, level in levels] == ["1", "0"]
    assert levels[0][0] == pytest.approx(0.001, abs=2e-6)
    assert levels[1][0] == pytest.approx(0.003, abs=2e-6)


@pytest.mark.parametrize(
    ("name", "text", "line", "expected"),
    [
        ("a.csv", "when,RB8\n", 1, "expected column names"),
        ("a.csv", "time,RB8,RX9\n", 1, "RX9"),
        ("a.csv", "time,RB8\n0.1,1\n0.2,2\n", 3, "RB8: a level is 0 or 1, not '2'"),
        ("a.csv", "time,RB8\nsoon,1\n", 2, "expected a time in s, not 'soon'"),
        ("a.csv", "time,RB8\n1e999999999,1\n", 2, "expected a time in s, not '1e999999999'"),
        ("a.csv", "time,RB8\n1e12,1\n", 2, "at most 10^18 cycles"),
        ("a.csv", 'time,RB8\n0,"' + "1" * 140_000, 2, "field"),
        ("a.csv", "time,RB8\n0.1,1,1\n", 2, "expected 2 cells, found 3"),
        ("a.csv", "time,uart1\n0.1,256\n", 2, "uart1: expected a byte"),
        ("a.vcd", "hello\n", 1, "expected a VCD file"),
        (
            "a.vcd",
            "$timescale 1 ns $end\n$var wire 1 ! clk $end\n$enddefinitions $end\n#0\n1!\n",
            1,
            "named after pins",
        ),
    ],
)
def test_errors_are_reported_with_their_line(tmp_path, name, text, line, expected):
    path = tmp_path / name
    path.write_text(text)
    with pytest.raises(StimulusError) as raised:
        load_waveform(BOARD, path)
    assert str(raised.value).startswith(f"{path}:{line}: ")
    assert expected in str(raised.value)


class Chip:
    fcy = 14_745_600


class BOARD:
    chip = Chip
