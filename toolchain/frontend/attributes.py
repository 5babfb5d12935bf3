"""XC16's attributes (abi-elf.md §1.4, §2.5), rewritten to clang's in preprocessed C.

The pass finds every `__attribute__((...))` and `__attribute((...))` token by token, wherever the declaration has it,
and replaces the attributes of `REWRITES`; the others are clang's. Attributes of definitions become annotations, which
`emit/data.py` and `emit/annotations.py` read with the values that clang computed for their arguments. Attributes that
select a memory become section names, made unique by a number, because constants, variables and functions cannot share
one.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator

LISTS = re.compile(rb"\b__attribute(?:__)?\s*\(\s*\(|\b__(?:at|interrupt|persistent|near|far|eeprom|xdata|ydata)\b")
"""Pattern of sources that may contain attributes."""
_TOKEN = re.compile(
    r'"(?:[^"\\\n]|\\.)*"|\'(?:[^\'\\\n]|\\.)*\'|//[^\n]*|/\*.*?\*/|\b__attribute(?:__)?\b|^\#[^\n]*',
    re.DOTALL | re.MULTILINE,
)
_PIECE = re.compile(r'"(?:[^"\\\n]|\\.)*"|\'(?:[^\'\\\n]|\\.)*\'|[()\[\]{},]', re.DOTALL)
_MARKER = re.compile(r"^[ \t]*#[^\n]*$", re.MULTILINE)
_SPACES = {
    "data": "", "auto_psv": "", "prog": ".prog", "psv": ".psv", "eedata": ".eedata", "xmemory": ".xmemory",
    "ymemory": ".ymemory",
}  # fmt: skip

Rewrite = Callable[[list[str], int], list[str]]
"""Function that returns clang's attributes for the arguments of an attribute of XC16 and a unique number."""


def _annotation(name: str) -> Rewrite:
    return lambda _arguments, _number: [f'__annotate__("{name}")']


def _valued(name: str) -> Rewrite:
    """An annotation with the value of the first argument, a constant expression."""

    def rewrite(arguments: list[str], _number: int) -> list[str]:
        if len(arguments) != 1:
            return _refused(f"attribute {name} with {len(arguments)} arguments")
        return [f'__annotate__("{name}", (unsigned long)({arguments[0]}))']

    return rewrite


def _section(name: str, *others: str) -> Rewrite:
    return lambda _arguments, number: [*others, f'__section__("{name}.0{number}")']


def _refused(what: str) -> list[str]:
    """Return an attribute at which clang reports the error "<what> is not supported"."""
    return [f'__aligned__(sizeof(struct {{ int i; _Static_assert(0, "{what} is not supported"); }}))']


def _refusal(name: str) -> Rewrite:
    return lambda _arguments, _number: _refused(f"attribute {name}")


def _space(arguments: list[str], number: int) -> list[str]:
    kind = _without_underscores(arguments[0]) if len(arguments) == 1 else ""
    if kind not in _SPACES:
        return _refused(f"attribute space({', '.join(arguments)})")
    section = [f'__section__("{_SPACES[kind]}.0{number}")'] if _SPACES[kind] else []
    return ["__used__", *section] if kind == "eedata" else section


def _interrupt(arguments: list[str], number: int) -> list[str]:
    """`interrupt(irq(N), altirq(N), save(a, b), preprologue("text"), shadow, auto_psv, no_auto_psv)`."""
    out = ['__annotate__("interrupt")', "__used__"]
    for argument in arguments:
        name, inside = _name_and_arguments(argument)
        if name in ("irq", "altirq"):
            out += _valued(name)(inside, number)
        elif name == "save":
            out.append(f'__annotate__("save:{",".join(inside)}")')
        elif name == "preprologue":
            out.append(f'__annotate__("preprologue:" {" ".join(inside)})')
        elif name in ("shadow", "auto_psv", "no_auto_psv"):
            out.append(f'__annotate__("{name}")')
        else:
            out += _refused(f"argument {name} of attribute interrupt")
    return out


REWRITES: dict[str, Rewrite] = {
    "interrupt": _interrupt,
    **{name: _annotation(name) for name in ("auto_psv", "no_auto_psv", "shadow", "noload")},
    "address": lambda arguments, number: ["__used__", *_valued("address")(arguments, number)],
    "reverse": _valued("reverse"),
    "near": _section(".near"), "far": _section(".far"),
    "persistent": lambda _arguments, _number: ['__section__(".pbss")'],
    "keep": lambda _arguments, _number: ["__used__", "__retain__"],
    "user_init": lambda _arguments, _number: ["__constructor__"],
    "unordered": lambda _arguments, _number: [],  # position in the section, which the linker chooses in any case
    "sfr": lambda _arguments, _number: ['__section__("sfr")'],  # the linker knows the addresses of the chip's registers
    "space": _space,
    "noclone": lambda _arguments, _number: [],  # ignored: clang has no such attribute
    "externally_visible": lambda _arguments, _number: ["__used__"],
    **{name: _refusal(name) for name in ("boot", "secure", "eds", "fillupper")},
}  # fmt: skip
NAKED: dict[str, Rewrite] = {"naked": lambda _arguments, _number: ['__annotate__("naked")', "__noinline__", "__used__"]}
"""The attribute of functions without prologue and epilogue, for sources whose naked functions contain C statements."""
NAKED_WITH_STATEMENTS = re.compile(rb"non-ASM statement in naked function|parameter references not allowed in naked")
"""Pattern of clang's messages about such a source."""
_ASSEMBLY_BODY = re.compile(
    r"""[^;{]*\{(?:[\s;]|^\#[^\n]*$|\b(?:__asm__|__asm|asm)\b\s*(?:(?:__volatile__|volatile)\s*)?
    \((?:\s|^\#[^\n]*$|"(?:[^"\\\n]|\\.)*")*\))*\}""",
    re.MULTILINE | re.VERBOSE,
)
"""Pattern of the rest of a function definition whose statements are basic assembly."""
NAMES = "|".join(REWRITES)
USED = re.compile(rf"\b(?:__)?(?:{NAMES})(?:__)?\b".encode())
"""Pattern of the names of XC16's attributes in a source."""
IGNORED = re.compile(
    rf"unknown attribute '(?:__)?(?:{NAMES})(?:__)?' ignored|'(?:__)?interrupt(?:__)?' attribute".encode()
)
"""Pattern of clang's messages about a source that needs `rewrite`."""


