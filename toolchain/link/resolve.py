"""Symbol resolution: the definition of each name, and the archive members that are needed.

Afterwards every global name has one definition; otherwise one error lists all undefined and duplicate names.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from toolchain.elf.archive import Archive, ArchiveMember
from toolchain.elf.model import Bind, Home, ObjectFile, Section, Symbol
from toolchain.elf.read import read_object
from toolchain.elf.symbols import is_named
from toolchain.errors import ToolError
from toolchain.link.smartio import plain_name

MAX_REFERENCES = 4  # maximum number of references shown per undefined symbol


@dataclass(slots=True)
class Resolution:
    """Objects of the link in order, definitions by name, and the object of each section."""

    objects: list[ObjectFile] = field(default_factory=list)
    globals: dict[str, Symbol] = field(default_factory=dict)
    owner: dict[Section, ObjectFile] = field(default_factory=dict)
    defined_in: dict[str, ObjectFile] = field(default_factory=dict)
    wanted: dict[str, bool] = field(default_factory=dict)  # referenced names; True if any reference is strong
    duplicates: dict[str, list[str]] = field(default_factory=dict)

    def add(self, obj: ObjectFile) -> None:
        """Add an object with its sections, definitions and references."""
        self.objects.append(obj)
        for section in obj.sections:
            self.owner[section] = obj
        for symbol in obj.symbols:
            if symbol.bind is Bind.LOCAL or not symbol.name:
                continue
            if symbol.home is Home.UNDEFINED:
                symbol.name = plain_name(symbol.name, obj.name)
                self.wanted[symbol.name] = self.wanted.get(symbol.name, False) or symbol.bind is Bind.GLOBAL
            else:
                self._define(symbol, obj)

    def _define(self, symbol: Symbol, obj: ObjectFile) -> None:
        known = self.globals.get(symbol.name)
        if known is None or _rank(symbol) > _rank(known):
            self.globals[symbol.name] = symbol
            self.defined_in[symbol.name] = obj
        elif _rank(known) == _rank(symbol) == _STRONG:
            first = self.defined_in[symbol.name].name
            self.duplicates.setdefault(symbol.name, [first]).append(obj.name)
        elif known.home is Home.COMMON and symbol.home is Home.COMMON:
            known.size = max(known.size, symbol.size)
            known.value = max(known.value, symbol.value)

    def lookup(self, symbol: Symbol) -> Symbol:
        """Return the definition of `symbol`: itself if it is local, else the global definition of its name, if any."""
        if symbol.bind is Bind.LOCAL:
            return symbol
        return self.globals.get(symbol.name, symbol)


_STRONG = 3
MAIN = "_main"


def _rank(symbol: Symbol) -> int:
    """Return the precedence of a definition: strong over common over weak."""
    if symbol.home is Home.COMMON:
        return 2
    return 1 if symbol.bind is Bind.WEAK else _STRONG


def resolve(
    objects: list[ObjectFile],
    archives: list[Archive],
    roots: list[str],
    instead: dict[int, ArchiveMember] | None = None,
) -> Resolution:
    """Add all `objects`, then repeatedly archive members that define undefined names (one group, abi-elf.md §2.8).

    `roots` begins with the start symbol.  If a needed member defines the start symbol too, as the library's `atexit`
    does, resolution is repeated with that member as start-up code: `instead` maps the id of the replaced member to it.
    """
    result = Resolution()
    for obj in objects:
        result.add(obj)
    for name in roots:
        result.wanted[name] = True
    loaded: set[tuple[str, int]] = set()
    starts: list[ArchiveMember] = []
    progress = True
    while progress:
        progress = False
        for name, strong in list(result.wanted.items()):
            if not strong or name in result.globals:
                continue
            for archive in archives:
                member = archive.index.get(name)
                if member is not None and instead:
                    member = instead.get(id(member), member)
                if member is not None and (archive.name, member.offset) not in loaded:
                    loaded.add((archive.name, member.offset))
                    obj = read_object(member.data, f"{archive.name}({member.name})")
                    result.add(obj)
                    if any(s.name == roots[0] and s.home is not Home.UNDEFINED for s in obj.symbols):
                        starts.append(member)
                    progress = True
                    break
    if len(starts) == 2 and not instead:
        return resolve(objects, archives, roots, {id(starts[0]): starts[1]})
    return result


def place_of(obj: ObjectFile, section: Section, offset: int) -> str:
    """Return object, section and enclosing symbol of a reference, for the message."""
    around = [s for s in obj.symbols if s.section is section and s.value <= offset and is_named(s)]
    name = max(around, key=lambda s: s.value).name if around else ""
    return f"{obj.name}:({section.name}+{offset:#x}{f' in {name}' if name else ''})"


def _cure(name: str) -> str:
    """Return what to do about an undefined symbol."""
    if not name.startswith("_"):
        return "define it; assembly writes a C name with an underscore before it"
    return f"define '{name[1:]}', or name its source, object or library (-l) on the command line"


def check(result: Resolution, provided: set[str], live: set[Section]) -> None:
    """Raise `ToolError` listing every duplicate and every undefined symbol that live sections refer to."""
    findings = [
        f"{objects[-1]}: error: duplicate symbol {name}, defined in {', '.join(objects)}"
        for name, objects in result.duplicates.items()
    ]
    missing: dict[str, list[str]] = {}
    for obj in result.objects:
        for section in obj.sections:
            if section not in live:
                continue
            for reloc in section.relocs:
                symbol = reloc.symbol
                if symbol.home is not Home.UNDEFINED or symbol.bind is Bind.WEAK or not symbol.name:
                    continue
                if symbol.name not in result.globals and symbol.name not in provided:
                    missing.setdefault(symbol.name, []).append(place_of(obj, section, reloc.offset // 2))
    for name, places in missing.items():
        if name == MAIN and all(".init" in place for place in places):
            findings.append(f"error: undefined symbol {MAIN}: the program needs a function main")
            continue
        shown = ", ".join(places[:MAX_REFERENCES])
        more = f" and {len(places) - MAX_REFERENCES} more" if len(places) > MAX_REFERENCES else ""
        where = f"{places[0].split(':(')[0]}: error: undefined symbol {name}, referenced at {shown}{more}"
        findings.append(f"{where}; {_cure(name)}")
    if findings:
        raise ToolError.of(findings)
