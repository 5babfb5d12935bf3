"""Write compile_commands.json for editors: python tools/compile_commands.py -m toolchain cc OPTION... SOURCE... -o FILE

The arguments are those of the compiler command that the Makefile has run in the current folder. It compiles all sources
at once; the file has one command for each, with the flags by which the toolchain runs clang.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

from toolchain.frontend.clang import front_end_flags
from toolchain.frontend.options import parse

SOURCES = (".c", ".cpp", ".S")
COMMAND = ["-m", "toolchain", "cc"]


def commands(arguments: list[str], folder: Path) -> list[dict[str, object]]:
    """Return one entry for each C, C++ and assembly source of a compiler command that runs in `folder`."""
    words = arguments[len(COMMAND) :] if arguments[: len(COMMAND)] == COMMAND else arguments
    sources = [word for word in words if word.endswith(SOURCES) and not word.startswith("-")]
    options = parse([*words, "-o", "firmware.elf"])
    entries: list[dict[str, object]] = []
    for source in sources:
        language = "c++" if source.endswith(".cpp") else "c"
        flags = ["clang++" if language == "c++" else "clang", *front_end_flags(options, language)]
        file = str((folder / source).resolve())
        entries.append({"directory": str(folder), "file": file, "arguments": [*flags, "-c", source]})
    return entries


if __name__ == "__main__":
    *given, option, output = sys.argv[1:]
    if option != "-o" or not output.endswith(".json"):
        print(f"expected -o FILE.json at the end, not {option} {output}", file=sys.stderr)
        sys.exit(2)
    text = json.dumps(commands(given, Path.cwd()), indent=1)
    Path(output).write_text(text + "\n", encoding="utf-8")
