"""A boot loader programs, verifies and starts an image, over both UARTs, in every engine (dspic30f6014a.md §10, §16).

It accesses its rows by table reads and writes with [Wn++] and [Wn--], as boot loaders do.
"""

from __future__ import annotations

import random

import pytest

from emu.api import Machine
from emu.dspic30f.engines import NAMES
from emu.dspic30f.isa.text import parse
from emu.image.loader import load_image

FIRST_ROW, ROWS, ROW_WORDS = 0x8000, 6, 32
EEPROM_ROW, EEPROM_WORDS = 0x7FF020, 16
SUM, END = 0x2000, FIRST_ROW + 2 * ROWS * ROW_WORDS
PATIENCE = 400_000
"""Maximum Tcy for a packet: its bytes, and four times 2 ms."""

# Adds up the programmed bytes, stores the sum in RAM and loops.
CHECKSUM = f"""
    clr w2
    mov #{FIRST_ROW >> 16}, w0
    mov w0, 0x32
    mov #{FIRST_ROW & 0xFFFF}, w3
    mov #{END & 0xFFFF}, w4
    clr w0
    tblrdl.b [w3], w0
    add w2, w0, w2
    tblrdh.b [w3++], w0
    add w2, w0, w2
    tblrdl.b [w3++], w0
    add w2, w0, w2
    cp w3, w4
    bra nz, .-16
    mov #{EEPROM_ROW >> 16}, w0
    mov w0, 0x32
    mov #{EEPROM_ROW & 0xFFFF}, w3
    repeat #{EEPROM_WORDS - 1}
    tblrdl [w3++], [w5++]
    mov w2, {SUM:#x}
    bra .+2
"""


class Number:
    """Operand value for the assembly parser; "." is the address of the instruction."""

    def __init__(self, text: str, here: int) -> None:
        self.value: int | None = here + int(text[1:]) if text[0] == "." else int(text, 0)


def image() -> list[int]:
    """Return the words of the program, followed by random words."""
    words: list[int] = []
    for line in CHECKSUM.strip().splitlines():
        here = FIRST_ROW + 2 * len(words)
        words += parse(line.strip(), lambda text, at=here: Number(text, at)).encode(here)
    generator = random.Random(1)
    return words + [generator.getrandbits(24) for _ in range(ROWS * ROW_WORDS - len(words))]


def packet(kind: str, address: int, data: bytes = b"") -> bytes:
    body = kind.encode() + address.to_bytes(3, "little") + data
    return body + bytes([-sum(body) & 0xFF])


class Host:
    """Host computer connected to UART `port`."""

    def __init__(self, machine: Machine, port: int) -> None:
        self.machine, self.port = machine, port
        self.heard = bytearray()
        machine.uart[port].on_byte = lambda byte, _cycle: self.heard.append(byte)

    def ask(self, data: bytes) -> str:
        """Send a packet and return the loader's answer."""
        self.heard.clear()
        self.machine.uart[self.port].feed(data)
        limit = self.machine.cycle + PATIENCE
        while not self.heard and self.machine.cycle < limit:
            self.machine.run(cycles=4_000)
        return self.heard.decode()


@pytest.mark.slow
@pytest.mark.parametrize("port", [1, 2])
@pytest.mark.parametrize("engine", [name for name in NAMES if name != "auto"])
def test_an_image_is_programmed_verified_and_started(engine: str, port: int, program) -> None:
    """§16: every word of the image arrives in flash and EEPROM, is verified, and the image runs."""
    loader = load_image(program("loader.s"))
    machine = Machine(loader.chip, engine=engine)
    if hasattr(machine.runner, "wait"):
        machine.runner.threshold, machine.runner.wait = 1, True
    machine.load(loader)
    host, words = Host(machine, port), image()
    for row in range(ROWS):
        part = words[row * ROW_WORDS : (row + 1) * ROW_WORDS]
        data = b"".join(word.to_bytes(3, "little") for word in part)
        assert host.ask(packet("F", FIRST_ROW + 2 * row * ROW_WORDS, data)) == "K"
    stored = random.Random(2).randbytes(2 * EEPROM_WORDS)
    assert host.ask(packet("D", EEPROM_ROW, stored)) == "K"
    assert host.ask(packet("F", END, b"x" * 96)[:-1] + b"\0") == "N"
    assert [machine.program.word(FIRST_ROW + 2 * index) for index in range(len(words))] == words
    assert machine.program.word(END) == 0xFFFFFF
    machine.w[5] = 0x2100
    assert host.ask(packet("G", FIRST_ROW)) == "K"
    machine.run(cycles=10_000)
    assert machine.peek(SUM) == sum(sum(word.to_bytes(3, "little")) for word in words) & 0xFFFF
    assert bytes(machine.record.bytes[0x2100 : 0x2100 + 2 * EEPROM_WORDS]) == stored
