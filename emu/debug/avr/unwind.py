"""Call stacks of an AVR by the call frame information of avr-gcc (.debug_frame).

The canonical frame address (CFA) is the address of the return address's low byte; the caller's stack pointer equals it.
Code without frame information (assembly, libgcc) is not described: there, as the innermost frame, the stack is searched
for the first word that follows a call instruction. A number that looks like a return address can be mistaken for one.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Any, Final

from emu.avr.isa.codec import decode
from emu.debug.unwind import RawFrame
from emu.image.lines import dwarf_of

REGISTERS: Final = 33
"""R0 to R31 and the stack pointer, by DWARF number."""
STACK_POINTER: Final = 32
MAX_FRAMES: Final = 64
SEARCHED: Final = 64
"""Bytes of the stack in which a return address is searched."""
SREG: Final = 0x3F
"""I/O address of the flags."""
CALLS: Final = ("call", "rcall", "icall")
CALLEE_SAVED: Final = frozenset((*range(2, 18), 28, 29, STACK_POINTER))
"""Registers that a function of avr-gcc preserves: R2 to R17, Y."""

Registers = tuple[int | None, ...]


def pair(register: Callable[[int], int | None], number: int) -> int | None:
    """Return the address in the stack pointer or in a register pair, whose lower one is `number`; None if unknown."""
    if number == STACK_POINTER:
        return register(number)
    low, high = register(number), register(number + 1)
    return None if low is None or high is None else high << 8 | low


class AvrUnwinder:
    """Call stack unwinder of one program.

    `word(pc)` returns a program word, `memory(address)` a byte of data memory, None outside. `handlers` are the entries
    of interrupt handlers.
    """

    def __init__(
        self,
        sections: Mapping[str, bytes],
        word: Callable[[int], int],
        memory: Callable[[int], int | None],
        is_code: Callable[[int], bool],
        handlers: frozenset[int],
    ) -> None:
        self._word: Final = word
        self._memory: Final = memory
        self._is_code: Final = is_code
        self._handlers: Final = handlers
        self._entries: Final = _frame_entries(sections)
        self._starts: Final = [start for start, _, _ in self._entries]

    def frames(self, pc: int, registers: Registers, function_start: Callable[[int], int | None]) -> list[RawFrame]:
        """Return the frames, innermost first, for a PC and register values."""
        frames: list[RawFrame] = []
        is_exact = True
        while len(frames) < MAX_FRAMES:
            start = function_start(pc if is_exact else pc - 2)
            is_handler = start in self._handlers
            solved = self._epilogue(pc, registers) if is_exact else None
            solved = solved or self._caller(pc if is_exact else pc - 1, registers)
            if solved is None and not frames:
                solved = self._searched(registers)
            if solved is None:
                frames.append(RawFrame(pc, registers, None, start, is_handler))
                break
            cfa, after = solved
            frames.append(RawFrame(pc, registers, cfa, start, is_handler))
            high, low = self._memory(cfa - 1), self._memory(cfa)
            if high is None or low is None:
                break
            pc = 2 * (high << 8 | low)
            plausible = self._is_code(pc) if is_handler else self._follows_call(pc)
            if not plausible:
                break
            known = [value if is_handler or n in CALLEE_SAVED else None for n, value in enumerate(after)]
            registers, is_exact = tuple(known), is_handler
        return frames

    def _caller(self, pc: int, registers: Registers) -> tuple[int, list[int | None]] | None:
        """Return the CFA of the frame at `pc` and the registers of its caller; None without frame information."""
        index = bisect_right(self._starts, pc) - 1
        if index < 0 or pc >= self._entries[index][1]:
            return None
        row: Mapping[Any, Any] | None = None
        for one in self._entries[index][2]:
            if one["pc"] <= pc:
                row = one
        if row is None or row["cfa"].reg is None:
            return None
        base = pair(lambda number: registers[number] if number < REGISTERS else None, row["cfa"].reg)
        if base is None:
            return None
        cfa = base + row["cfa"].offset
        after = list(registers)
        for number, rule in row.items():
            if isinstance(number, int) and number < STACK_POINTER and rule.type == "OFFSET":
                after[number] = self._memory(cfa + rule.arg)
        after[STACK_POINTER] = cfa
        return cfa, after

    def _epilogue(self, pc: int, registers: Registers) -> tuple[int, list[int | None]] | None:
        """As `_caller`, where only POPs and writes of SREG lead to a RET: avr-gcc does not describe epilogues."""
        top, after = registers[STACK_POINTER], list(registers)
        while top is not None and self._is_code(pc):
            insn = decode(self._word(pc))
            match insn.row.mnemonic if insn is not None else "":
                case "pop" if insn is not None:
                    top += 1
                    after[insn.operands["d"]] = self._memory(top)
                case "out" if insn is not None and insn.operands["A"] == SREG:
                    pass
                case "ret" | "reti":
                    after[STACK_POINTER] = top + 2
                    return top + 2, after
                case _:
                    return None
            pc += 2
        return None

    def _searched(self, registers: Registers) -> tuple[int, list[int | None]] | None:
        """Return the address after the first word of the stack that looks like a return address, and no registers."""
        top = registers[STACK_POINTER]
        for cfa in range(top + 2, top + SEARCHED) if top is not None else ():
            high, low = self._memory(cfa - 1), self._memory(cfa)
            if high is not None and low is not None and self._follows_call(2 * (high << 8 | low)):
                return cfa, [*[None] * STACK_POINTER, cfa]
        return None

    def _follows_call(self, pc: int) -> bool:
        """Whether `pc` is the address after a call instruction."""
        for words in (2, 1):
            at = pc - 2 * words
            insn = decode(self._word(at), self._word(at + 2)) if at >= 0 and self._is_code(at) else None
            if insn is not None and insn.row.words == words and insn.row.mnemonic in CALLS:
                return True
        return False


def _frame_entries(sections: Mapping[str, bytes]) -> list[tuple[int, int, list[Mapping[Any, Any]]]]:
    """Return start, end and rows of each function with frame information, by address."""
    found: list[tuple[int, int, list[Mapping[Any, Any]]]] = []
    if not sections.get(".debug_frame"):
        return found
    with suppress(Exception):  # pyelftools raises many unrelated exceptions for damaged input
        dwarf = dwarf_of(sections)
        entries: list[Any] = dwarf.CFI_entries() if dwarf.has_CFI() else []
        for entry in entries:
            with suppress(Exception):
                start = entry.header["initial_location"]
                found.append((start, start + entry.header["address_range"], entry.get_decoded().table))
    return sorted(found, key=lambda one: one[:2])
