"""Check an application's interrupts (openswarm_interrupt.h): `python firmware/tools/interrupts.py IMAGE`.

In: a linked image. Out: nothing, or a line for each call that a level above 4 may not make, with the way to it, and
exit status 1. Level 4 may call the kernel; 5 and 6 interrupt it half-way, so they may call neither the kernel nor a
device, nor anything through a pointer, because its target is unknown. Level 6 belongs to the camera's capture
where that is linked.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from emu.image.lines import LineTable, SourceLine  # noqa: E402
from emu.image.loader import load_image  # noqa: E402
from toolchain.elf.read import read_executable  # noqa: E402
from toolchain.errors import ToolError  # noqa: E402
from toolchain.files import read_bytes  # noqa: E402
from toolchain.stack.analyse import Analysis  # noqa: E402
from toolchain.stack.annotations import Annotations  # noqa: E402

LEVEL = "os_level_of_"
"""Absolute symbols that SYS_INTERRUPT leaves in the image."""
DEVICE = 4
OWN = "include/openswarm_interrupt.h"
"""The only file of the system whose code may be inlined into such an interrupt."""
CAPTURE = 6
CAPTURES = "_camera_capture_next"


def findings(image: Path) -> Iterator[str]:
    """Yield the rule violations of an image's interrupts."""
    program = read_executable(read_bytes(str(image)), str(image))
    levels = {s.name.removeprefix(LEVEL): s.value for s in program.symbols if s.name.startswith(LEVEL)}
    if all(level <= DEVICE for level in levels.values()):
        return
    analysis = Analysis(program, Annotations())
    lines = load_image(image).lines
    places = {symbol.name: symbol.value for symbol in program.symbols if symbol.section is not None}
    for vector, level in sorted(levels.items()):
        if level <= DEVICE:
            continue
        if level == CAPTURE and CAPTURES in places:
            yield f"{vector}: level {level} belongs to the camera's capture, which is linked; choose level 4 or 5"
        yield from intrusions(analysis, lines, vector, level, places[f"_sys_isr_{vector}"])


def of_system(analysis: Analysis, lines: LineTable, function: int) -> SourceLine | None:
    """Return the first line of kernel or device code in a function, including inlined code."""
    end = min((entry for entry in analysis.entries if entry > function), default=function)
    for address in range(function, end, 2):
        line = lines.find(address) if address in analysis.code else None
        if line is not None and "openswarm/" in line.file and not line.file.endswith(OWN):
            return line
    return None


def intrusions(analysis: Analysis, lines: LineTable, vector: str, level: int, entry: int) -> Iterator[str]:
    """Yield all functions of the system reachable from `entry`, each with the shortest call path."""
    ways = {entry: [vector]}
    waiting = [entry]
    while waiting:
        function = waiting.pop(0)
        way = " -> ".join(ways[function])
        line = of_system(analysis, lines, function)
        if line is not None:
            yield (
                f"{way}: level {level} may not call the kernel or a device ({line}); raise an interrupt"
                " of level 4 (Sys_Raise_Interrupt)"
            )
            continue
        for call in analysis.functions[function].calls:
            if call.target is None:
                yield f"{way}: level {level} calls through a pointer, which may lead into the kernel"
            for target in analysis.targets(call):
                if target not in ways and target in analysis.functions:
                    ways[target] = [*ways[function], analysis.name(target).removeprefix("_")]
                    waiting.append(target)


def main() -> int:
    """Print the violations; return exit status 0: none, 1: some, 2: not an image."""
    if len(sys.argv) != 2 or sys.argv[1].startswith("-"):
        print(__doc__)
        return 0 if sys.argv[1:] in (["-h"], ["--help"]) else 2
    try:
        found = list(findings(Path(sys.argv[1])))
    except ToolError as error:
        print(f"{sys.argv[1]}: {error}", file=sys.stderr)
        return 2
    for line in found:
        print(f"error: {line}", file=sys.stderr)
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
