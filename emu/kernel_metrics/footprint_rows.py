"""Rows of a footprint baseline: every number of `emu footprint` that a check compares.

Input: the pieces of an image and the memory use of a run. Output: `Metric`s by name. A row of a single file or of free
memory is only compared if the baseline gives it a limit.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence

from emu.image.footprint import Piece, group
from emu.image.model import Image
from emu.kernel_metrics.baseline import Metric
from emu.kernel_metrics.blame import short
from emu.kernel_metrics.memory_results import ApplicationMemory
from emu.kernel_metrics.owners import sizes_by_owner


def static_numbers(image: Image, found: Sequence[Piece]) -> dict[str, Metric]:
    """Return the sizes of an image: in all, without start-up code, by owner, by source file."""
    numbers: dict[str, Metric] = {}
    for kind in ("rom", "ram"):
        name = kind.upper()
        where: dict[str, dict[str, int]] = defaultdict(dict)
        for piece in found:
            size = getattr(piece, kind)
            if size:
                parts = where[short(piece.module)]
                parts[piece.name] = parts.get(piece.name, 0) + size
        files = {file: sum(parts.values()) for file, parts in where.items()}
        numbers[name] = Metric(sum(files.values()), where=where)
        left = sum(getattr(piece, kind) for piece in found if group(piece) == "program")
        numbers[f"{name} without vectors, start-up code and printf"] = Metric(left, where=where)
        numbers |= {f"{file}: {name}": Metric(size, is_gated=False) for file, size in sorted(files.items())}
    for owner, sizes in sizes_by_owner(image).items():
        numbers |= {f"{owner}: ROM": Metric(sizes.rom), f"{owner}: RAM": Metric(sizes.ram)}
    return numbers


def run_numbers(memory: ApplicationMemory) -> dict[str, Metric]:
    """Return the numbers of a run: threads, events, heap, kernel stack."""
    numbers: dict[str, Metric] = {"threads at once": Metric(memory.most_threads, "threads")}
    for thread in memory.threads:
        name = f"thread {thread.name}"
        has_block = thread.heap > 0  # the stack of main is the rest of RAM, which grows when variables shrink
        numbers |= {
            f"{name}: stack": Metric(thread.stack, is_gated=has_block),
            f"{name}: stack used": Metric(thread.used, of=thread.stack),
            f"{name}: stack free": Metric(thread.free, of=thread.stack, more_is_better=True, is_gated=False),
            f"{name}: heap block": Metric(thread.heap),
            f"{name}: cleanup nodes": Metric(thread.cleanups, "nodes"),
            f"{name}: mutexes owned": Metric(thread.mutexes, "mutexes"),
        }
    numbers |= {
        "events": Metric(len(memory.events), "events"),
        "subscriptions": Metric(sum(event.subscriptions for event in memory.events), "subscriptions"),
    }
    for event in memory.events:
        numbers |= {
            f"{event.name}: subscriptions": Metric(event.subscriptions, "subscriptions"),
            f"{event.name}: queued messages": Metric(event.peak_messages, "messages"),
            f"{event.name}: queued bytes": Metric(event.peak_bytes),
        }
    heap = memory.heap
    return numbers | {
        "heap: peak": Metric(heap.peak, of=heap.capacity),
        "heap: used at the end": Metric(heap.used, of=heap.capacity),
        "heap: free at the end": Metric(heap.free, of=heap.capacity, more_is_better=True, is_gated=False),
        "heap: largest free block": Metric(heap.largest_free, of=heap.capacity, more_is_better=True, is_gated=False),
        "heap: messages at the end": Metric(heap.messages),
        "heap: drivers, peak": Metric(heap.drivers_peak),
        "kernel stack: used": Metric(memory.kernel_stack_used, of=memory.kernel_stack),
        "A of the memory equation": Metric(memory.equation["A"]),
    }


def line_of(row: str, memory: ApplicationMemory) -> str:
    """Return the source line that started the thread, or used the event, of a row; empty for other rows."""
    for thread in memory.threads:
        if row.startswith(f"thread {thread.name}: "):
            return thread.line
    for event in memory.events:
        if row.startswith(f"{event.name}: "):
            return event.sender if "queued" in row else event.line
    return ""


def grown_pieces(old: dict[str, dict[str, int]], new: dict[str, dict[str, int]]) -> list[tuple[str, str, int]]:
    """Return (source file, symbol, bytes) of everything that grew, the largest first."""
    grown = [
        (file, name, size - old.get(file, {}).get(name, 0))
        for file, parts in new.items()
        for name, size in parts.items()
        if size > old.get(file, {}).get(name, 0)
    ]
    return sorted(grown, key=lambda item: (-item[2], item[:2]))
