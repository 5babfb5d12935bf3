"""Small assembly programs as ELF files, for tests of the command line."""

from __future__ import annotations

import re

from emu.chips.dspic30f6014a import SFRS
from emu.dspic30f.isa.text import parse
from tests.emu.loader.elf_samples import ElfSample, Name, SampleSection, words

START = 0x100
DEBUG_WORD = 0xDA4000


def assembled(source: str, start: int = START) -> tuple[list[int], dict[str, int]]:
    """Return words and labels of `source`: one statement per line, `label:`, `.pword N`, and register names in
    braces."""
    lines = [line.split(";")[0].strip() for line in source.splitlines()]
    labels: dict[str, int] = {}
    for _pass in ("addresses", "words"):
        out: list[int] = []
        for line in filter(None, lines):
            pc = start + 2 * len(out)
            if line.endswith(":"):
                labels[line[:-1]] = pc
            elif line.startswith(".pword"):
                out.append(int(line.split()[1], 0))
            else:
                out += parse(_filled(line, labels, pc)).encode(pc)
    return out, labels


def _filled(line: str, labels: dict[str, int], pc: int) -> str:
    """Replace `{NAME}` by a register's address and `@label` by a label's."""
    line = re.sub(r"\{(\w+)\}", lambda found: hex(SFRS[found[1]].address), line)
    return re.sub(r"@(\w+)", lambda found: hex(labels.get(found[1], pc)), line)


def executable(source: str, vectors: dict[str, str] | None = None) -> bytes:
    """Return an ELF file that starts with `source`. `vectors` maps vector names to labels; all other vectors stop the
    machine."""
    from emu.chips.dspic30f6014a import VECTORS

    code, labels = assembled(source)
    default = START + 2 * len(code)
    handlers = {name: labels[label] for name, label in (vectors or {}).items()}
    table = [handlers.get(vector.name, default) for vector in VECTORS]
    return ElfSample(
        parts=[
            SampleSection(".reset", 0, words(0x040000 | START, 0)),
            SampleSection(".ivt", VECTORS[0].ivt, words(*table)),
            SampleSection(".text", START, words(*code)),
            SampleSection(".isr", default, words(DEBUG_WORD, 0xFE0000)),
            SampleSection(".nbss", 0x800, b"", 0x01000003, 8, size=8),
        ],
        names=[
            *(Name("_" + label, address, 2) for label, address in labels.items()),
            Name("__DefaultInterrupt", default, 3),
            Name("__exit_status", 0x802, 4, size=2, kind=1),
            Name("_counter", 0x800, 4, size=2, kind=1),
        ],
    ).build()


SETUP = """
    mov #7, w0
    mov w0, {U1BRG}
    bset {U1MODE}, #15
    bset {U1STA}, #10
"""
"""Set-up of UART1 for 115,200 baud on the e-puck (dspic30f6014a.md §10)."""

HELLO = (
    "main:"
    + SETUP
    + "".join(f"mov #{ord(letter)}, w1\nmov w1, {{U1TXREG}}\n" for letter in "hi!\n")
    + """
    mov #5, w0
    mov w0, 0x802
    pwrsav #1
forever:
    bra @forever
"""
)
"""Program that sends a line and then sleeps without a wake-up source; its status is 5."""

ECHO = (
    "main:"
    + SETUP
    + """
    bset {IEC0}, #9
loop:
    pwrsav #1
    bra @loop
receive:
    mov {U1RXREG}, w1
    inc w1, w1
    mov w1, {U1TXREG}
    bclr {IFS0}, #9
    retfie
"""
)
"""Program that sends back every byte plus one; needs the vector U1RXInterrupt -> receive."""

SPIN = """
main:
    clr w0
spin:
    inc w0, w0
    mov w0, 0x800
    bra @spin
"""
