"""XC16's register classes as constraint letters in inline assembly (`"=a"(x)`), which clang does not support.

`respell` replaces the letters in preprocessed C by `r` and adds a mark with the letter of each operand to the start of
the template. `select.asm_inline` removes the mark and assigns registers of the classes.
"""

from __future__ import annotations

import re

CLASSES = {
    "a": (0,), "b": (1,), "c": (2,), "d": tuple(range(1, 8)), "e": tuple(range(2, 8)),
    "v": (13,), "x": (8, 9), "y": (10, 11), "z": (4, 5, 6, 7),
}  # fmt: skip
"""Registers by constraint letter (XC16 User's Guide, register letters): WREG, divide, multiply, general, no divide,
write-back of accumulators, X and Y prefetch, MAC factors. Of W1-W14 and W2-W14 only caller-saved ones are used."""

REFUSED = re.compile(rb"invalid (?:in|out)put constraint '[=+&%]*[abcdevxyz]' in asm")
"""Pattern of clang's error message for a source that needs `respell`."""

MARK = re.compile(r"\x01((?:\d+[a-z] )+)\x01")

_LETTER = re.compile(r'"([=+&%]*)([abcdevxyz])"')
_TOKEN = re.compile(
    r'(?P<asm>\b(?:asm|__asm|__asm__)\b)|(?P<text>"(?:[^"\\\n]|\\.)*")|\'(?:[^\'\\\n]|\\.)*\'|[()\[\]:,]'
)


def respell(text: str) -> str:
    """Replace the constraint letters of asm statements by `r` and marks."""
    out: list[str] = []
    at = depth = part = operand = start = 0
    found: list[tuple[int, int, str, str]] = []  # (begin and end of a constraint, its replacement, its mark)
    for token in _TOKEN.finditer(text):
        sign = token[0]
        if token["asm"]:
            if depth == 0:
                depth, part = -1, 0  # depth -1: before the opening parenthesis
        elif sign in "([" and depth:
            if depth < 0:
                depth, operand, start, found = 0, 0, token.end(), []
            depth += 1
        elif sign in ")]" and depth > 0:
            depth -= 1
            if depth == 0 and found:
                marks = "".join(mark for *_, mark in found)
                out += [text[at:start], f'"\\001" "{marks}" "\\001" ']
                at = start
                for begin, end, new, _ in found:
                    out += [text[at:begin], new]
                    at = end
        elif depth == 1 and sign == ":":
            part += 1
        elif depth == 1 and token["text"] and part in (1, 2):
            letter = _LETTER.fullmatch(sign)
            if letter is not None:
                found.append((token.start(), token.end(), f'"{letter[1]}r"', f"{operand}{letter[2]} "))
            operand += 1
    return "".join([*out, text[at:]])
