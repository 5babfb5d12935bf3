"""-fshort-double: double and long double have 32 bits, XC16's default for double.

Clang computes with 32 bits (`FLAGS`). The run-time library keeps 64-bit functions under the names of C. Therefore
`rename` makes the IR of a program call the single-precision functions, and the link uses variants of printf and scanf.
A symbol marks the objects, because objects with 32-bit and 64-bit double must not pass each other doubles.
"""

from __future__ import annotations

import re

FLAGS = ["-Xclang", "-mdouble=32"]
MARK = "__short_double"
"""Weak absolute symbol of objects whose double has 32 bits."""
_WITH_F = (
    "fabs floor ceil trunc round fmod modf frexp ldexp ilogb copysign fmin fmax sqrt sin cos tan asin acos atan atan2 "
    "exp log log10 pow hypot sinh cosh tanh asinh acosh atanh exp2 expm1 log2 log1p cbrt rint nearbyint lrint llrint "
    "cacos casin catan ccos csin ctan cacosh casinh catanh ccosh csinh ctanh cexp clog csqrt conj cproj cabs carg "
    "creal cimag cpow lround llround logb scalbn scalbln nextafter remainder remquo fdim fma nan"
)
NAMES = {name: f"{name}f" for name in _WITH_F.split()} | {
    "nexttoward": "nextafterf", "nexttowardf": "nextafterf", "strtod": "strtof", "strtold": "strtof",
    "atof": "__short_atof", "difftime": "__short_difftime",
}  # fmt: skip
_USED = re.compile(rb'@(?:"\\01_?(%s)"|(%s)(?![\w.$]))' % (("|".join(NAMES).encode(),) * 2))
_DEFINED = re.compile(rb"^define [^@\n]*@(\w+)\(", re.MULTILINE)


def rename(ir: bytes) -> bytes:
    """The IR with calls of the single-precision functions; functions that the module defines itself stay."""
    own = {name.decode() for name in _DEFINED.findall(ir)} & NAMES.keys()

    def replacement(found: re.Match[bytes]) -> bytes:
        name = (found[1] or found[2]).decode()
        return found[0] if name in own else b"@" + NAMES[name].encode()

    text = _USED.sub(replacement, ir)
    return _without_repeated_declarations(text)


def _without_repeated_declarations(ir: bytes) -> bytes:
    """The IR with one declaration of each renamed function, which the program may call under both names."""
    seen: set[bytes] = set()
    out: list[bytes] = []
    targets = {name.encode() for name in NAMES.values()}
    for line in ir.split(b"\n"):
        declared = re.match(rb"declare [^@]*@(\w+)\(", line)
        if declared is not None and declared[1] in targets:
            if declared[1] in seen:
                continue
            seen.add(declared[1])
        out.append(line)
    return b"\n".join(out)
