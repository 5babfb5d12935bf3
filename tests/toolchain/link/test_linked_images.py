"""Linked images on the emulator: start-up, constants, function pointers above 64 K, EEPROM, interrupt vectors."""

import subprocess
import sys
from pathlib import Path

import pytest

from emu.api import load
from tests.watchdog import HANG
from toolchain.asm.assemble import assemble
from toolchain.elf.write import executable_bytes
from toolchain.link.hexfile import hex_text
from toolchain.link.link import link
from toolchain.link.options import LinkOptions

CRT0 = Path(__file__).resolve().parents[3] / "toolchain" / "runtime" / "crt0.s"

PROGRAM = """
    .global _main, __T1Interrupt
    .section .const,psv,page
text: .asciz "psv"
    .section .eedata,eedata
stored: .word 0xBEEF
    .section .ndata,data,near
odd: .byte 1, 2, 3
    .align 2
table: .word handle(far), handle(near), odd
    .section .nbss,bss,near
zero: .space 8
sum:  .space 2
seen: .space 2
from_psv: .space 2
from_ee: .space 2
ticks: .space 2
    .section high,code,address(0x14000)
far: inc sum
    return
    .text
near: inc2 sum
    return
_main:
    mov #table, w8
    mov [w8++], w0
    call w0
    mov [w8++], w0
    call w0
    mov [w8], w1
    mov.b [w1+2], w2
    ze w2, w2
    mov w2, seen
    mov #psvoffset(text), w1
    mov [w1], w2
    mov w2, from_psv
    mov TBLPAG, w3
    mov #tblpage(stored), w0
    mov w0, TBLPAG
    mov #tbloffset(stored), w0
    tblrdl [w0], w2
    mov w2, from_ee
    mov w3, TBLPAG
    mov #300, w0
    mov w0, PR1
    bset IEC0, #3
    bset T1CON, #15
1:  mov ticks, w0
    cp w0, #3
    bra ltu, 1b
    mov #42, w0
    return
__T1Interrupt:
    bclr IFS0, #3
    inc ticks
    retfie
"""


@pytest.fixture(scope="module")
def objects():
    return [assemble(CRT0.read_text(), "crt0.s")[0], assemble(PROGRAM, "program.s")[0]]


@pytest.mark.parametrize("form", ["elf", "hex"])
@pytest.mark.parametrize("pack", [True, False])
def test_a_linked_program_starts_and_finds_everything(tmp_path, objects, form, pack):
    """A linked program starts with correct data, handles and vectors (abi-elf.md §1.5, §2.7, §3.1, §3.2).

    Both .dinit formats are used; the ELF and the HEX file behave alike.
    """
    linked = link(objects, [], LinkOptions(pack_data=pack))
    image = tmp_path / f"x.{form}"
    image.write_bytes(executable_bytes(linked.image) if form == "elf" else hex_text(linked.image).encode())
    at = {s.name: s.value for s in linked.image.symbols}
    machine = load(image)
    for address in range(0x800, 0x2800, 2):
        machine.poke(address, 0xA5A5)  # hardware does not clear RAM
    stop = machine.run(cycles=20_000)
    assert stop.reason == "halt", stop
    values = {name: machine.peek(at[name]) for name in ("sum", "seen", "from_psv", "from_ee", "ticks", "__exit_status")}
    assert values == {
        "sum": 3, "seen": 3, "from_psv": int.from_bytes(b"ps", "little"), "from_ee": 0xBEEF, "ticks": 3,
        "__exit_status": 42,
    }  # fmt: skip
    assert [machine.peek(at["zero"] + 2 * i) for i in range(4)] == [0] * 4


def test_an_assembly_program_talks_on_uart1_from_the_timer_interrupt(tmp_path):
    """An assembly program built with `as` and `ld` sends characters from the timer interrupt under `emu run`.

    115,200 baud at 14.7456 MIPS is BRG 7, one character every 1500 Tcy.
    """
    here = Path(__file__).parent

    def run(*words):
        return subprocess.run([sys.executable, "-m", *map(str, words)], capture_output=True, cwd=tmp_path, timeout=HANG)

    assert run("toolchain", "as", "-g", here / "uart_hello.s", "-o", "hello.o").returncode == 0
    assert run("toolchain", "as", CRT0, "-o", "crt0.o").returncode == 0
    assert run("toolchain", "ld", "hello.o", "crt0.o", "-o", "hello.elf").returncode == 0
    done = run("emu", "run", "hello.elf", "--seconds", "1", "--exit-code")
    assert (done.stdout, done.returncode) == (b"hello from T1\r\n" * 4, 0)
