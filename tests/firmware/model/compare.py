"""Runs programs on the POSIX port and on the model, compares their records and shrinks a program that differs."""

from __future__ import annotations

import os
import struct
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path
from random import Random
from typing import Any

from tests.firmware.model.executor import Executor
from tests.firmware.model.generator import Generator, shared_families
from tests.firmware.model.program import RECORD, SCRIPTS, Code, Operation, Program, Record, Script, record_text
from tests.firmware.model.state import Sizes

HERE = Path(__file__).parent
LATER_ISR = SCRIPTS - 1
MOST_BOUNDARIES = 60
"""Maximum number of boundaries between two records that are tried as the place of an interrupt."""
CONTEXT = 6
"""Records shown before the first difference."""


def build(out: Path, *words: str) -> Path:
    """Build the interpreter for the POSIX port and return it. `words`: further arguments of make."""
    command = ["make", "-s", "-C", str(HERE), f"OUT={out}", *words]
    environment = {**os.environ, "MAKEFLAGS": ""}
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)
    if done.returncode:
        raise RuntimeError(done.stdout + done.stderr)
    return out / "interpreter"


@dataclass(frozen=True)
class Difference:
    """The records of kernel and model from shortly before the first that differs."""

    status: int
    kernel: list[Record]
    model: list[Record]

    def __str__(self) -> str:
        lines = [f"the kernel's process ended with wait status {self.status:#x}"] if self.status else []
        for number, (seen, wanted) in enumerate(zip_longest(self.kernel, self.model)):
            if seen != wanted:
                for record in self.model[max(number - CONTEXT, 0) : number]:
                    lines.append(f"        {record_text(record)}")
                lines.append(f"kernel: {record_text(seen) if seen else '(no record)'}")
                lines.append(f"model:  {record_text(wanted) if wanted else '(no record)'}")
                break
        return "\n".join(lines)


def executions(
    program: Program, sizes: Sizes, base: int, seen: list[Record]
) -> Iterator[tuple[Executor, list[Record]]]:
    """Yield the model's executions that may explain the records `seen`, each with its records.

    They differ in the boundary at which the interrupt within a call occurs. The records tell between which two of them
    it occurred; each boundary of the model there is tried. base: heap bytes in use when the program starts.
    """
    came = next(((n, record[8]) for n, record in enumerate(seen) if record[0] == LATER_ISR), (-1, 0))
    for boundary in range(MOST_BOUNDARIES):
        executor = Executor(program, sizes, (*came, boundary))
        yield executor, executor.run(base)
        if not executor.later_came:
            break


class Kernels:
    """The interpreter on the POSIX port."""

    def __init__(self, program: Path) -> None:
        self.program = program
        self.run_all([])
        ((_, records),) = self.run_all([Program()])
        self.base = RECORD.unpack_from(records)[7]
        """Heap bytes taken by Sys_Init_Kernel."""

    def run_all(self, programs: list[Program]) -> list[tuple[int, bytes]]:
        """Run programs and return the status and the records of each."""
        encoded = [program.encoded() for program in programs]
        data = b"".join(struct.pack("<H", len(one)) + one for one in encoded)
        answer = subprocess.run([self.program], input=data, capture_output=True, check=True).stdout
        (count,) = struct.unpack_from("<H", answer)
        self.sizes = Sizes(*struct.unpack_from(f"<{count}H", answer, 2))
        at = 2 + 2 * count
        results = []
        for _ in programs:
            status, records = struct.unpack_from("<HH", answer, at)
            end = at + 4 + records * RECORD.size
            results.append((status, answer[at + 4 : end]))
            at = end
        return results

    def difference(self, program: Program, status: int, records: bytes) -> Difference | None:
        """Return how the kernel's records of a program differ from the model's."""
        seen = list(RECORD.iter_unpack(records))
        wanted: list[Record] = []
        for _, wanted in executions(program, self.sizes, self.base, seen):
            if status == 0 and wanted == seen:
                return None
        return Difference(status, seen, wanted)

    def check(self, programs: list[Program]) -> Iterator[Difference | None]:
        """Run programs on both and yield the difference of each, or None."""
        for program, (status, records) in zip(programs, self.run_all(programs), strict=True):
            yield self.difference(program, status, records)

    def differs(self, program: Program) -> bool:
        return any(self.check([program]))

    def shrunk(self, program: Program) -> Program:
        """Return a smaller program whose records still differ; no operation can be removed or simplified further."""
        again = True
        while again:
            again = False
            for smaller in _smaller(program):
                if self.differs(smaller):
                    program, again = smaller, True
                    break
        return program


def _replaced(program: Program, number: int, operations: list[Operation], answer: int) -> Program:
    scripts = list(program.scripts)
    scripts[number] = Script(operations, answer)
    return Program(scripts)


def _smaller(program: Program) -> Iterator[Program]:
    """Yield programs with fewer operations, then those with smaller operands."""
    for number, script in enumerate(program.scripts):
        length = len(script.operations)
        size = length
        while size:
            for at in range(0, length, size):
                kept = script.operations[:at] + script.operations[at + size :]
                if any(code == Code.START_KERNEL for code, *_ in script.operations[at : at + size]):
                    continue
                yield _replaced(program, number, kept, script.answer)
            size //= 2
    for number, script in enumerate(program.scripts):
        if script.answer != 1:
            yield _replaced(program, number, script.operations, 1)
        for at, operation in enumerate(script.operations):
            for operand in (1, 2, 3):
                for value in {0, operation[operand] // 2, operation[operand] - 1}:
                    if 0 <= value < operation[operand]:
                        plainer: Any = (*operation[:operand], value, *operation[operand + 1 :])
                        operations = [*script.operations[:at], plainer, *script.operations[at + 1 :]]
                        yield _replaced(program, number, operations, script.answer)


def random_programs(seed: int, count: int, remote: bool = False) -> list[Program]:
    """Return `count` programs that depend on the seed only. remote: they share events (make REMOTE=1)."""
    random = Random(seed)
    return [Generator(random, shared_families(random) if remote else None).program() for _ in range(count)]
