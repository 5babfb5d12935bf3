"""Attribute `externally_initialized` for variables in unoptimised IR that the start-up code does not initialise.

`persistent` and `noload` variables start with the previous content of RAM. Without the mark, the middle end assumes the
value of the definition. If a program only sets a variable to one constant and compares it with that constant, the
middle end turns the variable into a boolean. It also turns a store in a `user_init` function into an initial value.
"""

from __future__ import annotations

import re

DEFINITION = re.compile(
    rb'^@("[^"]+"|[\w$.]+) = (?P<words>(?:\w+(?:\([^)]*\))? )*?)(?P<kind>global|constant) (?P<rest>.*)$', re.MULTILINE
)
UNTOUCHED_SECTION = re.compile(rb', section "(?:\.pbss[".]|[^",]*,[^"]*\b(?:persist|noload)\b)')
NOLOAD_TEXT = re.compile(rb'^(@[\w$.]+) = .*constant \[7 x i8\] c"noload\\00", section "llvm.metadata"', re.MULTILINE)
ANNOTATIONS = re.compile(rb"^@llvm\.global\.annotations = .*$", re.MULTILINE)
ENTRY = re.compile(rb'\{ ptr @("[^"]+"|[\w$.]+), ptr (@[\w$.]+), ')


def mark_externally_initialised(ir: bytes) -> bytes:
    """The IR text with the attribute on all such variables."""
    texts = set(NOLOAD_TEXT.findall(ir))
    noted = ANNOTATIONS.search(ir)
    names = {name for name, text in ENTRY.findall(noted[0]) if text in texts} if texts and noted is not None else set()

    def mark(found: re.Match[bytes]) -> bytes:
        if b"externally_initialized " in found["words"] or found[1].startswith(b"llvm."):
            return found[0]
        if found[1] not in names and UNTOUCHED_SECTION.search(found["rest"]) is None:
            return found[0]
        return b"@%s = %sexternally_initialized %s %s" % (found[1], found["words"], found["kind"], found["rest"])

    return DEFINITION.sub(mark, ir)
