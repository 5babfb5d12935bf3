"""Signatures of functions and function types, from the debug information: possible targets of typed pointers."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from emu.image.lines import dwarf_of
from toolchain.errors import ToolError

_STRIPPED = frozenset(("DW_TAG_typedef", "DW_TAG_const_type", "DW_TAG_volatile_type"))

Signature = tuple[str, ...]
LONGEST_CHAIN = 1000
"""Most typedefs and qualifiers of one type; damaged debug information may have a cycle of them."""


@contextmanager
def refused_if_damaged() -> Iterator[None]:
    """Raise ToolError for an exception in the block, which reads debug information."""
    try:
        yield
    except ToolError:
        raise
    except Exception as error:  # pyelftools checks little: damaged data raises exceptions of any kind
        raise ToolError(f"the image's debug information is damaged: {type(error).__name__}: {error}") from None


class Signatures:
    """Signatures of functions by address (`functions`), and of typedefs of functions or pointers by name (`types`)."""

    def __init__(self, sections: Mapping[str, bytes]) -> None:
        self.functions: dict[int, Signature] = {}
        self.types: dict[str, Signature] = {}
        if not sections.get(".debug_info"):
            return
        with refused_if_damaged():
            self._read(sections)

    def _read(self, sections: Mapping[str, bytes]) -> None:
        for unit in dwarf_of(sections).iter_CUs():
            for die in unit.iter_DIEs():
                if die.tag == "DW_TAG_subprogram" and "DW_AT_low_pc" in die.attributes:
                    self.functions[die.attributes["DW_AT_low_pc"].value] = self._signature(die)
                elif die.tag == "DW_TAG_typedef":
                    self._typedef(die)

    def _typedef(self, die: Any) -> None:
        target = _target(die)
        if target is not None and target.tag == "DW_TAG_pointer_type":
            target = _target(target)
        if target is not None and target.tag == "DW_TAG_subroutine_type" and "DW_AT_name" in die.attributes:
            self.types[die.attributes["DW_AT_name"].value.decode()] = self._signature(target)

    @staticmethod
    def _signature(die: Any) -> Signature:
        if "DW_AT_abstract_origin" in die.attributes:
            die = die.get_DIE_from_attribute("DW_AT_abstract_origin")
        parameters = [child for child in die.iter_children() if child.tag == "DW_TAG_formal_parameter"]
        return (_kind(_target(die)), *(_kind(_target(parameter)) for parameter in parameters))


def _target(die: Any) -> Any:
    """Return the type of a DIE without qualifiers and typedefs, None for void."""
    for _ in range(LONGEST_CHAIN):
        if "DW_AT_type" not in die.attributes:
            return None
        die = die.get_DIE_from_attribute("DW_AT_type")
        if die.tag not in _STRIPPED:
            return die
    raise ValueError("a type that is its own typedef")


def _kind(die: Any) -> str:
    """Return the calling-convention class of a type: all pointers are equal, integers differ by size."""
    if die is None:
        return "void"
    if die.tag == "DW_TAG_pointer_type":
        return "pointer"
    if die.tag in ("DW_TAG_base_type", "DW_TAG_enumeration_type"):
        size = die.attributes.get("DW_AT_byte_size")
        return f"scalar {size.value if size is not None else 2}"
    name = die.attributes.get("DW_AT_name")
    return f"{die.tag} {name.value.decode() if name is not None else ''}"
