"""Mutated sources and objects: assembler and linker produce an image or clear errors.

`python tests/fuzz/compiler/fuzz_asm.py [--inputs N] [--seed S] [--seconds T]`; exits with 1 at the first input with
any other outcome.
"""

from __future__ import annotations

import random
import sys
import time
from collections import Counter
from collections.abc import Iterable
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT))

from tests.fuzz.seeds import Campaign, parser  # noqa: E402
from toolchain.asm.assemble import assemble  # noqa: E402
from toolchain.asm.directives.table import DIRECTIVES  # noqa: E402
from toolchain.asm.state import Options  # noqa: E402
from toolchain.elf.read import read_executable, read_object  # noqa: E402
from toolchain.elf.write import executable_bytes, object_bytes  # noqa: E402
from toolchain.errors import ToolError  # noqa: E402
from toolchain.link.hexfile import hex_text  # noqa: E402
from toolchain.link.link import link  # noqa: E402
from toolchain.link.options import LinkOptions  # noqa: E402

SLOW_SECONDS = 10.0  # limit for one input

SEED_TEXT = """
        .equ    BIT, 3
        .global __reset, _main, __T1Interrupt
        .macro  twice a, b=w1
        mov     #\\a, \\b
        .if     \\a > 4
        inc     \\b, \\b
        .endif
        .endm
        .section .nbss,bss,near
_x:     .space  2
        .section .ndata,data,near
_y:     .word   0x1234, _x, handle(_main), _z - _y
_z:     .byte   1, -1, 'A', 255
        .align  2
        .section .const,psv,page
_c:     .asciz  "text; \\"quoted\\" \\n"
        .section .eedata,eedata
        .word   7
        .section __FOSC.sec,code
        .pword  0xC106
        .text
__reset:
        mov     #__SP_init, w15
        mov     #tbloffset(_tab), w1
        bset    _x, #BIT
        clr     w0
1:      inc     w0, w0
        cp      w0, #10
        bra     lt, 1b
        repeat  #4
        mov     w0, [w1++]
        do      #5, 2f
        nop
2:      nop
        twice   7
        .rept   3
        add.b   w1, [w2++], [w3--]
        .endr
        .irp    r, w4, w5
        push    \\r
        .endr
        rcall   _main
        call    _main
        goto    .
_tab:   .byte   1, 2, 3
        .pword  paddr(_main), 0xABCDEF
_main:  mac     w4*w5, A, [w8]+=2, w4, [w10]-=4, w6, [w13]+=2
        mov     _y+2, w3
        mov.b   [w2-5], w1
        mov     #psvpage(_c), w0
        return
__T1Interrupt:
        retfie
"""

TOKENS = (
    *"+-*/%&|^~!()[]#,:;.$=", "<<", ">>", "++", "--", "==", "/*", "*/", "\\", "\\@", '"', "'", "1b", "2f",
    "0b", "0x", "09",
    "w0", "w15", "w16", "WREG", "A", "B", "0", "-1", "65535", "65536", "0x7FFFFFFF", "99999999999999999999",
    "1 << 63",
    "\0", "\t", "\n", "\r", "é", "\x7f", "_x", "_undefined", "_main", "handle(", "tbloffset(", "paddr(",
    ".startof.(.text)",
    ".text\n", ".if 1\n", ".if 0\n", ".else\n", ".endif\n", ".macro m a\n", ".endm\n", "m m\n", ".rept 1000000\n",
    ".rept 9\n", ".endr\n", ".exitm\n", ".section .bss\n", ".section q,code,address(0x200)\n",
    ".space 0x7FFFFFFF\n",
    ".align 0x40000000\n", ".org 0xFFFFFF\n", ".global __reset\n", ".weak _main\n", ".set _x, _x\n",
    "_y = _x\n", ".end\n",
    '.include "/dev/null"\n', '.include ""\n', *(name + " 1\n" for name in DIRECTIVES),
    *(name + "\n" for name in DIRECTIVES),
)  # fmt: skip


