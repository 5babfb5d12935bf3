"""Whole-program optimisation: merge LLVM modules, and make symbols internal that no other object references.

Input: IR (text or bitcode) of every C file, and the assembler names that objects use. Output: one module. Modules are
passed as text, because clang would assemble file-scope asm as MSP430 code when it writes bitcode.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path

import llvmlite.binding as llvm

from toolchain.abi.isr_names import VECTOR_FUNCTIONS
from toolchain.errors import ToolError

VISIBLE_LINKAGES = {llvm.Linkage.external, llvm.Linkage.weak_any, llvm.Linkage.weak_odr, llvm.Linkage.linkonce_any,
                    llvm.Linkage.linkonce_odr, llvm.Linkage.common}  # fmt: skip
BITCODE_MAGIC = b"BC\xc0\xde"
DECLARED = re.compile(r"^declare [^@\n]*@([\w$.]+)\(", re.MULTILINE)
ATTRIBUTES = re.compile(rb"^attributes #\d+ = \{", re.MULTILINE)
INLINE_ASSEMBLY = re.compile(r" asm (.*)")
PREPROLOGUE = re.compile(r'c"preprologue:(.*)')
SAVED_NAMES = re.compile(r'c"save:(.*)')
OCTET = re.compile(r"\\[0-9A-Fa-f]{2}")
USED_TABLES = ("llvm.used", "llvm.compiler.used")
GLOBAL_NAME = re.compile(r"ptr @([\w$.]+)")
C_NAME = re.compile(r"\b([A-Za-z_]\w*)")
ASSEMBLER_NAME = re.compile(r"\b_([A-Za-z_]\w*)")


def read_module(source: Path, content: bytes) -> llvm.ModuleRef:
    """Parse IR text or bitcode. Raises ToolError naming `source`."""
    try:
        if is_bitcode(content):
            return llvm.parse_bitcode(content)
        return llvm.parse_assembly(content.decode(errors="replace"))
    except RuntimeError as error:
        raise ToolError(f"{source}: not readable as LLVM IR: {str(error).strip()}") from error


def is_bitcode(content: bytes) -> bool:
    """Whether content is LLVM bitcode, which `-flto -c` writes."""
    return content.startswith(BITCODE_MAGIC)


def functions_declared(text: str) -> set[str]:
    """Functions that a module declares without defining them, except LLVM intrinsics."""
    return {name for name in DECLARED.findall(text) if not name.startswith("llvm.")}


def without_builtins(ir: bytes, names: Iterable[str]) -> bytes:
    """IR text in which the middle end must not introduce calls of the library functions `names`."""
    if is_bitcode(ir):
        ir = str(llvm.parse_bitcode(ir)).encode()
    words = " ".join(f'"no-builtin-{name}"' for name in sorted(names)).encode()
    return ATTRIBUTES.sub(rb"\g<0> " + words, ir)


def merge(modules: list[tuple[Path, llvm.ModuleRef]]) -> llvm.ModuleRef:
    """Link the modules into the first one. Raises ToolError that lists every symbol defined more than once."""
    duplicates = _duplicate_definitions(modules)
    if duplicates:
        raise ToolError.of(duplicates)
    merged = modules[0][1]
    for source, module in modules[1:]:
        try:
            merged.link_in(module)
        except RuntimeError as error:
            raise ToolError(f"{source}: {str(error).strip()}") from error
    return merged


def names_used(objects: Iterable[tuple[str, bytes]]) -> set[str]:
    """Global names that objects, given as (name, content), reference or define.

    Definitions are included, so that the linker can report a symbol defined by an object and a C file.
    """
    from toolchain.elf.model import Bind
    from toolchain.elf.read import is_object, read_object

    names: set[str] = set()
    for name, content in objects:
        if is_object(content):
            names.update(s.name for s in read_object(content, name).symbols if s.bind is not Bind.LOCAL)
    return names


def names_in_inline_assembly(text: str) -> set[str]:
    """C names that occur as `_name` in inline assembly and `preprologue` annotations, or in `save` annotations."""
    names: set[str] = set()
    for pattern, name in ((INLINE_ASSEMBLY, ASSEMBLER_NAME), (PREPROLOGUE, ASSEMBLER_NAME), (SAVED_NAMES, C_NAME)):
        for line in pattern.findall(text):
            names.update(name.findall(OCTET.sub(" ", line)))
    return names


def internalise(module: llvm.ModuleRef, assembler_names: Iterable[str]) -> None:
    """Make every definition internal except `main`, interrupt handlers, `used` definitions and the given names.

    `assembler_names` have the leading underscore of C names (abi-elf.md §2.6). They include the names that the run-time
    library defines, because generated code may call its functions without a call in the IR.
    """
    keep = {name[1:] for name in assembler_names if name.startswith("_")} | {"main"}
    keep |= names_in_inline_assembly(str(module))
    keep |= {name for v in module.global_variables if v.name in USED_TABLES for name in GLOBAL_NAME.findall(str(v))}
    for value in [*module.functions, *module.global_variables]:
        if value.is_declaration or value.linkage not in VISIBLE_LINKAGES:
            continue
        name = value.name
        if name in keep or name.startswith("llvm.") or name in VECTOR_FUNCTIONS:
            continue
        value.linkage = llvm.Linkage.internal


def _duplicate_definitions(modules: list[tuple[Path, llvm.ModuleRef]]) -> list[str]:
    """One message per strong symbol that several modules define, with their files."""
    owners: dict[str, list[Path]] = {}
    for source, module in modules:
        for value in [*module.functions, *module.global_variables]:
            if not value.is_declaration and value.linkage is llvm.Linkage.external:
                owners.setdefault(value.name, []).append(source)
    return [
        f"error: duplicate symbol '{name}': defined in {', '.join(map(str, files))}"
        for name, files in owners.items()
        if len(files) > 1
    ]
