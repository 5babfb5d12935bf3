"""A boot loader over UART1: the firmware programs its own flash, whose code is native (dspic30f6014a.md §10, §16).

test_loader_rows.py runs a boot loader on every engine.
"""

from __future__ import annotations

import pytest

from emu.api import Machine
from emu.boards.epuck.board import Epuck
from emu.image.loader import load_image

ROW = 0x8000
RETURN = 0x060000


def constant(value: int) -> list[int]:
    """Return the program words of `mov #value, w0; return`, padded with erased words (isa.md: MOV #lit16 is 0010 kkkk
    kkkk kkkk kkkk dddd)."""
    return [0x200000 | value << 4, RETURN] + [0xFFFFFF] * 30


def packet(words: list[int], damage: int = 0) -> bytes:
    data = b"".join(word.to_bytes(3, "little") for word in words)
    return b"\xc1" + data + bytes([sum(data) + damage & 0xFF])


@pytest.fixture
def machine(program) -> Machine:
    image = load_image(program("bootload.c"))
    made = Machine(image.chip, board=Epuck)
    if hasattr(made.runner, "wait"):
        made.runner.threshold, made.runner.wait = 1, True
    made.load(image)
    made.program.put_flash(ROW, constant(7))
    return made


def talk(machine: Machine, data: bytes, cycles: int = 300_000) -> bytes:
    heard = bytearray()
    machine.board.bluetooth.on_byte = lambda byte, _cycle: heard.append(byte)
    machine.board.bluetooth.feed(data)
    machine.run(cycles=cycles)
    return bytes(heard)


@pytest.mark.slow
def test_programmed_rows_replace_compiled_code(machine):
    """§16: erasing and programming stall the CPU for 2 ms each, and native code of the old row is discarded."""
    machine.run(cycles=2_500_000)
    assert machine.peek("answer") == 7
    for number, value in enumerate((1234, 0, 0xBEEF), start=1):
        assert talk(machine, packet(constant(value))) == b"qKK"
        assert machine.peek("rows") == number
        assert [machine.program.word(ROW + 2 * i) for i in range(3)] == [*constant(value)[:2], 0xFFFFFF]
        machine.run(cycles=2_500_000)
        assert machine.peek("answer") == value


def test_a_damaged_row_is_refused_and_nothing_is_erased(machine):
    assert talk(machine, packet(constant(1), damage=1)) == b"qKN"
    assert machine.program.word(ROW) == constant(7)[0]
    assert talk(machine, packet(constant(1))[:50], cycles=3_000_000) == b"qKN"
    machine.run(cycles=2_500_000)
    assert machine.peek("answer") == 7
