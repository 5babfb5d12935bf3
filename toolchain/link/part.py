"""Programs that another image calls (`--part`): constants in RAM, and checks for unsupported contents."""

from __future__ import annotations

from emu.image.elf_facts import SectionFlag
from toolchain.elf.model import Section
from toolchain.errors import ToolError
from toolchain.link.gc import vector_names
from toolchain.link.place import space_of
from toolchain.link.resolve import Resolution


def adapt(resolution: Resolution) -> None:
    """Turn constants into initialised data, because the PSV window shows the constants of the calling image."""
    for section in resolution.owner:
        if section.is_psv and not section.flags & SectionFlag.EEDATA:
            kept = section.flags & ~(SectionFlag.PSV | SectionFlag.EXECINSTR)
            section.flags = kept | SectionFlag.WRITE | SectionFlag.ALLOC


def check(resolution: Resolution, live: set[Section]) -> None:
    """Raise `ToolError` for interrupt handlers, configuration words and EEPROM contents, which would have no effect."""
    findings = [
        f"{resolution.defined_in[name].name}: error: {name} is a handler of interrupts; the vectors are those of the"
        f" image that calls this program"
        for name in sorted(vector_names() & set(resolution.globals))
    ]
    for section in live:
        space = space_of(section)
        if section.units and space in ("config", "eeprom"):
            what = "configuration words" if space == "config" else "contents of the data EEPROM"
            owner = resolution.owner[section].name
            findings.append(f"{owner}: error: {section.name}: a program that another image calls has no {what}")
    if findings:
        raise ToolError.of(sorted(findings))
