"""Measurement of the memory equation: RAM = A + B n + C m + D s + sum over pending messages of (E + d).

A is the fixed part, B to D the bytes per thread, event and subscription, E the overhead of a pending message.

The `footprint` application builds a load of n threads, m events, s subscriptions and messages of d bytes. The emulator
reads the heap. Used memory is the capacity minus the reserve and the free blocks (kernel/memory.c). It must equal the
count kept by the allocator.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from typing import Final

from emu.image.footprint import pieces
from emu.image.model import Image
from emu.kernel_metrics.heap import Heap
from emu.kernel_metrics.owners import DEVICES, KERNEL, sizes_by_owner
from emu.kernel_metrics.target import WORD, MeasureError, Target

APPLICATION: Final = "footprint_wanted"
"""Symbol by which the application is recognised."""

PAPER: Final = {"A": 1142, "B": 146, "C": 6}
"""Coefficients of Eq. (1) in the paper (Trenkwalder et al., IROS 2016), which has no term for subscriptions."""
ORIGINAL: Final = {"B": 228, "C": 12, "D": 24, "E": 26}
"""Bytes that the original's allocator uses: 28 per pending message of 2 bytes (openswarm-original.md §4.6)."""

PAPER_ROM: Final = 12 * 1024
"""ROM bytes in the paper, including motors, UART and remote control (openswarm-original.md §1)."""
ORIGINAL_ROM: Final = {"kernel": 9072, "devices": 12288}
"""ROM bytes of the original, decoded from the authors' image (openswarm-original.md §1)."""

_APPLICATION: Final = ("_footprint_wanted", "_footprint_now", "_pids", "_any")
"""Variables of the measuring application itself, which do not count as kernel memory."""
OF_DEVICES: Final = ("device", "UART")
"""Substrings of names of those parts of A that belong to devices."""
KERNEL_EVENTS: Final = (0x01, 0x07)
"""Number of events that Sys_Init_Kernel registers for itself: termination and 1 ms (openswarm.h)."""
EVENT: Final = 6
"""Size of a registered event in bytes (kernel.h)."""
_RESULT_WORDS: Final = 6


@dataclass(frozen=True, slots=True)
class Load:
    """Load that the application has to build."""

    threads: int = 0
    events: int = 0
    subscriptions: int = 0
    messages: int = 0
    payload: int = 0

    @property
    def payload_bytes(self) -> int:
        """Stored size of all payloads in bytes; the allocator rounds up to whole words."""
        return self.messages * (self.payload + self.payload % WORD)


@dataclass(frozen=True, slots=True)
class Case:
    """A load and its memory use, as read from the heap and as counted by the allocator."""

    load: Load
    taken: int
    counted: int
    left: int
    """Bytes still allocated after everything was freed, minus those of the empty kernel; not 0 means a leak."""


@dataclass(frozen=True, slots=True)
class Equation:
    """Coefficients in bytes, and the largest difference between equation and measurement."""

    coefficients: dict[str, Fraction]
    constant: dict[str, int]
    """Size of each part of the constant A, in bytes."""
    sizes: dict[str, dict[str, int]]
    """ROM and A in bytes, for the kernel alone and for the kernel with its devices."""
    heap: int
    """Capacity of the heap in bytes, which is not part of A."""
    residual: Fraction
    cases: list[Case]


def measure(image: Image, engine: str = "auto") -> Equation:
    """Run all loads and fit the equation. Raises MeasureError if the application misbehaves or the counts differ."""
    target = Target(image, "footprint_begin", engine)
    heap = Heap(target.machine)
    target.run_to("footprint_empty")
    empty = heap.used()
    cases = [_case(target, heap, load, empty) for load in loads()]
    for case in cases:
        if case.taken != case.counted or case.left:
            raise MeasureError(f"{case}: the memory read, counted by the allocator and freed does not agree")
    own = EVENT * sum(1 for number in heap.events() if number in KERNEL_EVENTS)
    return _fit(cases, _constant(target, heap, empty, own), _roms(image), heap.capacity)


