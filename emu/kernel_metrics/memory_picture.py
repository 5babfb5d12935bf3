"""Picture of an application's memory as SVG: one bar for flash, one for RAM, each to scale; and as an HTML page.

The page holds the picture and the tables of `emu footprint`. It loads nothing from elsewhere.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from typing import Final

from emu.kernel_metrics.memory_results import ApplicationMemory

WIDTH, BAR, GAP, MARGIN = 960, 64, 84, 16
COLOURS: Final = {
    "kernel": "#4269d0", "devices": "#97bbf5", "application": "#efb118", "start-up and vectors": "#9c6b4e",
    "kernel stack": "#6cc5b0", "stack used": "#ff725c", "stack free": "#ffd0c8", "control blocks": "#a463f2",
    "events": "#3ca951", "messages": "#ff8ab7", "drivers": "#9498a0", "free": "#eeeeee",
}  # fmt: skip
"""Colours by kind of memory."""
SMALLEST_LABEL: Final = 46
"""Width in pixels below which a part has a tooltip only."""

Part = tuple[str, str, int]
"""(label, kind, bytes)."""


def ram_parts(memory: ApplicationMemory, ram: int) -> list[Part]:
    """Return the parts of `ram` bytes of RAM: variables by owner, stacks, threads, events, messages, free memory."""
    own, heap = memory.equation, memory.heap
    variables = own["A_parts"].items()
    parts: list[Part] = [(f"{owner} variables", owner, size) for owner, size in variables if owner in COLOURS]
    for one in memory.threads:
        if one.heap:  # the control block of main is a variable of the kernel
            parts.append((f"{one.name}: stack used", "stack used", one.used))
            parts.append((f"{one.name}: stack free", "stack free", one.stack - one.used))
            parts.append((f"{one.name}: control block", "control blocks", one.heap - one.stack))
    parts.append(("events and subscriptions", "events", heap.events + heap.subscriptions + heap.gates))
    messages, drivers = heap.fullest.get("messages", 0), heap.drivers_peak
    parts += [("messages, fullest moment", "messages", messages), ("drivers, peak", "drivers", drivers)]
    taken = sum(size for _, _, size in parts) - own["A"]
    parts.append(("heap, never used", "free", max(heap.capacity - taken, 0)))
    used = sum(one.used for one in memory.threads if not one.heap)
    parts.append(("main: stack used", "stack used", used))
    parts.append(("main: stack free", "stack free", max(ram - own["A"] - heap.capacity - used, 0)))
    return [part for part in parts if part[2] > 0]


def rom_parts(owners: Mapping[str, int], used: int, flash: int) -> list[Part]:
    """Return the parts of `flash` bytes of flash, of which `used` are used: code by owner and the rest."""
    parts: list[Part] = [(owner, owner, size) for owner, size in owners.items()]
    parts.append(("start-up and vectors", "start-up and vectors", max(used - sum(owners.values()), 0)))
    return [part for part in (*parts, ("free", "free", max(flash - used, 0))) if part[2] > 0]


def svg(bars: Sequence[tuple[str, Sequence[Part]]]) -> str:
    """Return an SVG document with one bar for each (title, parts)."""
    height = 2 * MARGIN + len(bars) * (BAR + GAP)
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height}" width="{WIDTH}" height="{height}"'
        ' font-family="sans-serif" font-size="11">'
    ]
    for number, (title, parts) in enumerate(bars):
        top = MARGIN + number * (BAR + GAP)
        whole = sum(size for _, _, size in parts)
        lines.append(f'<text x="{MARGIN}" y="{top + 10}" font-size="13">{escape(title)}</text>')
        left = float(MARGIN)
        for label, kind, size in parts:
            width = (WIDTH - 2 * MARGIN) * size / whole
            lines.append(
                f'<g><title>{escape(label)}: {size:,} bytes</title><rect x="{left:.2f}" y="{top + 18}"'
                f' width="{width:.2f}" height="{BAR}" fill="{COLOURS[kind]}" stroke="#fff" stroke-width="0.5"/>'
            )
            if width >= SMALLEST_LABEL:
                text = label if len(label) * 6 < width else f"{label[: max(int(width / 6) - 1, 1)]}…"
                lines.append(f'<text x="{left + 3:.2f}" y="{top + 34}">{escape(text)}</text>')
                lines.append(f'<text x="{left + 3:.2f}" y="{top + 50}">{size:,}</text>')
            lines.append("</g>")
            left += width
        lines += _legend(top + BAR + 34, parts)
    return "\n".join([*lines, "</svg>", ""])


def _legend(top: int, parts: Sequence[Part]) -> list[str]:
    lines = []
    left = MARGIN
    for kind in dict.fromkeys(kind for _, kind, _ in parts):
        lines.append(f'<rect x="{left}" y="{top - 9}" width="10" height="10" fill="{COLOURS[kind]}"/>')
        lines.append(f'<text x="{left + 14}" y="{top}">{escape(kind)}</text>')
        left += 26 + 7 * len(kind)
    return lines


def html(title: str, picture: str, text: str) -> str:
    """Return an HTML page with the picture and the tables."""
    return (
        f'<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8"><title>{escape(title)}</title></head>\n'
        f"<body><h1>{escape(title)}</h1>\n{picture}<pre>{escape(text)}</pre></body></html>\n"
    )
