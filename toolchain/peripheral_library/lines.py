"""Lines of a peripheral header: configuration macros, interrupt controls, inline functions."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from string import Template
from textwrap import dedent, indent

from emu.chips.chip import Chip

FORM = """#ifndef DSPIC_SETTING
#ifdef USE_AND_OR
#define DSPIC_SETTING(product, sum) sum
#else
#define DSPIC_SETTING(product, sum) product
#endif
#endif"""
"""Form of a configuration macro: a program combines the macros by `&`, or by `|` if it defines USE_AND_OR."""


def page(chip: Chip, name: str, title: str, body: Iterable[str]) -> str:
    """Return the text of the header `name` with the given lines."""
    guard = f"DSPIC_{name.removesuffix('.h').upper()}_H"
    lines = list(body)
    if not lines:
        return f"/* SPDX-License-Identifier: MIT */\n/* {title}: the {chip.name} has none. */\n"
    return "\n".join(
        [
            "/* SPDX-License-Identifier: MIT */",
            f"/* {title} of the {chip.name}, with the names of XC16's peripheral library; generated, do not edit. */",
            f"#ifndef {guard}",
            f"#define {guard}",
            '#include "p30fxxxx.h"',
            FORM,
            *lines,
            "#endif",
            "",
        ]
    )


def macro(name: str, product: int, total: int) -> str:
    """Return the definition of a macro that selects one setting of a field.

    `product` has ones in all bits outside the field, `total` has zeros there.
    """
    return f"#define {name} DSPIC_SETTING(0x{product:04X}, 0x{total:04X})"


def settings(
    chip: Chip, register: str, rows: Mapping[str, tuple[str, int]], prefix: str = "", base: int = 0xFFFF
) -> Iterator[str]:
    """Definitions of macros (field, value) of a register; fields that the chip lacks are omitted.

    `base` has zeros in the bits that every setting clears.
    """
    for name, (field, value) in rows.items():
        if field in chip.sfrs[register].fields:
            lsb, width = chip.sfrs[register].fields[field]
            yield macro(prefix + name, base & ~(((1 << width) - 1) << lsb) | value << lsb, value << lsb)


def interrupt_settings(
    priority: str, on: str, off: str, shift: int = 0, enable_bit: int = 3, base: int = 0xFFFF
) -> Iterator[str]:
    """Definitions for the argument of a ConfigInt function: a priority of 0 to 7 at bit `shift`, and an enable bit."""
    for level in range(8):
        yield macro(f"{priority}{level}", base & ~(7 << shift) | level << shift, level << shift)
    yield macro(on, base, 1 << enable_bit)
    yield macro(off, base & ~(1 << enable_bit), 0)


def interrupt_controls(source: str, name: str) -> Iterator[str]:
    """Macros that enable and disable the interrupt `source` (such as T1) and set its priority."""
    yield f"#define EnableInt{name} (_{source}IE = 1)"
    yield f"#define DisableInt{name} (_{source}IE = 0)"
    yield f"#define SetPriorityInt{name}(priority) (_{source}IP = (priority))"


def configure_interrupt(source: str, function: str, enable_bit: int = 3) -> str:
    """Function that clears the flag of an interrupt, then sets its priority and enable bit."""
    return inline(
        f"void {function}(unsigned int config)",
        f"_{source}IF = 0; _{source}IP = config & 7; _{source}IE = config >> {enable_bit} & 1;",
    )


def inline(prototype: str, body: str) -> str:
    """Definition of an inline function with the given lines."""
    return f"static __inline__ {prototype}\n{{\n{indent(dedent(body), '  ')}\n}}"


def functions(text: str, **names: str) -> Iterator[str]:
    """Definitions of inline functions from a text with `$name` placeholders; a blank line separates two functions.

    Each is a prototype, up to the first line that ends with `)`, and its statements.
    """
    for definition in Template(text).substitute(names).strip().split("\n\n"):
        prototype, _, body = definition.partition(")\n")
        yield inline(prototype + ")", body)


def module(source: str, name: str, configure: str, text: str, enable_bit: int = 3, **names: str) -> Iterator[str]:
    """Interrupt controls and functions of a module with one interrupt; `configure` names its ConfigInt function."""
    yield from interrupt_controls(source, name)
    yield from functions(text, **names)
    yield configure_interrupt(source, configure, enable_bit)


def instances(chip: Chip, register: str) -> list[str]:
    """Numbers of the instances of a module that the chip has; `register` has `$n` where the number is."""
    return [n for n in "123456789" if Template(register).substitute(n=n) in chip.sfrs]
