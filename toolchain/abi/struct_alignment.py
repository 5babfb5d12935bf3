"""Structs and unions of 2, 4 or 8 bytes that are passed in any free registers, unaligned (abi-elf.md §2.2 rule 3).

A record with an array, struct or union of 3, 5, 6 or 7 bytes at any depth is passed like one of odd size. IR types do
not show whether a record has such a member: in IR a union has one member, and bit-fields are arrays. The record
layouts that clang prints with `-fdump-record-layouts` show it. `mark` adds an attribute to `byval` parameters of such
records.
Limitation: an array with elements of a typedef'd array type is treated as an array of scalars.
"""

from __future__ import annotations

import re

from toolchain.ir.lex import UNALIGNED_RUN

LAYOUT_FLAGS = ["-Xclang", "-fdump-record-layouts"]
ODD_SIZES = {3, 5, 6, 7}

SIZE = re.compile(r"\[sizeof=(\d+),")
HEAD = re.compile(r"^\s*0 \| (.+)$", re.MULTILINE)
RECORD = re.compile(r"^Record: \w+ \S+ (?:prev \S+ )?<([^,>]+)")
FIELD = re.compile(r"^[|`]-FieldDecl .*?'([^']*)'(?::'([^']*)')?[^']*$", re.MULTILINE)
LLVM_TYPE = re.compile(r"LLVMType:%(\S+) = type")
TAGGED = re.compile(r"\b(?:struct|union) (\w+) definition$", re.MULTILINE)
POSITION = re.compile(r"\((?:unnamed|anonymous)[^)]* at ([^)]*)\)")
ARRAY = re.compile(r"^(.*[^)*])((?:\[\d+\])+)$")
BYVAL = re.compile(rb"byval\(%([\w.$-]+)\)")


def mark(ir: bytes, dump: str) -> bytes:
    """IR text with UNALIGNED_RUN after each `byval` of a record with odd-sized member; `dump`: record layouts."""
    loose = unaligned_types(dump) if b"byval(" in ir else set()
    return BYVAL.sub(lambda m: m[0] + b" " + UNALIGNED_RUN.encode() if m[1].decode() in loose else m[0], ir)


def unaligned_types(dump: str) -> set[str]:
    """Names of LLVM types, such as `struct.s`, whose records contain an odd-sized aggregate."""
    sizes: dict[str, int] = {}
    fields: dict[str, list[str]] = {}
    names: dict[str, str] = {}
    for part in dump.split("*** Dumping ")[1:]:
        if part.startswith("AST"):
            head, size = HEAD.search(part), SIZE.search(part)
            if head is not None and size is not None:
                sizes[_key(head[1])] = int(size[1])
            continue
        llvm = LLVM_TYPE.search(part)
        where = RECORD.search(part[part.index("\n") + 1 :])
        if llvm is None or where is None:
            continue
        tag = TAGGED.search(part.split("\n")[1])
        types = [found[1] or found[0] for found in FIELD.findall(part)]
        for key in {tag[1] if tag is not None else llvm[1].partition(".")[2], where[1]}:
            fields[key] = types
            names[llvm[1]] = key
    return {llvm for llvm, key in names.items() if _contains_odd(key, sizes, fields)}


def _key(type_name: str) -> str:
    """Unique name of a record in clang's spellings: tag, typedef or source position."""
    position = POSITION.search(type_name)
    if position is not None:
        return position[1]
    return re.sub(r"\b(const|volatile|struct|union|class)\b|\(empty\)", "", type_name).strip()


def _contains_odd(key: str, sizes: dict[str, int], fields: dict[str, list[str]]) -> bool:
    """Whether a record contains an odd-sized aggregate at any depth."""
    for text in fields.get(key, []):
        array = ARRAY.match(text)
        element = text
        if array is not None:
            element, count = array[1], 1
            for dimension in re.findall(r"\d+", array[2]):
                count *= int(dimension)
            if count in ODD_SIZES:  # an array of bytes, or of three words; larger elements do not fit in 8 bytes
                return True
            if not count:
                continue
        inner = _key(element)
        if inner in sizes and (sizes[inner] in ODD_SIZES or _contains_odd(inner, sizes, fields)):
            return True
    return False
