"""`openswarm program`: builds a program that running robots can receive, linked for the run slot."""

from __future__ import annotations

import argparse
import json
import re
from pathlib import Path
from typing import Final

from emu.host import paths
from emu.host.errors import print_json_error
from emu.host.exit_status import DONE
from emu.host.files import atomic_text_file
from emu.image.loader import load_image
from emu.image.model import Image
from openswarm.commands import made_parser
from openswarm.flashing.loaders import ROW_BYTES
from openswarm.flashing.program import LAST_VERSION, RAM, ROWS, SLOT, VERSION_SYMBOL, Program, program_of

DESCRIPTION: Final = f"""\
Build a program for firmware with `DEVICES := update`: up to {ROWS} rows of 32 instructions that robots receive while
they run, store in flash and pass on to each other. The firmware calls its `main` at each start; `main` returns, and the
handlers and threads that it has started continue. The program has {RAM.size} bytes of RAM for variables and constants,
calls the kernel through the firmware's jump table (board/epuck/update/update_calls.inc), and has no interrupts.

    #include <openswarm_io.h>
    int main(void) {{ return Sys_Set_LED(SYS_LED_BODY, true); }}

See docs/programs.md.

Exit status: 0 built, 1 errors in the C source, 2 anything else, as what is too large for the slot."""
_FOLDERS: Final = ("include", "hal", "kernel", "io", "port/dspic30f", "board/epuck", "board/epuck/update")


def parser() -> argparse.ArgumentParser:
    """Return the parser of the command's options."""
    made = made_parser("program", DESCRIPTION, "openswarm program lamp.c --version 2 -o lamp.elf")
    made.add_argument("sources", nargs="+", metavar="FILE", help="C, C++ and assembly, objects and libraries")
    made.add_argument(
        "--version", type=_version, required=True, metavar="N",
        help=f"1 to {LAST_VERSION}; robots accept only versions greater than the one they have",
    )  # fmt: skip
    made.add_argument("-o", "--output", type=Path, default=Path("program.elf"), metavar="FILE",
                      help="ELF (default program.elf)")  # fmt: skip
    made.add_argument("--header", type=Path, metavar="FILE", help="write its rows as a C array as well")
    made.add_argument("-O", dest="level", default="s", metavar="LEVEL", help="optimisation, as of cc (default s)")
    made.add_argument("-I", dest="folders", action="append", default=[], metavar="DIR", help="folder of headers")
    made.add_argument("-D", dest="definitions", action="append", default=[], metavar="NAME", help="define a macro")
    made.add_argument("--json", action="store_true", help="its facts as data, for scripts")
    return made


def _version(text: str) -> int:
    if not re.fullmatch(r"\d{1,5}", text) or not 1 <= int(text) <= LAST_VERSION:
        raise argparse.ArgumentTypeError(f"expected a number from 1 to {LAST_VERSION}, not {text!r}")
    return int(text)


def run(options: argparse.Namespace) -> int:
    """Build the program; return the exit status. Raises ValueError or OSError for unusable files."""
    from toolchain.driver.driver import main as cc

    output: Path = options.output
    if output.suffix.lower() in (".hex", ".ihex"):
        raise ValueError(f"{output}: the version would be lost; expected the name of an ELF file")
    firmware = paths.firmware() / "openswarm"
    words = [f"-O{options.level}", "-g", "-Wall", "-Wextra", "-fstack-check", "-nostartfiles"]
    words += [f"-I{folder}" for folder in options.folders] + [f"-D{name}" for name in options.definitions]
    words += [f"-I{firmware / folder}" for folder in _FOLDERS]
    words += [f"-ffile-prefix-map={firmware.parent}=firmware"]
    part = f"{SLOT.start:#x}-{SLOT.end - 1:#x},{RAM.start:#x}-{RAM.end - 1:#x}"
    for word in (f"--part={part}", "--no-pack-data", "--no-handles", "-e", "__update_start",
                 "-u", VERSION_SYMBOL, f"--defsym={VERSION_SYMBOL}={options.version}"):  # fmt: skip
        words += ["-Xlinker", word]
    status = cc([*words, *options.sources, str(firmware / "board/epuck/update/program/start.S"), "-o", str(output)])
    if status != DONE:
        if options.json:  # the compiler has printed its messages on standard error
            print_json_error(f"{output} was not built: errors in its sources", status)
        return status
    image = load_image(str(output))
    made = program_of(image)
    if options.header is not None:
        with atomic_text_file(options.header) as file:
            file.write(header(options.header.stem, output.name, made))
    _tell(options, image, made)
    return DONE


def _tell(options: argparse.Namespace, image: Image, made: Program) -> None:
    ram = sum(section.size for section in image.sections if section.kind in ("data", "bss"))
    if options.json:
        facts = {"program": str(options.output), "version": made.version, "rows": len(made.rows), "crc": made.crc}
        print(json.dumps(facts | {"ram": ram}))
    else:
        print(f"{options.output}: version {made.version}, {len(made.rows)} of {ROWS} rows, {ram} of {RAM.size} bytes of"
              f" RAM, CRC {made.crc:08X}")  # fmt: skip


def header(name: str, source: str, made: Program) -> str:
    """Return C source with the program's rows, for an application that contains the program."""
    array = re.sub(r"\W", "_", name)
    rows = ",\n".join(f"    {{{', '.join(f'0x{byte:02X}' for byte in row)}}}" for row in made.rows)
    declared = f"static const uint8 {array}[][{ROW_BYTES}]"
    return f"/* Rows of {source}, by `openswarm program`. */\n{declared} = {{\n{rows}\n}};\n"
