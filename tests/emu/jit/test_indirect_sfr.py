"""Indirect SFR access: native if a direct access is native, otherwise left to Python."""

from __future__ import annotations

import pytest
from test_native_code import eager, own_cache  # noqa: F401  (the fixture)

from emu.chips.dspic30f6014a import DSPIC30F6014A
from emu.dspic30f.jit.engine import JitEngine
from emu.machine.machine import Machine
from tests.emu.cpu.cpu_rig import START, assemble
from tests.emu.jit.comparison.random_firmware import difference

AT = {name: f"{sfr.address:#x}" for name, sfr in DSPIC30F6014A.sfrs.items()}

NATIVE = {
    "a count": ("TMR2", ["mov [w8], w2", "mov.b [w8], w3", "mov.b [w8+1], w3", "add w3, [w8], w3", "mov w1, [w8]"]),
    "two counts": ("TMR2", ["mov.d [w8++], w2", "mov.d [--w8], w4", "mov.d [w8], w2"]),
    "a period": ("PR2", ["mov [w8++], w2", "mov [--w8], w3", "mov #0xFF00, w5", "mov w5, [w8]"]),
    "a latch": ("LATD", ["mov w1, [w8]", "mov.b w1, [++w8]", "btg.b [w8--], #3", "ior w1, [w8], [w8]"]),
    "a port": ("PORTD", ["mov [w8++], w2", "mov w1, [--w8]", "mov.b w1, [w8+1]", "btss [w8], #3", "mov [w8], [w9]"]),
    "flags": ("IFS1", ["mov [w8], w2", "bclr.b [w8], #1", "cp0 [w8]"]),
    "enables": ("IEC2", ["mov w1, [w8]", "btg [w8], #5", "mov.b [w8+1], w2"]),
    "results": ("ADCBUF0", ["mov [w8++], w2", "mov [w8++], [w9++]", "mov.b [w8], w3", "mov.d [w8], w4"]),
}  # fmt: skip
"""Registers to which W8 points, and the accesses through it. W9 points to RAM."""
PYTHONS = {
    "the settings of a timer": ("T2CON", "mov w7, [w8]"),
    "a wrong address": ("TMR2", "mov [w8+w3], w2"),
    "the modes": ("CORCON", "mov w7, [w8]"),
    "two registers at once": ("LATD", "mov.d w4, [w8]"),
}


def machines(lines: list[str], corcon: str) -> tuple[Machine, Machine]:
    """Return machines with both engines that run `lines` in a loop, with the ADC on and a timer match every 187 Tcy."""
    head = [f"mov #{corcon}, w0", "mov w0, 0x44", "mov #0x900, w15", "mov #0x8001, w7", f"mov w7, {AT['T1CON']}"]
    for name, value in (("PR1", 186), ("PR2", 0xFFFF), ("T2CON", 0x8000), ("ADCSSL", 0x30), ("ADCON2", 0x404),
                        ("ADCON3", 0x1F3F), ("ADCON1", 0x80E4)):  # fmt: skip
        head += [f"mov #{value:#x}, w0", f"mov w0, {AT[name]}"]
    words, labels = assemble("\n".join([*head, "loop: inc w1, w1", *lines, "goto loop", "trap: goto loop"]))
    made = eager("plain"), eager("jit")
    for machine in made:
        machine.stop_on_fault = False
        machine.program.put(0xF80002, 0x7FFF)  # no watchdog
        machine.reset("POR")
        for at, word in (words | {2 * n: labels["trap"] for n in range(2, 64)} | {0: 0x040000 | START, 2: 0}).items():
            machine.program.put(at, word)
    return made


def compare(plain: Machine, native: Machine) -> int:
    """Run both machines to random stops and compare them. Return the instructions that Python executes per thousand
    Tcy at the end."""
    assert isinstance(native.runner, JitEngine)
    for length in (*range(1, 30), 997):
        assert plain.run(length) == native.run(length)
        assert not difference(plain, native)
    before = native.runner.counts.interpreted
    assert plain.run(10_000) == native.run(10_000)
    assert not difference(plain, native)
    return (native.runner.counts.interpreted - before) // 10


@pytest.mark.parametrize(("name", "accesses"), NATIVE.values(), ids=NATIVE)
def test_accesses_by_pointer_are_native_where_direct_ones_are(name: str, accesses: list[str]) -> None:
    """Reads and writes of words and bytes by pointer are native, with the PSV window on or off. Python only handles
    accesses in the cycle of an event, such as the timer match every 187 Tcy."""
    corcon = "0x24" if name.startswith(("ADC", "LAT")) else "0x20"
    plain, native = machines([f"mov #{AT[name]}, w8", "mov #0x1000, w9", *accesses], corcon)
    assert compare(plain, native) < 6


@pytest.mark.parametrize("name", ["LATD", "TMR2", "PR2", "IFS0"])
def test_a_constant_reaches_a_register_when_the_window_has_been_read(name: str) -> None:
    """isa.md §13.3: a read of the PSV window takes one or two extra cycles before the store, so events due in these
    cycles happen before the store."""
    lines = [f"mov #{AT[name]}, w8", "mov #0x8200, w6", "mov [w6++], [w8]", "ior w1, [w6], [w8]", "mov.b [w6], [w8]"]
    plain, native = machines(lines, "0x24")
    compare(plain, native)


@pytest.mark.parametrize(("name", "access"), PYTHONS.values(), ids=PYTHONS)
def test_what_a_direct_access_leaves_to_python_a_pointer_leaves_too(name: str, access: str) -> None:
    """Python handles accesses by pointer to registers without a rule, traps, mode registers, and two writes of which
    the second may be refused."""
    plain, native = machines([f"mov #{AT[name]}, w8", "mov #1, w3", access], "0x20")
    assert compare(plain, native) > 20


def test_a_loop_that_waits_for_the_time_by_pointer_is_not_skipped() -> None:
    """A loop that polls a timer through a pointer is not skipped as empty, because the pointer may lead to an SFR."""
    lines = [f"mov #{AT['TMR2']}, w8", "mov #7, w2", "wait: mov [w8], w3", "cp w3, w2", "bra nz, wait"]
    plain, native = machines(lines, "0x20")
    assert compare(plain, native) > 20


def test_the_converter_restarts_and_changes_its_channels_natively() -> None:
    """The sequence with which drivers restart the ADC is native: switch it off by a word write, select other
    channels, switch it on."""
    lines = ["mov #0x00E4, w2", f"mov w2, {AT['ADCON1']}", "and w1, #3, w3", "bset w3, #4",
             f"mov w3, {AT['ADCSSL']}", "mov #0x80E4, w2", f"mov w2, {AT['ADCON1']}", "repeat #400", "nop"]  # fmt: skip
    plain, native = machines(lines, "0x20")
    assert compare(plain, native) < 6
