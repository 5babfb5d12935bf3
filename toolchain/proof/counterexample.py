"""Counterexamples: an input for which code and IR differ, and an image that starts with it.

In: a model of the solver.  Out: registers and RAM bytes at the function's first instruction, and an ELF file for the
emulator and its debugger.  The program in the file sets them, calls the function and stops at `__returned`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import z3

from toolchain.abi.target import RAM_END, RETURN_ADDRESS_BYTES, SFR_END, SP
from toolchain.proof.memory import STACK
from toolchain.proof.problem import ENTRY, PAGE, CompiledFile


@dataclass(frozen=True)
class Counterexample:
    """Input of a function: registers by number, and the RAM bytes that the difference may depend on, by address."""

    function: str
    registers: Mapping[int, int]
    memory: Mapping[int, int]

    @property
    def text(self) -> str:
        """Return the input as text: W0 = 0x0003, [0x0850] = 0x07."""
        words = [f"W{n} = {value:#06x}" for n, value in self.registers.items()]
        return ", ".join([*words, *(f"[{at:#06x}] = {byte:#04x}" for at, byte in self.memory.items())])


def counterexample_of(model: z3.ModelRef, function: str, registers: list[Any], array: Any) -> Counterexample:
    """Return the function's inputs in a model; inputs that the model does not determine are omitted."""
    named = {str(d): d for d in model.decls()}
    values = {n: int(model.eval(r).as_long()) for n, r in enumerate(registers) if str(r) in named}
    memory: dict[int, int] = {}
    if str(array) in named:
        for at in range(SFR_END, RAM_END):
            memory[at] = int(model.eval(z3.Select(array, z3.BitVecVal(at, 16)), model_completion=True).as_long())
        usual = max(set(memory.values()), key=list(memory.values()).count)  # default of the solver's array
        memory = {at: byte for at, byte in memory.items() if byte != usual}
    for name, declared in named.items():
        if name.startswith("stack."):
            memory[int(name.removeprefix("stack."), 16)] = int(model[declared].as_long())
    return Counterexample(function, values, memory)


def image(compiled: CompiledFile, counterexample: Counterexample) -> bytes:
    """Return an ELF image of the file with start-up code for an input; raises ToolError."""
    return compiled.image_with_start(start_text(counterexample))


def start_text(counterexample: Counterexample) -> str:
    """Return assembly start-up code that sets the input and calls the function."""
    lines = [f"\t.global {ENTRY},__returned", "\t.section .text.__start,code", f"{ENTRY}:"]
    lines += [
        f"\tmov #{RAM_END - 0x10},w0",
        "\tmov w0,SPLIM",
        f"\tmov #{PAGE},w0",
        "\tmov w0,PSVPAG",
        "\tbset CORCON,#2",
    ]
    for at, byte in counterexample.memory.items():
        if not STACK - RETURN_ADDRESS_BYTES <= at < STACK:
            lines += [f"\tmov #{at},w1", f"\tmov #{byte},w0", "\tmov.b w0,[w1]"]
    lines.append(f"\tmov #{STACK - RETURN_ADDRESS_BYTES},w{SP}")
    lines += [f"\tmov #{counterexample.registers.get(n, 0)},w{n}" for n in range(SP)]
    lines += [f"\tcall {counterexample.function}", "__returned:", "\tbra __returned"]
    return "\n".join(lines) + "\n"
