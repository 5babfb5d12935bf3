"""Intel HEX as images, and files that are neither ELF nor HEX."""

from __future__ import annotations

import pytest

from emu.image.loader import load_image, parse_image
from emu.image.model import LoadError
from tests.emu.loader.elf_samples import words, xc16_like


def record(address: int, data: bytes, kind: int = 0) -> str:
    body = bytes((len(data), address >> 8, address & 0xFF, kind)) + data
    return ":" + (body + bytes((-sum(body) & 0xFF,))).hex() + "\n"


def upper(address: int) -> str:
    return record(0, (address >> 16).to_bytes(2, "big"), 4)


END = record(0, b"", 1)
GOTO = record(0, words(0x040100, 0x000000))


def parsed(text: str):
    return parse_image(text.encode(), "sample.hex")


def refusal(text: str | bytes) -> str:
    with pytest.raises(LoadError) as caught:
        parse_image(text if isinstance(text, bytes) else text.encode(), "sample.hex")
    return str(caught.value)


def test_a_word_sits_at_half_its_byte_address():
    """abi-elf.md §6.8: a word's address is half its byte address; lower-case digits, as bin2hex writes them, are
    accepted."""
    image = parsed(GOTO + record(0x200, words(0xABCDEF)) + END)
    assert list(image.words()) == [(0, 0x040100), (2, 0), (0x100, 0xABCDEF)]
    assert image.kind == "hex"


def test_config_words_and_eeprom_use_extended_addresses():
    """abi-elf.md §6.8: configuration words are at byte address 0x01F00000 and EEPROM at 0x00FFE000, by extended
    addresses."""
    image = parsed(
        upper(0x01F00000) + record(0, words(0xC706)) + upper(0x00FFE000) + record(0xE000, words(0x1234)) + END
    )
    assert dict(image.words()) == {0xF80000: 0xC706, 0x7FF000: 0x1234}


def test_missing_fourth_bytes_are_tolerated():
    image = parsed(record(0, b"\x00\x01\x04") + record(4, b"\x00\x00\x00") + END)
    assert dict(image.words()) == {0: 0x040100, 2: 0}


def test_missing_bytes_and_words_read_erased():
    image = parsed(record(0, b"\x12") + record(8, b"\x00\x00\x00") + END)
    assert dict(image.words()) == {0: 0xFFFF12, 4: 0}
    assert image.flash()[1] == 0xFFFFFF


def test_a_fourth_byte_that_is_not_zero_is_a_warning():
    image = parsed(record(0, b"\x00\x01\x02\xff") + END)
    assert dict(image.words()) == {0: 0x020100}
    assert image.warnings == ("line 1: fourth byte of a program word is not 0 (ignored)",)


def test_start_address_records_and_blank_lines_are_accepted():
    assert parsed("\r\n" + GOTO + "\n" + record(0, bytes(4), 5) + record(0, bytes(4), 3) + END + "\n").used


def test_elf_and_hex_of_the_same_program_hold_the_same_words():
    elf = parse_image(xc16_like().build(), "sample.elf")
    text = "".join(upper(2 * address) + record(2 * address & 0xFFFF, words(word)) for address, word in elf.words())
    assert dict(parsed(text + END).words()) == dict(elf.words())


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (GOTO, "is truncated: no end-of-file record after line 1"),
        (GOTO + END + GOTO, "line 3: text after the end-of-file record"),
        (GOTO + "hello\n" + END, "line 2: a record starts with ':'"),
        (":0\n", "line 1: not an even number of hexadecimal digits"),
        (":zz\n", "line 1: not an even number of hexadecimal digits"),
        (":\n", "line 1: record has 0 bytes"),
        (":10000000aa\n", "line 1: record has 5 bytes, its length field asks for 21"),
        (GOTO[:-3] + "00\n" + END, "line 1: checksum is 00, expected"),
        (record(0, b"", 6) + END, "line 1: unknown record type 06"),
        (record(0, b"\0", 4) + END, "line 1: record type 04 has 2 data bytes, found 1"),
        (GOTO + record(0, b"\x01") + END, "line 2: overlaps an earlier record at byte address 0x0"),
        (upper(0x30000) + GOTO + END, "line 2: byte address 0x30000 (program address 0x018000) is outside"),
        (END, "holds no data records"),
    ],
)
def test_mistakes_are_refused_with_their_line(text, expected):
    assert expected in refusal(text)


def test_a_repeated_record_with_the_same_bytes_is_harmless():
    assert len(list(parsed(GOTO + GOTO + END).words())) == 2


@pytest.mark.parametrize(
    ("data", "expected"),
    [
        (b"", "is empty"),
        (b"\x36\x12\x05\x00rest", "COFF"),
        (b"!<arch>\n", "library archive"),
        (b"\x7fEL", "is truncated after 3 octets"),
        (b"MZ\x90\0", "is neither ELF nor Intel HEX (it starts with 4d 5a 90 00)"),
    ],
)
def test_other_files_are_refused_by_what_they_are(data, expected):
    assert expected in refusal(data)


def test_unreadable_paths_are_refused(tmp_path):
    with pytest.raises(LoadError, match="is a directory"):
        load_image(tmp_path)
    with pytest.raises(LoadError, match="cannot be read: No such file"):
        load_image(tmp_path / "absent.elf")
    with pytest.raises(LoadError, match="cannot be read"):
        load_image("nul\0byte")
