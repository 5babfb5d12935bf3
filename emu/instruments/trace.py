"""Instruction trace: cycle, PC, disassembly and changed registers. The machine runs in single steps.

Input: a machine, its image, a stream. Output: one line per instruction or exception entry.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, TextIO

from emu.image.model import Image
from emu.instruments.disassembly import Item, instruction

if TYPE_CHECKING:
    from emu.machine.machine import Machine
    from emu.machine.stops import Stop

CORE_END: Final = 0x0054
"""First data address after the core's registers (isa.md §2.1)."""
SILENT: Final = frozenset({"PCL", "PCH", "DISICNT"})
"""Core registers omitted from the trace: PC has its own column, and DISICNT changes in every cycle."""

HEADER: Final = "#      cycle      pc  instruction                                   changed registers"


class Tracer:
    """Writes a trace of the instructions that `advance` executes to `stream`."""

    def __init__(self, machine: Machine, image: Image, stream: TextIO) -> None:
        self.machine: Final = machine
        self.image: Final = image
        self.stream: Final = stream
        self._core: Final = machine.record.u16[: CORE_END // 2]
        self._names: Final = {
            sfr.address // 2: "W" + sfr.name.removeprefix("WREG") if sfr.name.startswith("WREG") else sfr.name
            for sfr in image.chip.sfrs.values()
            if sfr.address < CORE_END and sfr.name not in SILENT
        }
        self._items: Final[dict[tuple[int, int, int], Item | None]] = {}
        print(HEADER, file=stream)

    def advance(self, until: int) -> Stop | None:
        """Run to cycle `until` as `Machine.run_until` does, and write a line for each step."""
        machine = self.machine
        while machine.cycle < until:
            cycle, pc, before = machine.cycle, machine.pc, self._core.tolist()
            stop = machine.service_boundary(until)
            if machine.pc != pc:
                self._write(cycle, f"{'':8}  -- exception: {self.image.symbols.text(machine.pc)}", before)
            elif machine.cycle != cycle:
                self._write(cycle, f"{'':8}  -- nothing executed for {machine.cycle - cycle:,} cycles", before)
            if stop is not None or machine.cycle >= until:
                return stop
            cycle, pc, before = machine.cycle, machine.pc, self._core.tolist()
            text = f"{pc:#08x}  {self._text(pc)}"
            stop = machine.step()
            self._write(cycle, text, before)
            if stop is not None:
                return stop
        return None

    def _write(self, cycle: int, text: str, before: list[int]) -> None:
        """Write a line that lists the registers whose values differ from `before`."""
        changed = [
            f"{self._names[word]}={value:04X}"
            for word, (old, value) in enumerate(zip(before, self._core.tolist(), strict=True))
            if value != old and word in self._names
        ]
        self.stream.write(f"{cycle:12} {text:54}  {' '.join(changed)}".rstrip() + "\n")

    def _text(self, pc: int) -> str:
        """Disassemble the instruction at `pc` from the machine's memory, which the firmware may have reprogrammed."""
        program = self.machine.program
        key = (pc, program.word(pc), program.word(pc + 2))
        if key not in self._items:
            self._items[key] = instruction(self.image, *key)
        item = self._items[key]
        return item.text if item is not None else f".pword {key[1]:#08x}"
