"""Functions that run before main: `constructor` and XC16's `user_init` are calls in .user_init (abi-elf.md §1.4, §3.1).

The start-up code calls that section when the program has one; the linker ends it with RETURN.
"""

from __future__ import annotations

from toolchain.abi.names import symbol
from toolchain.ir.model import ConstAgg, ConstInt, GlobalRef, Module, UnsupportedError


def emit_constructors(module: Module, large_code: bool) -> list[str]:
    """Lines of one call each, in order of priority, equal ones in order of the source."""
    if _rows(module, "llvm.global_dtors"):
        raise UnsupportedError("destructor functions: nothing runs after main", "attribute destructor")
    rows = sorted(_rows(module, "llvm.global_ctors"), key=lambda row: row[0])
    if not rows:
        return []
    op = "call" if large_code else "rcall"
    return ["\t.section .user_init,code", *(f"\t{op} {symbol(module, name)}" for _, name in rows)]


def _rows(module: Module, table: str) -> list[tuple[int, str]]:
    """(priority, function) of one of LLVM's tables."""
    var = module.globals.get(table)
    if var is None or not isinstance(var.init, ConstAgg):
        return []
    out = []
    for row in var.init.elems:
        if isinstance(row, ConstAgg) and isinstance(row.elems[0], ConstInt) and isinstance(row.elems[1], GlobalRef):
            out.append((row.elems[0].value, row.elems[1].name))
    return out
