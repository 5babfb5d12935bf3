"""Text of the memory use of an application: threads, events, heap, memory equation."""

from __future__ import annotations

from collections.abc import Iterator

from emu.kernel_metrics.memory_results import ApplicationMemory


def memory_text(memory: ApplicationMemory) -> str:
    """Return the tables of an application's memory use."""
    return "\n".join(_lines(memory))


def _lines(memory: ApplicationMemory) -> Iterator[str]:
    yield f"in {memory.seconds:g} s of simulated time"
    yield ""
    yield (
        f"{'thread':28} {'PID':>4} {'stack':>6} {'used':>6} {'free':>6} {'guard':>6} {'PCB':>5} {'cleanups':>9}"
        f" {'mutexes':>8} {'started':>8}"
    )
    for one in memory.threads:
        yield (
            f"{one.name:28} {one.pid:4} {one.stack:6,} {one.used:6,} {one.free:6,} {one.guard:6,} {one.control_block:5}"
            f" {one.cleanups:9} {one.mutexes:8} {one.started:8}"
        )
    yield ""
    yield f"{'event':28} {'subscriptions':>14} {'of drivers':>11} {'sent':>8} {'queued at most':>15} {'bytes':>7}"
    for event in memory.events:
        yield (
            f"{event.name:28} {event.subscriptions:14} {event.by_drivers:11} {event.sent:8,} {event.peak_messages:15}"
            f" {event.peak_bytes:7,}"
        )
    heap = memory.heap
    yield ""
    yield f"{'heap':28} {'at the end':>11} {'fullest':>8}"
    for kind in ("threads", "events", "subscriptions", "gates", "messages", "drivers"):
        yield f"{kind:28} {getattr(heap, kind):11,} {heap.fullest.get(kind, 0):8,}"
    yield f"{'used':28} {heap.used:11,} {sum(heap.fullest.values()):8,}"
    yield (
        f"capacity {heap.capacity:,}, peak {heap.peak:,}, free {heap.free:,} in {heap.free_blocks} blocks, the largest"
        f" {heap.largest_free:,} (fragmentation {100 * heap.fragmentation:.0f} %)"
    )
    yield f"kernel stack {memory.kernel_stack:,}, used {memory.kernel_stack_used:,}"
    yield ""
    yield equation_line(memory)


def equation_line(memory: ApplicationMemory) -> str:
    """Return the memory equation with the application's numbers when its allocations were largest."""
    own = memory.equation
    stacks = " + ".join(str(size) for size in own["stacks"].values()) or "0"
    extra = own["gates"] + own["drivers"]
    return (
        "RAM = A + sum over n threads of (B + stack) + C m + D s + sum over pending messages of (E + d)\n"
        f"    = {own['A']:,} + {own['B']} * {own['n']} + ({stacks}) + {own['C']} * {own['m']} + {own['D']} * {own['s']}"
        f" + {own['E']} * {own['messages']} + {own['payload']}"
        + (f" + {extra} of drivers" if extra else "")
        + f" = {own['ram']:,} bytes"
    )
