"""`used` and `retain`: definitions that --gc-sections keeps without a reference.

In GCC, `used` keeps a definition in the object and `retain` keeps it in the image; XC16's `keep` does both. Here every
one of them does both.
"""

from __future__ import annotations

from toolchain.ir.model import ConstAgg, GlobalRef, Module, Value

KEEP = ",keep"
"""The assembler's section attribute (abi-elf.md §4.3)."""
TABLES = ("llvm.used", "llvm.compiler.used")


def retained_names(module: Module) -> frozenset[str]:
    """Names of the functions and variables with these attributes, and of the targets of such aliases."""
    work: list[Value] = []
    for table in TABLES:
        var = module.globals.get(table)
        if var is not None and isinstance(var.init, ConstAgg):
            work += var.init.elems
    names: set[str] = set()
    while work:
        item = work.pop()
        if isinstance(item, GlobalRef) and item.name not in names:
            names.add(item.name)
            work += [module.aliases[item.name]] if item.name in module.aliases else []
    return frozenset(names)
