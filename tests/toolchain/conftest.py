"""Fixtures of the toolchain tests: assemble and link sources, and read the words of the result."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from toolchain.asm.assemble import assemble
from toolchain.asm.state import Options
from toolchain.elf.model import ObjectFile, Section
from toolchain.elf.read import read_object
from toolchain.elf.write import object_bytes
from toolchain.link.link import Linked, link
from toolchain.link.options import LinkOptions

VECTORS = Path(__file__).resolve().parents[1] / "vectors"


@pytest.fixture(scope="session")
def vectors() -> Path:
    """Return the folder of recorded vectors, which is part of the repository."""
    return VECTORS


class Assembled:
    """An object file with accessors for tests."""

    def __init__(self, obj: ObjectFile, messages: list[str]) -> None:
        self.object = obj
        self.messages = messages  # messages of .print and warnings
        self.sections = {s.name: s for s in obj.sections}
        self.symbols = {s.name: s for s in obj.symbols}

    def words(self, section: str = ".text") -> list[int]:
        """Return the program words of a code section."""
        data = self.sections[section].data
        return [int.from_bytes(data[i : i + 4], "little") for i in range(0, len(data), 4)]

    def bytes(self, section: str) -> bytes:
        """Return the bytes of a data section; assert that the phantom octets are 0."""
        data = self.sections[section].data
        assert not any(data[1::2])
        return bytes(data[::2])

    def relocs(self, section: str = ".text") -> list[tuple[int, int, str]]:
        """Return the relocations of a section as (octet offset, type, symbol)."""
        return [(r.offset, r.type, r.symbol.name) for r in self.sections[section].relocs]


@pytest.fixture(scope="session")
def asm() -> Callable[..., Assembled]:
    """Function that assembles text and reads the object back from its file form.

    Every test thus also covers the ELF writer and reader.
    """

    def run(text: str, **options: object) -> Assembled:
        obj, messages = assemble(text, "test.s", Options(**options))  # type: ignore[arg-type]
        return Assembled(read_object(object_bytes(obj), "test.o"), messages)

    return run


class Image:
    """A linked image with accessors for tests."""

    def __init__(self, linked: Linked) -> None:
        self.linked = linked
        self.symbols = {s.name: s.value for s in linked.image.symbols}
        self.flash: dict[int, int] = {}
        for section in linked.image.sections:
            if section.is_code or section.is_psv or section.is_eedata:
                for i in range(0, len(section.data), 4):
                    self.flash[section.load + i // 2] = int.from_bytes(section.data[i : i + 4], "little")

    def sections(self, name: str) -> list[Section]:
        """Return the output sections with a name."""
        return [s for s in self.linked.image.sections if s.name == name]

    def words(self, symbol: str, count: int) -> list[int]:
        """Return flash words from a symbol on."""
        return [self.flash[self.symbols[symbol] + 2 * i] for i in range(count)]


START = "\n .global __reset\n .text\n__reset:\n nop\n"


@pytest.fixture(scope="session")
def image() -> Callable[..., Image]:
    """Function that assembles and links sources; it adds a minimal `__reset` if none is defined."""

    def run(*sources: str, **options: object) -> Image:
        texts = list(sources)
        if not any("__reset:" in text for text in texts):
            texts.append(START)
        objects = []
        for number, text in enumerate(texts):
            obj, _ = assemble(text, f"{number}.s")
            objects.append(read_object(object_bytes(obj), f"{number}.o"))
        return Image(link(objects, [], LinkOptions(**options)))  # type: ignore[arg-type]

    return run
