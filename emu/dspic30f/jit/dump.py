"""What native code was made of a stretch of program, for whoever debugs the engine.

Enters: an engine that has run, and which addresses are meant. Leaves: text, for every set of processor modes in which
one of them was reached: the LLVM IR with the instruction of each part in front of it, then the host's assembly, whose
blocks are named by program addresses (`b434`) as in the IR.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import asdict
from typing import Protocol

from emu.dspic30f.isa.row import Insn
from emu.dspic30f.jit.engine import BLOCK_LEVEL, Code, JitEngine
from emu.dspic30f.jit.translate.function import Translator
from emu.dspic30f.jit.translate.region import Region, Step
from emu.dspic30f.jit.translate.values import Number
from emu.dspic30f.jit.worker import Backend


class Naming(Protocol):
    """Text of a decoded instruction."""

    def __call__(self, pc: int, insn: Insn) -> str: ...


class _Annotated(Translator):
    """Writes the guest's instruction in front of what it becomes."""

    naming: Naming

    def _instruction(self, step: Step, written: Number) -> tuple[bool, Number]:
        self.e.line(f"; {step.pc:06x}  {self.naming(step.pc, step.insn)}")
        return super()._instruction(step, written)


def dump(engine: JitEngine, is_meant: Callable[[int], bool], naming: Naming) -> Iterator[str]:
    """The stretches with an instruction at an address that is meant, a text each; none if none was translated."""
    backend = Backend()
    for code in engine.translated():
        for region in code.regions.values():
            if any(map(is_meant, region.steps)):
                yield _stretch(backend, code, region, naming)


def _stretch(backend: Backend, code: Code, region: Region, naming: Naming) -> str:
    translator = _Annotated(region, code.around, code.context, exact=False)
    translator.naming = naming
    text = translator.text()
    modes = ", ".join(f"{name}={value}" for name, value in asdict(code.context).items() if value)
    loop = f", DO loop {code.around.do_start:06x}..{code.around.do_end:06x}" if code.around.do_end >= 0 else ""
    head = f"; region {region.start:06x}, {len(region.steps)} instructions, modes {modes or 'as after reset'}{loop}"
    return f"{head}\n{text}\n; host code\n{backend.assembly(text, BLOCK_LEVEL)}"
