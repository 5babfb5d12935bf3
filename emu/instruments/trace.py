"""Instruction trace: cycle, PC, disassembly and changed registers.

Input: a machine, its image, a stream. Output: one line per instruction, exception entry and sleep. The machine logs
the state before each of them (emu/dspic30f/instruction_log.py), mostly in native code; trace_text.c makes the lines.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, Final, TextIO

import numpy as np

from emu.debug.disassembly import instruction
from emu.dspic30f.instruction_log import BOUNDARY, CORE_BYTES, CORE_END, Entries, InstructionLog
from emu.image.model import Image
from emu.native_library import ADDRESS, INT, functions

if TYPE_CHECKING:
    from emu.machine.machine import Machine
    from emu.machine.stops import Stop

SILENT: Final = frozenset({"PCL", "PCH", "DISICNT"})
"""Core registers omitted from the trace: PC has its own column, and DISICNT changes in every cycle."""
HEADER: Final = "#      cycle      pc  instruction                                   changed registers"
_NAME_BYTES: Final = 16
_TEXTS: Final = 8192
"""Number of instructions whose texts are kept."""
_TEXT_BYTES: Final = 1 << 22
"""Size of the buffer for lines."""
_SLOT_BYTES: Final = 320
_LONGEST_TEXT: Final = 300
"""Size of a text's slot for trace_text.c, and maximum length of a text, in bytes."""


@cache
def _code() -> Callable[..., int]:
    signature = (INT, (ADDRESS, ADDRESS, INT, INT, ADDRESS, INT, ADDRESS))
    return functions(Path(__file__).with_name("trace_text.c"), {"trace_text": signature})["trace_text"]


class _Texts(ctypes.Structure):
    """Texts for trace_text.c: their offsets by program word, the texts, and the names of the core registers."""

    _fields_ = (("offsets", ADDRESS), ("words", INT), ("texts", ADDRESS), ("names", ADDRESS))