def loads() -> Iterator[Load]:
    """Yield all loads: n = 0..8, m = 0..16, s = 0..16, messages of several sizes, and combinations."""
    yield from (Load(threads=n) for n in range(9))
    yield from (Load(events=m) for m in range(1, 17))
    yield from (Load(events=8, subscriptions=s) for s in range(1, 17))
    for payload in (0, 1, 2, 3, 4, 8, 24, 63, 64):
        yield from (Load(events=1, subscriptions=1, messages=count, payload=payload) for count in (1, 2, 5))
    yield Load(8, 16, 16, 4, 24)
    yield Load(3, 5, 7, 2, 10)


def _case(target: Target, heap: Heap, load: Load, empty: int) -> Case:
    target.restart()
    request = (load.threads, load.events, load.subscriptions, load.messages, load.payload)
    target.set_words("footprint_wanted", request)
    target.run_to("footprint_built")
    result = target.words("footprint_now", _RESULT_WORDS)
    if tuple(result[:4]) != request[:4]:
        raise MeasureError(f"requested {request[:4]} threads, events, subscriptions, messages; got {tuple(result[:4])}")
    taken, counted = heap.used() - empty, result[4] - empty
    target.run_to("footprint_undone")
    return Case(load, taken, counted, heap.used() - empty)


def _constant(target: Target, heap: Heap, empty: int, own: int) -> dict[str, int]:
    """Return the parts of A: RAM in use before the first thread, without heap and application variables."""
    parts = {
        "kernel stack": target.size("os_memory") - heap.capacity,
        "kernel events": own,
        "device events and subscriptions": empty - own,
    }
    for piece in pieces(target.image):
        if piece.name in ("_os_memory", *_APPLICATION) or "apps/" in piece.module:
            continue
        part = "UART state" if piece.name == "_channels" else _part_of(piece.module)
        parts[part] = parts.get(part, 0) + piece.ram
    return {name: size for name, size in parts.items() if size}


def _roms(image: Image) -> dict[str, int]:
    """Return the ROM bytes of the kernel alone and with its devices."""
    owned = sizes_by_owner(image)
    return {KERNEL: owned[KERNEL].rom, DEVICES: owned[KERNEL].rom + owned[DEVICES].rom}


def _part_of(module: str) -> str:
    """Return the part of A to which the variables of a source file belong."""
    folders = {"/kernel/": "kernel variables", "/port/": "kernel variables", "/io/": "device variables",
               "/board/": "device variables"}  # fmt: skip
    return next((part for folder, part in folders.items() if folder in f"/{module}"), "library variables, padding")


def _fit(cases: list[Case], parts: dict[str, int], roms: dict[str, int], capacity: int) -> Equation:
    """Fit the equation. Slopes come from loads with one parameter; the residual covers all loads."""
    by_load = {case.load: case.taken for case in cases}

    def slope(many: Load, few: Load, difference: int) -> Fraction:
        return Fraction(by_load[many] - by_load[few], difference)

    b = slope(Load(threads=8), Load(), 8)
    c = slope(Load(events=16), Load(), 16)
    d = slope(Load(events=8, subscriptions=16), Load(events=8, subscriptions=1), 15)
    e = slope(Load(0, 1, 1, 5, 2), Load(0, 1, 1, 1, 2), 4) - 2
    constant = Fraction(by_load[Load()])
    residual = max(
        abs(
            case.taken
            - (constant + b * case.load.threads + c * case.load.events + d * case.load.subscriptions)
            - (e * case.load.messages + case.load.payload_bytes)
        )
        for case in cases
    )
    coefficients = {"A": sum(parts.values()) + constant, "B": b, "C": c, "D": d, "E": e}
    alone = sum(size for name, size in parts.items() if not any(word in name for word in OF_DEVICES)) + int(constant)
    sizes = {
        KERNEL: {"rom": roms[KERNEL], "A": alone},
        DEVICES: {"rom": roms[DEVICES], "A": int(coefficients["A"])},
    }
    return Equation(coefficients, parts, sizes, capacity, residual, cases)
