"""Generated code of interrupt functions (abi-elf.md §2.5)."""

from __future__ import annotations

from pathlib import Path

import pytest

import emu
from tests.toolchain.c_programs import build


def assembly_of(folder: Path, c_text: str, level: str = "-Os") -> str:
    """Return the assembly of one C file."""
    (folder / "x.c").write_text("#include <dspic30f6014a.h>\n" + c_text)
    built = build([folder / "x.c"], folder / "x.s", level, "-S")
    assert built.status == 0, built.messages
    return (folder / "x.s").read_text()


def body_of(text: str, name: str) -> list[str]:
    """Return the instructions of one function, without labels and directives."""
    part = text.split(f"\n{name}:", 1)[1].split(".size", 1)[0]
    lines = [line.strip() for line in part.splitlines() if line.startswith("\t")]
    return [line for line in lines if line and not line.startswith(".")]


def test_minimal_handler_is_two_words(tmp_path: Path) -> None:
    """A minimal handler has two words, INC f and RETFIE, and saves no registers (abi-elf.md §2.5)."""
    text = assembly_of(tmp_path, "volatile int n; OS_ISR(_T1Interrupt) { n++; }")
    assert body_of(text, "__T1Interrupt") == ["inc _n", "retfie"]


def test_handler_that_calls_saves_rcount_and_w0_to_w7(tmp_path: Path) -> None:
    """A handler with a call saves RCOUNT and W0 to W7 and restores them in reverse (abi-elf.md §2.5 items 2 and 3)."""
    body = body_of(assembly_of(tmp_path, "void f(void); OS_ISR(_T1Interrupt) { f(); }"), "__T1Interrupt")
    assert body[:5] == ["push _RCOUNT", "mov.d w0,[w15++]", "mov.d w2,[w15++]", "mov.d w4,[w15++]", "mov.d w6,[w15++]"]
    assert body[-6:] == [
        "mov.d [--w15],w6", "mov.d [--w15],w4", "mov.d [--w15],w2", "mov.d [--w15],w0", "pop _RCOUNT", "retfie",
    ]  # fmt: skip


def test_shadow_handler_uses_the_shadow_registers(tmp_path: Path) -> None:
    """A handler with the attribute `shadow` uses the shadow registers (abi-elf.md §2.5)."""
    text = assembly_of(tmp_path, "volatile int a, b; OS_ISR_SHADOW(_T1Interrupt) { a = b + 3; }")
    body = body_of(text, "__T1Interrupt")
    assert body[0] == "push.s"
    assert body[-2:] == ["pop.s", "retfie"]


def test_auto_psv_handler_loads_and_restores_psvpag(tmp_path: Path) -> None:
    """An auto_psv handler loads and restores PSVPAG (abi-elf.md §2.5 item 6)."""
    source = "volatile int a; OS_ISR_AUTO_PSV(_T1Interrupt) { static const int t[3] = {5, 6, 7}; a = t[a]; }"
    body = "\n".join(body_of(assembly_of(tmp_path, source), "__T1Interrupt"))
    assert "push _PSVPAG" in body
    assert "#__const_psvpage" in body
    assert body.endswith("retfie")
    assert body.index("pop _PSVPAG") > body.index("#__const_psvpage")


SHARED = """
volatile unsigned in = 0x15, word, ran; volatile unsigned char byte;
volatile struct { unsigned a : 1, b : 1, c : 1, : 5, d : 1; } field;
OS_ISR(_T1Interrupt) { _T1IF = 0; ran++; word |= 0x100; byte |= 0x80; field.d = 1; _LATD0 = 1; }
__attribute__((noinline)) void work(void)
{
    field.a = 1; field.b = 1; field.b = 0; _LATD1 = 1; word |= 2; word ^= 4;
    if (in & 1) field.b = 1; else field.b = 0;
    if (in & 0x10) word |= 0x40; else word &= ~0x40;
    if (in & 0x200) byte |= 2; else byte &= ~2;
    if ((int)in < 0) word &= ~0x8000; else word |= 0x8000;
    switch (in & 3) {
    case 0: word |= 0x400; break;
    case 1: word &= ~0x400; break;
    case 2: word |= 0x800; break;
    default: word &= ~0x800;
    }
    _LATD3 = in & 8 ? 1 : 0;
    field.c = field.a;
    field.a ^= 1;
}
__attribute__((noinline)) void done(void) { Nop(); Nop(); Nop(); Nop(); Nop(); }
int main(void)
{
    _T1IE = 1;
    work();
    done();
    return ran * 100 + (word & 0x100) / 0x20 + (byte & 0x80) / 0x20 + field.d * 2 + _LATD0;
}
"""


@pytest.mark.parametrize("level", ["-O1", "-Os", "-O2"])
def test_single_bit_writes_of_a_handler_are_not_lost(level: str, tmp_path: Path) -> None:
    """Single-bit writes of program and handler to the same words are not lost (isa.md §5.4).

    T1 interrupts in every cycle.
    """
    (tmp_path / "x.c").write_text(f"#include <dspic30f6014a.h>\n{SHARED}")
    built = build([tmp_path / "x.c"], tmp_path / "x.elf", level)
    assert built.status == 0, built.messages
    machine = emu.load(tmp_path / "x.elf", engine="auto")
    machine.run(until="work", cycles=100_000)
    first, state = machine.cycle, machine.snapshot()
    machine.run(until="done", cycles=100_000)
    last = machine.cycle
    assert last - first > 40
    for cycle in range(first, last):
        machine.restore(state)
        machine.run_until(cycle)
        state = machine.snapshot()
        machine.poke("IFS0", machine.peek("IFS0") | 8)
        assert machine.run(cycles=100_000).reason == "halt"
        assert machine.w[0] == 100 + 8 + 4 + 2 + 1, cycle - first
