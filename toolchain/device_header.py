"""Device headers such as `dspic30f6014a.h`, generated from the register tables of `emu.chips`.

The compiler generates the headers of its chip on first use and keeps them in the user's cache, with a keyed checksum:
damaged headers are generated again. This compiler and XC16 accept the headers. `python -m toolchain.device_header CHIP
[NAME]` prints one, such as `timer.h` of the peripheral library.
"""

from __future__ import annotations

import atexit
import hashlib
import os
import re
import shutil
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path

import emu.chips
from emu.chips import NAMES, chip_named
from emu.chips.chip import Chip, Sfr
from emu.host.keyed_checksum import content_of, with_checksum
from emu.host.paths import headers
from emu.host.private_folder import is_usable, make_private
from toolchain import peripheral_library

CHIPS = Path(emu.chips.__path__[0])
ALTERNATIVES: dict[str, dict[str, str]] = {
    r"I2CSTAT": {"R_NOT_W": "R_W", "D_NOT_A": "D_A"},
    r"C\dINTF": {
        "RXB0IF": "RX0IF", "RXB1IF": "RX1IF", "TXB0IF": "TX0IF", "TXB1IF": "TX1IF", "TXB2IF": "TX2IF", "IRXIF": "IVRIF",
        "RXWARN": "RXWAR", "TXWARN": "TXWAR", "RXBP": "RXEP", "TXBP": "TXEP",
        "RXB1OVFL": "RX1OVR", "RXB0OVFL": "RX0OVR",
    },
    r"C\dINTE": {
        "RXB0IE": "RX0IE", "RXB1IE": "RX1IE", "TXB0IE": "TX0IE", "TXB1IE": "TX1IE", "TXB2IE": "TX2IE", "IRXIE": "IVRIE",
    },
    r"C\dCTRL": {"CANSIDL": "CSIDL"},
    r"C\dRX0CON": {"FILHIT0": "FILHIT", "DBEN": "RXB0DBEN"},
    r"U\dTXREG": {"UTXREG8": "UTX8"},
    r"U\dRXREG": {"URXREG8": "URX8"},
}  # fmt: skip
"""Second names of bits in XC16's headers, by pattern of the register name and by name in the data sheet."""
C_TYPES = {1: "unsigned char", 2: "unsigned int"}


def bit_fields(fields: Mapping[str, tuple[int, int]], only_bits: bool = False) -> Iterator[str]:
    """Members of a bit-field struct, low bit first; gaps are unnamed fields.

    With `only_bits`, each bit of a wide field is a member (TCKPS -> TCKPS0, TCKPS1), as in XC16's headers.
    """
    position = 0
    for name, (lsb, width) in sorted(fields.items(), key=lambda item: item[1]):
        if only_bits and (width == 1 or any(f"{name}{bit}" in fields for bit in range(width))):
            continue
        if lsb > position:
            yield f"unsigned :{lsb - position};"
        if only_bits:
            yield " ".join(f"unsigned {name}{bit}:1;" for bit in range(width))
        else:
            yield f"unsigned {name}:{width};"
        position = lsb + width


def second_names(sfr: Sfr) -> dict[str, tuple[int, int]]:
    """(lowest bit, width) of each field of the register with a second name, by that name."""
    for pattern, names in ALTERNATIVES.items():
        if re.fullmatch(pattern, sfr.name):
            return {new: sfr.fields[old] for old, new in names.items() if old in sfr.fields and new not in sfr.fields}
    return {}


def struct_type(sfr: Sfr) -> str:
    """The `typedef` of a register's bit-field struct or union."""
    views = [bit_fields(sfr.fields), bit_fields(sfr.fields, only_bits=True), bit_fields(second_names(sfr))]
    structs = [f"struct {{ {text} }}" for text in map(" ".join, views) if text]
    name = f"{sfr.name}BITS"
    if len(structs) == 1:
        return f"typedef {structs[0]} {name};"
    return "\n".join(["typedef union {", *(f"  {struct};" for struct in structs), f"}} {name};"])


