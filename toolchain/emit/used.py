"""`used` and `retain`: definitions that --gc-sections keeps although nothing refers to them.

GCC's `used` keeps them in the object and `retain` in the image; XC16 has one word for both, `keep`. Here either keeps
both, because nobody marks a function for an object's sake.
"""

from __future__ import annotations

from toolchain.ir.model import ConstAgg, GlobalRef, Module, Value

KEEP = ",keep"
"""The assembler's section attribute (abi-elf.md §4.3)."""
TABLES = ("llvm.used", "llvm.compiler.used")


def kept(module: Module) -> frozenset[str]:
    """Names of the functions and variables so marked; of an alias, those it stands for."""
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
