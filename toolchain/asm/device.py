"""`.include "p30F6014A.inc"`: the device include file, generated from the chip's tables if no such file exists.

The file defines names of register bits, of bytes of registers and of configuration settings, and the macro `config`. It
leaves the registers themselves undefined; the linker resolves them (abi-elf.md §2.6, §3.3).
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

from emu.chips.chip import Chip
from toolchain.device_header import second_names

_SETTINGS = Path(__file__).resolve().parents[1] / "include" / "dspic_compiler.h"
"""C header with the names and values of the configuration settings, which assembly sources share."""
_SETTING = re.compile(r"#define ([A-Z][A-Z0-9_]*) (0x[0-9A-F]{4})$", re.MULTILINE)
_CONFIG_MACRO = """
        .macro  config REG, VALUE
        .pushsection \\REG\\().sec, code
        .global \\REG
\\REG:  .pword  \\VALUE
        .popsection
        .endm
"""


def is_device_file(name: str, chip: Chip) -> bool:
    """Whether a file of that name is the include file of the device: p30F6014A.inc, p30fxxxx.inc or xc.inc."""
    return name.lower() in (f"p{chip.name.lower().removeprefix('dspic')}.inc", "p30fxxxx.inc", "xc.inc")


def _bits(chip: Chip) -> Iterator[tuple[str, int]]:
    """Bit names and positions; bits of a wide field are numbered: OC1IP0, OC1IP1, OC1IP2."""
    for sfr in chip.sfrs.values():
        for name, (lsb, width) in {**sfr.fields, **second_names(sfr)}.items():
            if width == 1:
                yield name, lsb
            else:
                yield from ((f"{name}{bit}", lsb + bit) for bit in range(width))


def _bytes(chip: Chip) -> Iterator[tuple[str, int]]:
    """Names and addresses of bytes of registers, such as SRL and SRH of SR; names of existing registers are omitted."""
    for sfr in chip.sfrs.values():
        if sfr.size == 2:
            for name, address in ((f"{sfr.name}L", sfr.address), (f"{sfr.name}H", sfr.address + 1)):
                if name not in chip.sfrs:
                    yield name, address


def include_text(chip: Chip) -> str:
    """Return the text of the include file.  A bit name with different positions in two registers is omitted."""
    positions: dict[str, set[int]] = {}
    for name, bit in _bits(chip):
        positions.setdefault(name, set()).add(bit)
    lines = [f"        .equiv {name}, {bits.pop()}" for name, bits in positions.items() if len(bits) == 1]
    lines += [f"        .equiv {name}, {address:#x}" for name, address in _bytes(chip) if name not in positions]
    lines += ["        .equiv SLEEP_MODE, 0", "        .equiv IDLE_MODE, 1"]
    lines += [f"        .equiv {name}, {value}" for name, value in _SETTING.findall(_SETTINGS.read_text())]
    return "\n".join(lines) + _CONFIG_MACRO