def mutate(text: str, rng: random.Random) -> str:
    """Make one to six random changes: tokens and lines inserted, dropped, doubled or swapped; characters damaged."""
    for _ in range(rng.choice((1, 1, 1, 2, 3, 6))):
        place = rng.randrange(len(text) + 1)
        match rng.randrange(7):
            case 0 | 1:
                text = text[:place] + rng.choice(TOKENS) + text[place:]
            case 2:
                text = text[:place] + text[place + rng.randint(1, 20) :]
            case 3:
                text = text[:place] + chr(rng.choice((rng.randrange(32, 127), rng.randrange(256)))) + text[place + 1 :]
            case 4:
                lines = text.split("\n")
                a, b = rng.randrange(len(lines)), rng.randrange(len(lines))
                lines[a], lines[b] = lines[b], lines[a]
                text = "\n".join(lines)
            case 5:
                lines = text.split("\n")
                at = rng.randrange(len(lines))
                lines[at:at] = lines[at : at + rng.randint(1, 3)] * rng.randint(1, 3)
                text = "\n".join(lines)
            case 6:
                lines = text.split("\n")
                del lines[rng.randrange(len(lines))]
                text = "\n".join(lines)
    return text


def outcome(text: str, relax: bool) -> str:
    """Return "assembly refused", "link refused" or "linked"; any other outcome raises an exception."""
    try:
        obj, _ = assemble(text, "fuzz.s", Options(relax=relax, debug=relax))
    except ToolError as error:
        check_findings(error)
        return "assembly refused"
    again = read_object(object_bytes(obj), "fuzz.o")
    try:
        linked = link([again], [], LinkOptions(gc_sections=relax))
    except ToolError as error:
        check_findings(error)
        return "link refused"
    data = executable_bytes(linked.image)
    hex_text(read_executable(data, "fuzz.elf"))
    return "linked"


def mutated_object(data: bytes, rng: random.Random) -> bytes:
    """Return an object file with some bytes changed or its end cut off."""
    out = bytearray(data)
    for _ in range(rng.choice((1, 1, 2, 8))):
        out[rng.randrange(len(out))] = rng.choice((0, 1, 0x7F, 0x80, 0xFF, rng.randrange(256)))
    return bytes(out[: rng.randrange(len(out))] if rng.randrange(10) == 0 else out)


def object_outcome(data: bytes) -> str:
    """Return "object refused" or "object linked"."""
    try:
        linked = link([read_object(data, "fuzz.o")], [], LinkOptions(gc_sections=True))
    except ToolError as error:
        check_findings(error)
        return "object refused"
    hex_text(read_executable(executable_bytes(linked.image), "fuzz.elf"))
    return "object linked"


def check_findings(error: ToolError) -> None:
    """Check that every message is one line with a source position and the word "error"."""
    for finding in error.findings:
        assert "error: " in finding, finding


def campaign(seeds: Iterable[int]) -> Counter[str]:
    """Test a mutated source and a mutated object for every seed. Raises AssertionError with the first one that
    fails."""
    good = object_bytes(assemble(SEED_TEXT, "seed.s")[0])
    outcomes: Counter[str] = Counter()
    for seed in seeds:
        rng = random.Random(seed)
        text = mutate(SEED_TEXT, rng)
        data = mutated_object(good, rng)
        start = time.monotonic()
        try:
            outcomes[outcome(text, relax=seed % 2 == 1)] += 1
            text = data.hex()
            outcomes[object_outcome(data)] += 1
        except Exception as error:
            raise AssertionError(f"{type(error).__name__}: {error}\n{text}") from error
        taken = time.monotonic() - start
        assert taken < SLOW_SECONDS, f"took {taken:.1f} s\n{text}"
    return outcomes


def main() -> int:
    plan = Campaign(parser(__doc__), "inputs", 20_000, "sources and objects")
    plan.parse()
    try:
        outcomes = campaign(plan)
    except AssertionError as error:
        return plan.failed(error)
    return plan.ended(", ".join(f"{n} {what}" for what, n in sorted(outcomes.items())))


if __name__ == "__main__":
    sys.exit(main())
