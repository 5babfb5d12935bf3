"""Assembler names of C objects (abi-elf.md §2.6)."""

from __future__ import annotations

from toolchain.ir.model import Module


def symbol(module: Module, name: str) -> str:
    """Assembler name of a global: _x for x, the name itself for asm("..."), a local label for private globals."""
    if name.startswith("\x01"):
        return name[1:]
    var = module.globals.get(name)
    if var is not None and var.linkage == "private":
        return f".L{name}"
    return f"_{name}"


def block_label(function: str, block: str) -> str:
    """Assembler label of a basic block whose address is taken."""
    return f".LA.{function}.{block}"
