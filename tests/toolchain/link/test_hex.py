"""Intel HEX output (abi-elf.md §6.8, §7 item 9)."""

import io

from intelhex import IntelHex

from toolchain.link.hexfile import hex_text

SOURCE = """
    .global __reset
__reset: mov #c, w0
    .section .const,psv,page
c:  .byte 1, 2, 3
    .section .eedata,eedata
    .word 0xABCD
    .section __FOSC.sec,code
    .pword 0x00C106
    .section .ndata,data,near
    .word 0x5555
    .section hi,code,address(0x7FFE)
    call __reset
"""


def test_every_word_is_at_twice_its_address_with_a_zero_fourth_byte(image):
    """Each word is at twice its address with a zero fourth byte, as an independent reader confirms.

    RAM is omitted, EEPROM is at 0xFFE000, config words are at 0x1F00000.
    """
    out = image(SOURCE)
    content = IntelHex(io.StringIO(hex_text(out.linked.image)))
    present, words = set(content.addresses()), {}
    for address in range(0, 2 * 0x18000, 4):
        if address in present:
            words[address // 2] = int.from_bytes(content.tobinstr(start=address, size=4), "little")
    flash = {a: w for a, w in out.flash.items() if a < 0x18000}
    assert words == flash
    assert content.tobinstr(start=0xFFE000, size=4) == bytes([0xCD, 0xAB, 0, 0])
    assert content.tobinstr(start=0x1F00000, size=4) == bytes([0x06, 0xC1, 0, 0])
    assert max(present) == 0x1F00003


def test_records_are_those_of_microchips_converter(image):
    """Records have the form of Microchip's converter.

    Only types 00, 01 and 04 occur, with 16 bytes each, in lower case; a type-04 record precedes every section,
    `:00000001ff` is last.
    """
    lines = hex_text(image(SOURCE).linked.image).splitlines()
    assert lines[0] == ":020000040000fa"
    assert lines[-1] == ":00000001ff"
    assert {line[7:9] for line in lines} == {"00", "01", "04"}
    assert max(int(line[1:3], 16) for line in lines) == 16
    assert all(sum(bytes.fromhex(line[1:])) % 256 == 0 for line in lines)
    data = [int(line[3:7], 16) + int(line[1:3], 16) for line in lines if line[7:9] == "00"]
    assert max(data) <= 0x10000
