"""Dump of native code for debugging the translator: LLVM IR with guest instructions, and host assembly.

Input: an engine that has run, and program addresses. Output: one text for each set of processor modes in which
an address was reached. In the IR and the assembly, blocks are named by program addresses (`b434`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import asdict
from typing import Protocol

from emu.dspic30f.isa.row import Insn
from emu.dspic30f.jit.code_table import CodeTable
from emu.dspic30f.jit.engine import BLOCK_LEVEL, JitEngine
from emu.dspic30f.jit.ir.values import Number
from emu.dspic30f.jit.translate.function import Translator
from emu.dspic30f.jit.translate.region import Region, Step
from emu.dspic30f.jit.worker import Backend


class Disassembler(Protocol):
    """Function that returns the text of a decoded instruction."""

    def __call__(self, pc: int, insn: Insn) -> str: ...


class _AnnotatingTranslator(Translator):
    """Translator that writes each guest instruction as a comment before its IR."""

    disassemble: Disassembler

    def _instruction(self, step: Step, written: Number) -> tuple[bool, Number]:
        self.e.line(f"; {step.pc:06x}  {self.disassemble(step.pc, step.insn)}")
        return super()._instruction(step, written)


def dump(engine: JitEngine, is_meant: Callable[[int], bool], disassemble: Disassembler) -> Iterator[str]:
    """Yield the text of each region that contains an instruction for whose address `is_meant` returns true."""
    backend = Backend()
    for code in engine.translated():
        for region in code.regions.values():
            if any(map(is_meant, region.steps)):
                yield _region_text(backend, code, region, disassemble)


def _region_text(backend: Backend, code: CodeTable, region: Region, disassemble: Disassembler) -> str:
    translator = _AnnotatingTranslator(region, code.layout, code.context, exact=False)
    translator.disassemble = disassemble
    text = translator.text()
    modes = ", ".join(f"{name}={value}" for name, value in asdict(code.context).items() if value)
    loop = f", DO loop {code.layout.do_start:06x}..{code.layout.do_end:06x}" if code.layout.do_end >= 0 else ""
    head = f"; region {region.start:06x}, {len(region.steps)} instructions, modes {modes or 'as after reset'}{loop}"
    return f"{head}\n{text}\n; host code\n{backend.assembly(text, BLOCK_LEVEL)}"
