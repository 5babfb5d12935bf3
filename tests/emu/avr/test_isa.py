"""The AVR instruction table: each word has one row, text equals that of binutils, results equal those of simavr."""

from __future__ import annotations

import re
import struct
import subprocess
from pathlib import Path

import pytest

from emu.avr.isa.codec import decode, row_of
from emu.avr.isa.rows import ERASED, ROWS
from emu.avr.isa.text import disassemble, target
from tests.emu.avr.conftest import needs
from tests.emu.avr.oracle import Pair, compared_rows
from tests.fuzz.seeds import base_seed

OTHER_CHIPS = {"elpm", "xch", "las", "lac", "lat", "des", "eijmp", "eicall", "spm Z+"}
"""Instructions of larger or newer AVRs, which the ATmega328P does not have."""
SECOND = 0x0124


def test_a_word_has_one_row() -> None:
    """No word matches two rows, and each row has a name of its own."""
    assert len({row.name for row in ROWS}) == len(ROWS)
    for first in ROWS:
        for second in ROWS:
            common = first.mask & second.mask
            assert first is second or (first.match ^ second.match) & common, (first.syntax, second.syntax)


def normal(text: str) -> str:
    return re.sub(r"0x0+(?=[0-9a-f])", "0x", text.replace(" ", "").replace("\t", "").lower())


@pytest.mark.slow
def test_all_words_are_disassembled_as_by_binutils(tmp_path: Path) -> None:
    """All 65,536 words have the text that avr-objdump prints, or belong to another AVR."""
    needs("avr-objdump")
    raw = tmp_path / "words.bin"
    raw.write_bytes(b"".join(struct.pack("<HH", word, SECOND) for word in range(0x10000)))
    command = ["avr-objdump", "-m", "avr:5", "-b", "binary", "-D", str(raw)]
    listing = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    theirs = {int(at, 16): text.split(";")[0].replace("\t", " ").strip()
              for at, text in re.findall(r"^\s*([0-9a-f]+):\t(?:[0-9a-f]{2} )+\s*\t(.*)$", listing, re.M)}  # fmt: skip
    differ = set()
    for word in range(0x10000):
        text, ours = theirs[4 * word], disassemble(word, SECOND)
        if normal(text) != normal(ours):
            differ.add(text if text in OTHER_CHIPS else text.split()[0])
            assert row_of(word) is None, (hex(word), text, ours)
    assert differ == OTHER_CHIPS


def test_targets() -> None:
    """`target` returns the target of branches, jumps and calls, and None for loads."""
    assert target(0xCFFF, 0, 0x100) == 0x100  # rjmp .-2
    assert target(0xF7F1, 0, 0x100) == 0xFE  # brne .-4
    assert target(0x940E, 0x0123, 0) == 0x246  # call
    assert target(0x9100, 0x0123, 0) is None  # lds


def test_erased_flash_is_executed() -> None:
    """An erased word runs as SBRS r31, 7, and is printed as data."""
    insn = decode(ERASED)
    assert insn is not None
    assert (insn.row.mnemonic, insn.operands) == ("sbrs", {"d": 31, "b": 7})
    assert disassemble(ERASED) == ".word 0xffff"


def test_every_row_computes_as_simavr(pair: Pair) -> None:
    """300 random cases of every row leave the same registers, SREG, RAM, PC and cycles; new ones per commit."""
    found = [difference for row in compared_rows() if (difference := pair.row(row, 300, base_seed()))]
    assert found == []
