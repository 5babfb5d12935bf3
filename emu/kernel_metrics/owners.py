"""Memory by owner (kernel, devices, application), determined by the folder of the source file.

Input: an image built with -g. Output: bytes of ROM and RAM by owner.

- Start-up code and vectors have no owner, because a program without a kernel has them too.
- Code from a header belongs to the owner of the function into which it was inlined.
- A slot of `.handle` (function pointers, abi-elf.md §1.5) belongs to the owner of its target.
- Library code and strings belong to the kernel.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import Final

from emu.image.footprint import START_UP, START_UP_SECTIONS, UNKNOWN, Piece, pieces
from emu.image.model import BYTES_PER_WORD, Image
from emu.instruments.disassembly import items

KERNEL: Final = "kernel"
DEVICES: Final = "devices"
APPLICATION: Final = "application"

_FOLDERS: Final = {
    "/kernel/": KERNEL, "/port/": KERNEL, "/hal/": KERNEL, "/include/": KERNEL, "/runtime/": KERNEL,
    "/io/": DEVICES, "/board/": DEVICES,
}  # fmt: skip
_WITHOUT_OWNER: Final = START_UP | START_UP_SECTIONS | {".ivt", ".aivt"}
_HANDLES: Final = ".handle"


@dataclass(frozen=True, slots=True)
class OwnerSize:
    """ROM and RAM bytes of one owner."""

    rom: int
    ram: int


def sizes_by_owner(image: Image) -> dict[str, OwnerSize]:
    """Return the bytes by owner. RAM includes the array that holds heap and kernel stack."""
    found = [piece for piece in pieces(image) if piece.name not in _WITHOUT_OWNER]
    homes = _homes(found)
    rom: Counter[str] = Counter()
    ram: Counter[str] = Counter()
    for piece in found:
        if piece.name != _HANDLES:
            owner = owner_of_module(piece.module) if not piece.module.endswith(".h") else homes.get(piece.name, KERNEL)
            rom[owner] += piece.rom
            ram[owner] += piece.ram
    for file, size in handles(image):
        rom[owner_of_module(file)] += size
    return {owner: OwnerSize(rom[owner], ram[owner]) for owner in (KERNEL, DEVICES, APPLICATION)}


def owner_of_module(module: str) -> str:
    """Return the owner of a source file; library code without a source file belongs to the kernel."""
    if module == UNKNOWN:
        return KERNEL
    return next((owner for folder, owner in _FOLDERS.items() if folder in f"/{module}"), APPLICATION)


def _homes(found: list[Piece]) -> dict[str, str]:
    """Return the owner of each symbol: the owner of most of its code, without code from headers."""
    sizes: dict[str, Counter[str]] = {}
    for piece in found:
        if piece.module != UNKNOWN and not piece.module.endswith(".h"):
            sizes.setdefault(piece.name, Counter())[owner_of_module(piece.module)] += piece.rom
    return {name: count.most_common(1)[0][0] for name, count in sizes.items()}


def handles(image: Image) -> list[tuple[str, int]]:
    """Return (source file of the target, bytes) for every slot of `.handle`."""
    symbol = image.symbols.find(_HANDLES)
    section = next((s for s in image.sections if s.name == _HANDLES), None)
    start, size = (section.address, section.size) if section else (symbol.address, symbol.size) if symbol else (0, 0)
    slots = []
    for item in items(image, start, start + size):
        target = image.symbols.find(item.text.split()[-1].partition("+")[0])
        line = image.lines.find(target.address) if target else None
        slots.append((line.file if line else UNKNOWN, BYTES_PER_WORD * len(item.words)))
    return slots
