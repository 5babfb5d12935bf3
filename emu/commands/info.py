"""`emu info`: print the contents of a firmware image, as text or as JSON."""

from __future__ import annotations

import argparse
import json
from typing import Any

from emu.commands.image_option import add_chip_option, image_of
from emu.host.command import Parser
from emu.host.exit_status import DONE
from emu.image.model import BYTES_PER_WORD, Image


def parser() -> Parser:
    made = Parser("info", "Print sections, ROM and RAM use, vectors and configuration words.", "emu info firmware.elf")
    made.add_argument("image", metavar="IMAGE", help="ELF executable or Intel HEX file")
    add_chip_option(made)
    made.add_argument("--json", action="store_true", help="print one JSON object")
    return made


def run(options: argparse.Namespace) -> int:
    """Run the command. Return 0 if printed, 2 for bad input."""
    facts = describe(image_of(options))
    print(json.dumps(facts, indent=2) if options.json else text(facts))
    return DONE


def describe(image: Image) -> dict[str, Any]:
    """Return the output of the command as plain data. Names of sizes contain the unit."""
    return {
        "path": image.path,
        "format": image.kind,
        "chip": image.chip.name,
        "entry": image.entry,
        "warnings": list(image.warnings),
        "sections": _sections(image),
        "memory": _memory(image),
        "vectors": _vectors(image),
        "config": _config(image),
    }


def _sections(image: Image) -> list[dict[str, Any]]:
    return [
        {
            "name": section.name,
            "kind": section.kind,
            "address": section.address,
            "load_address": section.load_address,
            "program_words": section.program_words,
            "ram_bytes": section.size if section.kind in ("data", "bss") else 0,
        }
        for section in image.sections
        if section.kind != "info" and section.size
    ]


def _memory(image: Image) -> dict[str, Any]:
    chip = image.chip
    flash, ram, eeprom = chip.program["flash"], chip.data["ram"], chip.program["eedata"]
    used = image.used(flash)
    memory: dict[str, Any] = {
        "flash_words": used,
        "flash_words_total": flash.size // 2,
        "flash_bytes": used * BYTES_PER_WORD,
        "flash_bytes_total": flash.size // 2 * BYTES_PER_WORD,
        "eeprom_bytes": 2 * image.used(eeprom),
        "eeprom_bytes_total": eeprom.size,
    }
    if image.kind == "elf":
        taken = {
            address
            for section in image.sections
            if section.kind in ("data", "bss")
            for address in range(section.address, min(section.address + section.size, ram.end))
        }
        memory |= {"ram_bytes": len(taken), "ram_bytes_total": ram.size}
    return memory


def _vectors(image: Image) -> list[dict[str, Any]]:
    """Return every vector that the image defines, of the main and the alternate table."""
    found = []
    for vector in image.chip.vectors:
        for table, address in (("ivt", vector.ivt), ("aivt", vector.aivt)):
            handler = image.word(address)
            if handler is not None:
                found.append(
                    {
                        "table": table,
                        "name": vector.name,
                        "address": address,
                        "handler": handler,
                        "symbol": image.symbols.text(handler) if len(image.symbols) else None,
                    }
                )
    return found


def _config(image: Image) -> list[dict[str, Any]]:
    return [
        {
            "name": register.name,
            "address": register.address,
            "value": word & 0xFFFF,
            "fields": {name: register.field(word, name) for name in register.fields},
        }
        for register in image.chip.config.values()
        if (word := image.word(register.address)) is not None
    ]


def text(facts: dict[str, Any]) -> str:
    """Return the output of `describe` as text."""
    kind = {"elf": "ELF executable", "hex": "Intel HEX"}[facts["format"]]
    lines = [f"{facts['path']}: {kind} for {facts['chip']}"]
    lines += [f"warning: {warning}" for warning in facts["warnings"]]
    if facts["sections"]:
        lines += ["", f"{'section':24} {'kind':7} {'address':>8} {'loaded at':>10} {'size':>14}"]
        lines += [_section_line(section) for section in facts["sections"]]
    lines += ["", *_memory_lines(facts["memory"])]
    if facts["vectors"]:
        lines += ["", *_vector_lines(facts["vectors"])]
    if facts["config"]:
        lines.append("")
    for register in facts["config"]:
        fields = " ".join(f"{name}={value}" for name, value in register["fields"].items())
        lines.append(f"{register['name']:8} {register['address']:#08x}  {register['value']:#06x}  {fields}")
    return "\n".join(lines)


def _section_line(section: dict[str, Any]) -> str:
    loaded = "" if section["load_address"] is None else f"{section['load_address']:#08x}"
    words = section["program_words"]
    size = f"{words:8,} words" if words else f"{section['ram_bytes']:8,} bytes"
    return f"{section['name']:24} {section['kind']:7} {section['address']:#08x} {loaded:>10} {size:>14}"


def _memory_lines(memory: dict[str, Any]) -> list[str]:
    rows = [("flash", "flash_bytes"), ("RAM", "ram_bytes"), ("EEPROM", "eeprom_bytes")]
    lines = []
    for name, key in rows:
        if memory.get(key) is None or (key == "eeprom_bytes" and not memory[key]):
            continue
        used, total = memory[key], memory[key + "_total"]
        note = f", {memory['flash_words']:,} program words" if key == "flash_bytes" else ""
        lines.append(f"{name:7} {used:8,} of {total:,} bytes ({100 * used / total:.1f} %{note})")
    return lines


def _vector_lines(vectors: list[dict[str, Any]]) -> list[str]:
    """Return one line per handler of a single vector, and one line with the count of the most common handler.

    Equal entries of the main and the alternate table share a line.
    """
    handlers = [vector["handler"] for vector in vectors]
    usual = max(set(handlers), key=handlers.count)
    shared = [vector for vector in vectors if vector["handler"] == usual]
    own: dict[tuple[str, int], list[dict[str, Any]]] = {}
    for vector in vectors:
        if vector["handler"] != usual or len(shared) == 1:
            own.setdefault((vector["name"], vector["handler"]), []).append(vector)
    lines = []
    for (name, handler), entries in own.items():
        tables = ", ".join(f"{entry['table']} {entry['address']:#05x}" for entry in entries)
        symbol = f"  {entries[0]['symbol']}" if entries[0]["symbol"] else ""
        lines.append(f"{tables:23} {name:18} -> {handler:#08x}{symbol}")
    if len(shared) > 1:
        symbol = f" ({shared[0]['symbol']})" if shared[0]["symbol"] else ""
        lines.append(f"{len(shared)} {'other ' if lines else ''}vectors -> {usual:#08x}{symbol}")
    return lines
