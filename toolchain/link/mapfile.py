"""The link map: memory use, sections and symbols with address and size, discarded sections, .dinit records."""

from __future__ import annotations

from xml.etree.ElementTree import Element, SubElement, indent, tostring

from emu.image.elf_facts import OCTETS_PER_UNIT
from toolchain.elf.model import Section, Symbol
from toolchain.elf.symbols import symbol_sizes
from toolchain.link.link import Linked, memory_use
from toolchain.link.place import memory_bytes, space_of


def memory_report(linked: Linked) -> str:
    """Return the used and free bytes of each memory, as `--report-mem` prints them."""
    used = memory_use(linked)
    memory = linked.layout.memory
    flash = memory.flash.size // OCTETS_PER_UNIT * 3
    rows = (
        ("flash", used["flash"], flash, f"{used['flash'] // 3} of {flash // 3} instruction words"),
        ("data memory", used["data"], memory.ram.size, f"stack gets {linked.stack[0]:#x}..{linked.stack[1]:#x}"),
        ("EEPROM", used["eeprom"], memory.eeprom.size, ""),
    )
    return "\n".join(f"{n:12} {u:6} of {t:6} bytes  {100 * u / t:5.1f} %  {note}".rstrip() for n, u, t, note in rows)


def memory_summary(linked: Linked, image: str) -> str:
    """Return memory use as XML, for MPLAB X's memory gauges (`--memorysummary`)."""
    used, place = memory_use(linked), linked.layout.memory
    flash = place.flash.size // OCTETS_PER_UNIT * 3
    rows = (("program", used["flash"], flash), ("data", used["data"], place.ram.size))
    project = Element("project")
    executable = SubElement(project, "executable", name=image)
    for name, taken, length in rows:
        memory = SubElement(executable, "memory", name=name)
        for tag, value in (("units", "bytes"), ("length", length), ("used", taken), ("free", length - taken)):
            SubElement(memory, tag).text = str(value)
    indent(project)
    return tostring(project, encoding="unicode", xml_declaration=True) + "\n"


def map_text(linked: Linked) -> str:
    """Return the whole map as text."""
    lines = ["Memory use", memory_report(linked), "", "Sections (address, size in address units, bytes)"]
    sizes: dict[Section, list[tuple[Symbol, int]]] = {}
    for obj in linked.resolution.objects:
        for symbol, size in symbol_sizes(obj.symbols):
            if symbol.section in linked.layout.placed:
                sizes.setdefault(symbol.section, []).append((symbol, size))
    for output in linked.outputs:
        section = output.section
        load = f"  load {section.load:#08x}" if section.load != section.address else ""
        bytes_used = memory_bytes(section, section.units)
        lines.append(f"\n{section.name:20} {section.address:#08x} {section.units:#7x} {bytes_used:6} bytes{load}")
        for source in output.inputs:
            placed = linked.layout.placed[source]
            owner = linked.resolution.owner[source].name
            used = memory_bytes(source, placed.size)
            lines.append(f"  {source.name:18} {placed.address:#08x} {placed.size:#7x} {used:6} bytes  {owner}")
            for symbol, size in sizes.get(source, []):
                address = placed.address + symbol.value
                lines.append(
                    f"    {'':16} {address:#08x} {size:#7x} {memory_bytes(source, size):6} bytes    {symbol.name}"
                )
    lines += ["", "Data initialisation (.dinit): address, bytes, how"]
    lines += [f"  {r.address:#06x} {r.size:6}  {r.format.name.lower()}" for r in linked.records]
    discarded = [
        f"  {section.name:18} {memory_bytes(section, section.units):6} bytes  {obj.name}"
        for obj in linked.resolution.objects
        for section in obj.sections
        if section not in linked.live and section.units and space_of(section) != "info"
    ]
    if discarded:
        lines += ["", "Left out by --gc-sections", *discarded]
    return "\n".join(lines) + "\n"
