"""Registers that are masked storage without a modelled function, with the reasons. `report` prints the list."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

from emu.chips.chip import Chip
from emu.system.bus import Bus

PLAIN: Final[Mapping[str, str]] = MappingProxyType(
    {
        "BSRAM": "CodeGuard access flags of the boot segment's RAM: no security segment is enforced (§17)",
        "SSRAM": "CodeGuard access flags of the secure segment's RAM: no security segment is enforced (§17)",
        "PMD3": "reserved address, no bits on this part",
    }
)
"""Reason by register name. Every other register in a chip's table is used or computed by the CPU or a device."""


def kind(bus: Bus, word: int) -> str:
    """Return how the register at word index `word` is modelled, for the printed list."""
    if bus.on_read[word] is not None:
        return "read and write have effects" if bus.on_write[word] is not None else "read has an effect"
    if bus.compute[word] is not None:
        return "computed, write has an effect" if bus.on_write[word] is not None else "computed"
    return "write has an effect" if bus.on_write[word] is not None else "storage read by its device"


def report(chip: Chip, bus: Bus) -> str:
    """Return the list as Markdown: plain registers with reasons, then how every other register is modelled."""
    plain, groups = [], dict[str, list[str]]()
    for sfr in chip.sfrs.values():
        if sfr.size != 2:
            continue
        if sfr.name in PLAIN:
            plain.append(f"| `{sfr.name}` | {sfr.address:04X} | {PLAIN[sfr.name]} |")
        else:
            group = "working registers" if sfr.name.startswith("WREG") else kind(bus, sfr.address >> 1)
            groups.setdefault(group, []).append(sfr.name)
    lines = [
        f"# Registers of the {chip.name}: which are modelled, which are plain",
        "",
        "`emu.peripherals.system.plain_registers.report(machine.chip, machine.bus)` generates this page;",
        "`tests/emu/peripherals/test_plain_registers.py` checks it. Section numbers are those of the chip reference.",
        "A plain register stores the bits of its mask; the first access is reported.",
        "",
        "| plain register | address | reason |",
        "|---|---|---|",
        *plain,
        "",
    ]
    for group, names in sorted(groups.items()):
        lines += [f"## {group[0].upper()}{group[1:]} ({len(names)})", "", *_wrap(names), ""]
    return "\n".join(lines)


def _wrap(names: list[str], width: int = 116) -> list[str]:
    lines = [""]
    for name in names:
        if len(lines[-1]) + len(name) + 1 > width:
            lines.append("")
        lines[-1] = f"{lines[-1]} {name}".strip()
    return lines