def suspected(source: bytes) -> bool:
    """Whether a source file probably needs `rewrite`; its headers are not read."""
    return LISTS.search(source) is not None and USED.search(source) is not None


def rewrite(text: str) -> str:
    """Replace XC16's attributes in preprocessed C. The lines keep their numbers."""
    return _replace(text, REWRITES)


def rewrite_naked(text: str) -> str:
    """Replace the attribute `naked` in preprocessed C, except where the definition that follows has assembly only.

    The lines keep their numbers.
    """
    return _replace(text, NAKED, _ASSEMBLY_BODY)


def _replace(text: str, rules: dict[str, Rewrite], unchanged: re.Pattern[str] | None = None) -> str:
    """Replace the attributes for which there is a rule, except in lists before a match of `unchanged`."""
    out: list[str] = []
    at = number = 0
    registers: list[str] = []
    for token in _TOKEN.finditer(text):
        if not token[0].startswith("__attribute") or token.start() < at:
            continue
        span = _list_after(text, token.end())
        if span is None:
            continue
        start, end = span
        close = text.index(")", text.index(")", end) + 1) + 1
        if unchanged and unchanged.match(text, close):
            continue
        number += 1
        replaced = []
        for attribute in split(_MARKER.sub(" ", text[start:end])):
            name, arguments = _name_and_arguments(attribute)
            if name == "sfr" and arguments:
                registers += _register(text, token.start(), end, arguments[0])
            rule = rules.get(name)
            replaced += [attribute] if rule is None else rule(arguments, number)
        lines = sum(not line.startswith("#") for line in text[token.start() : close].split("\n")[1:])
        out += [text[at : token.start()], f"__attribute__(({', '.join(replaced)}))", "\n" * lines]
        at = close
    tail = "".join(f'\n__asm__("{line}");' for line in dict.fromkeys(registers))
    return "".join([*out, text[at:], tail, "\n" if tail else ""])


def split(text: str) -> list[str]:
    """The parts of a text between commas outside of brackets and strings, without surrounding white space."""
    out: list[str] = []
    depth = start = 0
    for piece in _PIECE.finditer(text):
        if piece[0] in "([{":
            depth += 1
        elif piece[0] in ")]}":
            depth -= 1
        elif piece[0] == "," and depth == 0:
            out.append(text[start : piece.start()])
            start = piece.end()
    out.append(text[start:])
    return [" ".join(part.split()) for part in out if part.strip()]


def _without_underscores(name: str) -> str:
    """A name without the underscores that may surround attributes and their arguments."""
    name = name.strip()
    return name[2:-2] if len(name) > 4 and name.startswith("__") and name.endswith("__") else name


def _name_and_arguments(attribute: str) -> tuple[str, list[str]]:
    """Name and arguments of an attribute."""
    name, bracket, inside = attribute.partition("(")
    return _without_underscores(name), split(inside.rstrip()[:-1]) if bracket else []


def _list_after(text: str, at: int) -> tuple[int, int] | None:
    """Start and end of the attribute list in the double brackets that follow; None if there are none."""
    opening = re.compile(r"(?:\s|^\#[^\n]*$)*\((?:\s|^\#[^\n]*$)*\(", re.MULTILINE).match(text, at)
    if opening is None:
        return None
    depth = 1
    for piece in _PIECE.finditer(text, opening.end()):
        depth += (piece[0] == "(") - (piece[0] == ")")
        if depth == 0:
            return opening.end(), piece.start()
    return None


def _register(text: str, start: int, end: int, address: str) -> Iterator[str]:
    """Assembler definition of the register that `sfr(ADDRESS)` declares, if ADDRESS is a number.
    Vendors' headers write the name before or after the attribute.
    """
    before = re.search(r"(\w+)\s*$", text[max(0, start - 80) : start])
    after = re.match(r"\s*\)\s*\)\s*(\w+)\s*[;,\[]", text[end : end + 80])
    found = after or before
    if found is not None and re.fullmatch(r"(?:0[xX][0-9a-fA-F]+|\d+)[uUlL]*", address):
        yield f".set _{found[1]},{address.rstrip('uUlL')}"
