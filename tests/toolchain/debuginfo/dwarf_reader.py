"""Reader of the debug sections of this toolchain's images, with pyelftools."""

from __future__ import annotations

import inspect
import io
from pathlib import Path

from elftools.dwarf.dwarfinfo import DebugSectionDescriptor, DwarfConfig, DWARFInfo
from elftools.elf.elffile import ELFFile


def dwarf_of(image: Path) -> DWARFInfo:
    """Return the DWARF information of an image."""
    content: dict[str, bytes] = {}
    with image.open("rb") as file:
        for section in ELFFile(file).iter_sections():
            content[section.name] = content.get(section.name, b"") + section.data()
    arguments = dict.fromkeys(n for n in inspect.signature(DWARFInfo.__init__).parameters if n.endswith("_sec"))
    for name in ("info", "abbrev", "line", "loc", "ranges", "frame"):
        data = content.get(f".debug_{name}", b"")
        arguments[f"debug_{name}_sec"] = DebugSectionDescriptor(io.BytesIO(data), f".debug_{name}", 0, len(data), 0)
    return DWARFInfo(config=DwarfConfig(True, "dsPIC30F", 4), **arguments)
