"""XC16's register names in inline assembly: `"w0"` as a clobber and `asm("w4")` of a register variable.

Clang accepts only the register names of the MSP430, r0-r15 for W0-W15. `respell` replaces the names in
preprocessed C; templates of instructions are not changed.
"""

from __future__ import annotations

import re

REFUSED = re.compile(rb"unknown register name 'w\d+' in asm")
"""Pattern of clang's error message for a source that needs `respell`."""

_TOKEN = re.compile(
    r'(?P<asm>\b(?:asm|__asm|__asm__)\b)|"(?P<register>[wW](?:1[0-5]|\d))"'
    r'|"(?:[^"\\\n]|\\.)*"|\'(?:[^\'\\\n]|\\.)*\'|[()]'
)


def respell(text: str) -> str:
    """Replace string literals that are register names inside the parentheses of asm statements and declarations."""
    out: list[str] = []
    at = depth = 0
    waiting = False  # whether the last word was `asm` and its parenthesis has not been reached
    for token in _TOKEN.finditer(text):
        if token["asm"]:
            waiting = depth == 0
        elif token[0] == "(" and (waiting or depth):
            waiting, depth = False, depth + 1
        elif token[0] == ")" and depth:
            depth -= 1
        elif token["register"] and depth:
            out += [text[at : token.start()], f'"r{token["register"][1:]}"']
            at = token.end()
    return "".join([*out, text[at:]])
