"""Data sections that attributes of variables select, and near memory (abi-elf.md §1.4)."""

from __future__ import annotations

from toolchain.abi.target import NEAR_BYTES
from toolchain.ir.model import Module, size_of

# Attributes of each section that an attribute in C selects (frontend/attributes.py). The initialiser adds bss or data.
SECTION_ATTRIBUTES = {".near": ",near", ".far": "", ".xmemory": ",xmemory", ".ymemory": ",ymemory"}


def attribute_section(section: str) -> str:
    """Key of SECTION_ATTRIBUTES for a section, ignoring the number in names such as `.far.12`; "" for others."""
    stem, _, number = section.rpartition(".")
    return stem if number.isdigit() and stem in SECTION_ATTRIBUTES else ""


def is_near(module: Module, name: str) -> bool:
    """Whether the object is below 0x2000, so that file-register instructions can access it (abi-elf.md §1.4).

    The definition and every declaration agree, because only type, section and -mlarge-data decide. The exception is an
    `address(N)` beyond near memory, which only the module with the definition knows.
    """
    var = module.globals.get(name)
    if var is not None and var.section.startswith((".near", "sfr")):
        return True
    if module.large_data or name in module.far:
        return False
    if var is None or var.constant or var.type.kind == "opaque" or not 0 < size_of(var.type) <= NEAR_BYTES:
        return False
    return not var.section or var.section.startswith((".nbss", ".ndata"))
