"""Stand-in for `python` in the firmware's Makefile that compiles each kernel and driver source once per test run.

`make PYTHON="python tests/firmware/shared_front_end.py FOLDER"` stores in FOLDER the IR of the C files below
firmware/openswarm, by content and options. Applications are always compiled, and the other stages of the compiler are
unchanged, so that images have the same bytes (ports/test_same_bytes_anywhere.py).
"""

from __future__ import annotations

import hashlib
import os
import runpy
import sys
from dataclasses import replace
from pathlib import Path
from typing import Final

ROOT: Final = Path(__file__).resolve().parents[2]
sys.path[0] = str(ROOT)  # instead of this folder

from toolchain.driver import driver  # noqa: E402
from toolchain.frontend.options import CcOptions, Input  # noqa: E402

SYSTEM: Final = ROOT / "firmware" / "openswarm"
MAPPED: Final = "-ffile-prefix-map="


def is_system(path: Path) -> bool:
    """Whether a source or a folder of headers lies below firmware/openswarm."""
    return path.resolve().is_relative_to(SYSTEM)


def key_of(options: CcOptions) -> str | None:
    """Return the options that decide about the IR of a system source as text; None if headers of an application might
    do so, too."""
    if not all(is_system(Path(word[2:])) for word in options.clang if word.startswith("-I")):
        return None
    maps = [word for word in options.clang if word.startswith(MAPPED)]
    foreign = {word for word in maps if not SYSTEM.is_relative_to(word.removeprefix(MAPPED).partition("=")[0])}
    kept = [word for word in options.clang if word not in foreign]
    return repr(replace(options, clang=kept, inputs=[], output=None))


def front_end_in(folder: Path, compile_sources: driver.FrontEnd) -> driver.FrontEnd:
    """Return a front end that reads and stores IR of system sources in a folder, and calls another for the rest."""

    def front_end(options: CcOptions, scratch: Path) -> dict[Input, bytes]:
        key = key_of(options)
        files: dict[Input, Path] = {}
        for item in options.inputs:
            if key is not None and item.language == "c" and is_system(item.path):
                text = f"{Path.cwd()} {item} {key}".encode() + item.path.read_bytes()
                files[item] = folder / hashlib.sha256(text).hexdigest()
        known = {item: file.read_bytes() for item, file in files.items() if file.exists()}
        missing = [item for item in options.inputs if item not in known]
        made = compile_sources(replace(options, inputs=missing), scratch)
        for item in files.keys() & made.keys():
            part = files[item].with_suffix(f".{os.getpid()}")
            part.write_bytes(made[item])
            part.replace(files[item])
        modules = known | made
        return {item: modules[item] for item in options.inputs if item in modules}

    return front_end


def main() -> None:
    """Run the words behind FOLDER like Python does: `-m MODULE ...` or `SCRIPT ...`."""
    folder, *words = sys.argv[1:]
    Path(folder).mkdir(parents=True, exist_ok=True)
    driver.front_end = front_end_in(Path(folder), driver.front_end)
    is_module = words[0] == "-m"
    sys.argv = words[is_module:]
    if is_module:
        runpy.run_module(sys.argv[0], run_name="__main__", alter_sys=True)
    else:
        runpy.run_path(sys.argv[0], run_name="__main__")


if __name__ == "__main__":
    main()
