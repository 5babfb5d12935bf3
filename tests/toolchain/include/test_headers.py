"""Headers: the device header is generated, layouts and limits equal XC16's (abi-elf.md §1)."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from emu.chips import NAMES, chip_named
from emu.chips.dspic30f6014a import DSPIC30F6014A
from tests.toolchain.c_programs import build, run
from toolchain import device_header
from toolchain.device_header import header

INCLUDE = Path(__file__).resolve().parents[3] / "toolchain" / "include"


@pytest.mark.parametrize("name", NAMES)
def test_the_device_header_is_generated_once(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The header of each device is generated once and cached; without a usable cache folder it is temporary."""
    monkeypatch.setenv("OPENSWARM_CACHE", str(tmp_path / "cache"))
    device_header.folder_of.cache_clear()
    chip = chip_named(name)
    folder = device_header.folder_of(name)
    assert folder.is_relative_to(tmp_path / "cache")
    assert (folder / f"{name.lower()}.h").read_text() == header(chip)
    device_header.folder_of.cache_clear()
    monkeypatch.setenv("OPENSWARM_CACHE", str(tmp_path / "file"))
    (tmp_path / "file").write_text("")
    elsewhere = device_header.folder_of(name)
    assert (elsewhere / f"{name.lower()}.h").read_text() == header(chip)
    device_header.folder_of.cache_clear()