class Tracer:
    """Writes a trace of what `machine` executes to `stream`, until `close`.

    Raises ValueError if another instrument runs.
    """

    def __init__(self, machine: Machine, image: Image, stream: TextIO) -> None:
        self.machine: Final = machine
        self.image: Final = image
        self.stream: Final = stream
        self._write_lines: Final = _code()
        self._names: Final = {
            sfr.address // 2: "W" + sfr.name.removeprefix("WREG") if sfr.name.startswith("WREG") else sfr.name
            for sfr in image.chip.sfrs.values()
            if sfr.address < CORE_END and sfr.name not in SILENT
        }
        words = machine.chip.program["flash"].end // 2
        self._offsets: Final = np.full(words, -1, dtype=np.int64)
        self._texts: Final = np.zeros(_SLOT_BYTES * _TEXTS, dtype=np.uint8)
        self._text_end = 0
        names = np.zeros((CORE_BYTES // 2, _NAME_BYTES), dtype=np.uint8)
        for word, name in self._names.items():
            names[word, : len(name) + 2] = [len(name) + 1, *f"{name}=".encode()]
        self._name_table: Final = names
        places = (int(one.ctypes.data) for one in (self._texts, names))
        self._table: Final = _Texts(int(self._offsets.ctypes.data), words, *places)
        self._lines: Final = np.zeros(_TEXT_BYTES, dtype=np.uint8)
        self._pending: Entries | None = None
        """The last entry, whose successor is not known yet."""
        self._log: Final = InstructionLog(machine.core, self._consume)
        self._is_closed = self._has_failed = False
        self._stop: Final = self._start()
        machine.program.changed.append(self._forget_texts)
        print(HEADER, file=stream, flush=True)
        self._binary: Final[BinaryIO | None] = getattr(stream, "buffer", None)
        """The binary stream that `stream` wraps: large texts are written faster without encoding."""

    def _start(self) -> Callable[[], None]:
        """Start to log. Return the function that ends it."""
        if self.machine.engine == "plain":
            self._log.start()
            return self._log.stop
        from emu.dspic30f.jit.counting import InstructionLogging
        from emu.dspic30f.jit.engine import JitEngine

        assert isinstance(self.machine.runner, JitEngine)
        return self.machine.runner.start_counting(InstructionLogging(self._log))

    def advance(self, until: int) -> Stop | None:
        """Run to cycle `until` as `Machine.advance` does, and write the lines of what was executed."""
        stop = self.machine.advance(until)
        self._log.flush()
        if self._pending is not None and not int(self._pending["pc"][0]) & BOUNDARY:
            self._consume(self._log.present())
            self._pending = None
        return stop

    def close(self) -> None:
        """Stop the trace and write the last lines. Further calls do nothing. Raises OSError."""
        if self._is_closed:
            return
        self._is_closed = True
        self.machine.program.changed.remove(self._forget_texts)
        self._stop()
        if self._pending is not None:
            self._consume(self._log.present())

    def _consume(self, entries: Entries) -> None:
        """Write the lines of all entries but the last one, which becomes pending."""
        if self._has_failed:
            return
        if self._pending is not None:
            entries = np.concatenate([self._pending, entries])
        at, count, used = 0, len(entries), ctypes.c_int64()
        lines = self._lines
        while True:
            at = self._write_lines(ctypes.addressof(self._table), int(entries.ctypes.data), at, count,
                                   int(lines.ctypes.data), len(lines), ctypes.addressof(used))  # fmt: skip
            self._write(lines[: used.value].data)
            if at + 1 >= count:
                break
            where = int(entries["pc"][at])
            if where & BOUNDARY:
                at = self._boundary(entries, at)
            elif where >> 1 >= len(self._offsets):
                self._write_line(entries[at], entries[at + 1], self._text(where))
                at += 1
            elif self._offsets[where >> 1] < 0:
                self._provide_text(where)
        self._pending = entries[at:].copy()

    def _write(self, text: bytes | memoryview) -> None:
        """Write ASCII text to the stream. After a failed write, for example on a full disk, nothing more is written."""
        try:
            if self._binary is not None:
                self._binary.write(text)
            else:
                self.stream.write(str(text, "utf-8"))
        except OSError:
            self._has_failed = True
            raise

    def _boundary(self, entries: Entries, at: int) -> int:
        """Write the line of the boundaries from index `at` on. Return the index of the entry after them.

        Boundaries that follow each other have one line. If the last entry is one, its work may not be complete.
        """
        end = at + 1
        while int(entries["pc"][end]) & BOUNDARY and end + 1 < len(entries):
            end += 1
        if int(entries["pc"][end]) & BOUNDARY:
            entries[end] = entries[at]
            return end
        one, other = entries[at], entries[end]
        pc, cycles = int(other["pc"]), int(other["cycle"]) - int(one["cycle"])
        if pc != int(one["pc"]) & BOUNDARY - 1:
            text = f"{'':8}  -- exception: {self.image.symbols.text(pc)}"
        else:
            text = f"{'':8}  -- nothing executed for {cycles:,} cycles"
        self._write_line(one, other, text)
        return end

    def _write_line(self, one: Any, other: Any, text: str) -> None:
        """Write the line of the entry `one`, which is followed by `other`."""
        changed = [
            f"{self._names[word]}={value:04X}"
            for word, (old, value) in enumerate(zip(one["core"].tolist(), other["core"].tolist(), strict=True))
            if value != old and word in self._names
        ]
        self._write(f"{int(one['cycle']):12} {text:54}  {' '.join(changed)}".rstrip().encode() + b"\n")

    def _text(self, pc: int) -> str:
        """Disassemble the instruction at `pc` from the machine's memory, which the firmware may have reprogrammed."""
        program = self.machine.program
        word = program.word(pc)
        item = instruction(self.image, pc, word, program.word(pc + 2))
        return f"{pc:#08x}  {item.text if item is not None else f'.pword {word:#08x}'}"

    def _provide_text(self, pc: int) -> None:
        """Store the text of the instruction at `pc` for trace_text.c."""
        text = b" " + self._text(pc).encode()[:_LONGEST_TEXT]
        if self._text_end == len(self._texts):
            self._forget_texts(0, 2 * len(self._offsets))
            self._text_end = 0
        slot = self._texts[self._text_end : self._text_end + _SLOT_BYTES]
        slot[:2] = divmod(len(text), 256)[::-1]
        slot[2:] = np.frombuffer(text.ljust(_SLOT_BYTES - 2), dtype=np.uint8)
        self._offsets[pc >> 1] = self._text_end
        self._text_end += _SLOT_BYTES

    def _forget_texts(self, start: int, end: int) -> None:
        """Discard the texts of instructions in [start, end), whose program words have changed."""
        self._offsets[max(start - 2, 0) >> 1 : end + 1 >> 1] = -1
