"""Annotations of functions and variables, __attribute__((annotate("..."))): interrupt functions, addresses, probes."""

from __future__ import annotations

import re

from toolchain.abi.isr_names import IRQ_PREFIX, irq_name
from toolchain.ir.model import (
    ConstAgg,
    ConstBytes,
    ConstInt,
    ConstZero,
    Function,
    GlobalRef,
    Module,
    Undef,
    UnsupportedError,
    Value,
)

PREFIX = "os_isr:"
NAKED = "naked"
"""Annotation of a naked function with C statements, which clang's attribute does not allow."""
WORDS = {"interrupt", "auto_psv", "no_auto_psv", "shadow"}


def annotations_of(module: Module) -> dict[str, set[str]]:
    """Annotation strings of each function and variable, by name."""
    table = module.globals.get("llvm.global.annotations")
    out: dict[str, set[str]] = {}
    if table is None or not isinstance(table.init, ConstAgg):
        return out
    for row in table.init.elems:
        if isinstance(row, ConstAgg) and isinstance(row.elems[0], GlobalRef):
            note = _text(module, row.elems[1]) + _argument(module, row.elems[4])
            out.setdefault(row.elems[0].name, set()).add(note)
    return out


def _argument(module: Module, v: Value) -> str:
    """The argument of an annotation as "(number)", "" without one."""
    if not isinstance(v, GlobalRef):
        return ""
    init = module.globals[v.name].init
    first = init.elems[0] if isinstance(init, ConstAgg) else None
    return f"({first.value if isinstance(first, ConstInt) else 0})"


def _text(module: Module, v: Value) -> str:
    """The string constant to which a value points."""
    if not isinstance(v, GlobalRef):
        return ""
    init = module.globals[v.name].init
    if isinstance(init, ConstZero):
        return ""
    return init.data.rstrip(b"\0").decode() if isinstance(init, ConstBytes) else ""


def interrupt_kind(notes: set[str], position: str) -> str:
    """Return the kind of an interrupt function: "auto_psv" or "no_auto_psv", also with ",shadow"; "" for others.

    Source: abi-elf.md §2.5. Raises UnsupportedError at `position` if a function has both attributes.
    """
    words = {w for n in notes for w in n.removeprefix(PREFIX).split(",")} & WORDS
    if not any(n.startswith(PREFIX) for n in notes) and "interrupt" not in words:
        return ""
    if {"auto_psv", "no_auto_psv"} <= words:
        raise UnsupportedError("both auto_psv and no_auto_psv", position)
    kind = "no_auto_psv" if "no_auto_psv" in words else "auto_psv"
    return kind + (",shadow" if "shadow" in words else "")


def hides_operands(f: Function) -> bool:
    """Whether the function has a result or a parameter that no statement outside of inline assembly sets or reads."""
    read = {id(value) for b in f.blocks for i in b.instrs for value in i.args}
    ends = [b.instrs[-1] for b in f.blocks if f.ret.kind != "void"]
    unset = any(i.op == "unreachable" or (i.op == "ret" and isinstance(i.args[0], Undef)) for i in ends)
    return unset or any(id(parameter) not in read for parameter in f.args)


def preserved(notes: set[str]) -> tuple[str, ...]:
    """Assembler names of the variables in `save(...)`: pushed at entry, popped before RETFIE."""
    lists = [note.removeprefix("save:") for note in sorted(notes) if note.startswith("save:")]
    return tuple("_" + name.strip() for names in lists for name in names.split(",") if name.strip())


_ACCUMULATOR = re.compile(
    r"\b(?:mac|msc|mpy|mpy\.n|movsac|clr|lac|sac|sac\.r|sftac|add|sub|neg|ed|edac)\s(?:[^\n;]*,)?\s*([AB])\b",
    re.IGNORECASE,
)


def accumulators(f: Function) -> tuple[str, ...]:
    """Registers of the accumulators in inline assembly of an interrupt function, which are saved like `save(...)`."""
    texts = [i.extra["asm"].text for b in f.blocks for i in b.instrs if "asm" in i.extra]
    named = sorted({found.upper() for text in texts for found in _ACCUMULATOR.findall(text)})
    return tuple(f"_ACC{name}{part}" for name in named for part in "LHU")


def preprologue(notes: set[str]) -> tuple[str, ...]:
    """Lines of assembly that run before any register is saved."""
    texts = [note.removeprefix("preprologue:") for note in sorted(notes) if note.startswith("preprologue:")]
    return tuple(line.strip() for text in texts for line in re.split(r"[\n;]", text) if line.strip())


def vector_symbols(notes: set[str]) -> tuple[str, ...]:
    """Assembler names under which the linker finds the handlers of `irq(N)` and `altirq(N)`."""
    wanted = [(kind, int(number[:-1])) for note in sorted(notes)
              for kind, _, number in [note.partition("(")] if kind in IRQ_PREFIX]  # fmt: skip
    return tuple(f"__{IRQ_PREFIX[kind]}{irq_name(number)}" for kind, number in wanted)


def wants_probe(notes: set[str], default: bool) -> bool:
    """Whether the frame is probed against SPLIM: -fstack-check, unless "os_probe" or "os_no_probe" overrides it."""
    if "os_no_probe" in notes:
        return False
    return default or "os_probe" in notes


def section_modifiers(notes: set[str]) -> str:
    """`,address(0x1000)`, `,noload`, `,reverse(64)` for a `.section` line (abi-elf.md §4.3)."""
    out = ",noload" if "noload" in notes else ""
    return out + "".join(f",{what}(0x{number:X})" for what, number in address_and_reverse(notes))


def address_and_reverse(notes: set[str]) -> list[tuple[str, int]]:
    """("address" or "reverse", N) of the annotations of one object."""
    found = (re.fullmatch(r"(address|reverse)\((\d+)\)", note) for note in sorted(notes))
    return [(match[1], int(match[2])) for match in found if match is not None]