@pytest.mark.parametrize("place", ["dspic30f4013.h", "dspic30f4013_fields.h", "p30F4013.h", "dspic30f4013/timer.h"])
@pytest.mark.parametrize("damage", ["flipped", "cut", "deleted"])
def test_a_damaged_header_is_generated_again(
    place: str, damage: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """After a flipped bit, a truncation or a loss of a header, the compiler writes all headers again."""
    monkeypatch.setenv("OPENSWARM_CACHE", str(tmp_path / "cache"))
    device_header.folder_of.cache_clear()
    path = device_header.folder_of("dspic30f4013") / place
    right = path.read_bytes()
    if damage == "deleted":
        path.unlink()
    else:
        path.write_bytes(right[:-9] if damage == "cut" else right[:-9] + bytes([right[-9] ^ 1]) + right[-8:])
    device_header.folder_of.cache_clear()
    device_header.folder_of("dspic30f4013")
    assert path.read_bytes() == right
    written = path.stat().st_mtime_ns
    device_header.folder_of.cache_clear()
    device_header.folder_of("dspic30f4013")
    assert path.stat().st_mtime_ns == written
    device_header.folder_of.cache_clear()


def test_every_register_has_the_address_of_the_chip_table(tmp_path: Path) -> None:
    """Every register has the address of the chip table, as word, bytes and bit-field struct (dspic30f6014a.md §1).

    The comparison runs on the target, because the compiler assumes that no object has the address of WREG0.
    """
    names = list(DSPIC30F6014A.sfrs.values())
    rows = ", ".join(f"{{(unsigned)&{sfr.name}, sizeof {sfr.name}, {sfr.address}, {sfr.size}}}" for sfr in names)
    fields = "".join(
        f"    if ((unsigned)&{sfr.name}bits != {sfr.address} || sizeof {sfr.name}bits > {sfr.size}) return 2;\n"
        for sfr in names
        if sfr.fields
    )
    (tmp_path / "a.c").write_text(
        f"""#include <dspic30f6014a.h>
int main(void)
{{
    static const volatile struct {{ unsigned at, size, want, want_size; }} rows[] = {{ {rows} }};
    for (unsigned i = 0; i < sizeof rows / sizeof *rows; i++)
        if (rows[i].at != rows[i].want || rows[i].size != rows[i].want_size) return 1;
{fields}    return 0;
}}
"""
    )
    built = build([tmp_path / "a.c"], tmp_path / "a.elf", "-Os", "-Wall")
    assert (built.status, built.messages) == (0, "")
    assert run(tmp_path / "a.elf", engine="auto").status == 0


def test_bit_fields_are_where_the_chip_table_says(tmp_path: Path) -> None:
    """Bit-fields are at the positions of the chip table: each field of a plain register is set through the struct."""
    lines = []
    for sfr in DSPIC30F6014A.sfrs.values():
        for name, (lsb, width) in sfr.fields.items():
            mask = (1 << width) - 1 << lsb
            lines.append(
                f"    {{ union {{ {sfr.name}BITS bits; unsigned word; }} u = {{0}}; u.bits.{name} = ~0; "
                f"if (u.word != {mask:#x}u) return 1; }}"
            )
    body = "\n".join(lines)
    (tmp_path / "a.c").write_text(f"#include <dspic30f6014a.h>\nint main(void)\n{{\n{body}\n    return 0;\n}}\n")
    built = build([tmp_path / "a.c"], tmp_path / "a.elf", "-Os", "-Wall", "-Wno-bitfield-constant-conversion")
    assert (built.status, built.messages) == (0, "")
    assert run(tmp_path / "a.elf", engine="auto").status == 0


def test_second_names_of_bits_denote_the_same_bits(tmp_path: Path) -> None:
    """The names of CAN, I2C and UART bits in the data sheet and in the reference manual denote the same bits, as in
    XC16."""
    same = [
        ("C1INTF", "RXB0IF", "RX0IF"), ("C2INTF", "TXB2IF", "TX2IF"), ("C1INTF", "IRXIF", "IVRIF"),
        ("C2INTF", "RXB0OVFL", "RX0OVR"), ("C1INTF", "TXBP", "TXEP"), ("C2INTE", "IRXIE", "IVRIE"),
        ("C1CTRL", "CANSIDL", "CSIDL"), ("C2RX0CON", "FILHIT0", "FILHIT"), ("C1RX0CON", "DBEN", "RXB0DBEN"),
        ("I2CSTAT", "R_NOT_W", "R_W"), ("I2CSTAT", "D_NOT_A", "D_A"), ("U1TXREG", "UTXREG8", "UTX8"),
        ("U2RXREG", "URXREG8", "URX8"),
    ]  # fmt: skip
    lines = "".join(
        f"    {{ union {{ {register}BITS bits; unsigned word; }} a = {{0}}, b = {{0}};"
        f" a.bits.{first} = 1; b.bits.{second} = 1; if (a.word != b.word || !a.word) return {number}; }}\n"
        for number, (register, first, second) in enumerate(same, 1)
    )
    text = f"#include <dspic30f6014a.h>\nint main(void)\n{{\n{lines}    return _R_W | _D_A;\n}}\n"
    (tmp_path / "a.c").write_text(text)
    built = build([tmp_path / "a.c"], tmp_path / "a.elf", "-Os", "-Wall")
    assert (built.status, built.messages) == (0, "")
    assert run(tmp_path / "a.elf", engine="auto").status == 0


@pytest.mark.parametrize("path", sorted(INCLUDE.glob("*.h")), ids=lambda p: p.name)
def test_header_stands_alone_and_twice(path: Path, tmp_path: Path) -> None:
    """Each header includes its dependencies and may be included twice."""
    line = f"#include <{path.name}>\n"
    (tmp_path / "a.c").write_text(line + line + "int main(void) { return 0; }\n")
    part = re.fullmatch(r"(?:p|dspic)(30f\d+[a-z]?)", path.stem, re.IGNORECASE)
    chip = [f"-mcpu={part[1].upper()}"] if part else []  # a device header refuses other devices
    built = build([tmp_path / "a.c"], tmp_path / "a.o", "-c", "-std=c11", "-Wall", "-Wextra", "-pedantic", *chip)
    assert (built.status, built.messages) == (0, "")


def test_configuration_words_reach_the_image(tmp_path: Path) -> None:
    """Configuration macros such as _FOSC(CSW_FSCM_OFF & XT_PLL8) reach the image.

    Sources: dspic30f6014a.md §2, abi-elf.md §6.6.
    """
    (tmp_path / "a.c").write_text(
        "#include <p30F6014A.h>\n_FOSC(CSW_FSCM_OFF & XT_PLL8);\n_FWDT(WDT_OFF);\n"
        "_FBORPOR(PBOR_OFF & MCLR_EN & PWRT_64);\n"
        "int main(void) { return 0; }\n"
    )
    built = build([tmp_path / "a.c"], tmp_path / "a.elf", "-Os")
    assert built.status == 0, built.messages
    from emu.image.loader import load_image

    words = {block.base: block.words for block in load_image(tmp_path / "a.elf").blocks if block.base >= 0xF80000}
    flat = {base + 2 * i: word & 0xFFFF for base, part in words.items() for i, word in enumerate(part)}
    assert flat[0xF80000] == 0xFFE6
    assert flat[0xF80002] == 0x7FFF
    assert flat[0xF80004] == 0xFF7F
