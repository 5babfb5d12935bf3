"""Measure the assembler (source lines per second) and the linker (seconds for a 32,000-word image).

Usage: python -m bench.compiler.asm_link [--json]
"""

from __future__ import annotations

import argparse
import json
import random
import sys
import time

from toolchain.asm.assemble import assemble
from toolchain.elf.read import read_object
from toolchain.elf.write import executable_bytes, object_bytes
from toolchain.link.link import link
from toolchain.link.options import LinkOptions

MODULES, FUNCTIONS, GROUPS = 10, 40, 20


def source(module: int, rng: random.Random) -> str:
    """Return the source of a module: small functions, calls to other modules, and near variables."""
    lines: list[str] = []
    for number in range(FUNCTIONS):
        name = f"_f{module}_{number}"
        lines += [f" .section .text.{name},code", f" .global {name}", f" .type {name},@function", f"{name}:"]
        for group in range(GROUPS):
            lines += [
                f" mov #{rng.randrange(65536)}, w{rng.randrange(8)}",
                f" mov _v{rng.randrange(MODULES)}, w0",
                f" bra nz, .L{number}_{group}",
                f" rcall _f{rng.randrange(MODULES)}_{rng.randrange(FUNCTIONS)}",
                f".L{number}_{group}:",
            ]
        lines.append(" return")
    lines += [" .section .nbss,bss,near", f" .global _v{module}", f"_v{module}: .space 4"]
    if module == 0:
        lines += [" .text", " .global __reset", "__reset: rcall _f0_0", " bra __reset"]
    return "\n".join(lines) + "\n"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    rng = random.Random(1)
    texts = [source(module, rng) for module in range(MODULES)]
    start = time.perf_counter()
    files = [object_bytes(assemble(text, f"m{i}.s")[0]) for i, text in enumerate(texts)]
    assembled = time.perf_counter()
    objects = [read_object(data, f"m{i}.o") for i, data in enumerate(files)]
    image = link(objects, [], LinkOptions(gc_sections=True)).image
    executable_bytes(image)
    linked = time.perf_counter()
    lines = sum(text.count("\n") for text in texts)
    figures = {
        "source lines": lines,
        "assembled lines per second": round(lines / (assembled - start)),
        "linked words": sum(len(section.data) // 4 for section in image.sections),
        "link seconds": round(linked - assembled, 3),
    }
    print(json.dumps(figures) if options.json else "\n".join(f"{name:28} {value}" for name, value in figures.items()))
    return 0


if __name__ == "__main__":
    sys.exit(main())
