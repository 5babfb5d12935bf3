"""`used` and `retain`: definitions that --gc-sections keeps without a reference.

In GCC, `used` keeps a definition in the object and `retain` keeps it in the image; XC16's `keep` does both. In this
compiler, each of the three attributes keeps the definition in the object and in the image.
"""

from __future__ import annotations

from toolchain.ir.model import ConstAgg, GlobalRef, Module, Value

KEEP = ",keep"
"""The assembler's section attribute (abi-elf.md §4.3)."""
TABLES = ("llvm.used", "llvm.compiler.used")


def retained_names(module: Module) -> frozenset[str]:
    """Names of functions and variables with these attributes, and of the targets of aliases with them."""
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