def declarations(sfr: Sfr) -> Iterator[str]:
    """Declarations of one register."""
    yield f"extern volatile {C_TYPES[sfr.size]} {sfr.name} DSPIC_SFR; /* 0x{sfr.address:04X} */"
    if sfr.fields:
        yield struct_type(sfr)
        yield f"extern volatile {sfr.name}BITS {sfr.name}bits DSPIC_SFR;"


def bit_macros(chip: Chip) -> Iterator[str]:
    """Macros such as `_T1IF` for `IFS0bits.T1IF`, for field names that are unique on the chip."""
    names = {sfr.name: [*sfr.fields, *second_names(sfr)] for sfr in chip.sfrs.values()}
    uses = Counter(field for fields in names.values() for field in fields)
    for sfr in chip.sfrs.values():
        for field in names[sfr.name]:
            if uses[field] == 1:
                yield f"#define _{field} {sfr.name}bits.{field}"


def field_header(chip: Chip) -> str:
    """Text of the header with position, mask and length of every field, which Microchip's header names include."""
    lines = [
        "/* SPDX-License-Identifier: MIT */",
        f"/* Fields of the registers of the {chip.name}: lowest bit, mask, number of bits; do not edit. */",
        f"#ifndef {chip.name.upper()}_FIELDS_H",
        f"#define {chip.name.upper()}_FIELDS_H",
        "",
    ]
    for sfr in chip.sfrs.values():
        fields = {**sfr.fields, **second_names(sfr)}
        for name, (lsb, width) in list(fields.items()):
            if width > 1:
                fields |= {f"{name}{k}": (lsb + k, 1) for k in range(width) if f"{name}{k}" not in fields}
        for name, (lsb, width) in fields.items():
            prefix = f"#define _{sfr.name}_{name}_"
            lines += [
                f"{prefix}POSITION {lsb}",
                f"{prefix}MASK 0x{((1 << width) - 1) << lsb:04X}",
                f"{prefix}LENGTH {width}",
            ]
    return "\n".join([*lines, "", "#endif", ""])


def header(chip: Chip) -> str:
    """Text of the header of a chip."""
    lines = [
        "/* SPDX-License-Identifier: MIT */",
        f"/* Registers of the {chip.name}.",
        " * Written by `python -m toolchain.device_header` from the chip's register table; do not edit. */",
        f"#ifndef {chip.name.upper()}_H",
        f"#define {chip.name.upper()}_H",
        *_requirement(chip.name),
        "#endif",
        "",
        "#include \"dspic_compiler.h\"",
        "",
        "#ifndef __ASSEMBLER__",
        "#ifdef __cplusplus",
        "extern \"C\" {",
        "#endif",
        "",
    ]  # fmt: skip
    for sfr in chip.sfrs.values():
        lines += declarations(sfr)
    lines += ["", "/* Bits whose name is unique on this chip. */", *bit_macros(chip), ""]
    lines += ["#ifdef __cplusplus", "}", "#endif", "#endif", "", "#endif", ""]
    return "\n".join(lines)


def microchip_header(chip_name: str) -> str:
    """Text of the header of a chip with Microchip's name, such as p30F6014A.h."""
    stem = chip_name.lower()
    lines = [
        "/* SPDX-License-Identifier: MIT */",
        "/* Microchip's name of the device header. */",
        *_requirement(chip_name),
        "#else",
        f'#include "{stem}.h"',
        f'#include "{stem}_fields.h"',
        "#endif",
    ]
    return "\n".join([*lines, ""])


def _requirement(chip_name: str) -> list[str]:
    """Return the lines that begin a condition and refuse another chip than this one."""
    device = chip_name.removeprefix("dsPIC")
    return [f"#ifndef __{chip_name}__", f'#error "this header is for the {chip_name}: compile with -mcpu={device}"']


@cache
def folder_of(chip_name: str) -> Path:
    """Return the folder with the header of a chip and Microchip's names for it.

    The cache keeps one folder per version of the chips' tables. Damaged headers are written again.

    If the cache cannot be written or is not private, the folder is a temporary one. This process removes it at its end.
    """
    chip = chip_named(chip_name)
    folder = headers() / _version()
    target = folder / f"{chip.name.lower()}.h"
    safe = is_usable(headers().parent, headers(), folder)
    if not safe or not _is_intact(target):
        try:
            if not safe:
                raise PermissionError(folder)
            _write_all(target, chip)
            _seal(target)
        except OSError:
            temporary = tempfile.mkdtemp(prefix="dspic-headers-")
            atexit.register(shutil.rmtree, temporary, ignore_errors=True)
            folder = Path(temporary)
            _write_all(folder / target.name, chip)
    return folder


