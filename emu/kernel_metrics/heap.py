"""The kernel's heap in the RAM of a machine: capacity, free blocks, allocated bytes, registered events.

Used memory is the capacity minus the reserve and the free blocks (kernel/memory.c). It must equal the count kept by the
allocator. Only symbols are needed, no debug information.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Final

from emu.kernel_metrics.target import WORD, MeasureError, address_of, size_of

if TYPE_CHECKING:
    from emu.machine.machine import Machine

_PIECES: Final = (("reserve_begin", "reserve_end"), ("free_run", "free_run_end"))
"""Variables that hold the ends of free ranges outside the free blocks: the reserve, and the block being freed."""
_SIZE: Final = 4
"""Offset of the size field in a free block (kernel/memory.c)."""
_LONGEST_LIST: Final = 4096


class Heap:
    """The heap of the kernel that `machine` runs. Create it after Sys_Init_Kernel has initialised the heap.

    Raises MeasureError if the image lacks a variable of the allocator.
    """

    def __init__(self, machine: Machine) -> None:
        assert machine.image is not None
        self._machine: Final = machine
        self._image: Final = machine.image
        self.capacity: Final = self.free() + machine.peek(self._address("os_statistics"))
        """Size of the whole heap in bytes: free bytes plus those already allocated at the first read."""

    def _address(self, name: str) -> int:
        return address_of(self._image, name)

    def free_blocks(self) -> list[int]:
        """Return the sizes in bytes of all free blocks, the reserve included."""
        peek = self._machine.peek
        ranges = [peek(self._address(end)) - peek(self._address(begin)) for begin, end in _PIECES]
        return [size for size in ranges if size] + [peek(hole + _SIZE) for hole in self._holes()]

    def free(self) -> int:
        """Return the bytes of the reserve and of all free blocks."""
        return sum(self.free_blocks())

    def _holes(self) -> Iterator[int]:
        """Yield the addresses of the free blocks. Raises MeasureError if their tree is not a heap ordered by size."""
        peek = self._machine.peek
        found = [peek(self._address("holes"))]
        no_hole = self._address("no_hole")
        seen = 0
        while found:
            hole = found.pop()
            if hole == no_hole:
                continue
            seen += 1
            sides = [peek(hole + WORD * side) for side in range(2)]
            size = peek(hole + _SIZE)
            if seen > _LONGEST_LIST or any(peek(side + _SIZE) > size for side in sides):
                raise MeasureError("the tree of free blocks in the kernel's memory is not a heap by size")
            found += sides
            yield hole

    def used(self) -> int:
        """Return the allocated bytes."""
        return self.capacity - self.free()

    def events(self) -> Iterator[int]:
        """Yield the identifiers of all registered events."""
        first = self._address("events")
        for bucket in range(first, first + size_of(self._image, "events"), WORD):
            for event in self._list(self._machine.peek(bucket), WORD):
                yield self._machine.peek(event)

    def _list(self, block: int, link: int = 0) -> Iterator[int]:
        """Yield the addresses of a linked list's elements; the link is at offset `link` of an element."""
        for _ in range(_LONGEST_LIST):
            if not block:
                return
            yield block
            block = self._machine.peek(block + link)
        raise MeasureError("a list of the kernel does not end")
