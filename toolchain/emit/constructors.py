"""Functions that run before main: calls in section .user_init (abi-elf.md §1.4, §3.1).

The attributes `constructor` and XC16's `user_init` select these functions. The start-up code calls the section if the
program has one; the linker appends a RETURN to it.
"""

from __future__ import annotations

from toolchain.abi.names import symbol
from toolchain.ir.model import ConstAgg, ConstInt, GlobalRef, Module, UnsupportedError


def emit_constructors(module: Module, large_code: bool) -> list[str]:
    """Lines of section .user_init: one call per function, in order of priority, then of the source."""
    if _rows(module, "llvm.global_dtors"):
        raise UnsupportedError("destructor functions: no code runs after main", "attribute destructor")
    rows = sorted(_rows(module, "llvm.global_ctors"), key=lambda row: row[0])
    if not rows:
        return []
    op = "call" if large_code else "rcall"
    return ["\t.section .user_init,code", *(f"\t{op} {symbol(module, name)}" for _, name in rows)]


def _rows(module: Module, table: str) -> list[tuple[int, str]]:
    """(priority, function) rows of a table such as llvm.global_ctors."""
    var = module.globals.get(table)
    if var is None or not isinstance(var.init, ConstAgg):
        return []
    out = []
    for row in var.init.elems:
        if isinstance(row, ConstAgg) and isinstance(row.elems[0], ConstInt) and isinstance(row.elems[1], GlobalRef):
            out.append((row.elems[0].value, row.elems[1].name))
    return out
