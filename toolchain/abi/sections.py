"""Sections of data: which of them are near memory (abi-elf.md §1.4)."""

from __future__ import annotations

from toolchain.abi.target import NEAR_BYTES
from toolchain.ir.model import Module, size_of

# Sections that dspic_attributes.h names and numbers; the first word, bss or data, depends on the initialiser.
PLACES = {".near": ",near", ".far": "", ".xmemory": ",xmemory", ".ymemory": ",ymemory"}


def place_of(section: str) -> str:
    """The key of PLACES that a section of dspic_attributes.h, `.far.12`, stands for; "" for any other section."""
    stem, _, number = section.rpartition(".")
    return stem if number.isdigit() and stem in PLACES else ""


def is_near(module: Module, name: str) -> bool:
    """Whether the object lies below 0x2000, where file-register instructions reach it (abi-elf.md §1.4).

    Definition and every declaration agree, because only type, section and -mlarge-data decide; but an address beyond
    near memory is known where the definition is.
    """
    var = module.globals.get(name)
    if var is not None and var.section.startswith((".near", "sfr")):
        return True
    if module.large_data or name in module.far:
        return False
    if var is None or var.constant or var.type.kind == "opaque" or not 0 < size_of(var.type) <= NEAR_BYTES:
        return False
    return not var.section or var.section.startswith((".nbss", ".ndata"))