def include_folders(chip_name: str) -> tuple[Path, Path]:
    """Return the folder of the device headers and the folder of the chip's peripheral library."""
    folder = folder_of(chip_name)
    return folder, folder / chip_named(chip_name).name.lower()


def _digest(target: Path) -> bytes:
    """Return a hash of the names and contents of all headers that `_write_all` writes. Raises OSError."""
    digest = hashlib.sha256()
    own = (target, target.with_name(f"{target.stem}_fields.h"))
    for path in sorted([*own, *target.parent.glob("p30*.h"), *target.with_suffix("").iterdir()]):
        digest.update(path.relative_to(target.parent).as_posix().encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.digest()


def _seal_of(target: Path) -> tuple[Path, str]:
    """Return the file with the checksum of a chip's headers, and the name under which it is computed."""
    path = target.with_suffix(".checksum")
    return path, f"{path.parent.name}/{path.name}"


def _is_intact(target: Path) -> bool:
    """Whether the headers of a chip are those that `_seal` has seen."""
    path, name = _seal_of(target)
    try:
        return content_of(headers(), name, path.read_bytes()) == _digest(target)
    except OSError:
        return False


def _seal(target: Path) -> None:
    """Store the checksum of a chip's headers. Raises OSError."""
    path, name = _seal_of(target)
    _write(path, with_checksum(headers(), name, _digest(target)))


def _write_all(target: Path, chip: Chip) -> None:
    """Write the headers of the peripheral library, headers under Microchip's names, and last the chip's own header.

    XC16 accepts header names in upper and lower case: programs use `p30F4011.h`, `p30f4011.h` and `p30f6014A.h`.
    """
    for name, text in peripheral_library.headers(chip).items():
        _write(target.with_suffix("") / name, text)
    _write(target.with_name(f"{target.stem}_fields.h"), field_header(chip))
    for name in NAMES:  # the headers of other chips explain which -mcpu they need
        device = name.removeprefix("dsPIC")
        for spelling in sorted({f"p{device}", f"p{device.lower()}", f"p{device.replace('F', 'f')}"}):
            _write(target.with_name(f"{spelling}.h"), microchip_header(name))
    _write(target, header(chip))


def _version() -> str:
    """Hash of all inputs of a header: this module, the peripheral library and the tables of the chips."""
    digest = hashlib.sha256(Path(__file__).read_bytes())
    for path in sorted([*CHIPS.rglob("*"), *Path(peripheral_library.__path__[0]).iterdir()]):
        if path.suffix in (".py", ".csv"):
            digest.update(path.name.encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()[:16]


def _write(target: Path, content: str | bytes) -> None:
    """Write a file atomically. Raise OSError on failure."""
    make_private(target.parent)
    handle, temporary = tempfile.mkstemp(prefix=".header.", dir=target.parent)
    with os.fdopen(handle, "wb") as stream:
        stream.write(content.encode() if isinstance(content, str) else content)
    os.replace(temporary, target)


def main() -> int:
    """Print the header that the command line names, by default that of the first chip, and return the exit status."""
    words = sys.argv[1:]
    if len(words) > 2 or words[:1] == ["--help"]:
        print(
            f"usage: python -m toolchain.device_header [CHIP [NAME]]; CHIP is one of {', '.join(NAMES)}; "
            f"NAME is one of {', '.join(peripheral_library.BODIES)}",
            file=sys.stderr,
        )
        return 2
    try:
        chip = chip_named(*words[:1])
    except ValueError as error:
        print(f"toolchain.device_header: {error}", file=sys.stderr)
        return 2
    known = {"": header(chip), **peripheral_library.headers(chip)}
    name = words[1] if len(words) > 1 else ""
    if name not in known:
        print(f"toolchain.device_header: no header {name}: use one of {', '.join(list(known)[1:])}", file=sys.stderr)
        return 2
    print(known[name], end="")
    return 0


if __name__ == "__main__":
    sys.exit(main())
