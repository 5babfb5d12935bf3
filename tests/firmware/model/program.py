"""Programs of kernel calls: scripts of operations, their encoding for the interpreter, and their text."""

from __future__ import annotations

import re
import struct
from dataclasses import dataclass, field
from enum import IntEnum
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent


def _numbers(name: str) -> dict[str, int]:
    return {key: int(value) for key, value in re.findall(r"(MOST_\w+) = (\d+)", (HERE / name).read_text())}


def _codes() -> Any:
    names = re.findall(r"\bX\((\w+)\)", (HERE / "operations.h").read_text().partition("X) ")[2])
    return IntEnum("Code", names, start=0)


Code = _codes()
"""Operations, in the order of operations.h."""
LIMITS = _numbers("interpreter.h")
ENTRY, END = 0xFF, 0xFE

Operation = tuple[int, int, int, int]
"""Code and operands a, b and c (operations.h)."""


class Kind(IntEnum):
    """What runs a script."""

    MAIN, THREAD, HANDLER, CONDITION, CLEANUP, ISR, FINAL = range(7)


FIRST = {Kind.MAIN: 0, Kind.THREAD: 1, Kind.HANDLER: 5, Kind.CONDITION: 9, Kind.CLEANUP: 12, Kind.ISR: 15}
COUNT = {Kind.MAIN: 1, Kind.THREAD: 4, Kind.HANDLER: 4, Kind.CONDITION: 3, Kind.CLEANUP: 3, Kind.ISR: 3}
SCRIPTS = 18
KIND_OF = [kind for kind, first in FIRST.items() for _ in range(COUNT[kind])]


@dataclass
class Script:
    operations: list[Operation] = field(default_factory=list)
    answer: int = 1
    """What a handler or condition returns; 2: whether the data's value is odd."""


@dataclass
class Program:
    scripts: list[Script] = field(default_factory=lambda: [Script() for _ in range(SCRIPTS)])

    def encoded(self) -> bytes:
        """Return the bytes that the interpreter reads: for each script its length, answer and operations."""
        out = bytearray()
        for script in self.scripts:
            out += bytes((len(script.operations), script.answer))
            for operation in script.operations:
                out += bytes(operation)
        return bytes(out)

    @staticmethod
    def parse(text: str) -> Program:
        """Return the program that `text` describes."""
        program = Program()
        for line in text.strip().splitlines():
            head, _, calls = line.strip().partition(":")
            name, _, answer = head.partition(" -> ")
            kind, number = name.split()
            script = program.scripts[FIRST[Kind[kind.upper()]] + int(number)]
            script.answer = int(answer or 1)
            for call, operands in re.findall(r"(\w+)\(([^)]*)\)", calls):
                a, b, c = (int(operand) for operand in operands.split(","))
                script.operations.append((Code[call], a, b, c))
        return program

    def __len__(self) -> int:
        return sum(len(script.operations) for script in self.scripts)

    def __str__(self) -> str:
        lines = []
        for number, script in enumerate(self.scripts):
            if script.operations or script.answer != 1:
                calls = [f"{Code(c).name}({a}, {b}, {d})" for c, a, b, d in script.operations]
                answer = f" -> {script.answer}" if script.answer != 1 else ""
                lines.append(f"{script_name(number)}{answer}: {'; '.join(calls)}")
        return "\n".join(lines)


def named_texts(file: str) -> dict[str, str]:
    """Return the texts of the programs in a file of this folder, by their names."""
    parts = (HERE / file).read_text().split("# ")[1:]
    return {name.strip(): text for name, _, text in (part.partition("\n") for part in parts)}


def script_name(number: int) -> str:
    """Return a script's kind and number, such as "thread 2"."""
    kind = KIND_OF[number]
    return f"{kind.name.lower()} {number - FIRST[kind]}"


RECORD = struct.Struct("<BBBBHHHHHH")
Record = tuple[int, ...]
"""Script, kind, index, code, PID, result, last error, heap bytes, time, second result."""


def record_text(record: Record) -> str:
    """Return a record as one line."""
    script, kind, index, code, pid, result, error, heap, time, extra = record
    if kind == Kind.FINAL:
        where = f"final state {code}"
    else:
        what = {ENTRY: "begins", END: "ends"}.get(code) or f"{index} {Code(code).name}"
        where = f"{script_name(script)}: {what}"
    return f"{where:36} pid {pid} result {result:#x} {extra:#x} error {error} heap {heap} time {time}"
